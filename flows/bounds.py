"""Bounds that the command line and the server's parameters share."""

# Random generators take 32 bits everywhere.
HIGHEST_SEED = 2**32 - 1
MONTH_S = 31 * 24 * 3600.0
