"""What a convergence study reduces: one component, or several that are joined."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from typing import Protocol

import numpy as np

import cms
from nldyn.base.arrays import Real
from nldyn.base.errors import SystemModelError
from nldyn.reduction.load_case import LoadCase
from nldyn.reduction.model_errors import (
    GRID,
    Measured,
    most_modes,
    reductions,
    reference_model,
)
from nldyn.system.naming import quoted

ALL_MODES_UP_TO = 1500  # degrees of freedom; of larger ones the reference is reduced, too


@dataclass(frozen=True, eq=False)
class Reference:
    """The largest model of what is studied.

    Parameters
    ----------
    whole : cms.ReducedModel
        The model.
    full : bool
        Whether it leaves nothing out.
    fewest : int
        Modes that each component must keep: its rigid-body modes.
    parts : dict of str to cms.ReducedModel
        The models of the components, of one alone without a name.
    """

    whole: cms.ReducedModel
    full: bool
    fewest: int
    parts: Mapping[str, cms.ReducedModel]


class Studied(Protocol):
    """What a study asks of what it reduces."""

    @property
    def dofs(self) -> int:
        """Degrees of freedom."""

    @property
    def counted(self) -> str:
        """What the number of modes of a model means, where that is not plain."""

    def most_modes(self, methods: Sequence[str]) -> int:
        """How many modes can be kept by every one of some methods."""

    def reductions(self, counts: Sequence[int], method: str) -> list[cms.ReducedModel]:
        """Models with ascending counts, each larger than the one before."""

    def reference(self, modes: int) -> Reference:
        """The full model; of a large component one with more modes than a study's largest."""

    def receptance_error(self, known: Reference, grid: Real, at: str) -> Real:
        """Band (f, 2) of the error of the undamped receptance of a reduced reference."""


@dataclass(frozen=True, eq=False)
class Alone:
    """One component."""

    component: cms.ComponentLike
    counted: str = ""

    @property
    def dofs(self) -> int:
        """As `Studied.dofs`."""
        return int(self.component.mass.shape[0])

    def most_modes(self, methods: Sequence[str]) -> int:
        """As `Studied.most_modes`."""
        return most_modes(self.component, methods)

    def reductions(self, counts: Sequence[int], method: str) -> list[cms.ReducedModel]:
        """As `Studied.reductions`."""
        return reductions(self.component, counts, method)

    def reference(self, modes: int) -> Reference:
        """As `Studied.reference`."""
        full = self.dofs <= ALL_MODES_UP_TO
        whole = reference_model(self.component, modes, full)
        return Reference(whole, full, whole.rigid_body_modes, {"": whole})

    def receptance_error(self, known: Reference, grid: Real, at: str) -> Real:
        """As `Studied.receptance_error`."""
        return cms.accuracy(self.component, known.whole).receptance_error(grid, at, at)


@dataclass(frozen=True, eq=False)
class JoinedComponents:
    """Several components that are reduced each by itself and joined, for a `convergence_study`.

    Parameters
    ----------
    components : dict of str to ComponentLike
        Those that are reduced, by name. A study raises the numbers of modes of all of them
        together; a component that has fewer keeps all it has.
    joints : sequence of cms.Joint
        What holds them together, as for `cms.couple`.
    kept : dict of str to cms.ReducedModel
        Further components, which stay as they are in all models, also in the reference.

    Raises
    ------
    SystemModelError
        If no component is left to be reduced, or one is named twice.

    Examples
    --------
    >>> import numpy as np, cms
    >>> K = 2.0 * np.eye(9) - np.eye(9, k=1) - np.eye(9, k=-1)
    >>> half = cms.Matrices(K, np.eye(9), {"end": np.eye(9)[-1]})
    >>> JoinedComponents({"a": half, "b": half}, [cms.Joint(("a", "end"), ("b", "end"))])
    <JoinedComponents 'a', 'b', 1 joint>
    """

    components: Mapping[str, cms.ComponentLike]
    joints: Sequence[cms.Joint]
    kept: Mapping[str, cms.ReducedModel] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if not self.components:
            raise SystemModelError("joined components: none is given that can be reduced")
        if twice := sorted(set(self.components) & set(self.kept)):
            raise SystemModelError(
                f"joined components: '{twice[0]}' cannot be both reduced and kept as it is"
            )

    def __repr__(self) -> str:
        """One line: the names, and how many joints."""
        joints = f"{len(self.joints)} joint{'' if len(self.joints) == 1 else 's'}"
        return f"<JoinedComponents {quoted([*self.components, *self.kept])}, {joints}>"

    @property
    def dofs(self) -> int:
        """Degrees of freedom of all components together."""
        sizes = [component.mass.shape[0] for component in self.components.values()]
        return sum(map(int, [*sizes, *(model.basis.shape[0] for model in self.kept.values())]))

    @property
    def counted(self) -> str:
        """What the number of modes of a model means."""
        said = f"modes are counted in each component ({quoted(self.components)}); one with fewer "
        said += "keeps all that it has"
        if len(self.components) == 1:
            said = f"modes are counted in the component {quoted(self.components)}"
        if self.kept:
            said += f"; the same in all models: {quoted(self.kept)}"
        return said

    def most_modes(self, methods: Sequence[str]) -> int:
        """Modes of the component that has most, by the method that can keep fewest."""
        return max(most_modes(component, methods) for component in self.components.values())

    def reductions(self, counts: Sequence[int], method: str) -> list[cms.ReducedModel]:
        """Models with ascending counts, without those that are like the one before.

        Raises
        ------
        cms.ReductionError
            As `cms.reduce` and `cms.couple`, and if no component has so many modes.
        """
        most = self.most_modes((method,))
        if counts[-1] > most:
            raise cms.ReductionError(
                f"modes = {counts[-1]}, but of the components that are reduced none has more than "
                f"{most} by '{method}'"
            )
        ladders = {}
        for name, component in self.components.items():
            most = most_modes(component, (method,))
            with told_of(name):
                ladders[name] = reductions(
                    component, sorted({min(count, most) for count in counts}), method
                )
        rungs: dict[tuple[int, ...], dict[str, cms.ReducedModel]] = {}
        for count in counts:
            parts = {name: last_up_to(count, models) for name, models in ladders.items()}
            rungs.setdefault(tuple(part.modes for part in parts.values()), parts)
        return [self.joined(parts, method) for parts in rungs.values()]

    def joined(self, parts: Mapping[str, cms.ReducedModel], method: str) -> cms.ReducedModel:
        """The whole, told by its parts: their method, and the most modes that one keeps."""
        whole = cms.couple({**parts, **self.kept}, self.joints)
        return replace(whole, method=method, modes=max(part.modes for part in parts.values()))

    def reference(self, modes: int) -> Reference:
        """All modes of the components together; of large ones more than a study's largest."""
        full = self.dofs <= ALL_MODES_UP_TO
        parts = {}
        for name, component in self.components.items():
            with told_of(name):
                parts[name] = reference_model(component, modes, full)
        whole = self.joined(parts, next(iter(parts.values())).method)
        if full:
            whole = replace(whole, modes=whole.size)
        fewest = max(part.rigid_body_modes for part in parts.values())
        return Reference(whole, full, fewest, parts)

    def receptance_error(self, known: Reference, grid: Real, at: str) -> Real:
        """As `Studied.receptance_error`; what is kept counts as exact."""
        try:
            errors = {
                name: cms.accuracy(component, known.parts[name])
                for name, component in self.components.items()
            }
            for name, model in self.kept.items():
                m = len(model.interfaces)
                errors[name] = cms.Accuracy(model, np.inf, np.zeros((m, m)))
            band = cms.coupled_accuracy(errors, self.joints).receptance_band(grid, at, at)
        except cms.ReductionError:  # joints that follow from others
            return np.full((len(grid), 2), np.inf)
        return np.asarray(band - np.real(known.whole.receptance(grid, at, at))[:, None])


def receptance_bound(
    studied: Studied, known: Reference, linear: Measured, setting: LoadCase
) -> float:
    """Bound of the error of a reference's undamped receptance over the range, as in `Errors`."""
    observed = setting.observe or known.whole.interfaces[0]
    grid = np.linspace(*setting.range_hz, GRID)
    band = studied.receptance_error(known, grid, observed)
    return float(np.linalg.norm(np.abs(band).max(axis=1)) / np.linalg.norm(linear.receptance))


def last_up_to(count: int, models: Sequence[cms.ReducedModel]) -> cms.ReducedModel:
    """The largest of some models with up to so many modes; they ascend."""
    return [model for model in models if model.modes <= count][-1]


@contextmanager
def told_of(name: str) -> Iterator[None]:
    """Tell a fault of one component with its name."""
    try:
        yield
    except cms.ReductionError as error:
        raise cms.ReductionError(f"component '{name}': {error}") from None
