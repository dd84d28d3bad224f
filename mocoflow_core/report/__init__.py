"""One run as one page that opens anywhere."""
