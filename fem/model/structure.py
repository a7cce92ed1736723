"""What a structure is made of: solids, shells and beams, and what joins them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
import numpy.typing as npt

from fem.base.arrays import FloatArray, IntArray
from fem.base.errors import ModelError, by_name, listed, quoted
from fem.mesh.attachments import Attachments, Coupling, PointMass, PointSpring, Support
from fem.mesh.cells import KINDS, SPANS, CellKind, all_facets, facet_keys
from fem.mesh.doubled import check_no_doubles
from fem.mesh.element_types import check_family, counted, integration
from fem.mesh.lost import check_nothing_lost
from fem.mesh.shell_centres import with_centres
from fem.mesh.shell_facets import facets_of, shell_kinds
from fem.mesh.structure_mesh import StructureMesh
from fem.model.parts import BeamPart, ShellPart, SolidPart, TrussPart
from fem.model.supports import Foundation, Hinge, Interface

AXES = ("x", "y", "z", "rotation_x", "rotation_y", "rotation_z")
"""The six directions of a node, in the order of `Component.shape`."""
IN_PLANE = ("x", "y", "rotation_z")
NO_LENGTH = 1e-12  # of the mesh: so short, a beam has no direction
OUT_OF_PLANE = 1e-9  # of the mesh: height of a plane one


def axis_index(direction: str) -> int:
    """Position of a direction among the six of a node; "rotation" is about z.

    Examples
    --------
    >>> axis_index("y"), axis_index("rotation")
    (1, 5)
    """
    return AXES.index("rotation_z" if direction == "rotation" else direction)


Part = BeamPart | TrussPart | SolidPart | ShellPart

LISTS = {
    "supports": Support,
    "point_masses": PointMass,
    "springs": PointSpring,
    "hinges": Hinge,
    "couplings": Coupling,
    "foundations": Foundation,
}
TABLES: tuple[tuple[str, object, str], ...] = (
    ("parts", Part, "BeamPart, TrussPart, SolidPart and ShellPart"),
    ("interfaces", Interface, "Interface"),
)


@dataclass(frozen=True, eq=False)
class SolidCells:
    """Cells of one kind in one solid part that are integrated alike.

    Parameters
    ----------
    name, part
        The part.
    kind
        The kind of cell.
    nodes
        Of the cells, shape (e, b).
    reduced
        Whether they are integrated at 2 places in each direction.
    numbers
        Which cells of the kind in the part they are, shape (e,).
    """

    name: str
    part: SolidPart
    kind: CellKind
    nodes: IntArray
    reduced: bool
    numbers: IntArray


@dataclass(frozen=True, eq=False)
class StructureModel:
    """A structure of solids, shells and beams: a mesh and everything attached to it.

    Parameters
    ----------
    mesh
        A mesh with all kinds of cells. Here shells of ``quad8`` get a node in the middle of each
        cell, after those of the mesh.
    parts
        By the name of the group of cells: `SolidPart` for bodies, `ShellPart` for triangles and
        quadrilaterals in space, `BeamPart` and `TrussPart` for lines.
    supports, point_masses, springs, hinges
        What holds, loads and joins the named points of the mesh. The point of a support may be a
        face.
    couplings
        Faces joined to points, for beams, masses, springs, supports and interfaces on solids.
    foundations
        Elastic foundations.
    interfaces
        The named directions that a reduction keeps and a load may act on.
    separate
        Whether nodes at one place may belong to pieces that nothing joins, and cells lie against
        each other without having the same nodes. Else `fem.assemble` refuses both: as a rule they
        were to be joined.
    plane
        Whether the structure lies and moves in the x-y plane: every node has x, y and the
        rotation about z, and beams need no numbers but those of the plane. Plane solids make it
        so.
    pinned
        Names of parts that are meant to meet solids in nodes or edges about which they turn. Of
        others a `JointWarning` tells.

    Raises
    ------
    ModelError
        If something is not of its kind, a name is not in the mesh, a cell of the highest
        dimension belongs to no part or one to two, or anything holds, loads or joins what is not
        there or is held or joined already.

    Examples
    --------
    >>> import fem
    >>> model = fem.StructureModel(
    ...     fem.box_mesh("bar", (1.0, 0.1, 0.1), (4, 1, 1)),
    ...     parts={"bar": fem.SolidPart(fem.Material(2.1e11, 7800.0, 0.3))},
    ...     supports=[fem.Support("x0", ("x", "y", "z"))],
    ...     couplings=[fem.Coupling("tip", "x1", "averaging")],
    ...     interfaces={"tip": fem.Interface("tip", "y")},
    ... )
    >>> fem.assemble(model).stiffness.shape
    (144, 144)

    A plane frame:

    >>> mesh = fem.frame_mesh({"root": (0, 0), "tip": (1, 0)}, [("arm", "root", "tip", 4)])
    >>> arm = fem.BeamPart(fem.Material(2.1e11, 7800.0), fem.CircularSection(0.02))
    >>> held = [fem.Support("root", ("x", "y", "rotation"))]
    >>> fem.assemble(fem.StructureModel(mesh, {"arm": arm}, held, plane=True)).stiffness.shape
    (12, 12)
    """

    mesh: StructureMesh
    parts: Mapping[str, Part]
    supports: Sequence[Support] = ()
    point_masses: Sequence[PointMass] = ()
    springs: Sequence[PointSpring] = ()
    hinges: Sequence[Hinge] = ()
    couplings: Sequence[Coupling] = ()
    foundations: Sequence[Foundation] = ()
    interfaces: Mapping[str, Interface] = field(default_factory=dict)
    separate: bool = False
    pinned: Sequence[str] = ()
    plane: bool = False

    def __post_init__(self) -> None:
        if not isinstance(self.mesh, StructureMesh):
            raise ModelError(f"model: mesh must be a StructureMesh, not {self.mesh!r}")
        for name, kind in LISTS.items():
            given = getattr(self, name)
            object.__setattr__(self, name, listed(self.mesh.source, name, given, kind))
        for name, sort, words in TABLES:
            given, what = getattr(self, name), f"by name, of {words}"
            object.__setattr__(self, name, by_name(self.mesh.source, name, given, sort, what))
        flat = [part for part in self.parts.values() if isinstance(part, SolidPart) and part.plane]
        object.__setattr__(self, "plane", bool(self.plane or flat))
        self._check_parts()
        shells = [name for name, part in self.parts.items() if isinstance(part, ShellPart)]
        object.__setattr__(self, "mesh", with_centres(self.mesh, shells))
        self._check_pinned()
        object.__setattr__(self, "mesh", self._with_coupled_points())
        self._check_plane()
        self._check_names()

    @cached_property
    def beams(self) -> dict[str, tuple[BeamPart, IntArray]]:
        """Beam parts with the node pairs (e, 2) of their lines; one of three nodes is two beams."""
        return {
            name: (part, self._spans(name))
            for name, part in self.parts.items()
            if isinstance(part, BeamPart)
        }

    def _spans(self, name: str) -> IntArray:
        pairs = [
            self.mesh.cells[kind][at][:, list(ends)]
            for kind, at in self.mesh.part(name).items()
            for ends in SPANS[kind]
        ]
        return np.concatenate(pairs)

    @property
    def solids(self) -> dict[str, tuple[SolidPart, dict[str, IntArray]]]:
        """Solid parts with the nodes (e, b) of their cells by kind."""
        return {
            name: (part, {k: self.mesh.cells[k][at] for k, at in self.mesh.part(name).items()})
            for name, part in self.parts.items()
            if isinstance(part, SolidPart)
        }

    @cached_property
    def solid_cells(self) -> list[SolidCells]:
        """The cells of solid parts by kind and by how they are integrated."""
        found = []
        for name, (part, kinds) in self.solids.items():
            for kind, nodes in kinds.items():
                reduced = self._reduced(part, kind, self.mesh.part(name)[kind])
                for way in np.unique(reduced):
                    at = np.flatnonzero(reduced == way)
                    found.append(SolidCells(name, part, KINDS[kind], nodes[at], bool(way), at))
        return found

    def _reduced(self, part: SolidPart, kind: str, cells: IntArray) -> npt.NDArray[np.bool_]:
        """Which cells of a kind in a part are integrated at fewer places."""
        if not KINDS[kind].reducible:
            return np.zeros(len(cells), dtype=np.bool_)
        reduced = np.full(len(cells), part.integration != "full")
        if part.integration is None:
            types = self.mesh.element_types.items()
            full = [at[kind] for t, at in types if integration(t) == "full" and kind in at]
            reduced &= ~np.isin(cells, np.concatenate([[], *full]))
        return reduced

    @cached_property
    def attached(self) -> Attachments:
        """What is attached and held: by the mesh's file, and by the model itself."""
        own = Attachments(self.point_masses, couplings=self.couplings, supports=self.supports)
        return self.mesh.attachments + own

    @cached_property
    def trusses(self) -> dict[str, tuple[TrussPart, dict[str, IntArray]]]:
        """Truss parts with the nodes (e, 2) and (e, 3) of their lines by kind."""
        return {
            name: (part, {k: self.mesh.cells[k][at] for k, at in self.mesh.part(name).items()})
            for name, part in self.parts.items()
            if isinstance(part, TrussPart)
        }

    @cached_property
    def shells(self) -> dict[str, tuple[ShellPart, dict[str, IntArray]]]:
        """Shell parts with the nodes (e, 3) and (e, 4) of their facets by kind."""
        return {
            name: (
                part,
                facets_of({k: self.mesh.cells[k][at] for k, at in self.mesh.part(name).items()}),
            )
            for name, part in self.parts.items()
            if isinstance(part, ShellPart)
        }

    @property
    def links(self) -> IntArray:
        """Pairs of nodes that cells of parts, couplings, springs or equations join, (m, 2)."""
        pairs = [
            np.stack([np.repeat(cells[:, 0], cells.shape[1]), cells.ravel()], axis=1)
            for cells in self._part_cells()
        ]
        for coupling in self.attached.couplings:
            nodes = self.mesh.nodes(coupling.face)
            point = np.full(len(nodes), self.mesh.node(coupling.point))
            pairs.append(np.stack([point, nodes], axis=1))
        names = [link.points for link in self.attached.links]
        names += [equation.points for equation in self.attached.equations]
        names += [matrix.points for matrix in self.attached.matrices]
        for points in names:
            joined = [self.mesh.node(point) for point in points]
            pairs.append(np.array([[joined[0], node] for node in joined], dtype=np.int64))
        return np.concatenate(pairs)

    @cached_property
    def facets(self) -> dict[str, IntArray]:
        """Faces (in the plane: edges) of solids that no second cell shares, (f, k) by kind."""
        found = all_facets(cells for _, cells in self.solids.values())
        return {kind: once(facets, kind) for kind, facets in found.items()}

    def facets_on(self, name: str) -> dict[str, IntArray]:
        """The outer facets, and those of shells, all of whose nodes are in a point set or group."""
        inside = self._inside(name)
        found: dict[str, list[IntArray]] = {}
        for kinds in (self.facets, *(kinds for _, kinds in self.shells.values())):
            for kind, facets in kinds.items():
                found.setdefault(kind, []).append(facets[inside[facets].all(axis=1)])
        on = {kind: np.concatenate(blocks) for kind, blocks in found.items()}
        return {kind: facets for kind, facets in on.items() if len(facets)}

    def beams_on(self, name: str) -> dict[str, IntArray]:
        """Numbers of the lines of beam parts both of whose nodes are in a point set or group."""
        inside = self._inside(name)
        on = {beam: inside[lines].all(axis=1) for beam, (_, lines) in self.beams.items()}
        return {beam: np.flatnonzero(lines) for beam, lines in on.items() if lines.any()}

    def _inside(self, name: str) -> npt.NDArray[np.bool_]:
        inside = np.zeros(len(self.mesh.points), dtype=np.bool_)
        inside[self.mesh.nodes(name)] = True
        return inside

    def _check_parts(self) -> None:
        mesh = self.mesh
        owners = {kind: np.zeros(len(cells), dtype=np.int64) for kind, cells in mesh.cells.items()}
        for name, part in self.parts.items():
            group = mesh.part(name)
            wanted = self._kinds_for(part)
            wrong = sorted(set(group) - wanted)
            if wrong or not group:
                raise ModelError(
                    f"{mesh.source}: part {name!r} is a {type(part).__name__} and needs cells out"
                    f" of {quoted(sorted(wanted))}, but has {quoted(wrong)}"
                )
            reduced = isinstance(part, SolidPart) and part.integration == "reduced"
            if reduced and not any(KINDS[kind].reducible for kind in group):
                raise ModelError(
                    f"{mesh.source}: part {name!r} has integration 'reduced', which is for quad8"
                    f" and hexahedron20, but its cells are {quoted(group)}"
                )
            for kind, cells in group.items():
                owners[kind][cells] += 1
                types = {t: at[kind] for t, at in mesh.element_types.items() if kind in at}
                check_family(f"{mesh.source}: part {name!r}", part, counted(types, cells))
        highest = max(KINDS[kind].dimension for kind in mesh.cells if kind in KINDS)
        for kind, count in owners.items():
            bare = np.flatnonzero(count == 0)
            if len(bare) and (kind not in KINDS or KINDS[kind].dimension == highest > 0):
                if kind == "vertex":
                    continue
                raise ModelError(
                    f"{mesh.source}: {kind} {bare[0]} is in no part of the model, whose parts are"
                    f" {quoted(self.parts)} (the mesh has {quoted(mesh.groups)})"
                )
            if count.max() > 1:
                raise ModelError(
                    f"{mesh.source}: {kind} {np.argmax(count > 1)} is in more than one part"
                )
        check_nothing_lost(mesh, {k: n > 0 for k, n in owners.items() if k in KINDS})
        self._check_doubles()
        for name, (_, lines) in self.beams.items():
            spans = mesh.points[lines[:, 1]] - mesh.points[lines[:, 0]]
            short = np.flatnonzero(np.linalg.norm(spans, axis=1) <= NO_LENGTH * mesh.size)
            if len(short):
                raise ModelError(f"{mesh.source}: line {short[0]} of {name!r} has zero length")

    def _check_pinned(self) -> None:
        given = self.pinned
        if isinstance(given, str) or not all(isinstance(name, str) for name in given):
            raise ModelError(f"{self.mesh.source}: pinned must be names of parts, not {given!r}")
        object.__setattr__(self, "pinned", tuple(given))
        wrong = [name for name in self.pinned if name not in self.parts]
        if wrong:
            raise ModelError(
                f"{self.mesh.source}: {wrong[0]!r} of 'pinned' is no part; there are"
                f" {quoted(self.parts)}"
            )

    def _check_doubles(self) -> None:
        """No part, and no two of solids, may hold a cell twice; beams may lie side by side."""
        solids: dict[str, list[IntArray]] = {}
        for name, part in self.parts.items():
            for kind, at in self.mesh.part(name).items():
                if isinstance(part, SolidPart):
                    solids.setdefault(kind, []).append(at)
                else:
                    check_no_doubles(self.mesh.source, self.mesh.points, kind, at, self.mesh.cells)
        for kind, blocks in solids.items():
            at = np.concatenate(blocks)
            check_no_doubles(self.mesh.source, self.mesh.points, kind, at, self.mesh.cells)

    @staticmethod
    def _kinds_for(part: Part) -> set[str]:
        if isinstance(part, BeamPart | TrussPart):
            return set(SPANS)
        if isinstance(part, ShellPart):
            return shell_kinds()
        dimension = 2 if part.plane else 3
        return {name for name, kind in KINDS.items() if kind.dimension == dimension}

    def _with_coupled_points(self) -> StructureMesh:
        """The mesh with a node for every coupled point that is not in it."""
        mesh = self.mesh
        for coupling in self.couplings:
            owner = f"{mesh.source}: coupling of {coupling.face!r} to {coupling.point!r}"
            if coupling.point in mesh.names:
                if coupling.at is not None:
                    raise ModelError(f"{owner}: the mesh has a point of this name; leave out 'at'")
                mesh.node(coupling.point)
                continue
            place = coupling.at or self._centre(mesh, coupling.face)
            points = np.vstack([mesh.points, np.asarray(place)])
            sets = {**mesh.point_sets, coupling.point: np.array([len(points) - 1])}
            mesh = replace(mesh, points=points, point_sets=sets)
        return mesh

    @staticmethod
    def _centre(mesh: StructureMesh, face: str) -> FloatArray:
        """Middle of the box around a face."""
        points = mesh.points[mesh.nodes(face)]
        return np.asarray((points.min(axis=0) + points.max(axis=0)) / 2.0, dtype=np.float64)

    def _check_plane(self) -> None:
        if not self.plane:
            return
        if self.shells:
            raise ModelError(
                f"{self.mesh.source}: a structure in the plane has no shells; make its plane parts"
                " shells, too, or leave it in space"
            )
        solid = [part for part in self.parts.values() if isinstance(part, SolidPart)]
        if not all(part.plane for part in solid):
            raise ModelError(f"{self.mesh.source}: plane and three-dimensional parts do not mix")
        used = np.unique(np.concatenate([n.ravel() for n in self._part_cells()]))
        z = self.mesh.points[used, 2]
        if np.ptp(z) > OUT_OF_PLANE * self.mesh.size:
            raise ModelError(
                f"{self.mesh.source}: a plane structure needs one z at all nodes, but z runs from"
                f" {z.min():g} to {z.max():g}"
            )
        held = self.attached.supports
        named = [(f"support at {s.point!r}", d) for s in held for d in s.directions]
        named += [(f"spring at {spring.point!r}", spring.direction) for spring in self.springs]
        named += [
            (f"link at {link.first!r}", d)
            for link in self.attached.links
            for d in link.directions or ()
        ]
        named += [(f"interface {name!r}", i.direction) for name, i in self.interfaces.items()]
        for owner, direction in named:
            if AXES[axis_index(direction)] not in IN_PLANE:
                raise ModelError(
                    f"{self.mesh.source}: {owner}: a structure in the plane has no direction"
                    f" {direction!r}; it moves along x and y and turns about z ('rotation')"
                )

    def _part_cells(self) -> list[IntArray]:
        cells = [lines for _, lines in self.beams.values()]
        bodies = (*self.trusses.values(), *self.solids.values(), *self.shells.values())
        return cells + [nodes for _, kinds in bodies for nodes in kinds.values()]

    def _check_names(self) -> None:
        for support in self.attached.supports:
            self.mesh.nodes(support.point)
        points = [item.point for item in self.attached.point_masses]
        points += [p for item in self.attached.links for p in item.points]
        points += [p for item in self.attached.equations for p in item.points]
        points += [p for item in self.attached.matrices for p in item.points]
        points += [item.point for item in self.springs]
        points += [item.point for item in self.hinges]
        points += [item.point for item in self.interfaces.values()]
        for name in points:
            self.mesh.node(name)
        for name in [c.face for c in self.attached.couplings] + [f.face for f in self.foundations]:
            self.mesh.nodes(name)
        for hinge in self.hinges:
            if hinge.part not in self.beams:
                raise ModelError(
                    f"{self.mesh.source}: hinge at {hinge.point!r}: {hinge.part!r} is no beam part"
                )
            if self.hinges.count(hinge) > 1:
                raise ModelError(
                    f"{self.mesh.source}: the hinge of part {hinge.part!r} at {hinge.point!r} is"
                    " given twice"
                )
            if self.mesh.node(hinge.point) not in self.beams[hinge.part][1]:
                raise ModelError(
                    f"{self.mesh.source}: no line of part {hinge.part!r} meets the hinge at"
                    f" {hinge.point!r}"
                )


def once(facets: IntArray, kind: str) -> IntArray:
    """The facets (f, k) of a kind that occur once, told apart by their three lowest corners.

    Examples
    --------
    >>> once(np.array([[0, 1], [2, 1], [1, 0]]), "line")
    array([[2, 1]])
    """
    first, count = occurrences(facets[:, : len(KINDS[kind].corners)])
    return np.asarray(facets[np.sort(first[count == 1])], dtype=np.int64)


def occurrences(corners: IntArray) -> tuple[IntArray, IntArray]:
    """Where each facet (f, k) first is, and how often, told apart by their three lowest corners.

    Examples
    --------
    >>> occurrences(np.array([[0, 1], [2, 1], [1, 0]]))
    (array([0, 1]), array([2, 1]))
    """
    keys = facet_keys(np.sort(corners, axis=1)[:, :3])
    _, first, count = np.unique(keys, return_index=True, return_counts=True)
    return first, count


def symmetry(point: str, normal: str) -> Support:
    """The support of the nodes on a plane of symmetry with its normal along "x", "y" or "z".

    It holds the translation along the normal and the rotations about the other two axes.

    Examples
    --------
    >>> symmetry("middle", "x").directions
    ('x', 'rotation_y', 'rotation_z')
    """
    if normal not in ("x", "y", "z"):
        raise ModelError(f"symmetry at {point!r}: normal must be 'x', 'y' or 'z', not {normal!r}")
    return Support(point, (normal, *(f"rotation_{axis}" for axis in "xyz" if axis != normal)))
