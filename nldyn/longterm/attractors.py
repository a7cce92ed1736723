"""What a motion settles on: a periodic orbit, a torus, or chaos, with the evidence."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, field
from functools import partial
from typing import Literal

import numpy as np
from scipy.spatial import cKDTree

from nldyn.base.arrays import Real
from nldyn.base.errors import (
    FAILURES,
    ConvergenceError,
    SystemModelError,
    check_frequency,
    check_types,
    check_whole,
    is_finite,
    numbers,
    shown,
)
from nldyn.flow.flow_map import FlowMap, flow_of, kept_places
from nldyn.flow.settling import settling_runs, states_after
from nldyn.longterm.impacts import impacts
from nldyn.longterm.lyapunov import LyapunovSpectrum, spectrum_from
from nldyn.longterm.simulation import (
    MOST_PERIODS,
    MOST_RECORDED,
    PIECE,
    Motion,
    simulate,
    starting_state,
    transient_end,
)
from nldyn.orbits.newton import check_bounded, refine
from nldyn.orbits.orbit import Orbit, check_observe, same_orbit, stroboscopic
from nldyn.orbits.shooting import LONGEST_PERIOD
from nldyn.orbits.starts import orbit_near, random_states, settling_periods
from nldyn.runtime.executors import check_execution, values_of
from nldyn.runtime.progress import Progress, of_number, shows_progress, silent
from nldyn.system.system import System

Kind = Literal["periodic", "quasi-periodic", "chaotic", "drifting", "undecided", "failed"]

NEAR = 0.1  # a return within this share of the motion is worth a Newton iteration
ON_ORBIT = 1e-4  # distance from an orbit, relative to the motion, at which it is reached
SETTLED = 600  # most periods of a transient that is not chosen
CLOUD = 1000  # stroboscopic states kept of a motion that is not periodic
BLOCK = 64  # periods of an unforced transient between two looks whether it is at rest
LONG_RUN = 20000  # most periods that a motion is followed to an orbit
MOST_STARTS = 10**6
EVEN = 0.01  # relative difference of the ways that a body drifts in equal times
MOST_CONFIRMATIONS = 10**4
MOST_AVERAGED = 10**7  # periods of a first run
LONGEST = 8  # a motion that has not decided itself is followed this much longer
STILL = 0.1  # of `ON_ORBIT`: a run that moves less lies on its orbit
RECORDED = 64  # periods of a motion on an attractor
NEARER = 0.9  # of its distance from an orbit, to which a motion must come that may approach it
SLOWEST = 1e-12  # decay per period that is waited for
MOST = 0.9  # share of a cloud's points with a neighbour within what counts as near
REPEATS, MOVES = 1e-6, 1e-6  # of a run's size: what it returns to; a drift that is one


@dataclass(frozen=True)
class AttractorOptions:
    """Effort of `classify_attractor`.

    Parameters
    ----------
    max_period : int
        Longest period multiple that is looked for.
    transient : int, optional
        Excitation periods left out at first; chosen from the slowest linear decay unless given.
    periods : int
        Excitation periods over which Lyapunov exponents are averaged at first; up to eight times
        as many where they do not decide.
    confirmations : int
        How many more runs of as many periods chaos must last to be the verdict.

    Raises
    ------
    SystemModelError
        If one of them is not a whole number in its range.
    """

    max_period: int = 16
    transient: int | None = None
    periods: int = 1000
    confirmations: int = 1

    def __post_init__(self) -> None:
        check_whole("classify_attractor: confirmations", self.confirmations, 0, MOST_CONFIRMATIONS)
        check_whole("classify_attractor: max_period", self.max_period, 1, LONGEST_PERIOD)
        check_whole("classify_attractor: periods", self.periods, 32, MOST_AVERAGED)
        if self.transient is not None:
            check_whole("classify_attractor: transient", self.transient, 0, MOST_PERIODS)


@dataclass(frozen=True, eq=False)
class Attractor:
    """What a motion has settled on.

    Parameters
    ----------
    flow : FlowMap
        The system.
    frequency_hz : float
        Excitation frequency in Hz.
    kind : {"periodic", "quasi-periodic", "chaotic", "drifting", "undecided", "failed"}
        See `classify_attractor`.
    states : (k, 2n)
        Stroboscopic states z on it: all of a periodic orbit, else some of the motion.
    orbit : Orbit, optional
        The stable orbit, if it is periodic.
    exponents : LyapunovSpectrum, optional
        Lyapunov exponents, if it is no orbit that could be solved for.
    zero_one : float
        Result K of the 0-1 test for chaos, near 0 for regular motion and near 1 for chaos; nan for
        a periodic orbit.
    distance : float
        How far from the orbit the motion was last, relative to its size; nan if there is none.
    failure : str
        Why it failed, if it did.
    chaotic_runs : tuple of LyapunovSpectrum
        Exponents of the runs before, in which the motion was chaotic.
    settling : Orbit, optional
        Stable orbit that an undecided motion comes nearer to, too slowly to reach it.
    returns_after : int
        Periods after which an undecided motion repeats itself without being attracted; 0 if it
        does not.
    """

    flow: FlowMap
    frequency_hz: float
    kind: Kind
    states: Real
    orbit: Orbit | None = None
    exponents: LyapunovSpectrum | None = None
    zero_one: float = math.nan
    distance: float = math.nan
    failure: str = ""
    chaotic_runs: tuple[LyapunovSpectrum, ...] = ()
    settling: Orbit | None = None
    returns_after: int = 0
    _cache: dict[int, Motion] = field(default_factory=dict, repr=False)

    def __repr__(self) -> str:
        """One line: kind, frequency, and the orbit or the largest exponent."""
        what = (
            f": {self.orbit!r}" if self.orbit else f": {self.exponents!r}" if self.exponents else ""
        )
        return (
            f"<Attractor, {self.kind}, at {self.frequency_hz:.6g} Hz{what or ': ' + self.failure}>"
        )

    @property
    def period(self) -> int:
        """Period multiple of the orbit; 0 if there is none."""
        return self.orbit.period if self.orbit is not None else 0

    @property
    def name(self) -> str:
        """Such as ``period 3`` or ``chaotic``."""
        return f"period {self.period}" if self.orbit is not None else self.kind

    @property
    def lasting(self) -> bool:
        """Whether it is one: not a motion that has yet to settle, never does, or failed."""
        return self.kind not in ("failed", "undecided", "drifting")

    @property
    def impact_rate(self) -> float:
        """Impacts in an excitation period, over all stops."""
        if self.orbit is not None:
            return self.orbit.impacts / self.period
        return len(impacts(self.motion())) / RECORDED if self.lasting else math.nan

    @property
    def span(self) -> tuple[float, float]:
        """Smallest and largest displacement of the `interface` in m."""
        motion, name = self.motion(), self.interface
        ends = motion.history(2).displacement[name]
        values = np.concatenate([motion.extremes(name)[1], ends])
        return float(values.min()), float(values.max())

    @property
    def interface(self) -> str:
        """The first interface, of which the displacement is told."""
        return check_observe(self.motion().system, None)

    @property
    def title(self) -> str:
        """Such as ``period 3, 2 impacts`` or ``chaotic, 0.81 impacts per period``."""
        if self.orbit is not None:
            count = self.orbit.impacts
            return f"{self.name}, {count or 'no'} impact{'' if count == 1 else 's'}"
        if not self.lasting:
            return self.name
        rate = self.impact_rate
        return f"{self.name}, {rate:.2g} impacts per period" if rate else f"{self.name}, no impacts"

    @property
    def largest_exponent(self) -> tuple[float, float]:
        """Largest Lyapunov exponent and its standard error in 1/s.

        That of an orbit comes from its multipliers, with their uncertainty.
        """
        if self.orbit is not None:
            stability = self.orbit.stability
            duration = self.orbit.duration
            return stability.log_modulus / duration, stability.uncertainty / duration
        if self.exponents is not None:
            return self.exponents.largest, self.exponents.largest_error
        return math.nan, math.nan

    @property
    def evidence(self) -> str:
        """What the verdict rests on, in a sentence."""
        if self.kind == "failed":
            return f"the simulation failed: {self.failure}"
        if self.orbit is not None:
            said = (
                f"a stable orbit of period {self.period} was solved for, largest multiplier "
                f"{abs(self.orbit.largest_multiplier):.4g}, and the motion came as near to it as "
                f"{self.distance:.1e} of its size"
            )
        else:
            assert self.exponents is not None
            said = (
                f"the largest Lyapunov exponent is {_exponent_text(self.exponents)}, and the 0-1 "
                f"test gives {self.zero_one:.2f}"
            )
        return said + self._growth + self._slowness + self._before

    @property
    def _growth(self) -> str:
        """What decided about a motion that is neither periodic nor undecided."""
        if self.kind == "drifting":
            return "; a rigid-body mode drifts by the same distance in each quarter of the run"
        if self.exponents is None:
            return ""
        if self.kind == "quasi-periodic":
            return (
                f"; a disturbance has grown by a factor of {math.exp(self.exponents.growth):.3g} "
                "altogether, which is no more than a power of the time and decides"
            )
        if self.kind == "chaotic":
            seen = self.exponents.periods + sum(run.periods for run in self.chaotic_runs)
            return (
                f"; seen for {seen} periods only: `chaos_lifetime` tells whether it may end later"
            )
        return ""

    @property
    def _slowness(self) -> str:
        """Why an undecided motion is not decided, as far as it is known."""
        if self.kind != "undecided":
            return ""
        if self.returns_after:
            many = "period" if self.returns_after == 1 else "periods"
            return f"; the motion repeats after {self.returns_after} {many}, but attracts nothing"
        if self.settling is not None:
            return f"; a slow transient to the stable orbit of period {self.settling.period}"
        if self.exponents is not None and self.exponents.decaying:
            return "; a slow transient, or a period above `max_period`"
        return "; its error is too large to decide"

    @property
    def _before(self) -> str:
        if not self.chaotic_runs:
            return ""
        values = ", ".join(_exponent_text(run) for run in self.chaotic_runs)
        lasting = "chaotic before, too" if self.kind == "chaotic" else "a chaotic transient before"
        return f"; {lasting}: {values}"

    def motion(self, periods: int = RECORDED) -> Motion:
        """The motion on the attractor, recorded over some excitation periods."""
        check_whole("periods", periods, 1, MOST_RECORDED)
        if periods not in self._cache:
            start = self.flow.to_start(self.states[-1])
            self._cache[periods] = simulate(self.flow, self.frequency_hz, periods, start=start)
        return self._cache[periods]


def _exponent_text(found: LyapunovSpectrum) -> str:
    return f"{found.largest:.4g} ± {found.largest_error:.2g} 1/s over {found.periods} periods"


@shows_progress()
def classify_attractor(
    system: System | FlowMap,
    frequency_hz: float,
    *,
    start: Real | None = None,
    observe: str | None = None,
    options: AttractorOptions | None = None,
    progress: Progress | None = None,
) -> Attractor:
    """Find and classify the attractor that a state leads to.

    - *periodic*: the motion nearly repeats, Newton's method finds a stable orbit there, and the
      motion comes within 1e-4 of it.
    - *chaotic*: the largest Lyapunov exponent is positive by more than three standard errors, and
      so it is again over as many periods more (`AttractorOptions.confirmations`).
    - *quasi-periodic*: small disturbances neither grow nor shrink over the whole motion by more
      than a power of the time, ``e^5 N`` over N periods: its mean is zero as far as that tells.
    - *drifting*: a rigid-body mode goes on by the same distance, within 1 %, in each quarter of the
      last 1000 periods; nothing bounds its displacement.
    - *undecided*: it is negative but no orbit was reached (a period above `max_period`, a slow
      transient), the motion repeats itself without being attracted, or the error is too large
      after eight times the periods asked for.

    Without forcing the size of the motion is that of the largest on the way, so that what has
    come to rest has period 1. Transient chaos that lasts longer than all runs together looks like
    chaos; where it ended in time, `Attractor.evidence` tells of it.

    Parameters
    ----------
    system : System or FlowMap
        What to simulate.
    frequency_hz : float
        Excitation frequency in Hz.
    start : (2n,) array, optional
        Modal displacements and velocities at forcing phase zero; undeformed and still unless given.
    observe : str, optional
        Interface whose displacement the orbit reports; the first unless given.
    options : AttractorOptions, optional
        Effort.
    progress : callable, optional
        Called as ``progress(what, frequency_hz, done)``; how much there is to do is not known, and
        ``done`` is nan.

    Returns
    -------
    Attractor

    Raises
    ------
    SystemModelError
        For input that makes no sense.

    Examples
    --------
    >>> from nldyn import Stop, System, Unbalance, classify_attractor
    >>> system = System.from_matrices([[2.48]], [[16877.0]], {"middle": [1.0]},
    ...     modal_damping=0.0142, stops=[Stop("middle", stiffness=5.17e9)],
    ...     excitation=[Unbalance("middle", 4.92e-6)])
    >>> classify_attractor(system, frequency_hz=50.0).name
    'period 2'
    """
    flow = flow_of(system)
    check_types(options=(options, AttractorOptions, None), progress=(progress, Callable, None))
    check_frequency("frequency_hz", frequency_hz)
    check_bounded(flow, 2.0 * math.pi * frequency_hz)
    name = check_observe(flow.system, observe)
    state = starting_state(flow, start)
    tell = progress or silent
    return attractor_from(flow, frequency_hz, name, options or AttractorOptions(), state, tell)


def attractor_from(
    flow: FlowMap,
    frequency_hz: float,
    observe: str,
    options: AttractorOptions,
    state: Real,
    tell: Progress = silent,
) -> Attractor:
    """As `classify_attractor`, from a state z."""
    omega = 2.0 * math.pi * frequency_hz
    transient = options.transient
    if transient is None:
        transient = min(settling_periods(flow.system, frequency_hz), SETTLED)
    try:
        tell(f"transient of {transient} periods", frequency_hz, math.nan)
        state, floor = _settled(flow, state, omega, transient)
    except ConvergenceError as error:
        return Attractor(flow, frequency_hz, "failed", state[None], failure=str(error))
    window = 3 * options.max_period + 1
    periods = options.periods
    settling: Orbit | None = None
    chaos: list[LyapunovSpectrum] = []
    try:
        while True:
            run = states_after(flow, state, omega, window)
            found = reached_orbit(flow, run, omega, observe, options.max_period, floor)
            if found is not None:
                return _periodic(flow, frequency_hz, *found, chaos)
            tell(f"Lyapunov exponents over {periods} periods", frequency_hz, math.nan)
            exponents = spectrum_from(flow, run[-1], omega, periods)
            state = exponents.end
            if exponents.chaotic:
                chaos.append(exponents)
                if len(chaos) > options.confirmations:
                    break
                continue
            if exponents.vanishing and periods > options.periods:
                break
            if exponents.decaying:
                run = states_after(flow, state, omega, CLOUD)
                found, settling = _slow_orbit(flow, run, omega, observe, floor)
                if found is not None:
                    return _periodic(flow, frequency_hz, *found, chaos)
                if settling is not None:
                    break
            if periods >= LONGEST * options.periods:
                break
            periods *= 2
        cloud = states_after(flow, state, omega, max(CLOUD, window))
        end = cloud[-1 - window :]
        found = reached_orbit(flow, end, omega, observe, options.max_period, floor)
    except ConvergenceError as error:
        return Attractor(flow, frequency_hz, "failed", state[None], failure=str(error))
    if found is not None:
        return _periodic(flow, frequency_hz, *found, chaos)
    kind, again = _kind_without_orbit(flow, exponents, cloud, end, options.max_period)
    return Attractor(
        flow, frequency_hz, kind, cloud, exponents=exponents, zero_one=zero_one_test(cloud[:, 0]),
        chaotic_runs=tuple(chaos[:-1] if exponents.chaotic else chaos), settling=settling,
        returns_after=again,
    )  # fmt: skip


def _kind_without_orbit(
    flow: FlowMap, exponents: LyapunovSpectrum, cloud: Real, end: Real, max_period: int
) -> tuple[Kind, int]:
    """Kind of a motion that reaches no orbit, and the periods after which it returns, or 0."""
    if exponents.chaotic:
        return "chaotic", 0
    if _drifts(flow, cloud):
        return "drifting", 0
    again = _repeats(end, max_period) if exponents.vanishing else 0
    return ("quasi-periodic" if exponents.vanishing and not again else "undecided"), again


def _periodic(
    flow: FlowMap, hz: float, orbit: Orbit, distance: float, chaos: Sequence[LyapunovSpectrum]
) -> Attractor:
    states = stroboscopic(orbit)
    return Attractor(
        flow, hz, "periodic", states, orbit, distance=distance, chaotic_runs=tuple(chaos)
    )


def _settled(flow: FlowMap, state: Real, omega: float, periods: int) -> tuple[Real, float]:
    """State z after a transient, and the least size by which its motion is to be measured.

    Forcing sets the size of a motion. Without it a motion has only that which it had on the way,
    and is at rest once it has lost all but `ON_ORBIT` of that.
    """
    free = not flow.system.driven
    largest = float(np.linalg.norm(state)) if free else 0.0
    for run in settling_runs(flow, state, omega, periods, BLOCK if free else PIECE):
        state = run[-1]
        if free:
            largest = max(largest, float(np.linalg.norm(run, axis=1).max()))
            if float(np.linalg.norm(run - state, axis=1).max()) <= STILL * ON_ORBIT * largest:
                break
    return state, largest


def reached_orbit(
    flow: FlowMap, run: Real, omega: float, observe: str, max_period: int, floor: float
) -> tuple[Orbit, float] | None:
    """Stable orbit that the end of a run (k, 2n) has reached, and how far it is from it still."""
    scale = _size(run, floor)
    for period in range(1, max_period + 1):
        off = np.linalg.norm(run[period:] - run[:-period], axis=1)[-2 * max_period :]
        if float(np.median(off)) > NEAR * scale:
            continue
        start = run[-1 - period]
        if float(np.linalg.norm(start)) <= NEAR * floor:
            start = np.zeros_like(start)  # rest itself, not one of many tiny orbits
        orbit = orbit_near(flow, start, period, omega, observe)
        if orbit is None or not orbit.stable:
            continue
        distance = _distance(orbit, run[-1]) / scale
        if distance > 2.0 * NEAR:
            continue
        left = _distance_later(flow, run[-1], orbit, omega, scale, distance)
        if left <= ON_ORBIT:
            return orbit, left
    return None


def _slow_orbit(
    flow: FlowMap, run: Real, omega: float, observe: str, floor: float
) -> tuple[tuple[Orbit, float] | None, Orbit | None]:
    """Stable harmonic orbit that a slow transient (k, 2n) reaches, or else comes nearer to.

    A lightly damped motion goes round it for long, and the mean of its states lies near it.
    """
    scale = _size(run, floor)
    for start in (run.mean(axis=0), run[-1]):
        orbit = orbit_near(flow, start, 1, omega, observe)
        if orbit is None or not orbit.stable:
            continue
        first, last = _distance(orbit, run[0]) / scale, _distance(orbit, run[-1]) / scale
        left = _distance_later(flow, run[-1], orbit, omega, scale, last)
        if left <= ON_ORBIT:
            return (orbit, left), None
        if left < NEARER * first:
            return None, orbit
    return None, None


def _repeats(run: Real, max_period: int) -> int:
    """Periods after which a run (k, 2n) repeats to `REPEATS` of its size; 0 if it does not."""
    scale = float(np.linalg.norm(run, axis=1).max())
    for period in range(1, max_period + 1):
        if np.all(np.linalg.norm(run[period:] - run[:-period], axis=1) <= REPEATS * scale):
            return period
    return 0


def _drifts(flow: FlowMap, run: Real) -> bool:
    """Whether a rigid-body mode goes on evenly through a run (k, 2n), by more than rounding.

    The means of its four quarters, which leave out what swings, lie equally far apart.
    """
    free = np.flatnonzero(flow.system.natural_frequencies == 0.0)
    if not free.size:
        return False
    places = flow.to_modal(run)[:, free]
    means = np.array([part.mean(axis=0) for part in np.array_split(places, 4)])
    steps = np.diff(means, axis=0)
    step = np.abs(steps.mean(axis=0))
    even = np.all(np.abs(steps - steps.mean(axis=0)) <= EVEN * step, axis=0)
    return bool(np.any(even & (step > MOVES * _size(run, 0.0))))


def _size(run: Real, floor: float) -> float:
    return max(float(np.linalg.norm(run, axis=1).max()), floor) or 1.0


def _distance(orbit: Orbit, state: Real) -> float:
    return float(np.linalg.norm(stroboscopic(orbit) - state, axis=1).min())


def _distance_later(
    flow: FlowMap, state: Real, orbit: Orbit, omega: float, scale: float, distance: float
) -> float:
    """Relative distance from the orbit after as long as its multipliers say is needed.

    That is until it is below `ON_ORBIT`, but no longer than `LONG_RUN`.
    """
    if distance <= ON_ORBIT:
        return distance
    decay = -orbit.stability.log_modulus / orbit.period
    needed = 2.0 * math.log(max(distance, 10.0 * ON_ORBIT) / ON_ORBIT) / max(decay, SLOWEST)
    count = int(min(needed, LONG_RUN)) + orbit.period
    try:
        return _distance(orbit, transient_end(flow, state, omega, count)) / scale
    except ConvergenceError:
        return math.inf


def zero_one_test(values: Real) -> float:
    """Gottwald and Melbourne's 0-1 test for chaos of a series sampled once per period.

    The values, less their mean, drive a translation with random frequencies; its mean square
    displacement grows with the time for chaos and stays bounded for regular motion. K is the
    correlation of the two, the median over 40 frequencies.

    Parameters
    ----------
    values : (k,)
        At least 100.

    Returns
    -------
    float
        Near 0 for regular motion, near 1 for chaos.

    Raises
    ------
    SystemModelError
        For fewer than 100 values, or what is no list of numbers.

    References
    ----------
    G. A. Gottwald, I. Melbourne (2009), *SIAM J. Appl. Dyn. Syst.* 8, 129-145, section 3.

    Examples
    --------
    >>> logistic = [0.3]
    >>> for _ in range(999):
    ...     logistic.append(4.0 * logistic[-1] * (1.0 - logistic[-1]))
    >>> bool(zero_one_test(np.array(logistic)) > 0.9)
    True
    """
    values = numbers("values", values)
    if values.ndim != 1:
        raise SystemModelError(f"values must be a list of numbers, got shape {values.shape}")
    if values.size < 100:
        raise SystemModelError(f"the 0-1 test needs at least 100 values, got {values.size}")
    n = values.size
    lags = np.arange(1, n // 10 + 1)
    values = values - values.mean()
    size = float(np.abs(values).max())
    if size == 0.0:
        return 0.0
    values = values / size  # squares of tiny values would underflow
    results = []
    for c in np.random.default_rng(1).uniform(np.pi / 5.0, 4.0 * np.pi / 5.0, 40):
        turn = np.exp(1j * c * np.arange(1, n + 1))
        path = np.cumsum(values * turn)
        span = n - n // 10
        square = np.array([np.mean(np.abs(path[j : j + span] - path[:span]) ** 2) for j in lags])
        results.append(float(np.corrcoef(lags, square)[0, 1]))
    return float(np.median(results))


@dataclass(frozen=True, eq=False)
class Share:
    """An attractor and how many of the initial states led to it.

    Parameters
    ----------
    attractor : Attractor
        The first one found of several that are alike.
    count : int
        Number of initial states.
    """

    attractor: Attractor
    count: int


class Attractors(list[Share]):
    """The attractors that some initial states led to, with what these may have missed.

    Parameters
    ----------
    shares : iterable of Share
        The attractors.
    drawn : int
        How many of the initial states were drawn at random, each by itself.

    Examples
    --------
    >>> print(f"{Attractors([], drawn=19).missed_share():.3f}")
    0.146
    """

    def __init__(self, shares: Iterable[Share], drawn: int) -> None:
        super().__init__(shares)
        self.drawn = drawn

    def missed_share(self, confidence: float = 0.95) -> float:
        """Share of such initial states that an attractor which none of them met draws at most.

        One that draws the share p is missed by n states with the probability (1 - p)ⁿ. So
        p = 1 - (1 - confidence)^(1/n), about 3/n at 95 %: the upper limit of Clopper and Pearson
        (1934, *Biometrika* 26, 404-413) for nothing seen.
        """
        if not (is_finite(confidence) and 0.0 < confidence < 1.0):
            raise SystemModelError(f"confidence must lie between 0 and 1, got {shown(confidence)}")
        return 1.0 - (1.0 - confidence) ** (1.0 / self.drawn) if self.drawn else 1.0

    def __repr__(self) -> str:
        """How many there are, and what share of initial states may lead to others."""
        starts, most = sum(share.count for share in self), 100.0 * self.missed_share()
        many = f"{len(self)} attractor{'' if len(self) == 1 else 's'}"
        names = ", ".join(f"{share.attractor.name}: {share.count}" for share in self)
        return (
            f"<{many} from {starts} starts ({names}); one that none of the {self.drawn} random "
            f"starts met draws less than {most:.2g} % of such (95 % confidence)>"
        )


@shows_progress(of_number("motions"))
def find_attractors(
    system: System | FlowMap,
    frequency_hz: float,
    *,
    starts: int | Real = 20,
    seed: int = 20,
    observe: str | None = None,
    options: AttractorOptions | None = None,
    executor: Executor | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Attractors:
    """Different attractors at one frequency, from many initial states.

    Parameters
    ----------
    system : System or FlowMap
        What to simulate.
    frequency_hz : float
        Excitation frequency in Hz.
    starts : int or (k, 2n) array
        How many initial states (rest, then random ones up to ten times the linear response), or
        modal displacements and velocities, which count as drawn at random.
    seed : int
        Of the random states.
    observe, options
        As for `classify_attractor`.
    executor : concurrent.futures.Executor, optional
        Where to compute; here unless given.
    progress : callable, optional
        Called as ``progress(done, total)`` after each initial state.

    Returns
    -------
    Attractors
        A list of `Share` that tells what these starts may have missed. Periodic attractors are
        the same if their orbits are, or differ only by the place at which something sticks behind
        its spring all the time; others if they are of one kind and
        their stroboscopic states fill the same region.

    Raises
    ------
    SystemModelError
        For input that makes no sense.
    TaskError
        If a computation ends in an error; a simulation that fails is an attractor of that kind.

    Examples
    --------
    >>> from nldyn import Stop, System, Unbalance, find_attractors
    >>> system = System.from_matrices([[2.48]], [[16877.0]], {"middle": [1.0]},
    ...     modal_damping=0.0142, stops=[Stop("middle", stiffness=5.17e9)],
    ...     excitation=[Unbalance("middle", 4.92e-6)])
    >>> find_attractors(system, 25.3, starts=4)
    <1 attractor from 4 starts (period 1: 4); one that none of the 3 random starts met draws less \
than 63 % of such (95 % confidence)>
    """
    flow = flow_of(system)
    check_types(options=(options, AttractorOptions, None))
    check_execution(executor, progress)
    check_frequency("frequency_hz", frequency_hz)
    omega = 2.0 * math.pi * frequency_hz
    check_bounded(flow, omega)
    name = check_observe(flow.system, observe)
    check_whole("seed", seed, 0)
    if isinstance(starts, np.ndarray | list | tuple):
        states = np.array([starting_state(flow, np.asarray(start)) for start in starts])
        if not len(states):
            raise SystemModelError("starts must hold at least one initial state, got none")
        drawn = len(states)
    else:
        check_whole("starts", starts, 1, MOST_STARTS)
        states = random_states(flow, omega, int(starts), seed)
        drawn = len(states) - 1  # the first is rest
    task = partial(attractor_from, flow, frequency_hz, name, options or AttractorOptions())
    return Attractors(distinct(values_of(task, list(states), executor, progress)), drawn)


def distinct(attractors: Sequence[Attractor]) -> list[Share]:
    """Group attractors at one frequency that are the same."""
    groups: list[list[Attractor]] = []
    for attractor in attractors:
        for group in groups:
            if same_attractor(group[0], attractor):
                group.append(attractor)
                break
        else:
            groups.append([attractor])
    return [Share(group[0], len(group)) for group in groups]


def same_attractor(a: Attractor, b: Attractor) -> bool:
    """Whether two attractors at one frequency are the same, as far as their states tell."""
    if a.kind != b.kind:
        return False
    if a.kind == "failed":
        return a.failure == b.failure
    if a.orbit is not None and b.orbit is not None:
        return same_orbit(a.orbit, b.orbit) or side_by_side(a.orbit, b.orbit)
    if a.settling is not None and b.settling is not None:
        return same_orbit(a.settling, b.settling)
    return (a.orbit is None) == (b.orbit is None) and overlap(a.states, b.states)


def side_by_side(a: Orbit, b: Orbit) -> bool:
    """Whether two orbits differ only by where something sticks behind its spring all the time.

    It does so at any place within its friction. Newton's method leads from one to the other if it
    begins with the one on which the springs of the other's places pull.
    """
    problem, kept = a.problem, stuck_places(a)
    if a.period != b.period or not kept or kept != stuck_places(b):
        return False
    flow = problem.flow
    away = flow.places(stroboscopic(b)[:1])[0] - flow.places(stroboscopic(a)[:1])[0]
    away = np.where(np.isin(2 * flow.system.size + 2 * np.arange(away.size), kept), away, 0.0)
    try:
        nodes = problem.nodes(a.point) + flow.to_state(_pulled(flow.system, away))
        return same_orbit(refine(problem, nodes, a.omega, a.observe), b)
    except FAILURES:
        return False


def _pulled(system: System, places: Real) -> Real:
    """Rest of the linear structure, and the places in m of the springs that pull it there.

    As `FlowMap.to_state` takes it.
    """
    numbers = [*system.sprung, *(i for i in system.sprung if i in system.over_planes)]
    springs = np.array([system.sliders[i].tangential_stiffness or 0.0 for i in numbers])
    pulls = np.array([system.vector_between(*ends) for ends in system.place_ends])
    stiffness = system.stiffness + (pulls.T * springs) @ pulls
    rest = np.linalg.solve(stiffness, pulls.T @ (springs * places))
    return np.concatenate([rest, np.zeros(system.size), places])


def stuck_places(orbit: Orbit) -> list[int]:
    """Entries of the state that are places at which something sticks all the time."""
    return kept_places(orbit.system, orbit.jacobians)


def overlap(a: Real, b: Real) -> bool:
    """Whether two clouds of states (k, n) lie in one another.

    Most states of either have a neighbour in the other not much further than in their own.

    Examples
    --------
    >>> cloud = np.random.default_rng(1).normal(size=(400, 2))
    >>> overlap(cloud[:200], cloud[200:]), overlap(cloud[:200], cloud[200:] + 10.0)
    (True, False)
    """

    def mostly_inside(points: Real, cloud: Real) -> bool:
        tree = cKDTree(cloud)
        own = np.quantile(np.asarray(tree.query(cloud, k=2)[0])[:, 1], MOST)
        return bool(np.mean(np.asarray(tree.query(points)[0]) <= 3.0 * own) > 0.5)

    return mostly_inside(a, b) and mostly_inside(b, a)
