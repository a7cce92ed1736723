"""Tables of what is meshed: the file, places in it, and what is attached there."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field, field_validator, model_validator

from nldyn.scene.schema.table import Direction, NotNegative, Positive, Table, Triple, exactly_one


class MeshTable(Table):
    """``[mesh]``: the file of the finite element mesh."""

    file: str
    """Mesh: Gmsh `.msh`, VTK `.vtu` or `.vtk`, MED `.med`, universal `.unv`, Abaqus or CalculiX
    `.inp`, Nastran `.bdf` or `.dat`. A path that is not absolute is relative to the folder of
    the scene file; where it may lead is [told below](#a-scene-is-data)."""
    model: Literal["frame", "structure"] = "frame"
    """`"frame"`: everything lies and moves in a plane z = constant, most often beams.
    `"structure"`: solids, shells and beams in space, see [structures.md](structures.md); plane
    solids make it lie in the plane, too."""
    mirror: str | None = None
    """Point or face on the plane of symmetry of a half model. `nldyn render` then draws the whole
    structure; nothing else changes. Not in a component of several."""
    parts_from_file: list[str] | Literal["all"] = []
    """Names of parts whose material and section are taken from the file of Abaqus or CalculiX, see
    [decks.md](decks.md), or of [Nastran](nastran.md); they are not in `[parts]`. `"all"`: all
    that the file describes and `[parts]` does not give."""
    unit: Literal["m", "cm", "mm", "inch"] = "m"
    """Unit of the lengths in the file: `"m"`, `"cm"`, `"mm"` or `"inch"`. It must be given
    where the file states another one than m. Everything else, in the scene and in all output,
    is SI. Not for files whose masses, springs or parts are taken over."""
    offset: Triple | None = None
    """[m] Of a component: how far along x, y and z its mesh is moved from where the file has it, so
    that one file serves twice. All coordinates of the scene are those after that."""
    ignore: list[str] = []
    """Cells to leave out by name: groups, kinds of cells such as `"quad"`, element types of
    Abaqus such as `"S4R"`, or `"ungrouped"` for the cells in no group. `nldyn check` tells how
    many."""
    merge: bool | Positive = False
    """[m] Make nodes at one place one node; `true` for within 1e-9 of the size
    of the mesh, or a distance. `nldyn check` tells how many and how far apart they were.
    Springs between nodes that become one are refused."""
    separate: bool = False
    """Nodes at one place that nothing joins, and cells that lie against each other without the
    same nodes, are meant. Else pieces that touch so and cells that hang are refused, and slits
    within a piece told."""
    pinned: list[str] = []
    """Names of parts that are meant to meet solids in nodes or edges, about
    which they turn. Of others `nldyn check` tells."""

    @model_validator(mode="after")
    def _one_mesh(self) -> MeshTable:
        if self.merge and self.separate:
            raise ValueError("has both 'merge' and 'separate'; keep one")
        return self


class PlaceTable(Table):
    """``[places.NAME]``: a point set by coordinates or by a box, where the mesh has no name."""

    at: Triple | None = None
    """[m] Place [x, y, z] of one node, to within 1e-6 of the size of the mesh; or:"""
    box: Annotated[list[Triple], Field(min_length=2, max_length=2)] | None = None
    """[m] The corners [[x, y, z], [x, y, z]] with the lowest and the highest coordinates: all
    nodes inside."""

    @model_validator(mode="after")
    def _one_way(self) -> PlaceTable:
        exactly_one(self, "at", "box")
        return self


class SupportTable(Table):
    """``[[supports]]``: directions in which the nodes of a point set cannot move."""

    at: str
    """Point of the mesh, or a set of points, all of which are held."""
    fixed: Annotated[list[Direction], Field(min_length=1)]
    """List of directions that cannot move there. In a frame all three clamp the point; `["x",
    "rotation"]` is symmetry about a line along y. Of a solid `["x", "y", "z"]` clamps a face
    and `["x"]` is symmetry."""


class PointMassTable(Table):
    """``[[point_masses]]``: a lumped mass at a point set."""

    at: str
    """Point of the mesh."""
    mass: NotNegative
    """[kg] Lumped mass, 0 or more."""
    rotary_inertia: (
        NotNegative | Annotated[list[NotNegative], Field(min_length=3, max_length=3)]
    ) = 0.0
    """[kg m²] Moment of inertia about the centre of mass: about the normal of the plane; in a
    structure about all axes, or a list of three, about x, y and z."""
    offset: Triple | None = None
    """[m] Place (x, y, z) of the centre of mass as seen from the point."""

    @field_validator("rotary_inertia", mode="before")
    @classmethod
    def _one_or_three(cls, value: Any) -> Any:
        if isinstance(value, list) and len(value) != 3:
            raise ValueError(f"must be one number or three (about x, y and z), not {len(value)}")
        return value

    @model_validator(mode="after")
    def _some(self) -> PointMassTable:
        if self.mass == 0.0 and self.rotary_inertia in (0.0, [0.0] * 3):
            raise ValueError("needs a 'mass' or a 'rotary_inertia' above 0")
        return self


class HingeTable(Table):
    """``[[hinges]]``: a rotary joint, at which one part keeps a rotation of its own."""

    at: str
    """Point of the mesh where parts meet."""
    part: str
    """Part that is hinged there: it keeps a rotation of its own."""


class CouplingTable(Table):
    """``[[couplings]]``: joins the nodes of a face to a point."""

    at: str
    """Name of the point: one of the mesh, or a new one."""
    face: str
    """Face whose nodes are joined to it."""
    kind: Literal["rigid", "averaging"] = "rigid"
    """`"rigid"`: the face moves with the point as one rigid body. `"averaging"`: the point
    moves with the face in the mean and does not stiffen it."""
    place: Triple | None = None
    """[m] Coordinates (x, y, z) of a new point; if left out, the centre of the face."""
    directions: Annotated[list[Literal["x", "y", "z"]], Field(min_length=1)] = ["x", "y", "z"]
    """Of a rigid coupling: the translations of the face that follow the point."""


class FoundationTable(Table):
    """``[[foundations]]``: an elastic foundation under a face, an edge or a beam."""

    at: str
    """Face of solids, edge of solids in the plane, or part of beams."""
    stiffness: Annotated[list[NotNegative], Field(min_length=3, max_length=3)]
    """[N/m³, N/m²] Along x, y and z: per area of a face, or per length of an edge or a beam."""


class InterfaceTable(Table):
    """``[interfaces.NAME]``: a point and direction where something acts or is observed."""

    at: str
    """Point of the mesh."""
    direction: Direction
    """A direction."""
