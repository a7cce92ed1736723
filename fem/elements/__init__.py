"""Matrices of elements, and sparse sums of them."""
