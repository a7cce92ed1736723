"""Lyapunov exponents from the exact Jacobians of the flow map."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from functools import partial
from typing import Any, overload

import numpy as np

from nldyn.base.arrays import Real
from nldyn.base.errors import ConvergenceError, SystemModelError, check_whole, numbers
from nldyn.flow.flow_map import FlowMap, flow_of
from nldyn.flow.settling import periods_at_once
from nldyn.longterm.growth_rates import growth_rates
from nldyn.longterm.simulation import (
    MOST_PERIODS,
    cases_at,
    is_list,
    transient_end,
)
from nldyn.orbits.orbit import contact_damping
from nldyn.runtime.executors import check_execution, values_of
from nldyn.runtime.progress import of_number, shows_progress
from nldyn.system.system import System

BLOCK = 64  # periods in one call
FEWEST_BLOCKS = 16  # from which an error is estimated
SQUEEZE = 4.0  # most e-foldings by which the linear part may shrink a direction over a segment
NOTHING = 1e-14  # of a Jacobian's size: directions that a body's rest on a rigid stop ends
CLEAR = 3.0  # standard errors
RESOLVED = 1e-3  # least logarithm of a shrinkage over all periods that is told from none
SLOW_GROWTH = 5.0  # logarithm of a growth that goes with a power of the time, beside that of it


@dataclass(frozen=True, eq=False)
class LyapunovSpectrum:
    """Lyapunov exponents of a motion with their standard errors.

    The state of the stroboscopic map has 2n coordinates and so many exponents; the zero exponent
    along the time of the excitation is not among them.

    Parameters
    ----------
    frequency_hz : float
        Excitation frequency in Hz.
    exponents : (2n,)
        In 1/s, largest first; -inf for what is forgotten where a body rests on a rigid stop.
    errors : (2n,)
        Standard errors in 1/s, from averages over blocks of periods.
    divergence : float
        What the exponents add up to by Liouville's formula, in 1/s.
    periods : int
        Excitation periods averaged over.
    end : (2n,)
        State z after them, at phase zero.
    """

    frequency_hz: float
    exponents: Real
    errors: Real
    divergence: float
    periods: int
    end: Real

    def __repr__(self) -> str:
        """One line: the largest exponent with its standard error."""
        return (
            f"<LyapunovSpectrum at {self.frequency_hz:.6g} Hz: largest {self.exponents[0]:.4g} +- "
            f"{self.errors[0]:.1g} 1/s over {self.periods} periods>"
        )

    @property
    def largest(self) -> float:
        """Largest exponent in 1/s."""
        return float(self.exponents[0])

    @property
    def largest_error(self) -> float:
        """Standard error of the largest exponent in 1/s."""
        return float(self.errors[0])

    @property
    def sum_error(self) -> float:
        """How far the sum is from the divergence, relative to it (or to 1/s where that is less)."""
        total = float(self.exponents.sum())
        if total == self.divergence:  # both infinite, where a body rests
            return 0.0
        return abs(total - self.divergence) / max(abs(self.divergence), 1.0)

    @property
    def growth(self) -> float:
        """Logarithm of the growth of a small disturbance over all periods."""
        return self.largest * self.periods / self.frequency_hz

    @property
    def chaotic(self) -> bool:
        """Whether the largest exponent is positive beyond doubt.

        It is larger than three standard errors, and the growth is more than the power of the time
        with which neighbours on a torus part.
        """
        return self.largest > CLEAR * self.largest_error and self.growth > self._slow_growth

    @property
    def decaying(self) -> bool:
        """Whether the largest exponent is negative beyond doubt.

        It lies more than three standard errors below zero, and a disturbance has shrunk by more
        than 0.1 % over all periods. A basis that is not yet turned costs growth in the first blocks
        only, and their scatter contains it.
        """
        return self.largest < -CLEAR * self.largest_error and self.growth < -RESOLVED

    @property
    def vanishing(self) -> bool:
        """Whether the largest exponent is zero as far as it is resolved.

        Neighbours on a torus part with a power of the time: growth up to that is none, and its
        standard error must not be larger.
        """
        error = self.largest_error * self.periods / self.frequency_hz
        unclear = self.chaotic or self.decaying
        return not unclear and max(abs(self.growth), error) < self._slow_growth

    @property
    def _slow_growth(self) -> float:
        return SLOW_GROWTH + math.log(self.periods)

    @property
    def dimension(self) -> float:
        """Kaplan-Yorke dimension of the attractor of the stroboscopic map."""
        total = 0.0
        for j, exponent in enumerate(self.exponents):
            if total + exponent < 0.0:
                return j + (total / abs(exponent) if j else 0.0)
            total += float(exponent)
        return float(len(self.exponents))


@overload
def lyapunov_exponents(
    system: System | FlowMap,
    frequency_hz: float,
    *,
    start: Real | None = ...,
    transient: int = ...,
    periods: int = ...,
    executor: Executor | None = ...,
    progress: Callable[[int, int], None] | None = ...,
) -> LyapunovSpectrum: ...


@overload
def lyapunov_exponents(
    system: System | FlowMap,
    frequency_hz: Sequence[float] | Real,
    *,
    start: Real | None = ...,
    transient: int = ...,
    periods: int = ...,
    executor: Executor | None = ...,
    progress: Callable[[int, int], None] | None = ...,
) -> list[LyapunovSpectrum]: ...


@shows_progress(of_number("motions"))
def lyapunov_exponents(
    system: System | FlowMap,
    frequency_hz: float | Sequence[float] | Real,
    *,
    start: Real | None = None,
    transient: int = 300,
    periods: int = 2000,
    executor: Executor | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> LyapunovSpectrum | list[LyapunovSpectrum]:
    """All Lyapunov exponents of the motion that a state leads to, or of several motions.

    An orthonormal basis is carried by the Jacobians of the flow map and made orthonormal again
    after every segment [Benettin et al. 1980; Shimada and Nagashima 1979]; as many periods as a
    tenth of them only turn the basis before. The errors come from means over blocks of the periods
    [Flyvbjerg and Petersen 1989], see `nldyn.longterm.lyapunov.standard_errors`.

    Parameters
    ----------
    system : System or FlowMap
        What to simulate.
    frequency_hz : float or sequence of k
        Excitation frequency in Hz. A list of them gives a list of spectra, each a computation of
        its own.
    start : (2n,) or (k, 2n) array, optional
        Modal displacements and velocities at forcing phase zero; undeformed and still unless
        given. One for
        all, or one for each frequency.
    transient : int
        Excitation periods left out at the beginning.
    periods : int
        Excitation periods averaged over, at least 32.
    executor : concurrent.futures.Executor, optional
        Where to compute a list; here unless given.
    progress : callable, optional
        Called as ``progress(done, total)`` after each spectrum of a list.

    Returns
    -------
    LyapunovSpectrum or list of LyapunovSpectrum

    Raises
    ------
    SystemModelError
        For input that makes no sense.
    ConvergenceError
        If the motion cannot be simulated to its end.
    TaskError
        In place of a ConvergenceError, for one of a list.

    Examples
    --------
    >>> from nldyn import Stop, System, Unbalance, lyapunov_exponents
    >>> system = System.from_matrices([[2.48]], [[16877.0]], {"middle": [1.0]},
    ...     modal_damping=0.0142, stops=[Stop("middle", stiffness=5.17e9)],
    ...     excitation=[Unbalance("middle", 4.92e-6)])
    >>> found = lyapunov_exponents(system, frequency_hz=36.0)
    >>> found.chaotic, found.sum_error < 1e-6
    (True, True)

    References
    ----------
    G. Benettin, L. Galgani, A. Giorgilli, J.-M. Strelcyn (1980), *Meccanica* 15, 9-30;
    I. Shimada, T. Nagashima (1979), *Prog. Theor. Phys.* 61, 1605-1616;
    H. Flyvbjerg, H. G. Petersen (1989), *J. Chem. Phys.* 91, 461-466.
    """
    flow = flow_of(system, periodic=False)
    check_execution(executor, progress)
    check_whole("transient", transient, 0, MOST_PERIODS)
    check_whole("periods", periods, 2 * FEWEST_BLOCKS, MOST_PERIODS)
    cases = cases_at(flow, frequency_hz, start)
    if is_list(frequency_hz):
        task = partial(_spectrum_after, flow, transient, periods)
        return values_of(task, cases, executor, progress)
    return _spectrum_after(flow, transient, periods, cases[0])


def _spectrum_after(
    flow: FlowMap, transient: int, periods: int, case: tuple[float, Real]
) -> LyapunovSpectrum:
    """Exponents of the motion at a frequency in Hz from a state z, a transient left out."""
    frequency_hz, start = case
    omega = 2.0 * math.pi * frequency_hz
    state = transient_end(flow, start, omega, transient)
    return spectrum_from(flow, state, omega, periods, transient)


def spectrum_from(
    flow: FlowMap, state: Real, omega: float, periods: int, before: int = 0
) -> LyapunovSpectrum:
    """Lyapunov exponents of the motion from a state z, some periods after the beginning."""
    parts = segments_per_period(flow.system, omega)
    basis = np.eye(state.size)
    turning = max(periods // 10, 1)
    state, _, _ = _grown(flow, state, omega, before, turning, parts, basis)
    state, stretches, viscous = _grown(flow, state, omega, before + turning, periods, parts, basis)
    rates = stretches * (omega / (2.0 * math.pi))
    means, errors = rates.mean(axis=0), np.zeros(state.size)
    errors[np.isfinite(means)] = standard_errors(rates[:, np.isfinite(means)])
    order = np.argsort(-means, kind="stable")
    divergence = -float(np.trace(flow.system.total_damping))
    if flow.system.sliders:  # what turns and sticks takes a share of its own
        divergence = math.nan
    divergence -= viscous / (periods * 2.0 * math.pi / omega)
    return LyapunovSpectrum(
        omega / (2.0 * math.pi),
        means[order],
        errors[order],
        divergence,
        periods,
        state,
    )


def segments_per_period(system: System, omega: float) -> int:
    """Segments over which no direction of the linear part shrinks so much as to lose digits.

    Examples
    --------
    >>> segments_per_period(System.from_modal([10.0], {"tip": [1.0]}, modal_damping=0.01), 6.28)
    1
    """
    fastest = max(-float(np.linalg.eigvals(block).real.min()) for block in system.linear.blocks)
    return max(1, math.ceil(fastest * 2.0 * math.pi / omega / SQUEEZE))


def _grown(
    flow: FlowMap, state: Real, omega: float, before: int, periods: int, parts: int, basis: Real
) -> tuple[Real, Real, float]:
    """Last state, stretches per period (periods, 2n) and ∫ of the stops' damping, in blocks."""
    rubs = any(stop.friction for stop in flow.system.round_stops.values())
    lossy = flow.system.loses_by_speed or rubs
    stretches = np.empty((periods, state.size))
    viscous = lost = 0.0
    at_once = periods_at_once(flow, BLOCK)
    for first in range(0, periods, at_once):
        count = min(at_once, periods - first)
        phases = np.linspace(0.0, 2.0 * np.pi * count, count * parts + 1)
        here = flow.at(omega, (before + first) * 2.0 * math.pi / omega)
        found = here.shoot(state[None], phases, omega, chained=True)
        if found.failure:
            hz = omega / (2.0 * math.pi)
            raise ConvergenceError(f"the simulation at {hz:g} Hz failed: {found.failure}")
        if lossy:
            motion = here.trajectory(state[None], phases, omega, chained=True)
            lost = contact_damping(here, motion)
            viscous += lost
        grown = growth_rates(found.jacobians, basis, NOTHING if math.isinf(lost) else 0.0)
        stretches[first : first + count] = grown.reshape(count, parts, -1).sum(axis=1)
        state = found.ends[-1]
    return state, stretches, viscous


def standard_errors(samples: Any) -> Real:
    """Standard errors (n,) of the means of correlated samples (k, n), from averages over blocks.

    Blocks of about 1/64, 1/32 and 1/16 of the samples are averaged, and the largest of the three
    errors taken. Means of blocks that are longer than the correlation are independent, and the
    error is right; shorter ones give too small an error where neighbours are alike and too large a
    one where they compensate each other [Flyvbjerg and Petersen 1989].

    Raises
    ------
    SystemModelError
        For fewer than 32 samples, or what is no table of numbers.

    Examples
    --------
    >>> samples = np.random.default_rng(1).normal(size=(4096, 1))
    >>> bool(abs(standard_errors(samples)[0] * 64.0 - 1.0) < 0.3)
    True
    """
    samples = numbers("samples", samples)
    if samples.ndim != 2:
        raise SystemModelError(f"samples must be a table (k, n), got shape {samples.shape}")
    k, n = samples.shape
    if k < 2 * FEWEST_BLOCKS:
        raise SystemModelError(f"an error needs {2 * FEWEST_BLOCKS} samples, got {k}")
    largest = np.zeros(n)
    for count in (4 * FEWEST_BLOCKS, 2 * FEWEST_BLOCKS, FEWEST_BLOCKS):
        length = k // count
        if length:
            means = samples[: count * length].reshape(count, length, n).mean(axis=1)
            largest = np.maximum(largest, means.std(axis=0, ddof=1) / math.sqrt(count))
    return largest
