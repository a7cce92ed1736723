"""Factors of large matrices, and lowest modes."""
