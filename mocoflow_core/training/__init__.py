"""Schedule, stages, loop, checkpoints and the guard of the optimisation."""
