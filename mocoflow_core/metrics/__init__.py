"""How wrong a reconstruction is: scores per view, truth errors, and error against run time."""
