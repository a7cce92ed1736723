"""Floquet multipliers from the Jacobians of an orbit's segments, and how sure they are."""

from __future__ import annotations

import ctypes
import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from nldyn.base.arrays import Real
from nldyn.base.errors import ComputationError
from nldyn.engine.library import HOST, function
from nldyn.engine.numbers import address_of, reals
from nldyn.orbits.critical_functions import ROUNDED_MODULUS, Critical
from nldyn.orbits.periodic_schur import NO_MEMORY, product_eigenvalues

EPS = float(np.finfo(float).eps)
SAMPLES = 4  # perturbations: the uncertainty is off by a factor above 10 once in 6000 times
COARSE = 1e-8  # a segment that squeezes a direction more than so, beside its norm, is cut
FINE = 1e-4  # and the pieces should squeeze no more than so
MOST_PARTS = 64
FAILED = "the multipliers of an orbit could not be computed"
_spectrum = function(
    "nldyn_spectrum", ctypes.c_char_p, *[ctypes.c_int64] * 2, ctypes.c_void_p, ctypes.c_double,
    *[ctypes.c_void_p] * 3,
)  # fmt: skip
_balanced = function("nldyn_balanced", *[ctypes.c_int64] * 2, *[ctypes.c_void_p] * 2)


class MultiplierError(ComputationError):
    """The eigenvalues of a product could not be computed."""


@dataclass(frozen=True, eq=False)
class FloquetSpectrum:
    """Multipliers of a periodic orbit.

    Parameters
    ----------
    multipliers : (n,) complex
        Largest modulus first; zero or infinite where the modulus leaves the range of
        floating-point numbers.
    log_moduli : (n,)
        Natural logarithms of the moduli, which do not leave it; -inf for zero.
    squeeze : float
        The smallest factor by which a segment multiplies one of the directions of the periodic
        Schur form, relative to the segment's largest entry: multipliers are rounded relative to
        the largest entry, so that directions squeezed by less than 1e-16 are lost.
    critical : Critical
        Test functions of the multipliers.
    """

    multipliers: NDArray[np.complex128]
    log_moduli: Real
    squeeze: float
    critical: Critical


@dataclass(frozen=True)
class Stability:
    """What decides the stability of an orbit, and how sure it is.

    Parameters
    ----------
    multiplier : complex
        The largest multiplier (of a complex pair the upper one).
    log_modulus : float
        ``ln |μ|``: its distance from the unit circle, negative inside.
    uncertainty : float
        Of `log_modulus`.

    Examples
    --------
    >>> Stability(1.002 + 0j, 0.002, 1e-6).verdict
    'unstable'
    """

    multiplier: complex
    log_modulus: float
    uncertainty: float

    @property
    def verdict(self) -> Literal["stable", "unstable", "undecided"]:
        """Undecided where the unit circle lies within the uncertainty."""
        if not abs(self.log_modulus) > self.uncertainty:
            return "undecided"
        return "stable" if self.log_modulus < 0.0 else "unstable"


def floquet_spectrum(jacobians: Real) -> FloquetSpectrum:
    """Eigenvalues of the product ``jacobians[k-1] @ ... @ jacobians[0]``.

    The periodic QR algorithm [Bojanczyk, Golub and Van Dooren 1992] never forms the product: the
    results are exact for matrices that differ from the given ones, balanced, by rounding relative
    to the norm of each. Small eigenvalues beside large ones keep their digits as long as no single
    matrix squeezes them below its own rounding error.

    Parameters
    ----------
    jacobians : (k, n, n) array
        The matrices, the one that acts first first.

    Returns
    -------
    FloquetSpectrum

    Raises
    ------
    MultiplierError
        If the matrices are not finite or the iteration does not converge.

    Examples
    --------
    >>> turn = np.array([[0.6, -0.8], [0.8, 0.6]])
    >>> quarters = [turn @ np.diag([1e3, 1e-3]) @ turn.T] * 4
    >>> [float(f"{x:.6g}") for x in floquet_spectrum(np.array(quarters)).multipliers.real]
    [1000000000000.0, 1e-12]
    """
    jacobians = reals(jacobians)
    k, n, _ = jacobians.shape
    numbers = np.empty(3 * n + 8)
    place = address_of(numbers)
    converged = _spectrum(
        HOST, k, n, address_of(jacobians), ROUNDED_MODULUS, place, place + 16 * n, place + 24 * n
    )
    if converged < 0:
        raise MemoryError(NO_MEMORY)
    if not converged:
        raise MultiplierError(FAILED)
    squeeze, *tests = numbers[3 * n :].tolist()
    multipliers = numbers[: 2 * n].view(np.complex128)
    return FloquetSpectrum(multipliers, numbers[2 * n : 3 * n], squeeze, Critical.told(tests))


def balanced(jacobians: Real) -> Real:
    """The same maps (k, n, n) in coordinates scaled by powers of two, so that entries are alike.

    Rounding is relative to the norm of a matrix: that of a free body, whose coordinates have no
    natural scale, is otherwise taken for much more than it is [Osborne 1960].

    Examples
    --------
    >>> balanced(np.array([[[1.0, 1024.0], [1.0 / 1024.0, 1.0]]])).tolist()
    [[[1.0, 2.0], [0.5, 1.0]]]
    """
    jacobians = reals(jacobians)
    found = np.empty_like(jacobians)
    if not _balanced(*jacobians.shape[:2], address_of(jacobians), address_of(found)):
        raise MemoryError(NO_MEMORY)
    return found


def uncertainties(jacobians: Real, found: FloquetSpectrum, error: float) -> Real:
    """Estimate of how far each log-modulus may be off when each matrix has a relative error.

    The matrices are perturbed in `SAMPLES` orthogonal random directions, always the same ones, and
    the changes are scaled from the random to the worst direction [Kenney and Laub 1994, section
    2]. The perturbations are as large as the errors themselves, so that repeated and defective
    multipliers, which have no derivative, are treated as what they are.

    Parameters
    ----------
    jacobians : (k, n, n) array
        The matrices.
    found : FloquetSpectrum
        Their multipliers.
    error : float
        Relative error of each matrix, in the Frobenius norm.

    Returns
    -------
    (n,) array
        Infinite for multipliers of which nothing is known.

    Examples
    --------
    >>> matrix = np.diag([2.0, 1e-9])[None]
    >>> unsure = uncertainties(matrix, floquet_spectrum(matrix), 1e-8)
    >>> bool(unsure[0] < 1e-7), bool(unsure[1] > 1.0)
    (True, True)
    """
    k, n = jacobians.shape[:2]
    jacobians = balanced(jacobians)
    sizes = np.linalg.norm(jacobians, axis=(1, 2))[:, None, None]
    total = np.zeros(n)
    for direction in _directions(k, n):
        _, moved, _, converged = product_eigenvalues(jacobians + error * sizes * direction)
        if not converged:
            return np.full(n, math.inf)
        with np.errstate(invalid="ignore"):
            total += (moved - found.log_moduli) ** 2
    return np.where(np.isnan(total), math.inf, np.sqrt(total))


@lru_cache(maxsize=16)
def _directions(k: int, n: int) -> Real:
    """Random perturbations (SAMPLES, k, n, n) for `uncertainties`.

    They are orthogonal. Matrices with relative errors of 1 are √k long together; the expected
    projection of a unit vector on m random directions of N-dimensional space is √(m/N) (nearly).
    """
    size = k * n * n
    samples = min(SAMPLES, size)
    basis, _ = np.linalg.qr(np.random.default_rng(1).normal(size=(size, samples)))
    length = math.sqrt(k) * math.sqrt((size - 0.5) / (samples - 0.5))
    return np.asarray(length * basis.T.reshape(samples, k, n, n))


def parts_for(squeeze: float) -> int:
    """In how many parts to cut each segment so that no part squeezes a direction too much."""
    if squeeze <= 0.0:
        return MOST_PARTS
    return min(max(2, math.ceil(math.log(squeeze) / math.log(FINE))), MOST_PARTS)


def log_determinant(jacobians: Real) -> tuple[float, float]:
    """Logarithm of the determinant of the product, and a bound on its rounding error.

    Entries with relative rounding errors ε change ln det by at most ε Σ |J⁻¹|ᵢⱼ |J|ⱼᵢ. This is the
    same for rows and columns of any scale, so that strongly damped coordinates do no harm as
    long as they can be told from the others. The logarithm is nan where the determinant is not
    positive.

    Parameters
    ----------
    jacobians : (k, n, n) array
        The matrices.

    Examples
    --------
    >>> value, rounding = log_determinant(np.array([np.diag([1e3, 1e-200])] * 3))
    >>> round(value / math.log(10.0), 9), rounding < 1e-14
    (-591.0, True)
    """
    signs, logarithms = np.linalg.slogdet(jacobians)
    if not np.all(np.isfinite(logarithms)):
        return math.nan, math.inf
    try:
        inverses = np.linalg.inv(jacobians)
    except np.linalg.LinAlgError:
        return math.nan, math.inf
    rounding = EPS * float(np.einsum("kij,kji->", np.abs(inverses), np.abs(jacobians)))
    return (float(logarithms.sum()) if np.prod(signs) > 0.0 else math.nan), rounding
