"""The linear part of a system: independent pairs of real coordinates, and its steady response."""

from __future__ import annotations

import warnings
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
import scipy.linalg as sla
from numpy.typing import NDArray
from scipy.sparse.csgraph import connected_components

from nldyn.base.arrays import Complex, Real
from nldyn.base.errors import SystemModelError

# |λ - iω| below this share of ω makes an eigenvalue λ near: a steady response is at most 1/NEAR
# times as large as what the excitation brings about in 1/ω, and so are its rounding errors; in the
# derivative by ω they are up to 1/NEAR² times as large
NEAR = 3e-3


# kinds of terms of a response: e^{imωt}; the growth from rest e' = λe + e^{imωt}; and for a slow
# block A of a trace and determinant the functions of ∫exp(As) ds = e + e_on A from 0 to t
STEADY, GROWTH, DRIFT, DRIFT_ON = range(4)


class Terms(NamedTuple):
    """Functions of time that a response is made of, beside the steady one at order 1.

    Parameters
    ----------
    kinds : (k,)
        `STEADY`, `GROWTH`, `DRIFT` or `DRIFT_ON`.
    orders : (k,)
        Multiples m of the excitation frequency.
    rates : (k,)
        Eigenvalues λ of growths, trace + i determinant of drifts, in 1/s and 1/s².
    """

    kinds: NDArray[np.int64]
    orders: Real
    rates: Complex


_Term = tuple[int, float, complex, Complex]  # kind, order, rate and amplitude


# Beyond this condition number of the basis a Jacobian has fewer than eight digits left: its error
# is about 200 roundings times the condition (the cases of `hard.modes`).
_MAX_CONDITION = 2e5
# Shares by which a frequency is moved where damping makes modes inseparable: the condition goes
# with the inverse root of the share, and what a share of 1e-10 changes in a period of the mode is
# within the promise of a flow map.
_SPLITS = (1e-11, 3e-11, 1e-10)
_LARGEST_RATE = 1e100  # its square is far from the largest floating-point number
_EPS = float(np.finfo(float).eps)
_MOST_SWEEPS = 30  # of rotations; they converge quadratically
_ROUNDED = 1e-12  # of the largest: an eigenvalue, or a rate over the frequency, that may be zero
_FEW = 8.0  # roundings of each mode in a sum over all
_SLOW = 1e-3  # of the fastest mode: a slower one is scaled as that
_LOST = 1e-16  # of the faster rate: a slower one that does not count beside it


@dataclass(frozen=True)
class LinearPart:
    r"""Pairs of real coordinates that move by themselves between contacts.

    The state :math:`x = (q, \dot q)` is ``right @ z`` and ``z = left @ x``; each pair follows
    :math:`\dot z_b = A_b z_b` with a real 2×2 block. A mode that no damper couples to others is
    a pair whatever its damping, also at 0 Hz and at critical damping; coupled modes are pairs of
    the eigenvectors' planes. The length of z is a modal displacement.

    Parameters
    ----------
    blocks : (n, 2, 2)
        Matrices A_b in 1/s.
    right, left : (2n, 2n)
        Basis and its inverse.
    growth : (n,)
        Upper bounds of the norm of exp(A_b t) over t >= 0 (infinite for a free rigid body).
    condition : float
        Condition number of the basis in energy coordinates.
    places : int
        How many of the blocks, the last, are no pairs of the modes but places that stay where they
        are, with a rate that is given: `right` has more columns by two of each, `left` rows.
    """

    blocks: Real
    right: Real
    left: Real
    growth: Real
    condition: float
    places: int = 0

    @property
    def frequencies_hz(self) -> Real:
        """Frequencies of the pairs without their damping, sqrt(det A_b)/2π, ascending, (n,)."""
        return np.sort(np.sqrt(np.abs(np.linalg.det(self._pairs)))) / (2.0 * np.pi)

    @property
    def _pairs(self) -> Real:
        """The blocks of the modes, (n, 2, 2)."""
        return self.blocks[: len(self.blocks) - self.places]

    def with_places(self, count: int) -> LinearPart:
        """The same with places beside the modes."""
        if not count:
            return self
        still = np.tile([[0.0, 1.0], [0.0, 0.0]], (count, 1, 1))
        none = np.zeros((len(self.right), 2 * count))
        return replace(
            self,
            blocks=np.concatenate([self.blocks, still]),
            right=np.hstack([self.right, none]),
            left=np.vstack([self.left, none.T]),
            growth=np.append(self.growth, np.ones(count)),
            places=count,
        )

    def coordinates_of(self, other: LinearPart) -> Real:
        """Matrix from the coordinates of another linear part to those here; places are kept."""
        change = self.left @ other.right
        for kept in range(2 * (len(self.blocks) - self.places), len(change)):
            change[kept, kept] = 1.0
        return change

    def of_modes(self, modes: Real) -> LinearPart:
        """The same for states of displacements ``modes @ q``, with orthogonal modes (n, n)."""
        n = modes.shape[0]
        turned, back = np.array(self.right), np.array(self.left)
        for half in (slice(0, n), slice(n, 2 * n)):
            turned[half] = modes @ self.right[half]
            back[:, half] = self.left[:, half] @ modes.T
        return replace(self, right=turned, left=back)

    @property
    def slowest_decay(self) -> float:
        """Rate in 1/s of the free motion that decays last; not positive if one does not decay."""
        return -float(np.linalg.eigvals(self._pairs).real.max())

    def times_block(self, rows: Real) -> Real:
        """Rows (..., 2n) times the block-diagonal matrix A."""
        pairs = rows.reshape(*rows.shape[:-1], -1, 2)
        product = np.einsum("...bi,bij->...bj", pairs, self.blocks)
        return np.ascontiguousarray(product.reshape(rows.shape))

    def response(self, orders: Real, drives: Complex, omega: float) -> ForcedResponse:
        """Response to Σ Re(drives[h] e^{i orders[h] ωt}), also where a mode has no steady response.

        Parameters
        ----------
        orders : (h,) array
            Multiples of the excitation frequency, from 0 for a constant force on; the first is 1.
        drives : (h, 2n) array
            Amplitudes of the excitation of z.
        omega : float
            Excitation frequency in rad/s.
        """
        found: list[_Term] = []
        for order, drive in zip(orders.tolist(), drives, strict=True):
            steady, growing = (
                self._drift(drive, omega) if order == 0.0 else self._swing(drive, order, omega)
            )
            found += [(STEADY, order, 0j, steady), *growing]
        first, *others = found
        terms = Terms(
            np.array([term[0] for term in others], dtype=np.int64),
            np.array([term[1] for term in others], dtype=float),
            np.array([term[2] for term in others], dtype=complex),
        )
        return ForcedResponse(terms, np.array([first[3], *(term[3] for term in others)]))

    def _swing(self, drive: Complex, order: float, omega: float) -> tuple[Complex, list[_Term]]:
        """Steady response to Re(drive e^{i order ωt}), and growths of the near eigenvalues."""
        pace = order * omega
        a, b, c, d, rates = self._entries
        near = np.flatnonzero(np.abs(rates - 1j * pace) < NEAR * pace)
        x, y = drive[0::2], drive[1::2]
        first, last = 1j * pace - a, 1j * pace - d
        determinant = first * last - b * c
        determinant[near] = 1.0
        steady = np.empty(drive.size, dtype=complex)
        steady[0::2] = (last * x + b * y) / determinant
        steady[1::2] = (first * y + c * x) / determinant
        growths = []
        for block in near:
            pair, rate = slice(2 * block, 2 * block + 2), rates[block]
            turned = (self.blocks[block] - rate.real * np.eye(2)) @ drive[pair] / (1j * rate.imag)
            growing = np.zeros(drive.size, dtype=complex)
            growing[pair] = 0.5 * (drive[pair] + turned)
            steady[pair] = 0.5 * (drive[pair] - turned) / (1j * pace - rate.conjugate())
            growths.append((GROWTH, order, complex(rate), growing))
        return steady, growths

    def _drift(self, drive: Complex, omega: float) -> tuple[Complex, list[_Term]]:
        """Displacement by a constant drive, and the drifts of the blocks that are slow beside ω."""
        a, b, c, d, _ = self._entries
        determinant, trace = a * d - b * c, a + d
        slow = np.flatnonzero(slowest_rate(trace, determinant) < NEAR * omega)
        x, y = drive[0::2], drive[1::2]
        divisor = np.array(determinant)
        divisor[slow] = 1.0
        steady = np.empty(drive.size, dtype=complex)
        steady[0::2] = (b * y - d * x) / divisor
        steady[1::2] = (c * x - a * y) / divisor
        drifts = []
        for block in slow:
            pair = slice(2 * block, 2 * block + 2)
            steady[pair] = 0.0
            rate = complex(trace[block], determinant[block])
            along, onward = np.zeros((2, drive.size), dtype=complex)
            along[pair] = drive[pair]
            onward[pair] = self.blocks[block] @ drive[pair]
            drifts += [(DRIFT, 0.0, rate, along), (DRIFT_ON, 0.0, rate, onward)]
        return steady, drifts

    @cached_property
    def _entries(self) -> tuple[Real, Real, Real, Real, Complex]:
        """Entries of the blocks, row by row, and their upper eigenvalues (nan for two decays)."""
        a, b, c, d = np.ascontiguousarray(self.blocks.reshape(-1, 4).T)
        half = 0.5 * (a - d)
        square = half * half + b * c
        with np.errstate(invalid="ignore"):
            return a, b, c, d, 0.5 * (a + d) + 1j * np.sqrt(-square)


def slowest_rate(trace: Real, determinant: Real) -> Real:
    """Smallest |eigenvalue| of 2×2 matrices of some traces and determinants."""
    square = 0.25 * trace * trace - determinant
    fastest = np.where(
        square < 0.0,
        np.sqrt(np.abs(determinant)),
        0.5 * np.abs(trace) + np.sqrt(np.maximum(square, 0.0)),
    )
    return np.asarray(np.abs(determinant) / np.where(fastest > 0.0, fastest, 1.0))


@dataclass(frozen=True)
class ForcedResponse:
    """What excitation brings about in the linear part, as a sum of terms.

    Re(amplitudes[0] e^{iωt} + Σ amplitudes[1 + k] e_k(t)) is a motion of the linear part, see
    `Terms`.

    Parameters
    ----------
    terms : Terms
        The k other terms.
    amplitudes : (1 + k, 2n)
        Of the steady response at order 1, then of the terms.
    """

    terms: Terms
    amplitudes: Complex

    def unbounded(self, omega: float) -> tuple[str, str] | None:
        """Why no motion without contact is bounded at ω (rad/s), and what helps, if none is."""
        terms = self.terms
        driven = np.any(self.amplitudes[1:], axis=1)
        hz = self.resonance_hz(omega, _ROUNDED)
        if hz is not None:
            return (
                f"the excitation at {hz:g} Hz meets an undamped mode exactly",
                "give the mode some damping or move the frequency",
            )
        drifts = np.isin(terms.kinds, (DRIFT, DRIFT_ON))
        still = slowest_rate(terms.rates.real, terms.rates.imag) < _ROUNDED * omega
        if np.any(driven & drifts & still):
            return (
                "a constant force acts on a body that nothing but a stop holds",
                "hold the body by a spring or a stop",
            )
        return None

    def resonance_hz(self, omega: float, within: float) -> float | None:
        """Frequency in Hz of an undamped mode that a harmonic drives, within a share of ω."""
        terms = self.terms
        off = terms.rates - 1j * terms.orders * omega
        met = (np.abs(off.real) < _ROUNDED * omega) & (np.abs(off.imag) < within * omega)
        met &= (terms.kinds == GROWTH) & np.any(self.amplitudes[1:], axis=1)
        return float(terms.rates[met][0].imag / (2.0 * np.pi)) if np.any(met) else None

    def harmonics(self, omega: float) -> tuple[Real, Complex]:
        """Orders m (k,) and amplitudes a (k, 2n) of the steady response z = Σ Re(a e^{imωt}).

        An order may occur several times.

        Raises
        ------
        SystemModelError
            If there is none, see `unbounded`.
        """
        fault = self.unbounded(omega)
        if fault is not None:
            raise SystemModelError("; ".join(fault))
        kinds, orders, rates = self.terms
        factors = np.ones(1 + kinds.size, dtype=complex)
        for k, kind in enumerate(kinds.tolist()):
            if not np.any(self.amplitudes[1 + k]):
                continue
            if kind == GROWTH:
                factors[1 + k] = 1.0 / (1j * orders[k] * omega - rates[k])
            elif kind == DRIFT_ON:  # -A⁻¹ = (A - trace)/determinant
                factors[1 + k] = 1.0 / rates[k].imag
            elif kind == DRIFT:
                factors[1 + k] = -rates[k].real / rates[k].imag
        return np.append(1.0, orders), factors[:, None] * self.amplitudes

    def steady(self, omega: float, phase: float = 0.0) -> Real:
        """State z (2n,) of the steady response at a forcing phase; raises as `harmonics`."""
        orders, amplitudes = self.harmonics(omega)
        return np.asarray((np.exp(1j * orders * phase) @ amplitudes).real)

    def size(self, omega: float) -> float:
        """Largest coordinate that it may have, as far as terms grow within one period."""
        period = 2.0 * np.pi / omega
        spans = {STEADY: 1.0, GROWTH: period, DRIFT: period, DRIFT_ON: 0.5 * period * period}
        weights = np.array([1.0, *(spans[kind] for kind in self.terms.kinds.tolist())])
        return float((weights @ np.abs(self.amplitudes)).max())


def diagonalised(omega: Real, added: Real) -> tuple[Real, Real]:
    """Circular frequencies (n,) and modes (n, n) of modes with a symmetric stiffness (n, n) added.

    By Jacobi's rotations, which keep the digits of a soft mode beside stiff ones [Demmel and
    Veselic 1992], and leave modes alone that nothing couples.

    Raises
    ------
    SystemModelError
        If the whole stiffness is negative in a direction.
    """
    n = omega.size
    K, modes = np.diag(omega**2) + added, np.eye(n)
    sizes = omega**2 + np.abs(np.diag(added))
    for _ in range(_MOST_SWEEPS):
        size = np.sqrt(np.abs(np.diag(K)))
        pairs = np.argwhere(np.triu(np.abs(K) > _EPS * np.outer(size, size), 1))
        if not pairs.size:
            break
        for i, j in pairs:
            pair = [i, j]
            half = 0.5 * (K[j, j] - K[i, i])
            t = K[i, j] / ((half + np.copysign(np.hypot(half, K[i, j]), half)) or 1.0)
            turn = np.array([[1.0, t], [-t, 1.0]]) / np.hypot(1.0, t)
            K[:, pair] = K[:, pair] @ turn
            K[pair, :] = turn.T @ K[pair, :]
            K[i, j] = K[j, i] = 0.0
            modes[:, pair] = modes[:, pair] @ turn
    squares = np.diag(K).copy()
    rounding = _FEW * n * _EPS * (modes**2).T @ sizes
    if np.any(squares < -rounding):
        raise SystemModelError(
            "springs make the linear stiffness negative in a direction, so that the structure runs "
            "away; give it and what bounds it as coefficients [k1, k2, k3, ...] of one spring"
        )
    return np.sqrt(np.where(squares > rounding, squares, 0.0)), modes


def without_rounding(matrix: Real) -> Real:
    """The matrix without entries of rounding's size, which would seem to couple modes."""
    size = np.sqrt(np.abs(np.diag(matrix)))
    scale = np.maximum(np.outer(size, size), _EPS * size.max(initial=0.0) ** 2)
    return np.where(np.abs(matrix) > 4.0 * matrix.shape[0] * _EPS * scale, matrix, 0.0)


def linear_part(
    omega: Real, damping: Real, held: Real | float = 0.0, cross: Real | None = None
) -> LinearPart:
    """Linear part of modes with circular frequencies (n,) and a damping matrix (n, n).

    `held` (n,) is the circular frequency that stops give to a mode which is free without them: it
    sets the scale of its coordinates. `cross` (n, n) is a skew stiffness, of bearings.

    Raises
    ------
    SystemModelError
        If the damping feeds energy in, or makes coupled modes inseparable, or if a skew stiffness
        lets motions grow.
    """
    n = omega.size
    if not (omega.max() < _LARGEST_RATE and abs(damping).max() < _LARGEST_RATE):
        raise SystemModelError(
            f"frequencies_hz or damping beyond {_LARGEST_RATE:g} 1/s cannot be computed with"
        )
    if np.linalg.eigvalsh(0.5 * (damping + damping.T))[0] < -_ROUNDED * (1.0 + abs(damping).max()):
        raise SystemModelError("damping must not feed energy in (the matrix has a negative part)")
    cross = np.zeros((n, n)) if cross is None else cross
    slow = _SLOW * (omega.max() or 1.0)
    unit = np.where(omega > slow, omega, np.maximum(slow, held))
    blocks, columns, scales = [], [], []
    groups, group_of = connected_components((damping != 0.0) | (cross != 0.0), directed=False)
    for group in range(groups):
        modes = np.flatnonzero(group_of == group)
        square = np.ix_(modes, modes)
        A, planes = _planes(omega[modes], unit[modes], damping[square], cross[square])
        places = np.concatenate([modes, n + modes])
        for plane in planes:
            plane, block = _separated(plane, plane.T @ A @ plane)
            column = np.zeros((2 * n, 2))
            column[places] = plane
            blocks.append(block)
            columns.append(column)
            scales.append(max(np.sqrt(abs(np.linalg.det(block))), unit[modes].min()))
    if np.any(cross):
        _check_bounded(np.array(blocks))
    energy_basis = np.hstack(columns)
    condition = float(np.linalg.cond(energy_basis))
    if not condition < _MAX_CONDITION:
        raise SystemModelError(
            "the linear part has (nearly) coinciding modes that damping makes inseparable "
            f"(condition of their basis {condition:.1e}); change a frequency or damping slightly, "
            "by 1e-9 of it say"
        )
    to_state = 1.0 / np.concatenate([unit, np.ones(n)])
    scale = np.repeat(scales, 2)
    return LinearPart(
        np.array(blocks),
        to_state[:, None] * energy_basis * scale,
        np.linalg.inv(energy_basis) / scale[:, None] / to_state,
        np.array([_growth(block) for block in blocks]),
        condition,
    )


def _check_bounded(blocks: Real) -> None:
    """Refuse a skew stiffness that feeds in more energy than the damping takes out."""
    values = np.linalg.eigvals(blocks)
    if values.real.max() > _ROUNDED * np.abs(values).max():
        worst = values.ravel()[values.real.argmax()]
        raise SystemModelError(
            f"the nonsymmetric stiffness lets the motion at {abs(worst.imag) / (2 * np.pi):.6g} Hz "
            f"grow at {worst.real:.3g} 1/s without bound: give more damping, or less of it"
        )


def _planes(omega: Real, unit: Real, damping: Real, cross: Real) -> tuple[Real, list[Real]]:
    """Matrix of a group of modes in energy coordinates, and its invariant planes.

    Where the planes (nearly) coincide a frequency is moved, the slowest that helps, which feeds no
    energy in; a warning tells of it.
    """
    A = _energy_matrix(omega, unit, damping, cross)
    if omega.size == 1:
        return A, [np.eye(2)]
    planes = _invariant_planes(A)
    if np.linalg.cond(np.hstack(planes)) < _MAX_CONDITION:
        return A, planes
    for share in _SPLITS:
        for mode in np.argsort(omega):
            other = omega.copy()
            other[mode] *= 1.0 + share
            moved = _energy_matrix(other, unit, damping, cross)
            split = _invariant_planes(moved)
            if np.linalg.cond(np.hstack(split)) < _MAX_CONDITION:
                hz = omega[mode] / (2.0 * np.pi)
                warnings.warn(
                    "damping makes two modes (nearly) coincide; to tell them apart, the frequency "
                    f"of the mode at {hz:.6g} Hz is moved by {share:g} of itself",
                    stacklevel=2,
                )
                return moved, split
    return A, planes


def _energy_matrix(omega: Real, unit: Real, damping: Real, cross: Real) -> Real:
    """Matrix of the state (unit·q, q'), in which energy is half the squared length."""
    n = omega.size
    pull = np.diag(omega**2 / unit) + cross / unit
    return np.block([[np.zeros((n, n)), np.diag(unit)], [-pull, -damping]])


def _invariant_planes(A: Real) -> list[Real]:
    """Orthonormal bases (2n, 2) of planes that A maps into themselves, slowest first."""
    values, vectors = sla.eig(A)
    tiny = _ROUNDED * np.abs(values).max()
    pairs = [(v.real, v.imag) for v in vectors.T[values.imag > tiny]]
    order = [abs(x) for x in values[values.imag > tiny]]
    real = np.flatnonzero(np.abs(values.imag) <= tiny)
    real = real[np.argsort(values[real].real)]
    for first, second in zip(real[::2], real[1::2], strict=True):
        pairs.append((vectors[:, first].real, vectors[:, second].real))
        order.append(abs(values[second]))
    planes = [np.linalg.qr(np.column_stack(pair))[0] for pair in pairs]
    return [planes[i] for i in np.argsort(order, kind="stable")]


def _separated(plane: Real, block: Real) -> tuple[Real, Real]:
    """The same plane along the eigenvectors of its block if these are real and far apart.

    A fast decay then leaves nothing in the coordinate of the slow one.
    """
    values, vectors = np.linalg.eig(block)
    if np.iscomplexobj(values) or np.abs(values).max() <= 4.0 * np.abs(values).min():
        return plane, block
    if np.linalg.cond(vectors) > 10.0:
        return plane, block
    return plane @ vectors, np.diag(values)


def _growth(block: Real) -> float:
    """Upper bound of the norm of exp(Bt) over t >= 0 for a block B, at most three times too large.

    With the slowest eigenvalue m, or the real part m of a pair m ± iω, and R = B - mI,

    exp(Bt) = exp(mt) (I cos ωt + R sin(ωt)/ω), or exp(mt) I + R f(t) for real eigenvalues,

    and f = exp(mt) sin(ωt)/ω or (exp(mt) - exp(at))/(m - a) has its largest value where f' = 0.
    Without decay |R|/ω, the condition number of the eigenvectors, is sharper.
    """
    if np.linalg.eigvalsh(0.5 * (block + block.T))[-1] <= _ROUNDED * np.abs(block).max():
        return 1.0  # the length never grows
    values = np.linalg.eigvals(block)
    slow, fast = sorted(values, key=abs)
    if fast == 0.0:
        return np.inf
    rest = float(np.linalg.norm(block - slow.real * np.eye(2), 2))
    if slow.imag:
        turn = abs(slow.imag)
        top = np.exp(slow.real * np.arctan2(turn, -slow.real) / turn) / abs(fast)
        return float(max(1.0, min(rest / turn, 1.0 + rest * top)))
    excess = abs(fast) - abs(slow)
    if not excess:
        share = 1.0
    elif abs(slow) > _LOST * abs(fast):
        share = abs(slow) / excess * np.log1p(excess / abs(slow))
    else:
        share = 0.0
    return float(1.0 + rest * np.exp(-share) / abs(fast))
