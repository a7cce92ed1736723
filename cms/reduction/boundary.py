"""Interfaces whose residual flexibility has no mass: a massless boundary."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from cms.base.arrays import FloatArray
from cms.base.errors import ReductionError
from cms.component.component import Pencil
from cms.reduction.area import Area
from cms.reduction.inertia import elastic_solutions
from cms.reduction.model import ReducedModel
from cms.reduction.residual import DEPENDENCE_TOLERANCE, ResidualModes, without_modes
from cms.solvers.eigen import Shifted

FEW = 8  # interfaces that are named one by one


def massless_boundary(
    pencil: Pencil, shifted: Shifted, modes: FloatArray, extra: ResidualModes, names: Sequence[str]
) -> FloatArray:
    """Shapes (N, m) under unit forces at some interfaces that modes with mass leave out.

    They are K-orthogonal to the kept modes (N, k) and to the residual modes of the others, so that
    a force at one of the others moves the named ones by the modes alone. Columns of the others are
    zero, but for what of them has no mass by itself.

    Raises
    ------
    ReductionError
        If nothing is left of the flexibility of a named one.
    """
    places = [pencil.names.index(name) for name in names]
    static = elastic_solutions(pencil, shifted, pencil.loads[:, places])
    left = without_modes(static, modes, pencil)
    taken = np.column_stack([extra.vectors / np.sqrt(extra.squares), extra.massless])
    for _ in range(2):
        left = left - taken @ (taken.T @ pencil.forces(left))
    for name, energy, whole in zip(
        names, np.diag(pencil.energies(left)), np.diag(pencil.energies(static)), strict=True
    ):
        if energy <= DEPENDENCE_TOLERANCE * whole:
            raise ReductionError(
                f"nothing is left of the flexibility of '{name}' that has no mass: all of it is in "
                "the modes, and in those of the interfaces with mass"
            )
    shapes = extra.massless @ (extra.massless.T @ pencil.loads)
    shapes[:, places] += left
    return shapes


def with_flexibility(model: ReducedModel, pencil: Pencil, shapes: FloatArray) -> ReducedModel:
    """The model with the massless flexibility of shapes (N, m) under unit forces.

    Between shapes of which one is zero there is none, not its rounding.
    """
    flexibility = pencil.loads.T @ shapes
    moved = np.any(shapes != 0.0, axis=0)
    flexibility = np.where(np.outer(moved, moved), (flexibility + flexibility.T) / 2, 0.0)
    return replace(model, residual_flexibility=flexibility, residual_shapes=shapes)


def massless_names(
    massless: Sequence[str], method: str, names: Sequence[str], areas: Mapping[str, Area]
) -> list[str]:
    """Interfaces of a massless boundary, of which areas may be named for all of their points.

    Raises
    ------
    ReductionError
        If it cannot be of these interfaces.
    """
    if method != "macneal":
        raise ReductionError(f"massless is for method 'macneal', not '{method}'")
    if isinstance(massless, str):
        raise ReductionError(f"massless must be a list of interfaces, got '{massless}'")
    if not massless:
        raise ReductionError("massless names no interface: without any it is method 'rubin'")
    points = {point: area for area, of in areas.items() for point in of.points}
    found: list[str] = []
    for name in massless:
        if name in areas:
            found += areas[name].points
            continue
        if name not in names:
            known = ", ".join(names) or "none"
            raise ReductionError(f"massless: there is no interface '{name}' (there are: {known})")
        if name in points:
            raise ReductionError(
                f"massless: '{name}' is a point of area '{points[name]}': name the area, whose "
                "points have mass together or none"
            )
        found.append(name)
    if len(set(found)) < len(found):
        raise ReductionError("massless names an interface twice")
    return found


def told_of_massless(reduced: ReducedModel) -> list[str]:
    """A sentence on the interfaces without mass, and how much they move each other at once."""
    G = reduced.residual_flexibility
    if G is None or not np.any(G):
        return []
    own = np.sqrt(np.diag(G))
    bare = [name for name, size in zip(reduced.interfaces, own, strict=True) if size > 0.0]
    share = np.abs(G) / np.where(np.outer(own, own) > 0.0, np.outer(own, own), 1.0)
    most = 100.0 * float(np.max(share - np.diag(np.diag(share))))
    told = ", ".join(bare) if len(bare) <= FEW else f"{len(bare)}, '{bare[0]}' to '{bare[-1]}'"
    return [
        f"interfaces without mass: {told}"
        + (f"; of what has none at most {most:.2g} % is common to two" if len(bare) > 1 else "")
    ]
