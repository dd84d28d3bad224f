"""Losses: what training pulls on."""
