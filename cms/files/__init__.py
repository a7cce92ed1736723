"""Matrices from files of other programs."""
