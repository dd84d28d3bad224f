"""mocoflow: a moving person, filmed by one fixed camera, seen from any side at any time."""

__version__ = "0.1.0"
