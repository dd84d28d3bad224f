"""Prefect flows, one deployable flow a file, and the command line: wiring only."""
