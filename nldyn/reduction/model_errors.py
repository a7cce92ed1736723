"""What is measured of a reduced model, and how far that of two models is apart."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

import cms
from cms.component.component import checked_pencil
from nldyn.base.arrays import SLACK, Complex, Real
from nldyn.base.errors import ConvergenceError
from nldyn.branches.branch import Branch
from nldyn.branches.continuation import continue_branch, open_ends
from nldyn.branches.peaks import resonance_peaks
from nldyn.flow.flow_map import FlowMap
from nldyn.orbits.axis import Axis
from nldyn.orbits.newton import refine
from nldyn.orbits.orbit import Orbit
from nldyn.orbits.solve import solve_orbit
from nldyn.reduction.load_case import LoadCase
from nldyn.runtime.progress import Progress, silent
from nldyn.system.chart import with_unit
from nldyn.system.springs_dampers import Damper, Spring
from nldyn.system.system import System

GRID = 400
LONGEST_SEARCH = 600.0  # s of processor time for the orbit with which a harmonic branch begins
EIGENFREQUENCIES = 3
SPECIAL_KINDS = ("LP", "PD")
MATCH = 0.02  # special points of one kind farther apart are not the same
FEWEST_REFERENCE_MODES = 40
MASSLESS = "its interfaces have no mass, so that a stop has no equation of motion"
MOVED = 1.001  # times an orbit: the start from which the time of Newton's method is measured
BRANCH_QUANTITIES = ("peak_at", "peak_height", "fold_flip")  # errors that need the whole range
VISIBLE = 1e-6  # of the largest displacement at an interface: that of a mode which is seen there


def axis_of(setting: LoadCase, system: System) -> Axis:
    """What changes in a load case, of a system.

    Raises
    ------
    SystemModelError
        If the system has no such parameter, or it cannot have these values.
    """
    return Axis.of(system, setting.limits, setting.parameter, setting.frequency_hz)


@dataclass(frozen=True, eq=False)
class Measured:
    """What one reduced model answers.

    Parameters
    ----------
    mesh, method : str
        Name of the mesh, empty where there is one only, and how it was reduced.
    dofs, modes, size : int
        Degrees of freedom of the component, kept component modes, modal coordinates of the system.
    frequencies_hz : (k,) array
        Lowest eigenfrequencies that an interface sees.
    receptance : (f,) complex array
        Linear receptance at the observed interface over the range, with all dampers, m/N.
    peak : Orbit or None
        Orbit at the top of the highest resonance peak of the harmonic branch.
    special_values : dict of str to tuple
        Frequencies in Hz of the folds (LP) and flips (PD) of the harmonic branch, or values of the
        parameter.
    orbit : Orbit or None
        Harmonic orbit at the frequency or value of the study.
    seconds_per_orbit : float
        Time to find that orbit again from a guess 0.1 % off, the shortest of nine.
    seconds : float
        Time for the branch.
    note : str
        What could not be computed.
    spans : tuple of (float, float)
        Values that the pieces of the harmonic branch cover, ascending and apart.
    """

    mesh: str
    method: str
    dofs: int
    modes: int
    size: int
    frequencies_hz: Real
    receptance: Complex
    peak: Orbit | None
    special_values: Mapping[str, tuple[float, ...]] | None
    orbit: Orbit | None
    seconds_per_orbit: float
    seconds: float
    note: str = ""
    spans: tuple[tuple[float, float], ...] = ()

    @property
    def label(self) -> str:
        """Mesh and method."""
        return " ".join(filter(None, (self.mesh, self.method)))

    def __repr__(self) -> str:
        """One line: mesh, method and how many modes are kept."""
        return f"<Measured {self.label}, {counted_modes(self)}>"


@dataclass(frozen=True, eq=False)
class Errors:
    """Relative errors of one model against the reference; nan where a number is missing.

    Peaks, folds and flips are compared only if both branches cover the same range. Where a range
    is not positive, values are compared over its width.

    Parameters
    ----------
    eigenfrequency : float
        Largest of the first three that an interface sees, or of as many as the model has.
    receptance : float
        ``norm(H - H_ref) / norm(H_ref)`` over the range.
    peak_at, peak_height : float
        Place, in Hz or as the value of the parameter, and height of the highest peak.
    fold_flip : float
        Largest error of a fold's or flip's place, of those that both models have; nan if there
        are none.
    counts : (int, int) or None
        Folds and flips of the reference that the model lacks, and the other way round; None if
        it has no branch, or one that covers another range.
    force, contact : float
        Largest contact force and whole contact time per period of the orbit at the frequency or
        value of the study.
    """

    eigenfrequency: float
    receptance: float
    peak_at: float
    peak_height: float
    fold_flip: float
    counts: tuple[int, int] | None
    force: float
    contact: float


def counted_modes(model: Measured) -> str:
    """How many modes a model keeps, in words."""
    return f"{model.modes} mode{'' if model.modes == 1 else 's'}"


def most_modes(component: cms.ComponentLike, methods: Sequence[str]) -> int:
    """How many modes a component has by each of some methods: those with mass, less the held."""
    pencil = checked_pencil(component)
    held = len(pencil.names) if "craig-bampton" in methods else 0
    return max(pencil.size - int(pencil.massless.shape[1]) - held, 1)


def best_of(models: Sequence[Measured], full: Measured) -> Measured:
    """Of the models whose branch was followed the largest, of several that with least error."""
    followed = [model for model in models if model.special_values is not None]
    if not followed:
        raise ConvergenceError("no model of the study has a harmonic branch: " + models[-1].note)
    return min(followed, key=lambda m: (-m.size, distance(m.receptance, full.receptance)))


def measured(
    mesh: str,
    reduced: cms.ReducedModel,
    setting: LoadCase,
    at: float,
    progress: Progress = silent,
) -> Measured:
    """Compute what a `ConvergenceStudy` compares for one reduced model."""
    linear = measured_linear(mesh, reduced.method, reduced, setting)
    if reduced.has_massless_part:
        return replace(linear, note=MASSLESS)
    start = time.perf_counter()
    try:
        what = f"{linear.label}, {counted_modes(linear)}"
        system = setting.system(reduced)
        axis = axis_of(setting, system)
        pieces, notes = harmonic_pieces(system, setting, at, told(progress, what, axis))
    except ConvergenceError as error:
        return replace(linear, note=str(error))
    seconds = time.perf_counter() - start
    peaks = [peak for piece in pieces for peak in resonance_peaks(piece)]
    orbits = [orbit for piece in pieces for orbit in piece.at(at)]
    return replace(
        linear,
        peak=max(peaks, key=lambda p: p.height).orbit if peaks else None,
        special_values=special_points_of(pieces),
        orbit=orbits[0] if orbits else None,
        seconds_per_orbit=seconds_per_orbit(orbits[0]) if orbits else np.nan,
        seconds=seconds,
        note="; ".join(dict.fromkeys([note for piece in pieces for note in piece.notes] + notes)),
        spans=merged((piece.span for piece in pieces), axis),
    )


def measured_linear(
    mesh: str, method: str, reduced: cms.ReducedModel, setting: LoadCase
) -> Measured:
    """Counts, visible eigenfrequencies and receptance of a model."""
    rows = np.array(list(reduced.participation.values()))
    seen = np.any(np.abs(rows) > VISIBLE * np.abs(rows).max(axis=1, keepdims=True), axis=0)
    return Measured(
        mesh,
        method,
        dofs=int(reduced.basis.shape[0]),
        modes=reduced.modes,
        size=reduced.size,
        frequencies_hz=np.sort(reduced.frequencies_hz[seen]),
        receptance=receptance(reduced, setting, np.linspace(*setting.range_hz, GRID)),
        peak=None,
        special_values=None,
        orbit=None,
        seconds_per_orbit=np.nan,
        seconds=np.nan,
    )


def reductions(
    component: cms.ComponentLike, counts: Sequence[int], method: str
) -> list[cms.ReducedModel]:
    """Models by one method with ascending counts; those by Rubin's lie in the largest."""
    if method == "guyan":
        return [cms.reduce(component, method=method)]
    if method != "rubin":
        models = [cms.reduce(component, modes=count, method=method) for count in counts]
        return list({model.modes: model for model in models}.values())
    largest = cms.reduce(component, modes=counts[-1])
    smaller = [count for count in counts if count < largest.modes]
    fewer = [cms.keep_modes(largest, range(1, count + 1)) for count in smaller]
    return [*fewer, largest]


def reference_model(component: cms.ComponentLike, modes: int, full: bool) -> cms.ReducedModel:
    """All modes of a component that an interface sees, or a model of more than a study's."""
    if full:
        return cms.reduce(component, modes=most_modes(component, ()), method="truncation")
    size = int(component.mass.shape[0])
    return cms.reduce(component, modes=min(max(2 * modes, FEWEST_REFERENCE_MODES), size))


def with_orbit(
    model: Measured,
    reduced: cms.ReducedModel,
    setting: LoadCase,
    guess: Orbit,
    progress: Progress,
) -> Measured:
    """The full model with its orbit, found from that of a reduced one."""
    progress(f"full model, {reduced.size} modes", guess.frequency_hz, 0.0)
    try:
        system = setting.system(reduced)
        axis = axis_of(setting, system)
        orbit = transferred(guess, axis.at(FlowMap(system), axis.value(guess)).flow.system)
    except ConvergenceError as error:
        return replace(model, note=str(error))
    return replace(model, orbit=orbit, seconds_per_orbit=seconds_per_orbit(orbit, repeats=1))


def transferred(guess: Orbit, system: System) -> Orbit:
    """The orbit of another model of the same component at the frequency of a known one.

    The modes of the models correspond by the order of their frequencies, as far as the known
    model has them; the others start at rest. Its coordinates are those of free-interface modes.
    """
    small, large = guess.system.size, system.size
    known = np.array(
        [int(np.argmin(np.abs(system.frequencies_hz - hz))) for hz in guess.system.frequencies_hz]
    )
    states = guess.problem.flow.to_modal(guess.problem.nodes(guess.point))
    first = guess.system.interfaces[0]
    alike = np.sign(guess.system.participation[first] * system.participation[first][known])
    start = np.zeros((states.shape[0], 2 * large))
    start[:, known] = states[:, :small] * alike
    start[:, large + known] = states[:, small:] * alike
    return solve_orbit(
        system,
        guess.frequency_hz,
        guess.period,
        guess=start,
        observe=guess.observe,
        segments=guess.problem.segments,
    )


def receptance(reduced: cms.ReducedModel, setting: LoadCase, frequency_hz: Real) -> Complex:
    """Linear receptance (f,) at the observed interface, with all dampers."""
    if reduced.has_massless_part:
        return massless_receptance(reduced, setting, frequency_hz)
    system = setting.system(reduced)
    row = next(iter(system.participation.values()))
    squares, D = system.natural_frequencies**2, system.total_damping
    if not np.any(D - np.diag(np.diag(D))) and not system.springs:
        omega = 2 * np.pi * frequency_hz[:, None]
        return np.asarray(np.sum(row**2 / (squares - omega**2 + 1j * omega * np.diag(D)), axis=1))
    found = [
        row @ np.linalg.solve(system.stiffness - w**2 * np.eye(row.size) + 1j * w * D, row)
        for w in 2 * np.pi * frequency_hz
    ]
    return np.array(found)


def massless_receptance(
    reduced: cms.ReducedModel, setting: LoadCase, frequency_hz: Real
) -> Complex:
    """The same where part of the flexibility has no mass.

    Dampers and springs close R = P Z^-1 P^T + G.
    """
    if any(setting.rayleigh):  # not known where flexibility has no mass
        return np.full(len(frequency_hz), np.nan, dtype=complex)
    names = reduced.interfaces
    observed = names.index(setting.observe or names[0])
    R = np.array(
        [
            [reduced.receptance(frequency_hz, a, b, setting.modal_damping) for b in names]
            for a in names
        ]
    )
    C, K = np.zeros((2, len(names), len(names)))
    linear = [d for d in setting.dampers if isinstance(d, Damper)]
    sizes = [(C, d.coefficient, d.at, d.against) for d in linear]
    springs = [s for s in setting.springs if isinstance(s, Spring)]
    sizes += [(K, s.stiffness, s.at, s.against) for s in springs]
    for matrix, size, at, against in sizes:
        ends = [1.0 * (name == at) - (name == against) for name in names]
        matrix += size * np.outer(ends, ends)
    found = [
        np.linalg.solve(np.eye(len(names)) + R[:, :, k] @ (K + 1j * w * C), R[:, observed, k])[
            observed
        ]
        for k, w in enumerate(2 * np.pi * frequency_hz)
    ]
    return np.array(found)


def harmonic_branch(system: System, setting: LoadCase, tell: Callable[[float], None]) -> Branch:
    """The harmonic branch downwards from the upper end of the range."""
    axis = axis_of(setting, system)
    _, high = axis.limits
    tell(high)
    try:
        orbit = _orbit_at(axis, system, axis.moved(high, -SLACK), setting)
    except ConvergenceError as error:
        raise _explained(error, system) from None
    return continue_branch(orbit, axis.limits, parameter=axis.parameter, progress=tell)


def _orbit_at(axis: Axis, system: System, value: float, setting: LoadCase) -> Orbit:
    """The harmonic orbit at a value of what changes.

    Raises
    ------
    ConvergenceError
        If none is found.
    """
    here = axis.at(FlowMap(system), value)
    return solve_orbit(
        here.flow, here.frequency_hz, observe=setting.observe, seconds=LONGEST_SEARCH
    )


def harmonic_pieces(
    system: System, setting: LoadCase, at: float, tell: Callable[[float], None]
) -> tuple[list[Branch], list[str]]:
    """The harmonic branch from the upper end of the range, and what it leaves out.

    If it does not come to the lower end, also the branch from there; if both leave out the
    place of the study, also the one through the orbit there. With notes on starts without an
    orbit.

    Raises
    ------
    ConvergenceError
        If there is an orbit at none of these.
    """
    pieces: list[Branch] = []
    missing: dict[str, ConvergenceError] = {}
    axis = axis_of(setting, system)
    low, high = axis.limits

    def still(_: float) -> None:
        tell(pieces[0].span[0])

    for value in (axis.moved(high, -SLACK), axis.moved(low, SLACK), at):
        if covers([piece.span for piece in pieces], (value, value), axis):
            continue
        try:
            orbit = _orbit_at(axis, system, value, setting)
        except ConvergenceError as error:
            missing[f"a branch through {axis.told(value)} is missing: {error}"] = error
            continue
        pieces.append(
            continue_branch(
                orbit,
                axis.limits,
                parameter=axis.parameter,
                progress=still if pieces else tell,
                open_ends=[end for piece in pieces for end in open_ends(piece)],
            )
        )
    if not pieces:
        raise _explained(next(iter(missing.values())), system)
    return pieces, list(missing)


def _explained(error: ConvergenceError, system: System) -> ConvergenceError:
    """Why there is no orbit, with what may be behind it."""
    rigid = system.free_modes
    if not rigid:
        return error
    modes = f"{rigid} mode{'' if rigid == 1 else 's'} at 0 Hz"
    return ConvergenceError(f"{error}; nothing holds the structure: it has {modes}")


def merged(spans: Iterable[tuple[float, float]], axis: Axis) -> tuple[tuple[float, float], ...]:
    """Spans that overlap made one, ascending.

    Examples
    --------
    >>> merged([(5.0, 8.0), (1.0, 2.0), (7.0, 9.0)], Axis.in_frequency((1.0, 9.0)))
    ((1.0, 2.0), (5.0, 9.0))
    """
    found: list[tuple[float, float]] = []
    for low, high in sorted(spans):
        if found and _reaches(found[-1][1], low, SLACK, axis):
            low, high = found[-1][0], max(found.pop()[1], high)
        found.append((low, high))
    return tuple(found)


def covers(
    spans: Sequence[tuple[float, float]],
    wanted: tuple[float, float],
    axis: Axis,
    slack: float = SLACK,
) -> bool:
    """Whether one of some spans holds another span, up to a difference as in `Axis.apart`.

    Examples
    --------
    >>> spans, axis = [(1.0, 2.0), (5.0, 9.0)], Axis.in_frequency((1.0, 9.0))
    >>> covers(spans, (5.0, 8.0), axis), covers(spans, (2.0, 5.0), axis)
    (True, False)
    """
    return any(
        _reaches(wanted[0], low, slack, axis) and _reaches(high, wanted[1], slack, axis)
        for low, high in spans
    )


def _reaches(value: float, other: float, slack: float, axis: Axis) -> bool:
    """Whether a value is not below another one, up to a difference."""
    return other <= value or axis.apart(other, value) <= slack


def alike_spans(a: Measured, b: Measured, axis: Axis) -> bool:
    """Whether the branches of two models cover the same range, up to 2 %."""
    pairs = [(a, span) for span in b.spans] + [(b, span) for span in a.spans]
    return all(covers(model.spans, span, axis, MATCH) for model, span in pairs)


def spans_in_words(spans: Sequence[tuple[float, float]], axis: Axis) -> str:
    """Spans as a list.

    Examples
    --------
    >>> spans_in_words([(4.0, 4.04441), (11.7417, 12.0)], Axis.in_frequency((4.0, 12.0)))
    '4 to 4.0444 and 11.742 to 12 Hz'
    """
    listed = " and ".join(f"{low:.5g} to {high:.5g}" for low, high in spans)
    return with_unit(axis.parameter, listed)


def noted(model: Measured, best: Measured, exact: Orbit | None, axis: Axis, at: float) -> Measured:
    """A model with notes on what of its branch and its contacts is not compared, and why.

    Parameters
    ----------
    model, best : Measured
        The model, and that whose branch is the reference's.
    exact : Orbit or None
        The orbit of reference.
    axis : Axis
        What changes, and its range.
    at : float
        Value at which orbits are compared.
    """
    if model.special_values is None:
        return model
    notes = [model.note] if model.note else []
    alike = alike_spans(model, best, axis)
    if not (alike and covers(model.spans, axis.limits, axis)):
        covered, asked = (spans_in_words(each, axis) for each in (model.spans, [axis.limits]))
        said = f"the branch covers {covered} of {asked}"
        if not alike:
            said += f", that of the reference {spans_in_words(best.spans, axis)}"
            said += ": peaks, folds and flips are not compared"
        notes.append(said)
    if model.orbit is None:
        notes.append(f"no orbit of the branch at {axis.told(at)}, so that its contacts are unknown")
    elif exact is None:
        notes.append(f"the reference has no orbit at {axis.told(at)}: contacts are not compared")
    return replace(model, note="; ".join(notes))


def told(progress: Progress, what: str, axis: Axis) -> Callable[[float], None]:
    """Tell how much of a range a branch covers that comes down from its upper end."""
    low, high = axis.limits
    lowest = high

    def tell(value: float) -> None:
        nonlocal lowest
        lowest = min(lowest, value)
        hz = value if axis.frequency_hz is None else 0.0
        progress(what, hz, (high - lowest) / (high - low))

    return tell


def seconds_per_orbit(orbit: Orbit, repeats: int = 9) -> float:
    """Time to find an orbit again from states 0.1 % off, the shortest of some repeats."""
    problem, times = orbit.problem, []
    for _ in range(repeats):
        start = time.perf_counter()
        refine(problem, problem.nodes(orbit.point) * MOVED, orbit.omega, orbit.observe)
        times.append(time.perf_counter() - start)
    return min(times)


def contact_time(orbit: Orbit) -> float:
    """Time in s per period of the orbit during which a stop is touched."""
    _, weights = orbit.trajectory.contact_quadrature()
    return float(np.sum(weights))


def largest_force(orbit: Orbit) -> float:
    """Largest contact force in N over a period."""
    return max(
        (math.inf if hit.force is None else hit.force for hit in orbit.impact_list), default=0.0
    )


def errors_of(
    model: Measured, reference: Measured, best: Measured, full: bool, axis: Axis
) -> Errors:
    """Errors of a model: linear numbers against the reference, the branch's against ``best``.

    The orbit is compared with that of the full model if there is one.
    """
    eigenfrequency = frequency_error(model.frequencies_hz, reference.frequencies_hz)
    fold_flip, counts = np.nan, None
    alike = alike_spans(model, best, axis)
    peak = model.peak if alike else None
    if alike and model.special_values is not None and best.special_values is not None:
        fold_flip, *lacking = matched(model.special_values, best.special_values, axis)
        counts = (lacking[0], lacking[1])
        if lacking[0] == sum(map(len, best.special_values.values())):
            fold_flip = np.nan
    orbit = reference.orbit if full else best.orbit
    moved = np.nan
    if peak is not None and best.peak is not None:
        moved = axis.apart(axis.value(peak), axis.value(best.peak))
    return Errors(
        eigenfrequency,
        distance(model.receptance, reference.receptance),
        moved,
        relative(peak, best.peak, lambda o: o.max_abs_displacement),
        fold_flip,
        counts,
        relative(model.orbit, orbit, largest_force),
        relative(model.orbit, orbit, contact_time),
    )


def frequency_error(own: Real, exact: Real) -> float:
    """Largest relative error of the first three frequencies, or of as many as the model has.

    That of a rigid-body mode is relative to the first frequency above zero. nan if there are none.
    """
    count = min(EIGENFREQUENCIES, exact.size, own.size)
    if not count:
        return np.nan
    elastic = exact[exact > 0.0]
    scale = np.where(exact > 0.0, exact, elastic[0] if elastic.size else 1.0)
    return float(np.max(np.abs(own[:count] - exact[:count]) / scale[:count]))


def distance(given: Complex, known: Complex) -> float:
    """Relative distance of a function on the grid from a known one."""
    return float(np.linalg.norm(given - known) / np.linalg.norm(known))


def relative(a: Orbit | None, b: Orbit | None, number: Callable[[Orbit], float]) -> float:
    """Relative difference of a number of two orbits; nan where one is missing, or b's is zero."""
    exact = 0.0 if b is None else number(b)
    return abs(number(a) - exact) / abs(exact) if a is not None and exact else np.nan


def special_points_of(pieces: Sequence[Branch]) -> dict[str, tuple[float, ...]]:
    """Values at the folds and flips of the pieces of a branch, by kind."""
    points = [point for piece in pieces for point in piece.special_points]
    return {
        kind: tuple(sorted(p.value for p in points if str(p.kind) == kind))
        for kind in SPECIAL_KINDS
    }


def matched(
    own: Mapping[str, tuple[float, ...]], exact: Mapping[str, tuple[float, ...]], axis: Axis
) -> tuple[float, int, int]:
    """Largest distance, as in `Axis.apart`, of special points that belong together; the others.

    Points of one kind are paired nearest first, up to a distance of 2 %.
    """
    worst, missing, extra = 0.0, 0, 0
    for kind, wanted in exact.items():
        given = own.get(kind, ())
        pairs = sorted((axis.apart(g, w), i, j) for i, w in enumerate(wanted)
                       for j, g in enumerate(given))  # fmt: skip
        left, right = set(range(len(wanted))), set(range(len(given)))
        for distance, i, j in pairs:
            if distance > MATCH or i not in left or j not in right:
                continue
            left.remove(i)
            right.remove(j)
            worst = max(worst, distance)
        missing += len(left)
        extra += len(right)
    return worst, missing, extra
