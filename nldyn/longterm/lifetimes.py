"""How long chaos lasts: motions from many states of a chaotic one, and when they settle."""

from __future__ import annotations

import math
from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from nldyn.base.arrays import Real
from nldyn.base.errors import SystemModelError, check_types, check_whole
from nldyn.flow.flow_map import FlowMap
from nldyn.flow.settling import settling_runs, states_after
from nldyn.longterm.attractors import Attractor, AttractorOptions, reached_orbit
from nldyn.longterm.lyapunov import spectrum_from
from nldyn.longterm.simulation import MOST_PERIODS
from nldyn.orbits.orbit import check_observe
from nldyn.runtime.executors import check_execution, values_of
from nldyn.runtime.progress import of_number, shows_progress

LOOK = 250  # periods between two looks whether a motion has settled
LAST = 500  # periods at the end over which exponents tell whether it is chaotic still
LONGEST = 8  # and this many times as many where they do not
CONFIDENCE = 0.95
NOT_ENDED, UNCLEAR = 0, -1


@dataclass(frozen=True, eq=False)
class ChaosLifetime:
    """How many motions from states of a chaotic one are chaotic still; see `chaos_lifetime`.

    Parameters
    ----------
    frequency_hz : float
        Excitation frequency in Hz.
    periods : int
        Excitation periods for which each motion was followed.
    ended : (m,) int
        For each motion the periods after which it was found on a stable orbit; 0 if it is chaotic
        still, -1 if it is neither.
    """

    frequency_hz: float
    periods: int
    ended: NDArray[np.int64]

    @property
    def count(self) -> int:
        """Number of motions m."""
        return int(self.ended.size)

    @property
    def lasting(self) -> int:
        """Motions that were chaotic for all periods."""
        return self.lasting_for(self.periods)

    def lasting_for(self, periods: int) -> int:
        """Motions that were chaotic for some periods, up to those for which they were followed."""
        check_whole("lasting_for: periods", periods, 1, self.periods)
        return int(np.sum((self.ended == NOT_ENDED) | (self.ended > periods)))

    @property
    def settled(self) -> int:
        """Motions that reached a stable orbit."""
        return int(np.sum(self.ended > 0))

    @property
    def followed(self) -> int:
        """Periods of all motions together, of each until it settled."""
        return int(np.sum(np.where(self.ended > 0, self.ended, self.periods)))

    @property
    def escape_rate(self) -> float:
        """Share of the chaotic motions that settle in a period, if they do so at a constant rate.

        The estimate of greatest likelihood, motions that settled over the periods followed: 0 if
        none did.
        """
        return self.settled / self.followed

    @property
    def largest_escape_rate(self) -> float:
        """Upper bound of the rate with 95 % confidence, also where no motion has settled.

        A motion that is neither settled nor chaotic counts as one that has settled.
        """
        ended = self.count - self.lasting
        return float(chi2.ppf(CONFIDENCE, 2 * (ended + 1)) / (2.0 * self.followed))

    @property
    def lifetime(self) -> float:
        """Mean periods for which chaos lasts; infinite if no motion has settled."""
        return math.inf if not self.settled else 1.0 / self.escape_rate

    @property
    def least_lifetime(self) -> float:
        """Lower bound of the lifetime with 95 % confidence."""
        return 1.0 / self.largest_escape_rate

    @property
    def evidence(self) -> str:
        """What was seen, in a sentence."""
        said = f"{self.lasting} of {self.count} motions are chaotic for {self.periods} periods more"
        if self.settled:
            said += f", {self.settled} settle after {two_digits(self.lifetime)} in the mean"
        unclear = self.count - self.lasting - self.settled
        if unclear:
            said += f", {unclear} do neither"
        least = two_digits(self.least_lifetime)
        return f"{said}; the mean is at least {least} with 95 % confidence"


def two_digits(value: float) -> str:
    """A number of periods to two digits.

    Examples
    --------
    >>> two_digits(3777.0)
    '3800'
    """
    return f"{float(f'{value:.2g}'):.0f}"


@shows_progress(of_number("motions"))
def chaos_lifetime(
    attractor: Attractor,
    *,
    states: int = 8,
    periods: int = 5000,
    executor: Executor | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> ChaosLifetime:
    """Follow motions from several states of a chaotic one, and count those that stay chaotic.

    Near a crisis chaos is a transient that may last for any time: its motions settle at a constant
    rate [Lai and Tél 2011, section 1.2]. No finite simulation tells a long transient from an
    attractor. What it tells is how many of m motions are chaotic for N periods, and bounds of the
    rate, as for the failures in a test of lifetimes [Epstein and Sobel 1953].

    Every 250 periods Newton's method looks for a stable orbit that a motion has reached, as
    `classify_attractor` does: shorter lifetimes are not resolved. At the end a motion is
    chaotic still if its largest Lyapunov exponent over the last 500 periods, or up to 4000 more
    where that does not decide, is positive by three standard errors.

    Parameters
    ----------
    attractor : Attractor
        One of kind ``"chaotic"``, such as `nldyn.classify_attractor` gives.
    states : int
        Number of motions, from states evenly spread over those kept of the attractor.
    periods : int
        Excitation periods, at least 1000.
    executor : concurrent.futures.Executor, optional
        Where to compute, each motion by itself; here unless given.
    progress : callable, optional
        Called as ``progress(done, total)`` after each motion.

    Returns
    -------
    ChaosLifetime

    Raises
    ------
    SystemModelError
        If the attractor is not chaotic, or for other input that makes no sense.
    TaskError
        If a motion cannot be simulated to its end.

    Examples
    --------
    >>> from nldyn import Stop, System, Unbalance, classify_attractor
    >>> from nldyn.longterm import chaos_lifetime
    >>> system = System.from_matrices([[2.48]], [[16877.0]], {"middle": [1.0]},
    ...     modal_damping=0.0142, stops=[Stop("middle", stiffness=5.17e9)],
    ...     excitation=[Unbalance("middle", 4.92e-6)])
    >>> found = chaos_lifetime(classify_attractor(system, 36.0), states=2, periods=1000)
    >>> found.lasting, found.settled
    (2, 0)

    References
    ----------
    Y.-C. Lai, T. Tél (2011), *Transient Chaos*, Springer; B. Epstein, M. Sobel (1953), Life
    testing, *J. Am. Stat. Assoc.* 48, 486-502.
    """
    check_types(attractor=(attractor, Attractor))
    check_execution(executor, progress)
    if attractor.kind != "chaotic":
        raise SystemModelError(
            f"chaos_lifetime needs a chaotic attractor, but the one at "
            f"{attractor.frequency_hz:g} Hz is {attractor.name}"
        )
    check_whole("chaos_lifetime: states", states, 1, len(attractor.states))
    check_whole("chaos_lifetime: periods", periods, 2 * LAST, MOST_PERIODS)
    flow = attractor.flow
    picked = np.linspace(0, len(attractor.states) - 1, states).round().astype(int)
    task = partial(_ended, flow, attractor.frequency_hz, periods)
    ended = values_of(task, list(attractor.states[picked]), executor, progress)
    return ChaosLifetime(attractor.frequency_hz, periods, np.array(ended, dtype=np.int64))


def _ended(flow: FlowMap, hz: float, periods: int, state: Real) -> int:
    """Periods after which a motion from a state z was found on a stable orbit, or a mark."""
    omega = 2.0 * math.pi * hz
    observe = check_observe(flow.system, None)
    longest = AttractorOptions().max_period
    done = 0
    for run in settling_runs(flow, state, omega, periods - LAST, LOOK):
        state, done = run[-1], done + len(run)
        end = run[-3 * longest - 1 :]
        if len(end) > 2 * longest and reached_orbit(flow, end, omega, observe, longest, 0.0):
            return done
    length = LAST
    while length <= LONGEST * LAST:
        exponents = spectrum_from(flow, state, omega, length)
        if exponents.chaotic:
            return NOT_ENDED
        end = states_after(flow, exponents.end, omega, 3 * longest + 1)
        if reached_orbit(flow, end, omega, observe, longest, 0.0):
            return periods
        state, length = exponents.end, 2 * length
    return UNCLEAR
