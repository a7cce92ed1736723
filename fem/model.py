"""What a plane frame is made of: materials, sections, supports, masses, springs, hinges."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from fem.attachments import (
    DIRECTIONS,
    Attachments,
    PointMass,
    PointSpring,
    known_direction,
    plane_direction,
    vector,
)
from fem.element_types import check_family, counted
from fem.errors import ModelError, by_name, check_positive, is_finite, listed, quoted
from fem.mesh import FrameMesh, IntArray
from fem.sections import CircularSection, CrossSection, SectionRun, TaperedSection

THEORIES = ("euler-bernoulli", "timoshenko")


@dataclass(frozen=True)
class Material:
    """A linear elastic material.

    Parameters
    ----------
    youngs_modulus
        E in N/m².
    density
        rho in kg/m³.
    poissons_ratio
        nu; solids, Timoshenko beams and beams in space need it.

    Examples
    --------
    >>> Material(2.1e11, 7746.0).density
    7746.0
    """

    youngs_modulus: float
    density: float
    poissons_ratio: float | None = None

    def __post_init__(self) -> None:
        check_positive("material", youngs_modulus=self.youngs_modulus, density=self.density)
        nu = self.poissons_ratio
        if nu is not None and not (is_finite(nu) and -1.0 < nu < 0.5):
            raise ModelError(f"material: poissons_ratio must be above -1 and below 0.5, not {nu!r}")

    def poissons_ratio_for(self, what: str) -> float:
        """Poisson's ratio, or a ModelError that says what needs it."""
        if self.poissons_ratio is None:
            raise ModelError(f"{what}: its material needs a poissons_ratio")
        return self.poissons_ratio


@dataclass(frozen=True)
class BeamPart:
    """Material and cross-section of a part of the mesh, and how it acts as a beam.

    Parameters
    ----------
    material, section
        What it is made of; the section is a `CrossSection` or a `TaperedSection`.
    theory
        "euler-bernoulli", or "timoshenko" with shear deformation and rotary inertia.
    axial_force
        In N, positive for tension: a preload, which adds its geometric stiffness.
    orientation
        In space: direction of the section's height, any vector not along the beam; only its part
        across the beam counts. By default the height lies in planes z = constant as in a plane
        frame, which beams along z cannot do.
    offset
        In space: place (along the height, along the width) in m of the beam's axis as seen from
        the line between its nodes, for eccentric connections.
    """

    material: Material
    section: Any
    theory: str = "euler-bernoulli"
    axial_force: float = 0.0
    orientation: Sequence[float] | None = None
    offset: Sequence[float] = (0.0, 0.0)

    def __post_init__(self) -> None:
        if not isinstance(self.material, Material):
            raise ModelError(f"part: material must be a Material, not {self.material!r}")
        if not isinstance(self.section, TaperedSection | SectionRun):
            self._check_section(self.section)
        if self.theory not in THEORIES:
            raise ModelError(f"part: theory must be one of {quoted(THEORIES)}, not {self.theory!r}")
        if not is_finite(self.axial_force):
            raise ModelError(f"part: axial_force must be finite, not {self.axial_force!r}")
        object.__setattr__(self, "offset", vector("part: offset", self.offset, 2))
        if self.orientation is not None:
            object.__setattr__(
                self, "orientation", vector("part: orientation", self.orientation, 3)
            )
            if not any(self.orientation):
                raise ModelError("part: orientation must not be the zero vector")

    @staticmethod
    def _check_section(section: CrossSection) -> None:
        if not (hasattr(section, "area") and hasattr(section, "second_moment")):
            raise ModelError(
                f"part: section must have an area and a second_moment, not be {section!r}"
            )
        check_positive("section", area=section.area, second_moment=section.second_moment)


@dataclass(frozen=True)
class TrussPart:
    """A part of the mesh that is a truss: its lines stretch, and neither bend nor twist.

    Its nodes have no rotation. A line of three nodes has a quadratic displacement; its middle node
    is held across it by nothing.

    Parameters
    ----------
    material
        What it is made of; a Poisson's ratio is not needed.
    area
        Of the cross-section, in m².

    Examples
    --------
    >>> TrussPart(Material(2.1e11, 7800.0), area=1e-4).section
    CircularSection(diameter=0.011283791670955126, bore=0.0)
    """

    material: Material
    area: float

    def __post_init__(self) -> None:
        if not isinstance(self.material, Material):
            raise ModelError(f"part: material must be a Material, not {self.material!r}")
        check_positive("truss part", area=self.area)

    @property
    def section(self) -> CircularSection:
        """The round bar of this area, as which it is drawn."""
        return CircularSection(2.0 * math.sqrt(self.area / math.pi))


@dataclass(frozen=True)
class Support:
    """Directions of a point that are held: any of "x", "y", "rotation".

    A clamp holds all three; a plane of symmetry normal to x holds ("x", "rotation"). In a
    structure there are also "z", "rotation_x", "rotation_y" and "rotation_z" (the same as
    "rotation"), and the point may be a face; nodes of solids have no rotation to hold.

    Examples
    --------
    >>> Support("foot", ("x", "y", "rotation")).directions
    ('x', 'y', 'rotation')
    >>> Support("end", "y").directions
    ('y',)
    """

    point: str
    directions: Sequence[str]

    def __post_init__(self) -> None:
        owner = f"support at {self.point!r}"
        given = (self.directions,) if isinstance(self.directions, str) else self.directions
        if not isinstance(given, Sequence):
            raise ModelError(f"{owner}: directions must be a list of names, not {given!r}")
        object.__setattr__(self, "directions", tuple(given))
        if not given:
            raise ModelError(f"{owner}: no direction is held")
        for name in given:
            known_direction(owner, name)
            if given.count(name) > 1:
                raise ModelError(f"{owner}: direction {name!r} is given twice")


@dataclass(frozen=True)
class Hinge:
    """A rotary joint: the named part keeps its own rotation at the point.

    The parts without a hinge there share the rotation of the point, on which supports, springs,
    inertias and interfaces act.
    """

    point: str
    part: str


@dataclass(frozen=True)
class Interface:
    """A point and direction ("x", "y", "rotation", ...) at which others may push and watch."""

    point: str
    direction: str

    def __post_init__(self) -> None:
        known_direction(f"interface at {self.point!r}", self.direction)


LISTS = {"supports": Support, "point_masses": PointMass, "springs": PointSpring, "hinges": Hinge}
TABLES: dict[str, tuple[object, str]] = {
    "parts": (BeamPart | TrussPart, "BeamPart and TrussPart"),
    "interfaces": (Interface, "Interface"),
}


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
        if np.ptp(z) > 1e-9 * np.ptp(self.mesh.points, axis=0).max():
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
            if isinstance(part, BeamPart) and (part.orientation is not None or any(part.offset)):
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
        for what, items in (("coupling", brought.couplings), ("equation", brought.equations)):
            if items:
                raise ModelError(
                    f"{self.mesh.source}: the file has couplings or linear equations ({len(items)}"
                    f" of the kind {what}), which a plane frame does not have; use a StructureModel"
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
