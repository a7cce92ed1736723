"""Meshes: points, cells and names, and what is attached to points."""
