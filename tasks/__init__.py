"""Cached stages, one a file: open inputs, call one core function, commit the output."""
