"""Deployed runs: a server, its database, a worker, and what they are told to run."""
