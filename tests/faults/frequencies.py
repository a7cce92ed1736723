"""Lowest frequencies of the full eigenproblem, another way than the program's own."""

import mpmath
import numpy as np
import scipy.linalg

SMALL = 6  # as many coordinates are solved for in 80 digits
ONE_FREQUENCY = 1e-9


def lowest_hz(stiffness, mass, count, loads=None, unseen=0.0, rigid=0):
    """Frequencies in Hz, and below which of them rounding of K cannot tell one from zero.

    Of many coordinates from the problem M u = K u / w², whose rounding spares the low ones, but
    where K is singular. With loads (n, m) only the first ``rigid`` modes, and those that one of
    them, scaled to one, moves by more than a share of their length.
    """
    heavy = np.diag(mass) > 0.0
    squares = np.diag(stiffness)[heavy] / np.diag(mass)[heavy]
    rounding = np.sqrt(64 * np.finfo(float).eps * squares.max(initial=0.0)) / (2 * np.pi)
    hz, modes = all_modes(stiffness, mass)
    seen = np.ones(len(hz), dtype=bool) if loads is None else moved(hz, modes, loads, unseen, rigid)
    return hz[seen][:count], rounding


def moved(hz, modes, loads, unseen, rigid):
    """Whether some load moves each mode; of modes of one frequency, as many as loads can tell."""
    forces = loads.T @ modes
    forces = forces / np.linalg.norm(loads, axis=0)[:, None] / np.linalg.norm(modes, axis=0)
    seen = np.arange(len(hz)) < rigid
    groups = np.cumsum(np.diff(hz, prepend=0.0) > ONE_FREQUENCY * hz)
    for group in np.unique(groups[~seen]):
        alike = np.flatnonzero((groups == group) & ~seen)
        seen[alike[: np.linalg.matrix_rank(forces[:, alike], tol=unseen)]] = True
    return seen


def all_modes(stiffness, mass):
    """All frequencies in Hz, ascending, and modes (n, k); not the infinite ones without mass."""
    if len(mass) <= SMALL and (exact := exact_modes(stiffness, mass)) is not None:
        return exact
    try:
        inverse, modes = scipy.linalg.eigh(mass, stiffness)
        heavy = inverse > 0.0
        inverse, modes = inverse[heavy][::-1], modes[:, heavy][:, ::-1]
        return 1.0 / np.sqrt(inverse) / (2 * np.pi), modes
    except np.linalg.LinAlgError:  # it floats, or all but does
        squares, modes = scipy.linalg.eigh(stiffness, mass)
        return np.sqrt(np.maximum(squares, 0.0)) / (2 * np.pi), modes


def exact_modes(stiffness, mass):
    """As `all_modes`, or None where the mass is not positive definite."""
    with mpmath.workdps(80):
        try:
            inverse = mpmath.cholesky(mpmath.matrix(mass.tolist())) ** -1
        except (ValueError, ZeroDivisionError):
            return None
        squares, turned = mpmath.eigsy(inverse * mpmath.matrix(stiffness.tolist()) * inverse.T)
        hz = [mpmath.sqrt(max(square, 0)) / (2 * mpmath.pi) for square in squares]
        modes = np.array((inverse.T * turned).tolist(), dtype=float)
    order = np.argsort(np.array(hz, dtype=float), kind="stable")
    return np.array(hz, dtype=float)[order], modes[:, order]
