"""What the tests of structures share: frequencies of any component, steel, a clamp."""

import numpy as np
from scipy.sparse.linalg import eigsh, spsolve

import fem

STEEL = fem.Material(2.0e11, 8000.0, 0.3)
TURNS = ("rotation_x", "rotation_y", "rotation_z")
CLAMP = ("x", "y", "z", *TURNS)


def lowest_hz(component, count):
    """Lowest natural frequencies; the shift lets structures float."""
    K, M = component.stiffness.tocsc(), component.mass.tocsc()
    if K.shape[0] <= 3 * count:
        from scipy.linalg import eigh

        squares = eigh(K.toarray(), M.toarray(), eigvals_only=True)[:count]
    else:
        shift = -1e-3 * K.diagonal().sum() / M.diagonal().sum() / K.shape[0]
        squares = eigsh(K, count, M, sigma=shift, return_eigenvectors=False)
    return np.sort(np.sqrt(np.maximum(squares, 0.0))) / (2 * np.pi)


def flexibility(component, loaded, seen=None):
    """Static displacement at one interface under a unit load at another."""
    vector = component.interfaces[loaded]
    return float(
        component.interfaces[seen or loaded] @ spsolve(component.stiffness.tocsc(), vector)
    )


def cantilever(part, direction=(1.0, 0.0, 0.0), length=1.0, elements=4, **attached):
    """A straight beam from the origin, clamped there, with interfaces at its tip."""
    end = tuple(length * np.asarray(direction) / np.linalg.norm(direction))
    mesh = fem.frame_mesh({"root": (0, 0, 0), "tip": end}, [("arm", "root", "tip", elements)])
    return fem.StructureModel(
        mesh,
        {"arm": part},
        supports=[fem.Support("root", CLAMP)],
        interfaces={name: fem.Interface("tip", name) for name in ("x", "y", "z", *TURNS)},
        **attached,
    )
