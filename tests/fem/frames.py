"""Small frames and a solver for the tests."""

import numpy as np
import scipy.linalg

import fem

CLAMP = ("x", "y", "rotation")
STEEL = fem.Material(2.1e11, 7800.0)
BAR = fem.BeamPart(STEEL, fem.RectangularSection(width=0.03, height=0.02))
EI = STEEL.youngs_modulus * BAR.section.second_moment
EA = STEEL.youngs_modulus * BAR.section.area
RHO_A = STEEL.density * BAR.section.area


def frequencies_hz(component, count=None):
    """Natural frequencies, lowest first, of a component that is held.

    The pencil is solved as M x = mu K x: the lowest frequencies are the largest mu, and keep their
    digits, which they lose to the highest ones in K x = lambda M x.
    """
    K, M = component.stiffness.toarray(), component.mass.toarray()
    size = len(K)
    count = size if count is None else count
    mu = scipy.linalg.eigh(M, K, eigvals_only=True, subset_by_index=[size - count, size - 1])
    return 1 / np.sqrt(mu[::-1]) / (2 * np.pi)


def beam(length=1.0, elements=16, angle=0.0, **rest):
    """A straight beam from point "left" to point "right"."""
    end = (length * np.cos(angle), length * np.sin(angle))
    mesh = fem.frame_mesh({"left": (0.0, 0.0), "right": end}, [("bar", "left", "right", elements)])
    return fem.StructureModel(mesh, {"bar": BAR}, **rest, plane=True)


def bending_hz(root, length=1.0):
    """Frequency of a beam whose root (k L) is known."""
    return (root / length) ** 2 * np.sqrt(EI / RHO_A) / (2 * np.pi)


def refined_frequencies_hz(component, count):
    """Lowest frequencies by subspace iteration with residuals in extended precision."""
    wide = np.longdouble
    K, M = component.stiffness.toarray(), component.mass.toarray()
    factor = scipy.linalg.cho_factor(K)
    size = len(K)
    _, vectors = scipy.linalg.eigh(M, K, subset_by_index=[size - count, size - 1])
    K, M = K.astype(wide), M.astype(wide)
    for _ in range(2):
        right = M @ vectors
        moved = np.zeros(vectors.shape, wide)
        for _ in range(5):
            moved = moved + scipy.linalg.cho_solve(factor, (right - K @ moved).astype(float))
        vectors = moved / np.sqrt(np.sum(moved * (K @ moved), axis=0))
        small = (vectors.T @ (M @ vectors)).astype(float)
        mu, turn = scipy.linalg.eigh(small, (vectors.T @ (K @ vectors)).astype(float))
        vectors = vectors @ turn
    return 1 / np.sqrt(mu[::-1]) / (2 * np.pi)
