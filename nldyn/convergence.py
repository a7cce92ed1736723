"""How the answer depends on the reduction: number of modes, method, and mesh."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from nldyn.branch import Branch
from nldyn.continuation import continue_branch
from nldyn.errors import SystemModelError
from nldyn.flow import FlowMap
from nldyn.linear import Complex, Real
from nldyn.orbit import ConvergenceError, Orbit, refine, solve_orbit
from nldyn.peaks import resonance_peaks
from nldyn.setting import Setting
from nldyn.system import System

if TYPE_CHECKING:
    import cms
    from nldyn.diagrams import Progress
    from nldyn.scene_schema import Scene

COUNTS = (*range(1, 11), 12, 16, 20, 30, 40)
GRID = 400
EIGENFREQUENCIES = 3
SPECIAL_KINDS = ("LP", "PD")
MATCH = 0.02  # special points of one kind farther apart are not the same
INVISIBLE = 1e-9
FULL = "full"
SCENE_METHODS = ("rubin", "craig-bampton", "guyan", "truncation")
QUANTITIES = {
    "eigenfrequency": "eigenfrequencies",
    "receptance": "receptance",
    "peak_hz": "peak frequency",
    "peak_m": "peak height",
    "fold_flip": "folds and flips",
    "force": "contact force",
    "contact": "contact duration",
}


@dataclass(frozen=True, eq=False)
class Measured:
    """What one reduced model answers.

    Parameters
    ----------
    label : str
        Which series it belongs to: a method or a mesh.
    modes, size : int
        Kept component modes, and modal coordinates of the system.
    frequencies_hz : (k,) array
        Lowest eigenfrequencies that an interface sees.
    receptance : (f,) complex array
        Linear receptance at the observed interface over the range, with all dampers, m/N.
    peak : Orbit or None
        Orbit at the top of the highest resonance peak of the harmonic branch.
    special_hz : dict of str to tuple
        Frequencies of the folds (LP) and flips (PD) of the harmonic branch.
    orbit : Orbit or None
        Harmonic orbit at the frequency of the study.
    seconds_per_orbit : float
        Time to find that orbit again from a guess 0.1 % off, the shortest of nine.
    seconds : float
        Time for the branch.
    note : str
        What could not be computed.
    """

    label: str
    modes: int
    size: int
    frequencies_hz: Real
    receptance: Complex
    peak: Orbit | None
    special_hz: Mapping[str, tuple[float, ...]] | None
    orbit: Orbit | None
    seconds_per_orbit: float
    seconds: float
    note: str = ""


@dataclass(frozen=True, eq=False)
class Errors:
    """Relative errors of one model against the reference; nan where a number is missing.

    Parameters
    ----------
    eigenfrequency : float
        Largest of the first three that an interface sees; infinite if there are fewer.
    receptance : float
        ``norm(H - H_ref) / norm(H_ref)`` over the range.
    peak_hz, peak_m : float
        Frequency and height of the highest resonance peak.
    fold_flip : float
        Largest error of a fold's or flip's frequency, of those that both models have.
    missing, extra : int
        Folds and flips of the reference that the model lacks, and the other way round.
    force, contact : float
        Largest contact force and whole contact time per period of the orbit at the frequency of
        the study.
    """

    eigenfrequency: float
    receptance: float
    peak_hz: float
    peak_m: float
    fold_flip: float
    missing: int
    extra: int
    force: float
    contact: float


@dataclass(frozen=True, eq=False)
class Study:
    """A convergence study.

    Parameters
    ----------
    setting : Setting
        What was asked.
    at_hz : float
        Frequency of the orbits that are compared.
    models : tuple of Measured
        All models, the reference last.
    errors : tuple of Errors
        One for each model, against the reference.
    """

    setting: Setting
    at_hz: float
    models: tuple[Measured, ...]
    errors: tuple[Errors, ...]

    @property
    def reference(self) -> Measured:
        """The model that the others are compared with."""
        return self.models[-1]

    def series(self) -> dict[str, list[int]]:
        """Indices of the models by label, without the reference."""
        found: dict[str, list[int]] = {}
        for index, model in enumerate(self.models[:-1]):
            found.setdefault(model.label, []).append(index)
        return found

    def enough(self, quantity: str, tolerance: float, label: str) -> int | None:
        """Smallest number of modes of a series from which on an error stays below a tolerance."""
        found = None
        for index in reversed(self.series()[label]):
            if not getattr(self.errors[index], quantity) <= tolerance:
                break
            found = self.models[index].modes
        return found

    def report(self) -> str:
        """The study as a table and a few sentences."""
        head = ("label", "modes", "size", "eigenf.", "recept.", "peak Hz", "peak m", "LP/PD",
                "lacks", "extra", "force", "contact", "ms/orbit", "branch s")  # fmt: skip
        rows: list[tuple[str, ...]] = [head]
        for model, error in zip(self.models, self.errors, strict=True):
            numbers = (error.eigenfrequency, error.receptance, error.peak_hz, error.peak_m,
                       error.fold_flip)  # fmt: skip
            rows.append((
                model.label, str(model.modes), str(model.size), *map(shown_error, numbers),
                str(error.missing), str(error.extra), shown_error(error.force),
                shown_error(error.contact), f"{1e3 * model.seconds_per_orbit:.3g}",
                f"{model.seconds:.3g}",
            ))  # fmt: skip
        widths = [max(len(row[i]) for row in rows) for i in range(len(head))]
        lines = [
            "  ".join(cell.rjust(width) for cell, width in zip(row, widths, strict=True))
            for row in rows
        ]
        lines.append(
            f"reference: the full model ({self.reference.size} modes) for eigenfrequencies and "
            f"receptance{' and the orbit' if self.reference.orbit else ''}, the largest model for "
            f"the rest; orbits at {self.at_hz:g} Hz"
        )
        for label in self.series():
            for quantity, name in QUANTITIES.items():
                counts = [self.enough(quantity, tolerance, label) for tolerance in (1e-2, 1e-4)]
                said = ", ".join(
                    f"{100 * tolerance:g} % from {count} modes"
                    if count is not None
                    else f"{100 * tolerance:g} % not reached"
                    for tolerance, count in zip((1e-2, 1e-4), counts, strict=True)
                )
                lines.append(f"{label}, {name}: {said}")
            lines += self.said_of_special_points(label)
        lines += [f"note: {m.label}, {m.modes} modes: {m.note}" for m in self.models if m.note]
        return "\n".join(lines)

    def said_of_special_points(self, label: str) -> list[str]:
        """From how many modes on a series has exactly the reference's folds and flips."""
        found: int | None = None
        for index in reversed(self.series()[label]):
            error = self.errors[index]
            if self.models[index].special_hz is None:
                continue
            if error.missing or error.extra:
                break
            found = self.models[index].modes
        if found is None:
            return [f"{label}: no count has the same folds and flips as the reference"]
        return [f"{label}: the same folds and flips as the reference from {found} modes"]


def converge(
    components: Mapping[str, cms.ComponentLike] | cms.ComponentLike,
    setting: Setting,
    *,
    modes: Sequence[int] = COUNTS,
    methods: Sequence[str] = ("rubin",),
    at_hz: float | None = None,
    full: bool = False,
    progress: Progress | None = None,
) -> Study:
    """Compute the same with more and more modes, and compare.

    Parameters
    ----------
    components : ComponentLike or mapping of str to ComponentLike
        The component, or the same on several meshes by name, the finest last.
    setting : Setting
        What acts on it and what range is asked for.
    modes : sequence of int
        Numbers of kept component modes.
    methods : sequence of str
        Names as for `cms.reduce`; those whose interfaces have no mass are refused.
    at_hz : float, optional
        Frequency of the orbits that are compared; by default the geometric mean of the range.
    full : bool
        Also find the orbit at ``at_hz`` in the full model, with all modes that an interface can
        see, and compare with that; this takes minutes for some hundred modes.
    progress : callable, optional
        Called as ``progress(what, frequency_hz)``.

    Returns
    -------
    Study

    Raises
    ------
    SystemModelError
        For counts or names that make no sense.
    cms.ReductionError
        As `cms.reduce`.

    Notes
    -----
    The reference is the full model, all modes of the component (of the last one of several) that
    an interface can see, for eigenfrequencies and receptance, and the model with the most modes
    for the harmonic branch. Every model has the setting's modal damping for all of its modes, also
    the residual ones, whose damping is therefore not that of the full model.
    The harmonic branch is followed downwards from the orbit that a simulation from rest finds at
    the upper end of the range.
    """
    import cms

    if not isinstance(components, Mapping):
        components = {"": components}
    if not components or not modes or not methods:
        raise SystemModelError("converge: give at least one component, count and method")
    at_hz = setting.middle_hz if at_hz is None else at_hz
    if not setting.range_hz[0] <= at_hz <= setting.range_hz[1]:
        raise SystemModelError(f"converge: at_hz must lie in the range, got {at_hz:g}")
    models: list[Measured] = []
    for mesh, component in components.items():
        for method in methods:
            label = " ".join(filter(None, (mesh, method)))
            for count in sorted(set(modes)) if method != "guyan" else [0]:
                asked = None if method == "guyan" else count
                reduced = cms.reduce(component, modes=asked, method=method)
                models.append(measured(label, reduced, setting, at_hz, progress))
    finest = list(components.values())[-1]
    best = best_of(models, list(components)[-1])
    models.append(measured_full(finest, setting, at_hz, best, full, progress))
    return Study(
        setting, at_hz, tuple(models), tuple(errors_of(m, models[-1], best, full) for m in models)
    )


def study_of_scene(
    scene: Scene,
    *,
    modes: Sequence[int] = COUNTS,
    methods: Sequence[str] = ("rubin",),
    refinements: Sequence[int] = (1,),
    at_hz: float | None = None,
    full: bool = False,
    progress: Progress | None = None,
) -> Study:
    """The convergence study of a scene with a mesh, see `converge`.

    Parameters
    ----------
    scene : Scene
        Its ``[reduction]`` is not used.
    modes, methods, at_hz, full, progress
        As for `converge`.
    refinements : sequence of int
        Meshes: every element is cut into so many.

    Raises
    ------
    SceneError
        As `build_component`, and if a model cannot be made or no branch is found.
    """
    import cms
    from nldyn.scene import build_component
    from nldyn.scene_messages import scene_error
    from nldyn.setting import setting_of

    setting = setting_of(scene)
    if min(refinements) < 1:
        raise SystemModelError("converge: a refinement must be 1 or more")
    for method in methods:
        if method not in SCENE_METHODS:
            raise SystemModelError(
                f"converge: there is no method '{method}' for a scene "
                f"(there are: {', '.join(SCENE_METHODS)})"
            )
    components = {
        "" if len(refinements) == 1 else f"x{times}": build_component(scene, times)
        for times in sorted(refinements)
    }
    try:
        return converge(
            components,
            setting,
            modes=modes,
            methods=methods,
            at_hz=at_hz,
            full=full,
            progress=progress,
        )
    except (cms.ReductionError, ConvergenceError) as error:
        raise scene_error(scene.file, ("reduction",), str(error), sep=": ") from None


def best_of(models: Sequence[Measured], mesh: str) -> Measured:
    """The largest model of the last mesh whose branch was followed."""
    followed = [m for m in models if m.special_hz is not None and m.label.startswith(mesh)]
    if not followed:
        raise ConvergenceError("no model of the study has a harmonic branch: " + models[-1].note)
    return max(followed, key=lambda model: model.size)


def measured(
    label: str,
    reduced: cms.ReducedModel,
    setting: Setting,
    at_hz: float,
    progress: Progress | None = None,
) -> Measured:
    """Compute what a `Study` compares for one reduced model."""
    system = setting.system(reduced)
    name = f"{label}, {reduced.modes} modes"
    linear = linear_part_of(label, reduced, setting, system)
    start = time.perf_counter()
    try:
        branch = harmonic_branch(system, setting, told(progress, name))
    except ConvergenceError as error:
        return Measured(*linear, None, None, None, np.nan, np.nan, str(error))
    seconds = time.perf_counter() - start
    peaks = resonance_peaks(branch)
    peak = max(peaks, key=lambda p: p.height).orbit if peaks else None
    orbits = branch.at(at_hz)
    orbit = orbits[0] if orbits else None
    special = special_points_of(branch)
    per_orbit = seconds_per_orbit(orbit) if orbit else np.nan
    return Measured(*linear, peak, special, orbit, per_orbit, seconds, "; ".join(branch.notes))


def measured_full(
    component: cms.ComponentLike,
    setting: Setting,
    at_hz: float,
    best: Measured,
    with_orbit: bool,
    progress: Progress | None = None,
) -> Measured:
    """What the full model answers; its orbit is found from that of the best reduced one."""
    import cms

    size = int(component.mass.shape[0])
    reduced = visible_modes(cms.reduce(component, modes=size, method="truncation"))
    system = setting.system(reduced)
    tell = told(progress, f"full model, {reduced.size} modes")
    linear = linear_part_of(FULL, reduced, setting, system)
    orbit, note, per_orbit = None, "", np.nan
    if with_orbit and best.orbit is not None:
        tell(at_hz)
        try:
            orbit = transferred(best.orbit, system)
            per_orbit = seconds_per_orbit(orbit, repeats=1)
        except ConvergenceError as error:
            note = str(error)
    return Measured(*linear, None, None, orbit, per_orbit, np.nan, note)


def visible_modes(reduced: cms.ReducedModel) -> cms.ReducedModel:
    """The model without the modes that no interface sees."""
    from dataclasses import replace

    rows = np.array(list(reduced.participation.values()))
    seen = np.any(np.abs(rows) > INVISIBLE * np.abs(rows).max(axis=1, keepdims=True), axis=0)
    return replace(
        reduced,
        frequencies_hz=reduced.frequencies_hz[seen],
        participation={name: row[seen] for name, row in reduced.participation.items()},
        basis=reduced.basis[:, seen],
        residuals=reduced.residuals[seen],
        modes=int(np.count_nonzero(seen[: reduced.modes])),
        damping=None if reduced.damping is None else reduced.damping[np.ix_(seen, seen)],
    )


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


def linear_part_of(
    label: str, reduced: cms.ReducedModel, setting: Setting, system: System
) -> tuple[str, int, int, Real, Complex]:
    """Label, counts, visible eigenfrequencies and receptance of a model."""
    rows = np.array(list(system.participation.values()))
    seen = np.any(np.abs(rows) > 1e-6 * np.abs(rows).max(axis=1, keepdims=True), axis=0)
    frequencies = np.sort(system.frequencies_hz[seen])
    return (
        label,
        reduced.modes,
        system.size,
        frequencies,
        receptance(system, np.linspace(*setting.range_hz, GRID)),
    )


def receptance(system: System, frequency_hz: Real) -> Complex:
    """Linear receptance (f,) at the observed interface, with all dampers."""
    row = next(iter(system.participation.values()))
    squares, D = system.natural_frequencies**2, system.total_damping
    if not np.any(D - np.diag(np.diag(D))):
        omega = 2 * np.pi * frequency_hz[:, None]
        return np.asarray(np.sum(row**2 / (squares - omega**2 + 1j * omega * np.diag(D)), axis=1))
    found = [
        row @ np.linalg.solve(np.diag(squares - w**2) + 1j * w * D, row)
        for w in 2 * np.pi * frequency_hz
    ]
    return np.array(found)


def harmonic_branch(system: System, setting: Setting, tell: Callable[[float], None]) -> Branch:
    """The harmonic branch downwards from the upper end of the range."""
    low, high = setting.range_hz
    tell(high)
    orbit = solve_orbit(FlowMap(system), high * (1.0 - 1e-9), observe=setting.observe)
    return continue_branch(orbit, (low, high))


def told(progress: Progress | None, what: str) -> Callable[[float], None]:
    """Tell a progress line what is being computed."""

    def tell(frequency_hz: float) -> None:
        if progress is not None:
            progress(what, frequency_hz)

    return tell


def seconds_per_orbit(orbit: Orbit, repeats: int = 9) -> float:
    """Time to find an orbit again from states 0.1 % off, the shortest of some repeats."""
    problem, times = orbit.problem, []
    for _ in range(repeats):
        start = time.perf_counter()
        refine(problem, problem.nodes(orbit.point) * 1.001, orbit.omega, orbit.observe)
        times.append(time.perf_counter() - start)
    return min(times)


def contact_time(orbit: Orbit) -> float:
    """Time in s per period of the orbit during which a stop is touched."""
    _, weights = orbit.trajectory.contact_quadrature()
    return float(np.sum(weights))


def largest_force(orbit: Orbit) -> float:
    """Largest contact force in N over a period."""
    return max((impact.force for impact in orbit.impact_list), default=0.0)


def errors_of(model: Measured, reference: Measured, best: Measured, full: bool) -> Errors:
    """Errors of a model: linear numbers against the reference, the branch's against ``best``.

    The orbit is compared with that of the full model if there is one.
    """
    count = min(EIGENFREQUENCIES, reference.frequencies_hz.size)
    exact = reference.frequencies_hz[:count]
    own = model.frequencies_hz[:count]
    eigenfrequency = (
        float(np.max(np.abs(own - exact) / np.maximum(exact, 1e-300)))
        if own.size == count
        else np.inf
    )
    H, known = model.receptance, reference.receptance
    fold_flip, missing, extra = np.nan, 0, 0
    if model.special_hz is not None and best.special_hz is not None:
        fold_flip, missing, extra = matched(model.special_hz, best.special_hz)
    orbit = reference.orbit if full else best.orbit
    return Errors(
        eigenfrequency,
        float(np.linalg.norm(H - known) / np.linalg.norm(known)),
        relative(model.peak, best.peak, lambda o: o.frequency_hz),
        relative(model.peak, best.peak, lambda o: o.max_abs_displacement),
        fold_flip,
        missing,
        extra,
        relative(model.orbit, orbit, largest_force),
        relative(model.orbit, orbit, contact_time),
    )


def relative(a: Orbit | None, b: Orbit | None, number: Callable[[Orbit], float]) -> float:
    """Relative difference of a number of two orbits; nan where one is missing."""
    if a is None or b is None:
        return np.nan
    exact = number(b)
    return abs(number(a) - exact) / abs(exact) if exact else abs(number(a))


def special_points_of(branch: Branch) -> dict[str, tuple[float, ...]]:
    """Frequencies of the folds and flips of a branch, by kind."""
    return {
        kind: tuple(sorted(p.frequency_hz for p in branch.special_points if str(p.kind) == kind))
        for kind in SPECIAL_KINDS
    }


def matched(
    own: Mapping[str, tuple[float, ...]], exact: Mapping[str, tuple[float, ...]]
) -> tuple[float, int, int]:
    """Largest relative distance of special points that belong together, and how many do not.

    Points of one kind are paired nearest first, up to a distance of 2 %.
    """
    worst, missing, extra = 0.0, 0, 0
    for kind, wanted in exact.items():
        given = own.get(kind, ())
        pairs = sorted((abs(g / w - 1.0), i, j) for i, w in enumerate(wanted)
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


def shown_error(value: float) -> str:
    """An error in a table."""
    return "-" if np.isnan(value) else f"{value:.1e}"
