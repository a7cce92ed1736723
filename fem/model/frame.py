"""What a plane frame is made of: materials, sections, supports, masses, springs, hinges."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
import numpy.typing as npt

from fem.base.arrays import IntArray
from fem.base.errors import ModelError, by_name, listed, quoted
from fem.mesh.attachments import (
    DIRECTIONS,
    Attachments,
    PointMass,
    PointSpring,
    Support,
    plane_direction,
)
from fem.mesh.element_types import check_family, counted
from fem.mesh.frame_mesh import FrameMesh
from fem.model.parts import BeamPart, TrussPart
from fem.model.supports import Hinge, Interface

LISTS = {"supports": Support, "point_masses": PointMass, "springs": PointSpring, "hinges": Hinge}
TABLES: dict[str, tuple[object, str]] = {
    "parts": (BeamPart | TrussPart, "BeamPart and TrussPart"),
    "interfaces": (Interface, "Interface"),
}
OUT_OF_PLANE = 1e-9  # of the frame: height of a plane one


@dataclass(frozen=True, eq=False)
class FrameModel:
    """A plane frame in the x-y plane: a mesh and everything attached to it.

    Parameters
    ----------
    mesh
        The line mesh; z must be the same at all nodes.
    parts
        Material and section by the name of the mesh part. Every element belongs to one of them.
    supports, point_masses, springs, hinges
        What holds, loads and joins the named points of the mesh.
    interfaces
        The named directions that a reduction keeps and a load may act on.
    separate
        Whether nodes at one place may belong to pieces that nothing joins; else `fem.assemble`
        refuses such pieces.

    Raises
    ------
    ModelError
        If something is not of its kind, a name is not in the mesh, an element belongs to no part
        or to two, z varies, a hinge joins nothing, or an interface is on a supported direction.

    Examples
    --------
    >>> import fem
    >>> mesh = fem.frame_mesh({"root": (0, 0), "tip": (1, 0)}, [("arm", "root", "tip", 4)])
    >>> model = fem.FrameModel(
    ...     mesh,
    ...     parts={"arm": fem.BeamPart(fem.Material(2.1e11, 7800.0), fem.CircularSection(0.02))},
    ...     supports=[fem.Support("root", ("x", "y", "rotation"))],
    ...     interfaces={"tip": fem.Interface("tip", "y")},
    ... )
    >>> fem.assemble(model).stiffness.shape
    (12, 12)
    """

    mesh: FrameMesh
    parts: Mapping[str, BeamPart | TrussPart]
    supports: Sequence[Support] = ()
    point_masses: Sequence[PointMass] = ()
    springs: Sequence[PointSpring] = ()
    hinges: Sequence[Hinge] = ()
    interfaces: Mapping[str, Interface] = field(default_factory=dict)
    separate: bool = False

    def __post_init__(self) -> None:
        if not isinstance(self.mesh, FrameMesh):
            raise ModelError(f"model: mesh must be a FrameMesh, not {self.mesh!r}")
        for name, kind in LISTS.items():
            given = getattr(self, name)
            object.__setattr__(self, name, listed(self.mesh.source, name, given, kind))
        for name, (sort, words) in TABLES.items():
            given, words = getattr(self, name), f"of {words} by name"
            object.__setattr__(self, name, by_name(self.mesh.source, name, given, sort, words))
        self._check_plane()
        self._check_spatial()
        self._check_points()
        self._check_parts()
        self._check_hinges()
        self._check_turns()
        self._check_interfaces()

    @cached_property
    def attached(self) -> Attachments:
        """Masses and links: of the mesh's file, and the model's own."""
        return self.mesh.attachments + Attachments(self.point_masses)

    def element_parts(self) -> dict[str, IntArray]:
        """Element indices of every part of the model."""
        return {name: self.mesh.part(name) for name in self.parts}

    @cached_property
    def turning(self) -> npt.NDArray[np.bool_]:
        """Whether each node has a rotation, because a beam meets it, shape (n,)."""
        found = np.zeros(len(self.mesh.points), dtype=np.bool_)
        for name, elements in self.element_parts().items():
            if isinstance(self.parts[name], BeamPart):
                found[self.mesh.lines[elements]] = True
        return found

    @property
    def links(self) -> IntArray:
        """Pairs of nodes that are joined, shape (m, 2)."""
        joined = [link.points for link in self.attached.links if link.second is not None]
        pairs = [[self.mesh.node(point) for point in points] for points in joined]
        return np.concatenate([self.mesh.lines, np.array(pairs, dtype=np.int64).reshape(-1, 2)])

    def _check_plane(self) -> None:
        z = self.mesh.points[:, 2]
        if np.ptp(z) > OUT_OF_PLANE * np.ptp(self.mesh.points, axis=0).max():
            raise ModelError(
                f"{self.mesh.source}: a plane frame needs one z at all nodes,"
                f" but z runs from {z.min():g} to {z.max():g}"
            )

    def _check_spatial(self) -> None:
        """Refuse what only a structure in space has."""
        named = [(f"support at {s.point!r}", d) for s in self.supports for d in s.directions]
        named += [(f"spring at {spring.point!r}", spring.direction) for spring in self.springs]
        named += [(f"interface {name!r}", i.direction) for name, i in self.interfaces.items()]
        for owner, direction in named:
            if direction not in DIRECTIONS:
                raise ModelError(
                    f"{self.mesh.source}: {owner}: a plane frame has no direction {direction!r};"
                    f" use {quoted(DIRECTIONS)}, or a StructureModel"
                )
        self._check_attached()
        for name, part in self.parts.items():
            if isinstance(part, BeamPart) and _is_spatial(part):
                raise ModelError(
                    f"{self.mesh.source}: part {name!r} has an orientation or an offset, which a"
                    " plane frame does not have; use a StructureModel"
                )
        for lump in self.point_masses:
            if any(lump.offset) or isinstance(lump.rotary_inertia, tuple):
                raise ModelError(
                    f"{self.mesh.source}: the point mass at {lump.point!r} has an offset or three"
                    " rotary inertias, which a plane frame does not have; use a StructureModel"
                )

    def _check_attached(self) -> None:
        """Refuse what the file of the mesh attaches and a plane frame does not have."""
        brought = self.mesh.attachments
        spatial = {
            "coupling": brought.couplings,
            "equation": brought.equations,
            "matrix": brought.matrices,
            "support": brought.supports,
        }
        for what, items in spatial.items():
            if items:
                raise ModelError(
                    f"{self.mesh.source}: the file has couplings, linear equations, matrices or"
                    f" supports ({len(items)} of the kind {what}), which a plane frame does not"
                    " take from it; use a StructureModel"
                )
        for link in brought.links:
            for direction in link.directions or ():
                if plane_direction(direction) not in DIRECTIONS:
                    raise ModelError(
                        f"{self.mesh.source}: the link at {link.first!r} acts in direction"
                        f" {direction!r}, which a plane frame does not have; use a StructureModel"
                    )

    def _check_points(self) -> None:
        for support in self.supports:
            self.mesh.nodes(support.point)
        names = [lump.point for lump in self.attached.point_masses]
        names += [point for link in self.attached.links for point in link.points]
        names += [spring.point for spring in self.springs]
        names += [hinge.point for hinge in self.hinges]
        names += [interface.point for interface in self.interfaces.values()]
        for name in names:
            self.mesh.node(name)

    def _check_parts(self) -> None:
        groups = self.element_parts()
        owners = np.zeros(len(self.mesh.lines), dtype=np.int64)
        for name, elements in groups.items():
            owners[elements] += 1
            what = f"{self.mesh.source}: part {name!r}"
            check_family(what, self.parts[name], counted(self.mesh.element_types, elements))
        bare = np.flatnonzero(owners == 0)
        if len(bare):
            raise ModelError(
                f"{self.mesh.source}: element {bare[0]} is in no part of the model,"
                f" whose parts are {quoted(groups)} (the mesh has {quoted(self.mesh.parts)})"
            )
        shared = np.flatnonzero(owners > 1)
        if len(shared):
            both = [name for name, elements in groups.items() if shared[0] in elements]
            raise ModelError(
                f"{self.mesh.source}: element {shared[0]} is in more than one part: {quoted(both)}"
            )

    def _check_hinges(self) -> None:
        twice = [hinge for hinge, count in Counter(self.hinges).items() if count > 1]
        if twice:
            raise ModelError(
                f"{self.mesh.source}: the hinge of part {twice[0].part!r}"
                f" at {twice[0].point!r} is given twice"
            )
        for hinge in self.hinges:
            self._check_hinge(hinge)

    def _check_turns(self) -> None:
        """Refuse what acts on a rotation where only trusses meet."""
        named = [
            (f"point mass at {lump.point!r}", lump.point)
            for lump in self.attached.point_masses
            if np.any(lump.rotary_inertia)
        ]
        named += [
            (f"link at {link.first!r}", point)
            for link in self.attached.links
            for point, way in zip(link.points, link.directions or (), strict=False)
            if plane_direction(way) == "rotation"
        ]
        named += [
            (f"spring at {spring.point!r}", spring.point)
            for spring in self.springs
            if spring.direction == "rotation"
        ]
        named += [
            (f"interface {name!r}", interface.point)
            for name, interface in self.interfaces.items()
            if interface.direction == "rotation"
        ]
        for owner, point in named:
            if not self.turning[self.mesh.node(point)]:
                raise ModelError(
                    f"{self.mesh.source}: {owner} acts on a rotation, but only trusses meet at"
                    f" {point!r}, which have none"
                )

    def _check_hinge(self, hinge: Hinge) -> None:
        if isinstance(self.parts.get(hinge.part), TrussPart):
            raise ModelError(
                f"{self.mesh.source}: the hinge at {hinge.point!r} is of part {hinge.part!r}, a"
                " truss, which turns freely at its ends without one"
            )
        meeting = self._parts_at(hinge.point)
        if hinge.part not in meeting:
            raise ModelError(
                f"{self.mesh.source}: no part {hinge.part!r} of the model meets the hinge"
                f" at {hinge.point!r}; there are {quoted(meeting)}"
            )
        hinged = {other.part for other in self.hinges if other.point == hinge.point}
        if not set(meeting) - hinged:
            raise ModelError(
                f"{self.mesh.source}: all parts at {hinge.point!r} are hinged there"
                f" ({quoted(meeting)}), so that none is left to turn with the point"
            )

    def _parts_at(self, point: str) -> list[str]:
        node = self.mesh.node(point)
        return [
            name
            for name, elements in self.element_parts().items()
            if isinstance(self.parts[name], BeamPart) and (self.mesh.lines[elements] == node).any()
        ]

    def _check_interfaces(self) -> None:
        held = {
            (int(node), direction)
            for support in self.supports
            for node in self.mesh.nodes(support.point)
            for direction in support.directions
        }
        for name, interface in self.interfaces.items():
            if (self.mesh.node(interface.point), interface.direction) in held:
                raise ModelError(
                    f"{self.mesh.source}: interface {name!r} is on direction"
                    f" {interface.direction!r} of point {interface.point!r},"
                    " which a support holds"
                )


def _is_spatial(part: BeamPart) -> bool:
    """Whether a beam has what only a structure in space has."""
    spatial = part.orientation, part.end_offsets, part.released
    return any((*part.offset, *part.neutral_axis)) or any(value is not None for value in spatial)
