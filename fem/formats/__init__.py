"""Meshes from files of other programs, and to them."""
