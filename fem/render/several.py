"""Several components in one picture."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from fem.assembly.component import Component
from fem.base.arrays import FloatArray, IntArray
from fem.base.errors import ModelError
from fem.render.scenery import Block, StopSphere
from fem.render.structure_surface import StructureSurface


@dataclass(frozen=True, eq=False)
class Several:
    """Components that are drawn together, where their meshes lie.

    Parameters
    ----------
    parts
        The components by name, without a dot. Their displacements stand below each other, and
        "arm.tip" is the point "tip" of the component "arm".

    Raises
    ------
    ModelError
        If there are none.

    Examples
    --------
    >>> import fem
    >>> steel = fem.BeamPart(fem.Material(2e11, 7800.0), fem.RectangularSection(0.1, 0.02))
    >>> def arm(start):
    ...     points = {"left": (start, 0), "right": (start + 1, 0)}
    ...     mesh = fem.frame_mesh(points, [("arm", "left", "right", 4)])
    ...     return fem.assemble(fem.StructureModel(mesh, {"arm": steel}, plane=True))
    >>> Several({"one": arm(0), "other": arm(1)})
    <Several: one, other; 30 degrees of freedom>
    """

    parts: Mapping[str, Component]

    def __post_init__(self) -> None:
        if not self.parts:
            raise ModelError("there are no components to draw")

    def __repr__(self) -> str:
        return f"<Several: {', '.join(self.parts)}; {len(self.free)} degrees of freedom>"

    @property
    def free(self) -> IntArray:
        """Indices of the free degrees of freedom, (N,)."""
        return np.arange(sum(len(part.free) for part in self.parts.values()))

    @property
    def source(self) -> str:
        """Where the meshes come from."""
        return " + ".join(dict.fromkeys(part.model.mesh.source for part in self.parts.values()))

    def pieces(self, u: FloatArray) -> dict[str, FloatArray]:
        """The displacements (N,) of each component."""
        ends = np.cumsum([len(part.free) for part in self.parts.values()])
        return dict(zip(self.parts, np.split(u, ends[:-1]), strict=True))

    def shape(self, u: FloatArray) -> dict[str, FloatArray]:
        """What ``shape`` of each component gives."""
        return {name: self.parts[name].shape(piece) for name, piece in self.pieces(u).items()}


@dataclass(frozen=True, eq=False)
class SeveralSurfaces:
    """The surfaces of several components, point after point.

    Parameters
    ----------
    component
        The components.
    parts
        The surface of each.
    """

    component: Several
    parts: Mapping[str, StructureSurface]

    def place(
        self, u: FloatArray, scale: float = 1.0, shrinkage: float = 1.0
    ) -> tuple[FloatArray, FloatArray]:
        """Points (P, 3) and displacements (P,) as those of one surface."""
        pieces = self.component.pieces(u)
        placed = [part.place(pieces[name], scale, shrinkage) for name, part in self.parts.items()]
        points, sizes = zip(*placed, strict=True)
        return np.concatenate(points), np.concatenate(sizes)

    def faces(self) -> list[IntArray]:
        """Arrays of polygons, each of shape (f, number of corners)."""
        return [faces + first for part, first in self._begun for faces in part.faces()]

    def edges(self) -> list[IntArray]:
        """Arrays of index pairs of the sharp edges, each of shape (f, 2)."""
        return [edges + first for part, first in self._begun for edges in part.edges()]

    @cached_property
    def _begun(self) -> list[tuple[StructureSurface, int]]:
        """Each surface with the index of its first point."""
        begun, first = [], 0
        for part in self.parts.values():
            begun.append((part, first))
            first += len(part.place(np.zeros(len(part.component.free)))[1])
        return begun


Surface = StructureSurface | SeveralSurfaces


def stops_at(name: str, stops: Sequence[StopSphere]) -> list[StopSphere]:
    """The stops of a component as it knows them, without those of others.

    Examples
    --------
    >>> stop = StopSphere("arm.tip", 0.01, (0.0, 1.0), 0.0)
    >>> [each.point for each in stops_at("arm", [stop])], stops_at("tool", [stop])
    (['tip'], [])
    """
    return [
        replace(stop, point=stop.point.removeprefix(f"{name}."))
        for stop in stops
        if stop.point.startswith(f"{name}.")
    ]


@dataclass(frozen=True, eq=False)
class OfPart:
    """A lumped mass of one of several components."""

    name: str
    block: Block

    @property
    def solid(self) -> Any:
        """What is drawn."""
        return self.block.solid

    def move(self, shapes: Mapping[str, FloatArray], scale: float) -> None:
        """Shift and turn it with its node, by ``shape`` of all components."""
        self.block.move(shapes[self.name], scale)
