"""Lowest frequencies of the full eigenproblem, another way than the program's own."""

import mpmath
import numpy as np
import scipy.linalg

SMALL = 6  # as many coordinates are solved for in 80 digits


def lowest_hz(stiffness, mass, count):
    """Frequencies in Hz, and below which of them rounding of K cannot tell one from zero.

    Of many coordinates from the problem M u = K u / w², whose rounding spares the low ones, but
    where K is singular.
    """
    heavy = np.diag(mass) > 0.0
    squares = np.diag(stiffness)[heavy] / np.diag(mass)[heavy]
    rounding = np.sqrt(64 * np.finfo(float).eps * squares.max(initial=0.0)) / (2 * np.pi)
    if len(mass) <= SMALL and (exact := exact_hz(stiffness, mass)) is not None:
        return exact[:count], rounding
    try:
        inverse = scipy.linalg.eigh(mass, stiffness, eigvals_only=True)[::-1][:count]
        return 1.0 / np.sqrt(inverse) / (2 * np.pi), rounding
    except np.linalg.LinAlgError:  # it floats, or all but does
        squares = scipy.linalg.eigh(stiffness, mass, eigvals_only=True)[:count]
        return np.sqrt(np.maximum(squares, 0.0)) / (2 * np.pi), rounding


def exact_hz(stiffness, mass):
    """All frequencies, ascending, or None where the mass is not positive definite."""
    with mpmath.workdps(80):
        try:
            inverse = mpmath.cholesky(mpmath.matrix(mass.tolist())) ** -1
        except (ValueError, ZeroDivisionError):
            return None
        squares = mpmath.eigsy(inverse * mpmath.matrix(stiffness.tolist()) * inverse.T, True)
        hz = [mpmath.sqrt(max(square, 0)) / (2 * mpmath.pi) for square in squares]
    return np.array([float(each) for each in sorted(hz)])
