"""Lowest frequencies of the full eigenproblem, another way than the program's own."""

import numpy as np
import scipy.linalg


def lowest_hz(stiffness, mass, count):
    """Frequencies in Hz, and by how much rounding may move them.

    From the problem M u = K u / w², whose rounding spares the low ones, but where K is singular.
    """
    try:
        inverse = scipy.linalg.eigh(mass, stiffness, eigvals_only=True)[::-1][:count]
        return 1.0 / np.sqrt(inverse) / (2 * np.pi), 0.0
    except np.linalg.LinAlgError:  # it floats, or all but does
        squares = scipy.linalg.eigh(stiffness, mass, eigvals_only=True)
        rounding = np.sqrt(1e-15 * squares[-1]) / (2 * np.pi)
        return np.sqrt(np.maximum(squares[:count], 0.0)) / (2 * np.pi), rounding
