"""How much stiffer cells are than the part that they stand for, in some of its motions.

The corners of a group of cells move as those of the part do; their other nodes, and the rotations
of shells, take what is the least energy under the part's own stress s. With the energy U of the
cells and the work F = ∫ s : e(u) of the stress in them, the motions by themselves, at the best
amplitude, have the compliance F U⁻¹ Fᵀ, where it should be G = ∫ s : e. Ritz's method makes the
excess of stiffness of this.
"""

from __future__ import annotations

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import spsolve

from fem.base.arrays import FloatArray, IntArray

LEAST = 1e-6
"""Of the right compliance, which cells have that cannot follow a motion at all."""
RIDGE = 1e-12
"""Of the stiffness of what is free: holds what nothing else does."""


def settled(
    stiffness: FloatArray,
    displacement: FloatArray,
    force: FloatArray,
    numbers: IntArray,
    free: IntArray,
) -> FloatArray:
    """Displacements (e, m, n) of cells with the least energy in what is free.

    Parameters
    ----------
    stiffness
        Of cells, shape (e, n, n).
    displacement, force
        Of m motions, shape (e, m, n).
    numbers
        Of the cells' degrees of freedom, the same for the same ones, shape (e, n).
    free
        Which of a cell's degrees of freedom are free.

    Examples
    --------
    Two springs in a row, the middle of which is free:

    >>> spring = np.array([[[1.0, -1.0], [-1.0, 1.0]]])
    >>> ends = np.array([[[0.0, 9.0]], [[4.0, 9.0]]])
    >>> numbers = np.array([[0, 1], [2, 1]])
    >>> settled(spring.repeat(2, axis=0), ends, 0.0 * ends, numbers, np.array([1]))[:, 0]
    array([[0., 2.],
           [4., 2.]])
    """
    if not len(free):
        return displacement
    held = displacement.copy()
    held[:, :, free] = 0.0
    load = (force - held @ stiffness)[:, :, free]
    used, place = np.unique(numbers[:, free], return_inverse=True)
    place = place.reshape(len(numbers), -1)
    own = stiffness[:, free[:, None], free]
    row, column = (np.broadcast_to(at, own.shape) for at in (place[:, :, None], place[:, None]))
    shape = (len(used), len(used))
    K = sparse.csc_array(
        sparse.coo_array((own.ravel(), (row.ravel(), column.ravel())), shape=shape)
    )
    total = np.zeros((len(used), displacement.shape[1]))
    np.add.at(total, place, load.transpose(0, 2, 1))
    ridge = RIDGE * K.diagonal().max() * sparse.eye_array(len(used), format="csc")
    answer = spsolve(sparse.csc_array(K + ridge), total).reshape(total.shape)
    held[:, :, free] = answer[place].transpose(0, 2, 1)
    return held


def excess(
    energy: FloatArray, work: FloatArray, exact: FloatArray, whole: FloatArray, kept: FloatArray
) -> FloatArray:
    """Greatest excess of stiffness (g,) over that of the part, among combinations of motions.

    Parameters
    ----------
    energy, work, exact
        U, F and G of groups of cells, shape (g, m, m).
    whole
        The energy beside which the excess counts, shape (g, m, m).
    kept
        From combinations to what is tested of them, shape (g, m, m).

    Examples
    --------
    >>> one = np.ones((1, 1, 1))
    >>> np.round(excess(3.0 * one, one, one, 2.0 * one, one), 4)
    array([1.])
    """
    size = np.trace(energy, axis1=1, axis2=2)[:, None, None]
    held = energy + RIDGE * size * np.eye(energy.shape[1])
    compliance = work @ np.linalg.solve(held, work.transpose(0, 2, 1))
    compliance = (compliance + compliance.transpose(0, 2, 1)) / 2.0 + LEAST * exact
    stiffer = exact @ np.linalg.solve(compliance, exact) - exact
    root = kept @ np.linalg.inv(np.linalg.cholesky(whole)).transpose(0, 2, 1)
    return np.asarray(np.linalg.eigvalsh(root.transpose(0, 2, 1) @ stiffer @ root)[:, -1])


def summed(values: FloatArray, group: IntArray, count: int) -> FloatArray:
    """Sums (g, ...) of values (e, ...) over the groups that they are of."""
    found = np.zeros((count, *values.shape[1:]))
    np.add.at(found, group, values)
    return found
