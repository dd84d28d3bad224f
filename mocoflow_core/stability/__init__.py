"""The catalogue of stiff and extreme cases: one file for each area, one entry for each case."""
