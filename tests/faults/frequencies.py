"""Lowest frequencies of the full eigenproblem, another way than the program's own."""

import numpy as np
import scipy.linalg


def lowest_hz(stiffness, mass, count):
    """Frequencies in Hz, and below which of them rounding of K cannot tell one from zero.

    From the problem M u = K u / w², whose rounding spares the low ones, but where K is singular.
    """
    heavy = np.diag(mass) > 0.0
    squares = np.diag(stiffness)[heavy] / np.diag(mass)[heavy]
    rounding = np.sqrt(64 * np.finfo(float).eps * squares.max(initial=0.0)) / (2 * np.pi)
    try:
        inverse = scipy.linalg.eigh(mass, stiffness, eigvals_only=True)[::-1][:count]
        return 1.0 / np.sqrt(inverse) / (2 * np.pi), rounding
    except np.linalg.LinAlgError:  # it floats, or all but does
        squares = scipy.linalg.eigh(stiffness, mass, eigvals_only=True)[:count]
        return np.sqrt(np.maximum(squares, 0.0)) / (2 * np.pi), rounding
