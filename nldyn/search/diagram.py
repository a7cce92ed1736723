"""The bifurcation diagram: all branches of the wanted periods that simulations and flips give."""

from __future__ import annotations

import logging
import time
from collections import Counter
from collections.abc import Callable, Hashable, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from itertools import chain
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from nldyn.base.arrays import Real
from nldyn.base.errors import (
    SystemModelError,
    check_types,
    check_whole,
    is_finite,
    shown,
)
from nldyn.base.html_tables import html_table
from nldyn.bifurcations.events import Events
from nldyn.branches.branch import Branch, check_branches
from nldyn.branches.checkpoint import BranchFile, checkpoint_of_several
from nldyn.branches.step_control import ContinuationOptions
from nldyn.branches.tables import Part, to_pandas, to_xarray
from nldyn.flow.flow_map import FlowMap, flow_of
from nldyn.orbits.axis import Axis, Section
from nldyn.orbits.newton import NO_PLACE
from nldyn.orbits.orbit import Orbit, check_observe
from nldyn.orbits.starts import (
    MOST_COUNT,
    OrbitSearchOptions,
    orbits_from_strobe,
    reach,
    simulate_strobe,
)
from nldyn.runtime.prefetch import computing_ahead
from nldyn.runtime.progress import Progress, shows_progress, silent
from nldyn.runtime.threads import one_thread
from nldyn.search.collector import Collector, counted
from nldyn.search.outlook import CONTACT, SEARCH, Outlook
from nldyn.search.self_excited import follow_limit_cycles
from nldyn.system.chart import FREQUENCY, THE_FREQUENCY, Chart, label_of, moves_frequency
from nldyn.system.equilibrium import at_rest, rest
from nldyn.system.parameters import Parameter
from nldyn.system.system import System

if TYPE_CHECKING:
    import pandas
    import xarray

Found = tuple[tuple[str, ...], dict[int, list[Orbit]]]  # failures, and orbits by their periods

logger = logging.getLogger("nldyn")
MOST_JOBS = 1000
# of a search by default: flights and panels times coordinates squared, some minutes of work; then
# it is shortened to no fewer motions of no fewer periods
MOST_WORK, FEWEST_STARTS, FEWEST_RECORDED = 1e9, 2, 40
PROBED = 5  # periods flown before the one whose work is counted
TRIED = 20  # flights through the period in an attempt of Newton's method that leads nowhere
TOLD = 60.0  # s of a search from which on its time is told at its beginning
MORE_STARTS = 4  # times as many in the second search, which looks for orbits with contact
SHIFTS = (0.0, 0.005, -0.005, 0.01, -0.01, 0.02, -0.02, 0.03, -0.03)  # relative, from a seed


@dataclass(frozen=True)
class SubharmonicSeed:
    """A frequency, or value of another parameter, at which to look for orbits of one period.

    Parameters
    ----------
    period : int
        Period multiple n.
    near : float
        Excitation frequency in Hz, or value of what the diagram is drawn over.

    Raises
    ------
    SystemModelError
        For a period or value that makes no sense.
    """

    period: int
    near: float

    def __post_init__(self) -> None:
        check_whole("SubharmonicSeed: period", self.period, 1)
        if not is_finite(self.near):
            got = shown(self.near)
            raise SystemModelError(f"SubharmonicSeed: near must be a number, got {got}")


@dataclass(frozen=True, eq=False)
class Diagram:
    """Branches over a range of frequencies, or of another parameter at one frequency.

    Parameters
    ----------
    branches : tuple of Branch
        In the order found; names tell period and origin.
    limits : (float, float)
        The range, in Hz or the parameter's unit.
    observe : str
        Interface whose displacement is reported.
    notes : tuple of str
        What was tried and gave nothing, and what may be missing.
    parameter : Parameter
        What changes along the branches.
    frequency_hz : float, optional
        Excitation frequency in Hz, where it is held.
    """

    branches: tuple[Branch, ...]
    limits: tuple[float, float]
    observe: str
    notes: tuple[str, ...] = ()
    parameter: Parameter = THE_FREQUENCY
    frequency_hz: float | None = None

    @classmethod
    def of(cls, box: Collector, branches: Sequence[Branch] | None = None) -> Diagram:
        """What a search has found: all its branches, or some of them."""
        found, axis = box.branches if branches is None else branches, box.axis
        return cls(
            tuple(found), axis.limits, box.observe, tuple(box.notes), axis.parameter,
            axis.frequency_hz,
        )  # fmt: skip

    @property
    def axis(self) -> Axis:
        """What changes, over which range, and what is held."""
        return Axis(Chart(self.parameter, *self.limits), self.frequency_hz)

    def __repr__(self) -> str:
        """One line: range, branches, special points."""
        special = sum(len(branch.special_points) for branch in self.branches)
        periods = ", ".join(map(str, sorted({branch.period for branch in self.branches})))
        return (
            f"<Diagram of {self.axis.told_range()}, of '{self.observe}': "
            f"{counted(self.branches)} of "
            f"period {periods or '(none)'}, {special} special points>"
        )

    def _repr_html_(self) -> str:
        """The branches, a row each."""
        rows = []
        for branch in self.branches:
            values = branch.values
            span = f"{values.min():.6g} to {values.max():.6g}"
            special = len(branch.special_points)
            row = (branch.name, branch.period, span, len(values), special, branch.stop_reason)
            rows.append(row)
        label = label_of(self.parameter)
        head = ("branch", "period", label, "points", "special points", "ends")
        return html_table(repr(self), head, rows)

    def of_period(self, period: int) -> list[Branch]:
        """Branches of one period multiple."""
        return [b for b in self.branches if b.period == period]

    def with_events(self, events: Events) -> Diagram:
        """The same diagram, with some events among the special points: see `Branch.with_events`."""
        return replace(self, branches=tuple(b.with_events(events) for b in self.branches))

    def table(self, part: Part = "points") -> dict[str, NDArray[Any]]:
        """Columns of numbers, one row per orbit, of all branches: see `Branch.table`.

        The first column has the name of the branch.

        Raises
        ------
        SystemModelError
            For an unknown part, or if there is no branch.
        """
        if not self.branches:
            raise SystemModelError("table: the diagram has no branch")
        tables = [branch.table(part) for branch in self.branches]
        rows = [table["period"].size for table in tables]
        names = np.repeat([branch.name for branch in self.branches], rows)
        columns = {key: np.concatenate([table[key] for table in tables]) for key in tables[0]}
        return {"branch": names, **columns}

    def to_pandas(self, part: Part = "points") -> pandas.DataFrame:
        """As `table`, as a DataFrame (needs pandas)."""
        return to_pandas(self.table(part), self._about)

    def to_xarray(self, part: Part = "points") -> xarray.Dataset:
        """As `table`, with the Floquet multipliers, as a Dataset over ``point`` (needs xarray)."""
        table = self.table(part)
        multipliers = np.concatenate([branch.multipliers(part) for branch in self.branches])
        return to_xarray(table, multipliers, self._about)

    @property
    def _about(self) -> dict[str, Any]:
        name = "range_hz" if self.parameter.name == FREQUENCY else "range"
        about: dict[str, Any] = {
            name: self.limits,
            "observe": self.observe,
            "notes": list(self.notes),
        }
        if self.parameter.name != FREQUENCY:
            about["parameter"] = repr(self.parameter)
        if self.frequency_hz is not None:
            about["frequency_hz"] = self.frequency_hz
        return about


def check_known(known: Diagram, flow: FlowMap) -> Axis:
    """The axis of a diagram; raise unless its branches are of this flow map and all along it."""
    axis = Axis.of(flow.system, known.limits, known.parameter, known.frequency_hz)
    low, high = axis.limits
    check_branches("known: branches", known.branches)
    check_types(**{"known: notes": (known.notes, tuple)})
    for branch in known.branches:
        if not axis.is_of(flow, branch.nodes[0].family.problem.flow):
            raise SystemModelError(
                f"known: branch '{branch.name}' is of another system or accuracy"
            )
        if not axis.is_along(branch.nodes[0]):
            other, held = branch.parameter, branch.points[0].frequency_hz
            at = "" if moves_frequency(other) else f" at {held:g} Hz"
            raise SystemModelError(
                f"known: branch '{branch.name}' was followed in {other.name}{at}, not in "
                f"{axis.told_held()}"
            )
        a, b = branch.course.limits if branch.course else (low, high)
        if not a <= low < high <= b:
            raise SystemModelError(
                f"known: branch '{branch.name}' was followed from {axis.told_span(a, b)}, not over "
                f"the range of the diagram, {axis.told_span(low, high)}"
            )
    check_observe(flow.system, known.observe)
    return axis


@one_thread()
@shows_progress()
def diagram(
    system: System | FlowMap,
    limits: tuple[float, float],
    periods: Sequence[int] = (1, 2, 3),
    *,
    parameter: str | Parameter | None = None,
    frequency_hz: float | None = None,
    seeds: Sequence[SubharmonicSeed] = (),
    search_points: int = 12,
    doublings: int = 0,
    observe: str | None = None,
    start: Real | None = None,
    options: ContinuationOptions | None = None,
    search: OrbitSearchOptions | None = None,
    progress: Progress | None = None,
    checkpoint: BranchFile | None = None,
    jobs: int = 1,
    executor: Executor | None = None,
) -> Diagram:
    """Compute the branches of the wanted periods over a range of frequencies or another parameter.

    Orbits of each period are looked for by simulation at `search_points` values and at the seeds,
    continued in both directions, and at each flip the doubled branch is followed when its period is
    wanted. At a branch point the other branch is followed both ways; where a symmetry
    breaks, these are its two halves. If the stops are open at rest and no orbit found touches one,
    the search is repeated once with four times as many initial states. What no simulation comes
    near (isolas of unstable orbits, say) is missed.

    Of a system that nothing excites limit cycles are looked for: from rest, and carried along by
    what moves beneath friction, by `nldyn.limit_cycle`, and continued with their frequency.

    Parameters
    ----------
    system : System or FlowMap
        What to compute.
    limits : (float, float)
        Frequencies in Hz, or values of the parameter, ascending.
    periods : sequence of int
        Period multiples wanted; may be empty when there are seeds. Of limit cycles, as
        `search_points` simulations find them, each has period 1.
    parameter : str or Parameter, optional
        What changes, the excitation frequency unless given: see
        `nldyn.system.chart.checked_parameter`.
    frequency_hz : float, optional
        Excitation frequency in Hz, held where another parameter changes; none where nothing excites
        the system.
    seeds : sequence of SubharmonicSeed
        Further values at which to look for a period (which need not be in `periods`).
    search_points : int
        Number of values searched, equally spaced on the parameter's scale: a logarithmic one if the
        range is positive.
    doublings : int
        How many doublings to follow at flips whose doubled period is not in `periods`.
    observe : str, optional
        Interface whose displacement is reported; the first unless given.
    start : (2n,) array, optional
        Of a system that nothing excites, modal displacements and velocities from which to simulate.
    options, search : optional
        Step control and search effort.
    progress : callable, optional
        Called as ``progress(what, frequency_hz, done)``, the frequency zero where it is held.
    checkpoint : CheckpointFile, optional
        File that keeps the branches computed so far, as for `continue_branch`. If it exists, the
        simulations are repeated, but of the branches only what is not in it is computed; those that
        were begun elsewhere stay in it. One of another system, accuracy or range is refused.
    jobs : int
        Processes that share the work, this one included. Their number changes nothing in the
        result. A program that asks for several begins with ``if __name__ == "__main__":``, as for
        `multiprocessing`.
    executor : concurrent.futures.Executor, optional
        Takes part in the work instead of processes of its own.

    Returns
    -------
    Diagram

    Raises
    ------
    SystemModelError
        For input that makes no sense.
    OutputError
        If `checkpoint` cannot be written.

    Examples
    --------
    >>> from nldyn import Stop, System, Unbalance, diagram
    >>> from nldyn.orbits import OrbitSearchOptions
    >>> system = System.from_matrices([[2.48]], [[16877.0]], {"middle": [1.0]},
    ...     modal_damping=0.0142, stops=[Stop("middle", stiffness=5.17e9)],
    ...     excitation=[Unbalance("middle", 4.92e-6)])
    >>> one = OrbitSearchOptions(starts=1)
    >>> found = diagram(system, (8.5, 9.0), (1, 2), search_points=1, search=one)
    >>> sorted(branch.period for branch in found.branches)
    [1, 2]
    >>> found = diagram(system, (0.0, 1e-5), [1], parameter="gap", frequency_hz=8.7,
    ...     search_points=1, search=one)
    >>> found
    <Diagram of gap = 0 to 1e-05 m at 8.7 Hz, of 'middle': 1 branch of period 1, 6 special points>
    """
    flow = flow_of(system)
    axis = Axis.of(flow.system, limits, parameter, frequency_hz)
    check_types(
        periods=(periods, Sequence),
        seeds=(seeds, Sequence),
        options=(options, ContinuationOptions, None),
        search=(search, OrbitSearchOptions, None),
        progress=(progress, Callable, None),
        executor=(executor, Executor, None),
    )
    check_whole("jobs", jobs, 1, MOST_JOBS)
    wanted = _checked_periods(periods, seeds, axis)
    check_whole("search_points", search_points, 1, MOST_COUNT)
    check_whole("doublings", doublings, 0, MOST_COUNT)
    _check_fits(axis, seeds, doublings, search, start)
    box = Collector(
        flow,
        axis,
        check_observe(flow.system, observe),
        options or ContinuationOptions(),
        progress or silent,
    )
    box.checkpoint = checkpoint_of_several(checkpoint, box.branches, flow, axis)
    with box.checkpoint, computing_ahead(flow, jobs, executor) as box.ahead:
        if axis.self_excited:
            box.outlook = Outlook(places=search_points)
            follow_limit_cycles(box, axis.middles(search_points)[::-1], start)
            return Diagram.of(box)
        effort, whole = _effort(box, search, search_points, wanted)
        places = axis.middles(search_points)[::-1] if wanted else []
        again = MORE_STARTS if whole and _contact_is_missing(box) else 0
        box.outlook = Outlook(wanted, len(places), len(seeds), again)
        _search(box, places, wanted, effort)
        if places and again and _contact_is_missing(box):
            more = replace(effort, starts=again * effort.starts, seed=effort.seed + 1)
            _search(box, places, wanted, more, CONTACT)
        _follow_seeds(box, seeds, effort)
        _follow_branch_points(box)
        _follow_flips_of_new(box, wanted, doublings)
        _follow_branch_points(box)
        for branch in box.branches:  # which become more
            box.from_mirror(branch, box.options)
    _note_missing(box, wanted, search_points)
    return Diagram.of(box)


def _checked_periods(
    periods: Sequence[int], seeds: Sequence[SubharmonicSeed], axis: Axis
) -> list[int]:
    """The periods wanted, ascending; seeds must lie in the range."""
    for seed in seeds:
        check_types(**{"seeds: each": (seed, SubharmonicSeed)})
    for period in periods:
        check_whole("periods: each", period, 1)
    if not (periods or seeds):
        raise SystemModelError("periods must not be empty when there are no seeds")
    low, high = axis.limits
    for seed in seeds:
        if not low <= seed.near <= high:
            raise SystemModelError(
                f"seeds: near = {seed.near:g} lies outside {axis.chart.range_name} "
                f"({low:g}, {high:g})"
            )
    return sorted(set(periods))


def _check_fits(
    axis: Axis,
    seeds: Sequence[SubharmonicSeed],
    doublings: int,
    search: OrbitSearchOptions | None,
    start: Real | None,
) -> None:
    """Refuse what counts periods of an excitation where there is none, and a start where one is."""
    if not axis.self_excited:
        if start is not None:
            raise SystemModelError("start: is for a system that nothing excites; give seeds")
    elif seeds or doublings or search is not None:
        raise SystemModelError(
            "nothing excites the system: seeds, doublings and search are for excited ones"
        )


def _effort(
    box: Collector, search: OrbitSearchOptions | None, search_points: int, wanted: Sequence[int]
) -> tuple[OrbitSearchOptions, bool]:
    """The effort of the search, and whether it is the whole one, or the one asked for."""
    if search is not None:
        return search, True
    effort = OrbitSearchOptions()
    if wanted:
        middle = box.at(box.axis.between(*box.axis.limits, 0.5))
        effort = shortened(middle, effort, search_points, wanted)
    whole = effort == OrbitSearchOptions()
    if not whole:
        box.notes.append(
            f"periods take many contacts of {box.flow.system.size} modes: the search was shortened "
            f"to {effort.starts} motions of {effort.recorded} periods at each {box.axis.noun}; "
            "nldyn.diagram(..., search=OrbitSearchOptions()) does all of it"
        )
    return effort, whole


def _note_missing(box: Collector, wanted: Sequence[int], search_points: int) -> None:
    """What was looked for and not found."""
    for period in wanted:
        if not any(branch.period == period for branch in box.branches):
            tried = box.axis.counted(search_points)
            box.notes.append(f"no orbit of period {period} found by simulation at {tried}")
    if not box.branches and box.flow.system.free_modes:
        box.notes.append(NO_PLACE)
    if _contact_is_missing(box):
        box.notes.append(
            "no orbit that touches a stop was found; there may be some all the same: try a range "
            "that begins lower, or more search points"
        )


def _search(
    box: Collector,
    values: Sequence[float],
    periods: Sequence[int],
    effort: OrbitSearchOptions,
    part: str = SEARCH,
) -> None:
    """Follow what simulations at some values come near, one period after the other."""
    found = _searched(box, values, periods, effort, part)
    for value, (failures, _) in zip(values, found, strict=True):
        _note_failures(box, value, failures, effort)
    for period in periods:
        if period not in box.outlook.doubled:
            box.offer_orbits(orbit for _, of_period in found for orbit in of_period[period])
    for period in periods:
        if period in box.outlook.doubled:
            box.outlook.flips(period, 0)
            _follow_flips(box, box.of_period(period // 2))
        for _, of_period in found:
            for orbit in of_period[period]:
                box.from_orbits([orbit])
                box.reach(*box.outlook.orbit_done(period))


def _searched(
    box: Collector,
    values: Sequence[float],
    periods: Sequence[int],
    effort: OrbitSearchOptions,
    part: str,
) -> list[Found]:
    """What simulations at some values come near, on all processes."""
    counts = Counter({period: int(box.outlook.reached[f"1/{period}"]) for period in periods})

    def told(done: int, found: Found) -> None:
        box.outlook.searched(part, [box.at(value).frequency_hz for value in values], done)
        if part == SEARCH and any(each.touches_stops for each in chain(*found[1].values())):
            box.outlook.touched()
        box.done = box.outlook.done
        for period, orbits in found[1].items():
            counts[period] += len(orbits)
            if done > 1:
                box.outlook.found(period, counts[period] * len(values) / done)
        box.tell(part, values[done - 1])

    if values:
        box.tell(part, values[0])
    arguments = [(box.axis, value, tuple(periods), box.observe, effort) for value in values]
    keys = [("search", *given) for given in arguments]
    return box.ahead.values(keys, search_at, arguments, told)


def search_at(
    flow: FlowMap,
    axis: Axis,
    value: float,
    periods: Sequence[int],
    observe: str,
    effort: OrbitSearchOptions,
    look: Callable[[], None] | None = None,
) -> Found:
    """Why simulations at a value failed, and the orbits of some periods that others pass."""
    here = axis.at(flow, value)
    strobe = simulate_strobe(here.flow, here.frequency_hz, effort)
    orbits = {p: orbits_from_strobe(here.flow, strobe, p, observe, effort) for p in periods}
    return strobe.failures, orbits


def _note_failures(
    box: Collector, value: float, failures: Sequence[str], effort: OrbitSearchOptions
) -> None:
    for reason, count in Counter(failures).items():
        place = box.axis.told(value)
        box.notes.append(f"{count} of {effort.starts} simulations at {place} failed: {reason}")


def shortened(
    section: Section, effort: OrbitSearchOptions, points: int, periods: Sequence[int]
) -> OrbitSearchOptions:
    """The effort of a search that takes minutes where the whole one would take hours.

    Its work goes with the flights and contact panels of a period, counted at one section, and the
    square of the number of coordinates.
    """
    flow, omega = section.flow, section.omega
    start = flow.to_state(at_rest(rest(flow.system)))
    before = flow.strobe(start, omega, PROBED)
    begun = time.process_time()
    probe = flow.trajectory(before.ends[-1:], np.array([0.0, 2.0 * np.pi]), omega)
    seconds = time.process_time() - begun
    if before.failure or probe.failure:
        return effort
    each = probe.record.phase.size * float(flow.system.state_size) ** 2

    def flown(effort: OrbitSearchOptions) -> int:
        """Periods of simulation and of Newton's method."""
        tried = effort.candidates * TRIED * sum(periods)
        return points * effort.starts * (effort.transient + effort.recorded + tried)

    while each * flown(effort) > MOST_WORK and effort.starts > FEWEST_STARTS:
        effort = replace(
            effort,
            starts=max(effort.starts // 2, FEWEST_STARTS),
            recorded=max(effort.recorded // 2, FEWEST_RECORDED),
            candidates=max(effort.candidates // 2, 1),
        )
    if seconds * flown(effort) > TOLD:
        logger.info(
            f"a period takes {probe.record.phase.size} flights and contacts of {flow.system.size} "
            f"modes, {seconds:.2g} s: the search takes up to {seconds * flown(effort) / 60.0:.0f} "
            "minutes of processor time, and fewer search_points or periods = [1] less"
        )
    return effort


def _contact_is_missing(box: Collector) -> bool:
    """Whether all stops are open at rest, and no orbit found touches one."""
    orbits = (orbit for branch in box.branches for orbit in branch.points)
    return reach(box.flow.system) > 0.0 and not any(orbit.touches_stops for orbit in orbits)


def _follow_seeds(
    box: Collector, seeds: Sequence[SubharmonicSeed], effort: OrbitSearchOptions
) -> None:
    """Follow the branches at seeds, the searches of all but the first ahead of their turn."""
    for number, seed in enumerate(seeds, 1):
        _follow_seed(box, seed, effort)
        box.reach("seeds", number)
        if number == 1:  # which has compiled what the others need
            for other in seeds[1:]:
                key, given = _seed_task(box, other, other.near, effort)
                box.ahead.offer(key, search_at, *given)


def _follow_seed(box: Collector, seed: SubharmonicSeed, effort: OrbitSearchOptions) -> None:
    """Look around a seed, nearest first, until a new branch turns up."""
    for shift in SHIFTS:
        value = box.axis.moved(seed.near, shift)
        if not box.axis.holds(value):
            continue
        box.tell(f"search 1/{seed.period}", value)
        key, given = _seed_task(box, seed, value, effort)
        failures, found = box.ahead.value(key, search_at, *given)
        _note_failures(box, value, failures, effort)
        if orbits := found[seed.period]:
            box.from_orbits(orbits)
            return
    box.notes.append(f"no 1/{seed.period} orbit found near {box.axis.told(seed.near)}")


def _seed_task(
    box: Collector, seed: SubharmonicSeed, value: float, effort: OrbitSearchOptions
) -> tuple[Hashable, tuple[Any, ...]]:
    given = (box.axis, value, (seed.period,), box.observe, effort)
    return ("search", *given), given


def _follow_flips(box: Collector, branches: Sequence[Branch]) -> None:
    flips = [s for branch in branches for s in branch.special_points if s.kind == "PD"]
    if not flips:
        return
    what = box.outlook.flips(2 * flips[0].orbit.period, len(flips))
    for number, special in enumerate(flips, 1):
        box.from_flip(special)
        box.reach(what, number)


def _follow_branch_points(box: Collector) -> None:
    """Branches that cross those found, and those that cross these."""
    for branch in box.branches:  # which grow
        for special in branch.special_points:
            if special.kind == "BP":
                box.from_branch_point(special)


def _follow_flips_of_new(box: Collector, wanted: Sequence[int], doublings: int) -> None:
    """Doubled branches of wanted periods from branches found late, then further doublings."""
    for period in wanted:
        if 2 * period in wanted:
            _follow_flips(box, box.of_period(period))
    fresh = [b for b in box.branches if not {b.period, 2 * b.period} <= set(wanted)]
    for _ in range(doublings):
        count = len(box.branches)
        _follow_flips(box, fresh)
        fresh = box.branches[count:]
        if not fresh:
            break
