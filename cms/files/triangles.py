"""Matrices of which a file holds one triangle, or both."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy import sparse

from cms.base.errors import ReductionError


def mirrored(matrix: sparse.csc_array[np.float64]) -> sparse.csc_array[np.float64]:
    """The symmetric matrix of which a file holds each pair of entries once, or all of them twice.

    Examples
    --------
    >>> import numpy as np
    >>> from scipy import sparse
    >>> mirrored(sparse.csc_array(np.array([[3.0, 0.0], [-1.0, 4.0]]))).toarray().tolist()
    [[3.0, -1.0], [-1.0, 4.0]]
    """
    off = sparse.csc_array(matrix - sparse.diags_array(matrix.diagonal()))
    off.eliminate_zeros()
    pattern = sparse.csc_array((np.ones(off.nnz), off.indices, off.indptr), shape=off.shape)
    twice = pattern.multiply(pattern.T).nnz
    return matrix if twice else sparse.csc_array(matrix + off.T)


def check_one_triangle(filled: Any) -> None:
    """Refuse a symmetric matrix whose reader added entries up as it filled in a triangle.

    Parameters
    ----------
    filled
        The matrix as coordinates, both triangles, before entries at one place are added.

    Raises
    ------
    ReductionError
        If a place has more than one entry, as where the file holds both triangles.
    """
    kept = filled.data != 0
    places = np.sort(filled.row[kept] * np.int64(filled.shape[1]) + filled.col[kept])
    again = places[1:][np.diff(places) == 0]
    if again.size:
        row, column = divmod(int(again[-1]), filled.shape[1])
        raise ReductionError(
            f"gives entry ({row + 1}, {column + 1}) twice, though its first line says that it is "
            "symmetric or skew: give each pair once, as one triangle, or say 'general'"
        )
