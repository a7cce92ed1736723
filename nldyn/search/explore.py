"""The search for all branches: simulations, deflation, and what the branches found lead to."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from dataclasses import replace
from itertools import product
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from nldyn.base.arrays import Real
from nldyn.base.errors import (
    ConvergenceError,
    KeptWorkError,
    SystemModelError,
    check_types,
    check_whole,
    shown,
)
from nldyn.branches.branch import Branch
from nldyn.branches.checkpoint import Checkpoint
from nldyn.branches.step_control import ContinuationOptions
from nldyn.flow.flow_map import FlowMap, flow_of
from nldyn.flow.settling import settling_runs
from nldyn.orbits.axis import Axis, Section
from nldyn.orbits.deflation import deflated_orbit
from nldyn.orbits.orbit import Orbit, check_observe, same_orbit, stroboscopic
from nldyn.orbits.shooting import LONGEST_PERIOD
from nldyn.orbits.starts import (
    near_returns,
    orbit_beside,
    orbit_near,
    random_states,
    settling_periods,
)
from nldyn.runtime.keeper import KeptFile
from nldyn.runtime.prefetch import computing_ahead
from nldyn.runtime.progress import Progress, shows_progress, silent
from nldyn.runtime.threads import one_thread
from nldyn.search.collector import Collector
from nldyn.search.diagram import MOST_JOBS, Diagram, check_known
from nldyn.search.exploration import Coverage, Exploration, ExploreOptions, Question, Stage
from nldyn.search.extend import Place, Strategy
from nldyn.search.fixed_point_index import is_damped, sum_of_indices, without_index_note
from nldyn.search.mixtures import Mixtures
from nldyn.search.pseudo_orbits import PseudoOrbits
from nldyn.search.random_walks import ClosedWalks
from nldyn.system.parameters import Parameter
from nldyn.system.system import System

RETURNS = 3.0  # recorded periods after settling, over the longest period looked for
NEAR = 0.1  # a return within this share of the motion is worth a Newton iteration
ARRIVED = 0.01  # a motion this near to a known orbit, relative, has settled on it or passes it
CANDIDATES = 5  # near returns of each motion and period from which Newton's method starts
TRANSIENT = 5  # periods of a motion beside which no orbits are looked for
PIECE = 16  # periods simulated between two looks at the known orbits
LATER = 0.25  # of all before, where that is more
LIKELY_ROUNDS = 2  # after which, mostly, a round has found nothing new
AGAIN = 12  # times that a frequency is searched again while its indices say that orbits are missing
NEAR_ORBIT = 1e-4  # of a run's size: from its end to the orbit on which it lies


class ExplorationFile(KeptFile, Protocol):
    """A file that keeps an exploration; `nldyn.io.CheckpointFile` is one."""

    def read_exploration(self, system: System) -> Exploration:
        """The exploration of a system that it holds."""

    def write_exploration(self, found: Exploration) -> None:
        """Keep an exploration in place of what it holds."""


@one_thread()
@shows_progress()
def explore(
    system: System | FlowMap,
    limits: tuple[float, float],
    max_period: int = 8,
    *,
    parameter: str | Parameter | None = None,
    frequency_hz: float | None = None,
    observe: str | None = None,
    effort: ExploreOptions | None = None,
    options: ContinuationOptions | None = None,
    known: Diagram | None = None,
    progress: Progress | None = None,
    checkpoint: ExplorationFile | None = None,
    jobs: int = 1,
    executor: Executor | None = None,
) -> Exploration:
    """Find the branches of periodic orbits over a range, without initial guesses.

    The range is one of frequencies, or of another parameter at one frequency. Motions are simulated
    at many of its values from random states and swept up and down, each value starting from the
    attractors of the one before. What they settle on is solved for as
    an orbit, and its branch continued in both directions unless it is known. Unstable orbits come
    from near returns of motions that wander, from Newton's method deflated by the known orbits
    [Farrell, Birkisson and Funke 2015], and from flips, at each of which the doubled branch is
    followed as long as its period is within `max_period`, and from branch points. On the way down,
    others come from pieces and mixtures of known orbits and from closed walks among random states,
    see `PseudoOrbits`, `Mixtures` and `ClosedWalks`.

    Isolas of unstable orbits that no motion passes, attractors with small basins that exist
    between two of the frequencies only, and orbits of longer periods can still be missing.

    Parameters
    ----------
    system : System or FlowMap
        What to explore.
    limits : (float, float)
        Frequencies in Hz, or values of the parameter, ascending.
    max_period : int
        Longest orbits wanted, in excitation periods.
    parameter, frequency_hz : optional
        What changes, and the excitation frequency in Hz where that is held, see `diagram`.
    observe : str, optional
        Interface whose displacement is reported; the first unless given.
    effort : ExploreOptions, optional
        How much to simulate.
    options : ContinuationOptions, optional
        Step control.
    known : Diagram, optional
        Of this system in this range, from `diagram` or an exploration with less effort. Its
        branches are taken over, what they lead to is followed, and others are looked for.
    progress : callable, optional
        Called as ``progress(what, frequency_hz, done)``.
    checkpoint : CheckpointFile, optional
        File that keeps what is found, written now and then, at the end, and when an exception such
        as Ctrl-C ends the exploration; `load` reads it at any time. If it holds this
        very exploration, that one goes on and gives what an uninterrupted one gives.
    jobs, executor
        As for `diagram`: they share the branches, and change nothing in what is found.

    Returns
    -------
    Exploration

    Raises
    ------
    SystemModelError
        For input that makes no sense, or if `known` or `checkpoint` is of something else.
    OutputError
        If `checkpoint` cannot be written.

    Examples
    --------
    >>> from nldyn import ExploreOptions, Stop, System, Unbalance, explore
    >>> system = System.from_matrices([[2.48]], [[16877.0]], {"middle": [1.0]},
    ...     modal_damping=0.0142, stops=[Stop("middle", stiffness=5.17e9)],
    ...     excitation=[Unbalance("middle", 4.92e-6)])
    >>> found = explore(system, (48.0, 52.0), 2, effort=ExploreOptions(spacing=0.05, starts=4))
    >>> sorted({branch.period for branch in found.diagram.branches})
    [1, 2]
    """
    flow = flow_of(system)
    check_types(
        effort=(effort, ExploreOptions, None),
        options=(options, ContinuationOptions, None),
        known=(known, Diagram, None),
        progress=(progress, Callable, None),
        executor=(executor, Executor, None),
    )
    check_whole("jobs", jobs, 1, MOST_JOBS)
    axis = Axis.of(flow.system, limits, parameter, frequency_hz)
    check_whole("max_period", max_period, 1, LONGEST_PERIOD)
    question = Question(
        flow,
        axis,
        max_period,
        check_observe(flow.system, observe),
        effort or ExploreOptions(),
        options or ContinuationOptions(),
    )
    box = Collector(
        flow,
        axis,
        question.observe,
        question.options,
        progress or silent,
    )
    known = known or Diagram.of(box)
    _check_known(known, question)
    known = replace(known, notes=tuple(without_index_note(known.notes)))
    survey = _Survey(box, question, known)
    if checkpoint is None or not survey.goes_on_in(checkpoint):
        box.take(known.branches, known.notes)
    with box.checkpoint, computing_ahead(flow, jobs, executor) as box.ahead:
        while not survey.so_far(box.branches).finished:
            survey.step()
    return survey.so_far(box.branches)


def strategies_of(effort: ExploreOptions) -> list[tuple[int, Strategy]]:
    """What guesses on the way down, each with the number that its random numbers have."""
    found: list[tuple[int, Strategy]] = []
    if effort.pseudo_orbits:
        found.append((4, PseudoOrbits(effort.pseudo_orbits)))
    if effort.mixtures:
        found.append((2, Mixtures(effort.mixtures)))
    if effort.walks:
        found.append((3, ClosedWalks(effort.walk_states, effort.walks)))
    return found


def _check_known(known: Diagram, question: Question) -> None:
    """Raise unless branches that are known belong to the question."""
    axis = check_known(known, question.flow)
    if axis != question.axis:
        told = axis.told_range(), question.axis.told_range()
        raise SystemModelError(f"known: is of {told[0]}, but {told[1]} are to be explored")
    if known.observe != question.observe:
        raise SystemModelError(
            f"known: observes {shown(known.observe)}, not {shown(question.observe)}"
        )


def _same_branches(a: Diagram, b: Diagram) -> bool:
    """Whether two diagrams hold the same branches, in the same order, and notes."""
    return (
        a.notes == b.notes
        and len(a.branches) == len(b.branches)
        and all(
            np.array_equal(one.values, other.values)
            and np.array_equal(one.nodes[0].orbit.point, other.nodes[0].orbit.point)
            for one, other in zip(a.branches, b.branches, strict=True)
        )
    )


class _Survey:
    """Simulations over a range that fill a box of branches."""

    def __init__(self, box: Collector, question: Question, known: Diagram) -> None:
        self.box, self.question, self.known = box, question, known
        self.max_period, self.effort = question.max_period, question.effort
        nothing = np.empty((0, question.flow.system.state_size))
        given = len(known.branches)
        met = np.zeros((0, given), dtype=bool)
        self.stage = Stage(0, given, len(known.notes), nothing, (), met, (), given)

    def goes_on_in(self, place: ExplorationFile) -> bool:
        """Keep everything in a file, and begin where the exploration in it ended, if there is one.

        Raises
        ------
        SystemModelError, OutputError
            As `explore`.
        """
        place.check_writable()
        earlier: Sequence[Branch] = ()
        begun = place.exists()
        if begun:
            kept = place.read_exploration(self.question.flow.system)
            given = replace(
                kept.diagram,
                branches=kept.diagram.branches[: kept.stage.given],
                notes=kept.diagram.notes[: len(self.known.notes)],
            )
            if not (self.question.same(kept.question) and _same_branches(given, self.known)):
                raise KeptWorkError(
                    f"{place.name}: holds another exploration (other system, range, periods, "
                    "effort, options or known branches); choose another file, or delete it"
                )
            self.stage = kept.stage
            take = self.box.take_back if kept.stage.steps else self.box.take
            take(
                kept.diagram.branches[: kept.stage.branches],
                kept.diagram.notes[: kept.stage.notes],
            )
            earlier = kept.diagram.branches[kept.stage.branches :]
        self.box.checkpoint = Checkpoint(
            lambda branches: place.write_exploration(self.so_far(branches)),
            self.box.branches,
            earlier,
        )
        return begun

    def so_far(self, branches: Sequence[Branch]) -> Exploration:
        """What the steps that are done have come to, with branches found since then too."""
        return Exploration(Diagram.of(self.box, branches), self.question, self.stage)

    def step(self) -> None:
        """Simulate at the next value, from what came before and, going up, random states."""
        box, stage = self.box, self.stage
        turn, place, length = self.question.place(stage.steps)
        up, last = place < length // 2, place == length - 1
        here = box.at(self.question.values(turn)[place if up else length - 1 - place])
        box.done = self._share_done()
        box.tell("explore", here.value)
        if stage.steps == 0:
            box.follow_up(0, *self._depth)
        starts = here.taken_over(stage.carried)
        if up:
            seed: tuple[int, ...] = (self.effort.seed, turn, place)
            more = random_states(here.flow, here.omega, self.effort.starts, seed)
            starts = np.vstack([starts, more])
        known = _Known(box, here)
        coverage, carried = self._search(starts, known, also_unstable=up)
        for again in range(AGAIN if up else 0):
            if not known.incomplete(min(self.effort.unstable_period, self.max_period)):
                break
            seed = (self.effort.seed, turn, place, again + 1)
            starts = random_states(here.flow, here.omega, self.effort.starts + 1, seed)[1:]
            coverage = coverage.with_more(self._search(starts, known, also_unstable=True)[0])
        if not up and self.effort.unstable_period:
            self._follow_guesses(here, (self.effort.seed, turn, place))
        both = {c.value: c for c in stage.coverage}
        earlier = both.get(here.value)
        both[here.value] = earlier.with_more(coverage) if earlier else coverage
        met = self._met(turn + 1)
        met[turn, known.met] = True
        self.stage = Stage(
            stage.steps + 1,
            len(box.branches),
            len(box.notes),
            here.to_base(np.array(carried).reshape(-1, box.flow.system.state_size)),
            tuple(both[value] for value in sorted(both)),
            met,
            (*stage.ends, len(box.branches)) if last else stage.ends,
            stage.given,
        )
        if box.checkpoint.work is None:
            box.checkpoint.work = lambda: None  # the coverage is worth keeping without a branch too
        box.checkpoint.offer()

    def _share_done(self) -> float:
        """Share of the work that the steps done make; a second round may be the last."""
        rounds = min(self.effort.rounds, LIKELY_ROUNDS)
        lengths = [2 * len(self.question.values(turn)) for turn in range(rounds)]
        return min(self.stage.steps / sum(lengths), 1.0)

    def _met(self, rounds: int) -> NDArray[np.bool_]:
        """Which branches each round came to, with those found since the last step."""
        met = np.zeros((rounds, len(self.box.branches)), dtype=bool)
        met[: len(self.stage.met), : self.stage.branches] = self.stage.met
        return met

    def _search(
        self, starts: Real, known: _Known, *, also_unstable: bool
    ) -> tuple[Coverage, list[Real]]:
        """Follow what motions come to; the states from which the next value starts."""
        attractors: list[Orbit] = []
        runs, wandering = [], []
        for start in starts:
            run, orbit = self._motion(start, known)
            if run is None:
                continue
            runs.append(run)
            orbit = orbit or self._settled_on(run, known.here, attractors)
            if orbit is None:
                wandering.append(run)
            elif not any(same_orbit(orbit, other) for other in attractors):
                attractors.append(orbit)
                self._meet(orbit, known)
        adrift = [run[-1] for run in wandering]
        settled = [stroboscopic(orbit)[0] for orbit in attractors]
        if also_unstable:
            self._beside(runs, known)
            self._deflate(adrift + settled, known)
        coverage = Coverage(
            known.here.value,
            tuple(sorted({orbit.period for orbit in attractors})),
            len(runs) - len(wandering),
            len(wandering),
            len(starts) - len(runs),
        )
        return coverage, settled + adrift[:1]

    def _motion(self, start: Real, known: _Known) -> tuple[Real | None, Orbit | None]:
        """States after each period, and the known stable orbit on which the motion has settled.

        It ends as soon as it comes near to one; no states if it cannot be computed.
        """
        here = known.here
        waited = settling_periods(here.flow.system, here.frequency_hz)
        waited = min(waited, self.effort.settling)
        most = waited + math.ceil(RETURNS * self.max_period) + 1
        states = np.array([start])
        self.box.tell("search", here.value)
        try:
            for run in settling_runs(here.flow, start, here.omega, most, PIECE, LATER):
                self.box.tell("search", here.value)
                states = np.vstack([states, run])
                orbit = known.stable_near(states[-PIECE:])
                if orbit is not None:
                    return states, orbit
        except ConvergenceError:
            return None, None
        return states, None

    def _settled_on(self, run: Real, here: Section, known: Sequence[Orbit]) -> Orbit | None:
        """Stable orbit to which a run comes near at its end, one of the known ones if it can be."""
        scale = float(np.linalg.norm(run, axis=1).max()) or 1.0
        for orbit in known:
            if _nearest(stroboscopic(orbit), run[-1]) < NEAR_ORBIT * scale:
                return orbit
        for period in range(1, self.max_period + 1):
            tail = run[-period - self.max_period :]
            off = np.linalg.norm(tail[period:] - tail[:-period], axis=1)
            if float(np.median(off)) > NEAR * scale:
                continue
            found = orbit_near(here.flow, run[-1 - period], period, here.omega, self.box.observe)
            if found is None or not found.stable:
                continue
            if _nearest(stroboscopic(found), run[-1]) < NEAR * scale:
                return next((other for other in known if same_orbit(found, other)), found)
        return None

    def _follow_guesses(self, here: Section, seed: Sequence[int]) -> None:
        """Follow the orbits to which the strategies lead, each with random numbers of its own."""
        spacing, periods = self.effort.spacing, self._unstable_periods()
        for number, strategy in strategies_of(self.effort):
            rng = np.random.default_rng((*seed, AGAIN + number))
            place = Place(here, spacing, periods, rng)
            for _, orbits in strategy.guesses(self.box, self.box.branches, place):
                for orbit in orbits:
                    self._follow(orbit)

    def _unstable_periods(self) -> range:
        return range(1, min(self.effort.unstable_period, self.max_period) + 1)

    def _beside(self, runs: Sequence[Real], known: _Known) -> None:
        """Look for unstable orbits of short periods beside motions."""
        box = self.box
        for period, run in product(self._unstable_periods(), runs):
            for start in near_returns(run[TRANSIENT:], period, CANDIDATES):
                state = run[TRANSIENT + start]
                number = known.beside(state, period)
                if number is not None:
                    known.met.append(number)
                    continue
                found = orbit_beside(known.here, state, period, box.observe)
                for orbit in box.within([found]):
                    self._meet(orbit, known)

    def _deflate(self, starts: Sequence[Real], known: _Known) -> None:
        """Look for unstable orbits of short periods with the known ones divided out."""
        flow, omega, observe = known.here.flow, known.here.omega, self.box.observe
        for period, start in product(self._unstable_periods(), starts):
            others = known.of_period(period)
            other = deflated_orbit(flow, start, period, omega, others, observe)
            if other is not None:
                self._follow(other)
                known.take()

    def _meet(self, orbit: Orbit, known: _Known) -> None:
        """Follow the branch of an orbit that a motion came to, unless it is known."""
        if known.number(orbit) is None:
            self._follow(orbit)
            known.take()
        number = known.number(orbit)
        if number is not None:
            known.met.append(number)

    def _follow(self, orbit: Orbit) -> None:
        """Follow an orbit's branch unless it is known, and those that it leads to."""
        self.box.follow(orbit, *self._depth)

    @property
    def _depth(self) -> tuple[int, int, int | None]:
        """How far doubled branches are followed, see `Collector.follow_up`."""
        longest = max(self.max_period, self.effort.doubled_period)
        return longest, self.max_period, self.effort.doubled_points


class _Known:
    """Orbits of all branches at one value, and which of the branches motions came to."""

    def __init__(self, box: Collector, here: Section) -> None:
        self.box, self.here = box, here
        self.met: list[int] = []
        self._orbits: list[tuple[int, Orbit, Real]] = []  # with their stroboscopic states
        self._seen = 0
        self.take()

    def take(self) -> None:
        """Take the orbits of branches that were found since."""
        for number in range(self._seen, len(self.box.branches)):
            orbits = self.box.branches[number].at(self.here.value)
            self._orbits += [(number, orbit, stroboscopic(orbit)) for orbit in orbits]
        self._seen = len(self.box.branches)

    def of_period(self, period: int) -> list[Orbit]:
        """Orbits of one period multiple."""
        return [orbit for _, orbit, _ in self._orbits if orbit.period == period]

    def incomplete(self, longest: int) -> bool:
        """Whether the indices of the fixed points of some Pⁿ up to a period do not add up to one.

        They need not where a mode is not damped.
        """
        if not is_damped(self.here.flow.system):
            return False
        orbits = [orbit for _, orbit, _ in self._orbits]
        return any(sum_of_indices(orbits, n) != 1 for n in range(1, longest + 1))

    def number(self, orbit: Orbit) -> int | None:
        """Number of the branch that an orbit, perhaps of another value, lies on."""
        if orbit.problem.flow is self.here.flow and orbit.omega == self.here.omega:
            return next((i for i, other, _ in self._orbits if same_orbit(orbit, other)), None)
        return self.box.branch_of(orbit)

    def beside(self, state: Real, period: int) -> int | None:
        """Number of the branch with an orbit near a state, its period the given one or a part."""
        size = ARRIVED * (float(np.linalg.norm(state)) or 1.0)
        for number, orbit, places in self._orbits:
            if period % orbit.period == 0 and _nearest(places, state) < size:
                return number
        return None

    def stable_near(self, states: Real) -> Orbit | None:
        """Stable orbit near which the last of some states lie, one period after the other."""
        size = ARRIVED * (float(np.linalg.norm(states, axis=1).max()) or 1.0)
        for _, orbit, places in self._orbits:
            if not orbit.stable:
                continue
            tail = states[-orbit.period :]
            off = np.linalg.norm(places[:, None] - tail[None], axis=2).min(axis=0)
            if float(off.max()) < size:
                return orbit
        return None


def _nearest(places: Real, state: Real) -> float:
    """Distance of a state from the nearest of some places (m, 2n)."""
    return float(np.linalg.norm(places - state, axis=1).min())
