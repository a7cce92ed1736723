"""How the answer depends on the reduction: number of modes, method, and mesh."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

import cms
from nldyn.base.errors import SystemModelError
from nldyn.orbits.axis import Axis
from nldyn.reduction.load_case import LoadCase
from nldyn.reduction.model_errors import (
    BRANCH_QUANTITIES,
    Errors,
    Measured,
    axis_of,
    best_of,
    counted_modes,
    covers,
    errors_of,
    largest_force,
    measured,
    measured_linear,
    noted,
    spans_in_words,
    with_orbit,
)
from nldyn.reduction.studied import (
    ALL_MODES_UP_TO,
    Alone,
    JoinedComponents,
    Studied,
    receptance_bound,
)
from nldyn.runtime.executors import as_finished, own_processes
from nldyn.runtime.progress import Progress, Shares, shows_progress, silent
from nldyn.runtime.threads import one_thread

Component = cms.ComponentLike | JoinedComponents
COUNTS = (*range(1, 11), 12, 16, 20, 30, 40)
ONE_MODE = 4.0  # part of the cost of a branch that does not grow with its modes, in modes
EXACT = 1e-6  # relative difference of frequencies that are the same but for rounding
FULL = "full"
REFERENCE = "reference"
METHODS = ("rubin", "craig-bampton", "guyan", "truncation", "macneal")
QUANTITIES = {
    "eigenfrequency": "eigenfrequencies",
    "receptance": "receptance",
    "peak_at": "peak position",
    "peak_height": "peak height",
    "fold_flip": "folds and flips",
    "force": "contact force",
    "contact": "contact duration",
}
SAID = (1e-2, 1e-4)  # relative errors for which it is said how many modes suffice


@dataclass(frozen=True, eq=False)
class ConvergenceStudy:
    """A convergence study.

    Parameters
    ----------
    setting : LoadCase
        What was asked.
    at : float
        Frequency in Hz, or value of the parameter, of the orbits that are compared.
    axis : Axis
        What changes, over which range.
    models : tuple of Measured
        All models, the reference last.
    errors : tuple of Errors
        One for each model, against the references.
    best : Measured
        The model whose branch is that of reference.
    reference_error : float
        Bound, but for rounding, of the reference's own error: of the receptance without damping,
        relative as in `Errors`. 0 for the full model; inf if a mode left out may resonate in the
        range.
    counted : str
        What the numbers of modes mean, of components that are joined.
    """

    setting: LoadCase
    at: float
    axis: Axis
    models: tuple[Measured, ...]
    errors: tuple[Errors, ...]
    best: Measured
    reference_error: float = 0.0
    counted: str = ""

    def __repr__(self) -> str:
        """One line: how many models, and where their orbits are compared."""
        place = self.axis.told(self.at)
        return f"<ConvergenceStudy of {len(self.models)} models, orbits at {place}>"

    @property
    def reference(self) -> Measured:
        """The model with which eigenfrequencies and receptance are compared: the full one if
        it is small enough.
        """
        return self.models[-1]

    def series(self) -> dict[str, list[int]]:
        """Indices of the models with one mesh and method, by its label, without the reference."""
        return self._grouped(lambda model: model.label)

    def mesh_series(self) -> dict[str, list[int]]:
        """Indices of the models by one method with one count on several meshes, by its name."""
        found = self._grouped(lambda model: f"{model.method}, {counted_modes(model)}")
        return {name: indices for name, indices in found.items() if len(indices) > 1}

    def _grouped(self, name: Callable[[Measured], str]) -> dict[str, list[int]]:
        found: dict[str, list[int]] = {}
        for index, model in enumerate(self.models[:-1]):
            found.setdefault(name(model), []).append(index)
        return found

    def enough(self, quantity: str, tolerance: float, indices: Sequence[int]) -> Measured | None:
        """First model of a series from which on an error stays below a tolerance.

        The model that is the reference of a quantity proves nothing, unless it is exact.
        """
        found = None
        for index in reversed(indices):
            if self.is_own_reference(index, quantity):
                continue
            if not getattr(self.errors[index], quantity) <= tolerance:
                break
            found = self.models[index]
        return found

    def is_exact(self, model: Measured) -> bool:
        """Whether a model leaves nothing out: it has all modes of the full one."""
        own, known = model.frequencies_hz, self.reference.frequencies_hz
        return (
            self.reference.method == FULL
            and own.size == known.size
            and np.allclose(own, known, rtol=EXACT, atol=0.0)
        )

    def is_own_reference(self, index: int, quantity: str) -> bool:
        """Whether a model, which is not exact, has an error of 0 by comparison with itself."""
        others = ("force", "contact") if self.reference.orbit else ()
        with_best = quantity not in ("eigenfrequency", "receptance", *others)
        return with_best and self.models[index] is self.best and not self.is_exact(self.best)

    def report(self) -> str:
        """The study as a table and a few sentences."""
        head = ("label", "dofs", "modes", "size", "eigenf.", "recept.", "peak at", "peak m",
                "LP/PD", "lacks", "extra", "force", "contact", "ms/orbit", "branch s")  # fmt: skip
        rows: list[tuple[str, ...]] = [head]
        for index, (model, error) in enumerate(zip(self.models, self.errors, strict=True)):
            *numbers, force, contact = (self.shown(index, quantity) for quantity in QUANTITIES)
            rows.append((
                model.label, str(model.dofs), str(model.modes), str(model.size), *numbers,
                *map(str, error.counts or ("-", "-")), force, contact,
                if_finite(1e3 * model.seconds_per_orbit), if_finite(model.seconds),
            ))  # fmt: skip
        widths = [max(len(row[i]) for row in rows) for i in range(len(head))]
        lines = [
            "  ".join(cell.rjust(width) for cell, width in zip(row, widths, strict=True))
            for row in rows
        ]
        lines.append(self.said_of_references())
        known = self.reference.orbit or self.best.orbit
        if known is not None and largest_force(known) == 0.0:
            place = self.axis.told(self.at)
            lines.append(f"no stop is touched at {place}, so that there is no contact to compare")
        for label, indices in self.series().items():
            if len(indices) > 1:
                lines += self.said_of(label, indices, counted_modes)
        for label, indices in self.mesh_series().items():
            lines += self.said_of(label, indices, lambda m: f"{m.dofs} degrees of freedom")
        lines += [f"note: {note}" for note in self.notes()]
        return "\n".join(lines + self.advice())

    def notes(self) -> list[str]:
        """What could not be computed or compared, a line for each note with the models' names."""
        notes: dict[str, list[str]] = {}
        for model in self.models:
            notes.setdefault(model.note, []).append(f"{model.label}, {counted_modes(model)}")
        return [f"{'; '.join(names)}: {note}" for note, names in notes.items() if note]

    def advice(self, tolerance: float = 0.01) -> list[str]:
        """How many modes suffice, one sentence for each mesh and method with several counts.

        A number of modes suffices if with it, and with every larger one of the study, the linear
        receptance and what is told of the harmonic branch, its contacts included, differ by less
        than the tolerance from the reference. Eigenfrequencies are left out: those of residual
        modes are none of the structure. So are peaks, folds and flips if the reference's branch
        does not cover the range.

        Parameters
        ----------
        tolerance : float
            Relative difference that is small enough.
        """
        return [
            self._advised(label, indices, tolerance)
            for label, indices in self.series().items()
            if len(indices) > 1
        ]

    def _advised(self, label: str, indices: Sequence[int], tolerance: float) -> str:
        whole = covers(self.best.spans, self.axis.limits, self.axis)
        unsaid = ("eigenfrequency", *(() if whole else BRANCH_QUANTITIES))
        told = [
            quantity
            for quantity in QUANTITIES
            if quantity not in unsaid
            and any(np.isfinite(getattr(self.errors[i], quantity)) for i in indices)
        ]
        found = {quantity: self.enough(quantity, tolerance, indices) for quantity in told}
        lacking = [QUANTITIES[quantity] for quantity, model in found.items() if model is None]
        share = f"{100 * tolerance:g} %"
        unasked = ""
        if not whole:
            spans = (self.best.spans, [self.axis.limits])
            covered, asked = (spans_in_words(each, self.axis) for each in spans)
            unasked = "; nothing on peaks, folds and flips, as the reference's branch covers "
            unasked += f"{covered} of {asked}"
        if lacking:
            wrong = ", ".join(lacking)
            said = f"advice: {label}: no count of this study suffices for {share} in {wrong}"
            return said + unasked
        modes = {quantity: model.modes for quantity, model in found.items() if model}
        last, most = max(modes.items(), key=lambda each: each[1])
        first = next(self.models[i] for i in indices if self.models[i].modes == most)
        said = (
            f"advice: {label}: {counted_modes(first)} suffice{'s' if most == 1 else ''} for "
            f"{share} in {', '.join(QUANTITIES[quantity] for quantity in told)}"
        )
        if len(set(modes.values())) > 1:
            said += f", of which {QUANTITIES[last]} needs most"
        same = self.same_special_points(indices)
        if not whole:
            said += unasked
        elif same is None:
            said += "; no count has exactly the folds and flips of the reference"
        elif same.modes > most:
            said += f"; for the same folds and flips as the reference {counted_modes(same)}"
        if not self.is_exact(self.best) and self.best.modes < 2 * most:
            said += f". To be sure, repeat with up to {2 * most} modes"
        return said

    def shown(self, index: int, quantity: str) -> str:
        """An error in the table: "-" if unknown, "ref" if that of the reference itself."""
        error = getattr(self.errors[index], quantity)
        if np.isnan(error):
            return "-"
        return "ref" if self.is_own_reference(index, quantity) else f"{error:.1e}"

    def said_of_references(self) -> str:
        """What the models are compared with, and how wrong that is itself."""
        orbit = " and the orbit" if self.reference.orbit else ""
        largest = f"{self.best.label} with {counted_modes(self.best)}"
        if self.is_exact(self.best):
            own = f"{largest} leaves nothing out: the interfaces see no other modes"
        else:
            own = f"how wrong {largest} is itself, only a study with more modes can say"
        return (
            f"reference: {self._whole()} for eigenfrequencies and receptance{orbit}, {largest} for "
            f"the rest; orbits at {self.axis.told(self.at)}\n{own}"
            + (f"\n{self.counted}" if self.counted else "")
        )

    def _whole(self) -> str:
        if self.reference.method == FULL:
            return f"the full model ({counted_modes(self.reference)})"
        if np.isfinite(self.reference_error):
            own = (
                f"its undamped receptance is within {self.reference_error:.1e} of the full model's "
                "but for rounding"
            )
        else:
            own = "without a bound of its error: a mode that it leaves out may lie in the range"
            own += ", or a joint may follow from others" if self.counted else ""
        return f"rubin with {counted_modes(self.reference)} ({own})"

    def said_of(
        self, label: str, indices: Sequence[int], size: Callable[[Measured], str]
    ) -> list[str]:
        """From what size on the errors of a series are small."""
        lines = []
        for quantity, name in QUANTITIES.items():
            if all(np.isnan(getattr(self.errors[index], quantity)) for index in indices):
                continue
            said = []
            for tolerance in SAID:
                model = self.enough(quantity, tolerance, indices)
                place = f"from {size(model)}" if model else "not reached"
                said.append(f"{100 * tolerance:g} % {place}")
            lines.append(f"{label}, {name}: {', '.join(said)}")
        return lines + self.said_of_special_points(label, indices, size)

    def said_of_special_points(
        self, label: str, indices: Sequence[int], size: Callable[[Measured], str]
    ) -> list[str]:
        """From what size on a series has exactly the reference's folds and flips."""
        if all(self.errors[index].counts is None for index in indices):
            return []
        found = self.same_special_points(indices)
        if found is None:
            return [f"{label}: no model has the same folds and flips as the reference"]
        return [f"{label}: the same folds and flips as the reference from {size(found)}"]

    def same_special_points(self, indices: Sequence[int]) -> Measured | None:
        """First model of a series from which on there are exactly the reference's special points.

        As for `enough`, the reference itself proves nothing unless it is exact.
        """
        found = None
        followed = [index for index in indices if self.models[index].special_values is not None]
        for index in reversed(followed):
            if self.is_own_reference(index, "fold_flip"):
                continue
            if self.errors[index].counts != (0, 0):
                break
            found = self.models[index]
        return found


@shows_progress()
def convergence_study(
    components: Mapping[str, Component] | Component,
    setting: LoadCase,
    *,
    modes: Sequence[int] | None = None,
    methods: Sequence[str] = ("rubin",),
    at: float | None = None,
    full: bool = False,
    progress: Progress | None = None,
    jobs: int = 1,
) -> ConvergenceStudy:
    """Compute the same with more and more modes, and compare.

    Parameters
    ----------
    components : ComponentLike, JoinedComponents, or mapping of str to one of these
        The component, or several that are joined; the same on several meshes by name, the finest
        last.
    setting : LoadCase
        What acts on it and what range is asked for.
    modes : sequence of int, optional
        Numbers of kept component modes; by default those of 1 to 10, 12, 16, 20, 30 and 40 that
        every mesh and method can keep. Of joined components each keeps so many, or all it has.
    methods : sequence of str
        Names as for `cms.reduce`. By "macneal" interfaces have no mass, so that there is no
        equation of motion with a stop: only the linear numbers are compared.
    at : float, optional
        Frequency in Hz, or value of the parameter, of the orbits that are compared; by default the
        geometric mean of the range, or its middle if that is not positive.
    full : bool
        Also find the orbit at ``at`` in the full model, with all modes that an interface can
        see, and compare with that; this takes minutes for some hundred modes.
    progress : callable, optional
        Called as ``progress(what, frequency_hz, done)``.
    jobs : int
        Processes that share the models; their number changes nothing but the times.

    Returns
    -------
    ConvergenceStudy

    Raises
    ------
    SystemModelError
        For counts or names that make no sense.
    cms.ReductionError
        As `cms.reduce`.

    Notes
    -----
    The reference is the full model, all modes of the component (of the last one of several) that
    an interface can see, for eigenfrequencies and receptance. Of a component with more than 1500
    degrees of freedom it is a model by Rubin's method with twice the largest count, at least 40
    modes; `cms.accuracy` bounds how far that is from the full one. For the harmonic branch it is
    the model with the most coordinates; of several, the one with the best receptance. Every model
    has the setting's modal damping for all of its modes, also the residual ones, whose damping is
    therefore not that of the full model.
    The harmonic branch is followed downwards from the orbit that a simulation from rest finds at
    the upper end of the range. If it does not come to the lower end, the branch from there is
    followed too, and then the one at ``at`` if both leave that out. Peaks, folds and flips are
    those of all these pieces; they are compared only where the pieces cover the same frequencies
    as those of the reference.
    """
    given = components if isinstance(components, Mapping) else {"": components}
    studied: dict[str, Studied] = {
        name: each if isinstance(each, JoinedComponents) else Alone(each)
        for name, each in given.items()
    }
    if not studied or (modes is not None and not modes) or not methods:
        raise SystemModelError("converge: give at least one component, count and method")
    if at is not None and not setting.limits[0] <= at <= setting.limits[1]:
        raise SystemModelError(f"converge: at must lie in the range, got {at:g}")
    mesh, finest = list(studied.items())[-1]
    if full and finest.dofs > ALL_MODES_UP_TO:
        raise SystemModelError(
            f"converge: full is for components with up to {ALL_MODES_UP_TO} degrees of freedom, "
            f"this one has {finest.dofs}"
        )
    wanted = modes or counts_up_to(min(each.most_modes(methods) for each in studied.values()))
    known = finest.reference(max(wanted))
    if modes is None:
        wanted = [count for count in wanted if count >= known.fewest] or [max(wanted)]
    whole = known.whole
    axis = axis_of(setting, setting.system(whole))
    at = axis.between(*axis.limits, 0.5) if at is None else at
    linear = measured_linear("", FULL if known.full else REFERENCE, whole, setting)
    counts = sorted(set(wanted))
    cases = [
        (name, reduced)
        for name, each in studied.items()
        for method in methods
        for reduced in each.reductions(counts, method)
    ]
    shares = Shares(progress or silent, {str(k): _cost(case[1]) for k, case in enumerate(cases)})
    models = _measured_all(cases, setting, at, shares, jobs)
    best = best_of([model for model in models if model.mesh == mesh], linear)
    if full and best.orbit is not None:
        shares.weigh(FULL, 0.0)
        linear = with_orbit(linear, whole, setting, best.orbit, shares.part(FULL))
    elif full:
        linear = replace(linear, note=f"no orbit at {axis.told(at)}: the largest model has none")
    place, exact = models.index(best), linear.orbit if full else best.orbit
    models = [noted(model, best, exact, axis, at) for model in models]
    best = models[place]
    models.append(linear)
    errors = tuple(errors_of(model, linear, best, full, axis) for model in models)
    error = 0.0 if known.full else receptance_bound(finest, known, linear, setting)
    return ConvergenceStudy(setting, at, axis, tuple(models), errors, best, error, finest.counted)


def if_finite(number: float) -> str:
    """A number of the table, "-" if it is unknown.

    Examples
    --------
    >>> if_finite(1.25), if_finite(float("nan"))
    ('1.25', '-')
    """
    return f"{number:.3g}" if np.isfinite(number) else "-"


def counts_up_to(most: int) -> list[int]:
    """The default numbers of modes up to a largest one.

    Examples
    --------
    >>> counts_up_to(14)
    [1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 12]
    """
    return [count for count in COUNTS if count <= most] or [most]


def _cost(reduced: cms.ReducedModel) -> float:
    """Time to follow a branch of a model, relative to that of others."""
    return ONE_MODE + len(reduced.frequencies_hz)


def _measured_all(
    cases: Sequence[tuple[str, cms.ReducedModel]],
    setting: LoadCase,
    at: float,
    shares: Shares,
    jobs: int,
) -> list[Measured]:
    """What each model answers; those after the first on several processes, if wanted."""
    models: dict[int, Measured] = {}

    def one(number: int) -> None:
        name, reduced = cases[number]
        models[number] = measured(name, reduced, setting, at, shares.part(str(number)))
        shares.end(str(number))

    if cases:
        one(0)  # compiles what the others need
    with own_processes(min(jobs, len(cases) - 1)) as pool:
        if pool is None:
            for number in range(1, len(cases)):
                one(number)
        else:
            task = partial(_measured_case, setting, at)
            for outcome in as_finished(task, cases[1:], pool):
                number = outcome.index + 1
                if outcome.value is None:
                    one(number)  # or the error that it ends with
                    continue
                models[number] = outcome.value
                shares.part(str(number))(models[number].label, 0.0, 1.0)
    return [models[number] for number in range(len(cases))]


def _measured_case(setting: LoadCase, at: float, case: tuple[str, cms.ReducedModel]) -> Measured:
    """As `measured`, in another process."""
    with one_thread():
        return measured(*case, setting, at)
