"""What a motion settles on: a periodic orbit, a torus, or chaos, with the evidence."""

from __future__ import annotations

import math
from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, field
from functools import partial
from typing import Literal

import numpy as np

from nldyn.branch import same_orbit, stroboscopic
from nldyn.errors import SystemModelError, check_frequency, check_types, check_whole
from nldyn.executors import run_all
from nldyn.exploration import settling_periods
from nldyn.flow import FlowMap
from nldyn.linear import Real
from nldyn.lyapunov import LyapunovSpectrum, spectrum_from
from nldyn.orbit import ConvergenceError, Orbit, check_bounded, check_observe
from nldyn.search import orbit_near, random_states
from nldyn.simulation import Motion, simulate, starting_state, transient_end
from nldyn.system import System

Kind = Literal["periodic", "quasi-periodic", "chaotic", "undecided", "failed"]

NEAR = 0.1  # a return within this share of the motion is worth a Newton iteration
ON_ORBIT = 1e-4  # distance from an orbit, relative to the motion, at which it is reached
SETTLED = 600  # most periods of a transient that is not chosen
CLOUD = 1000  # stroboscopic states kept of a motion that is not periodic
LONGEST = 8  # a motion that has not decided itself is followed this much longer


@dataclass(frozen=True)
class AttractorOptions:
    """Effort of `classify`.

    Parameters
    ----------
    max_period : int
        Longest period multiple that is looked for.
    transient : int, optional
        Excitation periods left out at first; chosen from the slowest linear decay unless given.
    periods : int
        Excitation periods over which Lyapunov exponents are averaged at first; up to eight times
        as many where they do not decide.

    Raises
    ------
    SystemModelError
        If one of them is not a whole number in its range.
    """

    max_period: int = 16
    transient: int | None = None
    periods: int = 1000

    def __post_init__(self) -> None:
        check_whole("classify: max_period", self.max_period, 1)
        check_whole("classify: periods", self.periods, 32)
        if self.transient is not None:
            check_whole("classify: transient", self.transient, 0)


@dataclass(frozen=True, eq=False)
class Attractor:
    """What a motion has settled on.

    Parameters
    ----------
    flow : FlowMap
        The system.
    frequency_hz : float
        Excitation frequency in Hz.
    kind : {"periodic", "quasi-periodic", "chaotic", "undecided", "failed"}
        See `classify`.
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
    _cache: dict[int, Motion] = field(default_factory=dict, repr=False)

    @property
    def period(self) -> int:
        """Period multiple of the orbit; 0 if there is none."""
        return self.orbit.period if self.orbit is not None else 0

    @property
    def name(self) -> str:
        """Such as ``period 3`` or ``chaotic``."""
        return f"period {self.period}" if self.orbit is not None else self.kind

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
        value, error = self.largest_exponent
        if self.orbit is not None:
            return (
                f"a stable orbit of period {self.period} was solved for, largest multiplier "
                f"{abs(self.orbit.largest_multiplier):.4g}, and the motion came as near to it as "
                f"{self.distance:.1e} of its size"
            )
        assert self.exponents is not None
        return (
            f"the largest Lyapunov exponent is {value:.4g} ± {error:.2g} 1/s over "
            f"{self.exponents.periods} periods, and the 0-1 test gives {self.zero_one:.2f}"
        )

    def motion(self, periods: int = 64) -> Motion:
        """The motion on the attractor, recorded over some excitation periods."""
        if periods not in self._cache:
            start = self.flow.to_modal(self.states[-1])
            self._cache[periods] = simulate(self.flow, self.frequency_hz, periods, start=start)
        return self._cache[periods]


def classify(
    system: System | FlowMap,
    frequency_hz: float,
    *,
    start: Real | None = None,
    observe: str | None = None,
    options: AttractorOptions | None = None,
) -> Attractor:
    """Find and classify the attractor that a state leads to.

    - *periodic*: the motion nearly repeats, Newton's method finds a stable orbit there, and the
      motion comes within 1e-4 of it.
    - *chaotic*: the largest Lyapunov exponent is positive by more than three standard errors.
    - *quasi-periodic*: it is zero: small disturbances grow or shrink over the whole motion by no
      more than a power of the time.
    - *undecided*: it is negative but no orbit was found (a period above `max_period`, a slow
      transient), or its error is too large after eight times the periods asked for.

    Transient chaos that lasts longer than the simulation looks like chaos.

    Parameters
    ----------
    system : System or FlowMap
        What to simulate.
    frequency_hz : float
        Excitation frequency in Hz.
    start : (2n,) array, optional
        Modal displacements and velocities at forcing phase zero; at rest unless given.
    observe : str, optional
        Interface whose displacement the orbit reports; the first unless given.
    options : AttractorOptions, optional
        Effort.

    Returns
    -------
    Attractor

    Raises
    ------
    SystemModelError
        For input that makes no sense.

    Examples
    --------
    >>> from nldyn import Stop, System, Unbalance, classify
    >>> system = System.from_matrices([[2.48]], [[16877.0]], {"middle": [1.0]},
    ...     modal_damping=0.0142, stops=[Stop("middle", stiffness=5.17e9)],
    ...     excitation=[Unbalance("middle", 4.92e-6)])
    >>> classify(system, frequency_hz=50.0).name
    'period 2'
    """
    flow = system if isinstance(system, FlowMap) else FlowMap(system)
    check_types(options=(options, AttractorOptions, None))
    check_frequency("frequency_hz", frequency_hz)
    check_bounded(flow.system, 2.0 * math.pi * frequency_hz)
    name = check_observe(flow.system, observe)
    state = starting_state(flow, start)
    return attractor_from(flow, frequency_hz, state, name, options or AttractorOptions())


def attractor_from(
    flow: FlowMap, frequency_hz: float, state: Real, observe: str, options: AttractorOptions
) -> Attractor:
    """As `classify`, from a state z."""
    omega = 2.0 * math.pi * frequency_hz
    transient = options.transient
    if transient is None:
        transient = min(settling_periods(flow.system, frequency_hz), SETTLED)
    moved, failure = transient_end(flow, state, omega, transient)
    if moved is None:
        return Attractor(flow, frequency_hz, "failed", state[None], failure=failure)
    window = 3 * options.max_period + 1
    periods = options.periods
    try:
        while True:
            phases = np.linspace(0.0, 2.0 * np.pi * window, window + 1)
            strobe = flow.shoot(moved[None], phases, omega, sensitivities=False, chained=True)
            if strobe.failure:
                raise ConvergenceError(strobe.failure)
            found = _reached_orbit(flow, strobe.ends, omega, observe, options.max_period)
            if found is not None:
                orbit, distance = found
                states = stroboscopic(orbit)
                return Attractor(flow, frequency_hz, "periodic", states, orbit, distance=distance)
            exponents = spectrum_from(flow, strobe.ends[-1], omega, periods)
            moved = exponents.end
            if exponents.chaotic or periods >= LONGEST * options.periods:
                break
            if not exponents.decaying and periods > options.periods:
                break
            periods *= 2
    except ConvergenceError as error:
        return Attractor(flow, frequency_hz, "failed", moved[None], failure=str(error))
    phases = np.linspace(0.0, 2.0 * np.pi * CLOUD, CLOUD + 1)
    strobe = flow.shoot(moved[None], phases, omega, sensitivities=False, chained=True)
    if strobe.failure:
        return Attractor(flow, frequency_hz, "failed", moved[None], failure=strobe.failure)
    cloud = strobe.ends
    kind: Kind = "chaotic" if exponents.chaotic else "undecided"
    if not exponents.chaotic and not exponents.decaying:
        kind = "quasi-periodic" if abs(exponents.growth) < 5.0 + math.log(periods) else "undecided"
    return Attractor(
        flow, frequency_hz, kind, cloud, exponents=exponents, zero_one=zero_one_test(cloud[:, 0])
    )


def _reached_orbit(
    flow: FlowMap, run: Real, omega: float, observe: str, max_period: int
) -> tuple[Orbit, float] | None:
    """Stable orbit that the end of a run (k, 2n) has reached, and how far it is from it still."""
    scale = float(np.linalg.norm(run, axis=1).max()) or 1.0
    for period in range(1, max_period + 1):
        off = np.linalg.norm(run[period:] - run[:-period], axis=1)[-2 * max_period :]
        if float(np.median(off)) > NEAR * scale:
            continue
        orbit = orbit_near(flow, run[-1 - period], period, omega, observe)
        if orbit is None or not orbit.stable:
            continue
        distance = _distance(orbit, run[-1]) / scale
        if distance > 2.0 * NEAR:
            continue
        reached = _approached(flow, run[-1], orbit, omega, scale, distance)
        if reached is not None:
            return orbit, reached
    return None


def _distance(orbit: Orbit, state: Real) -> float:
    return float(np.linalg.norm(stroboscopic(orbit) - state, axis=1).min())


def _approached(
    flow: FlowMap, state: Real, orbit: Orbit, omega: float, scale: float, distance: float
) -> float | None:
    """Distance from the orbit once it is below `ON_ORBIT`; None if the motion stays away.

    The multipliers tell how long that takes.
    """
    if distance <= ON_ORBIT:
        return distance
    decay = -orbit.stability.log_modulus / orbit.period
    needed = 2.0 * math.log(max(distance, 10.0 * ON_ORBIT) / ON_ORBIT) / max(decay, 1e-12)
    count = int(min(needed, 20000.0)) + orbit.period
    moved, _ = transient_end(flow, state, omega, count)
    if moved is None:
        return None
    left = _distance(orbit, moved) / scale
    return left if left <= ON_ORBIT else None


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
        For fewer than 100 values.

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
    if values.size < 100:
        raise SystemModelError(f"the 0-1 test needs at least 100 values, got {values.size}")
    n = values.size
    lags = np.arange(1, n // 10 + 1)
    values = values - values.mean()
    if not np.any(values):
        return 0.0
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


def find_attractors(
    system: System | FlowMap,
    frequency_hz: float,
    *,
    starts: int | Real = 20,
    seed: int = 20,
    observe: str | None = None,
    options: AttractorOptions | None = None,
    executor: Executor | None = None,
) -> list[Share]:
    """Different attractors at one frequency, from many initial states.

    Parameters
    ----------
    system : System or FlowMap
        What to simulate.
    frequency_hz : float
        Excitation frequency in Hz.
    starts : int or (k, 2n) array
        How many initial states (rest, then random ones up to ten times the linear response), or
        modal displacements and velocities.
    seed : int
        Of the random states.
    observe, options
        As for `classify`.
    executor : concurrent.futures.Executor, optional
        Where to compute; here unless given.

    Returns
    -------
    list of Share
        Periodic attractors are the same if their orbits are; others if they are of one kind and
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
    >>> [share.attractor.name for share in find_attractors(system, 25.3, starts=4)]
    ['period 1']
    """
    flow = system if isinstance(system, FlowMap) else FlowMap(system)
    check_types(options=(options, AttractorOptions, None), executor=(executor, Executor, None))
    check_frequency("frequency_hz", frequency_hz)
    omega = 2.0 * math.pi * frequency_hz
    check_bounded(flow.system, omega)
    name = check_observe(flow.system, observe)
    check_whole("seed", seed, 0)
    if isinstance(starts, np.ndarray | list | tuple):
        states = np.array([starting_state(flow, np.asarray(start)) for start in starts])
    else:
        check_whole("starts", starts, 1)
        states = random_states(flow, omega, int(starts), seed)
    task = partial(_attractor_task, flow.system, flow.options, frequency_hz, name,
                   options or AttractorOptions())  # fmt: skip
    found = run_all(task, list(states), executor)
    return distinct([outcome.value_or_raise() for outcome in found])


def _attractor_task(
    system: System, flow_options: object, hz: float, observe: str, options: AttractorOptions,
    state: Real,
) -> Attractor:  # fmt: skip
    flow = FlowMap(system, flow_options)  # type: ignore[arg-type]
    return attractor_from(flow, hz, state, observe, options)


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
    if a.orbit is not None and b.orbit is not None:
        return same_orbit(a.orbit, b.orbit)
    return (a.orbit is None) == (b.orbit is None) and overlap(a.states, b.states)


def overlap(a: Real, b: Real) -> bool:
    """Whether two clouds of states (k, n) lie in one another.

    Most states of either have a neighbour in the other not much further than in their own.

    Examples
    --------
    >>> cloud = np.random.default_rng(1).normal(size=(400, 2))
    >>> overlap(cloud[:200], cloud[200:]), overlap(cloud[:200], cloud[200:] + 10.0)
    (True, False)
    """
    from scipy.spatial import cKDTree

    def mostly_inside(points: Real, cloud: Real) -> bool:
        tree = cKDTree(cloud)
        own = np.quantile(np.asarray(tree.query(cloud, k=2)[0])[:, 1], 0.9)
        return bool(np.mean(np.asarray(tree.query(points)[0]) <= 3.0 * own) > 0.5)

    return mostly_inside(a, b) and mostly_inside(b, a)
