"""Rigid motion, cameras, rays, boxes and grids: the bottom layer."""
