"""Eigenvalues of a product of matrices, by the periodic QR algorithm (engine/periodic_schur.c)."""

from __future__ import annotations

import ctypes

import numpy as np

from nldyn.base.arrays import Complex, Real
from nldyn.engine.library import HOST, function
from nldyn.engine.numbers import address_of, reals

NO_MEMORY = "no memory for the multipliers"
_eigenvalues = function(
    "nldyn_product_eigenvalues", ctypes.c_char_p, *[ctypes.c_int64] * 2, *[ctypes.c_void_p] * 4
)


def product_eigenvalues(factors: Real) -> tuple[Complex, Real, float, bool]:
    """Eigenvalues of factors[k-1] @ ... @ factors[0], shape (k, n, n), largest modulus first.

    Returns
    -------
    multipliers : (n,) complex
        Zero or infinite where the modulus is beyond the range of floating-point numbers.
    logarithms : (n,)
        Natural logarithms of the moduli, -inf for zero.
    squeeze : float
        Smallest factor by which one of the matrices multiplies a direction of the periodic Schur
        form, relative to the matrix's largest entry.
    converged : bool
    """
    factors = reals(factors)
    k, n, _ = factors.shape
    multipliers, logarithms = np.empty(n, dtype=np.complex128), np.empty(n)
    squeeze = ctypes.c_double()
    converged = _eigenvalues(
        HOST, k, n, address_of(factors), address_of(multipliers), address_of(logarithms),
        ctypes.addressof(squeeze),
    )  # fmt: skip
    if converged < 0:
        raise MemoryError(NO_MEMORY)
    return multipliers, logarithms, squeeze.value, converged == 1
