"""What may stand in a scene file: one class per table, one attribute per key.

The docstring of a key begins with its unit in square brackets; ``docs/_site/scene_keys.py``
makes the tables of ``docs/reference/scene.md`` of them. A class here checks what can be judged
inside one table; what joins two tables is checked in ``nldyn.scene.checks``.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Discriminator,
    Field,
    PrivateAttr,
    Tag,
    ValidationInfo,
    field_validator,
    model_validator,
)

from nldyn.base.errors import LARGEST_FREQUENCY
from nldyn.scene.messages import quoted, show
from nldyn.system.loads import LARGEST_PHASE, MOST_HARMONIC
from nldyn.system.naming import is_angle
from nldyn.system.springs_dampers import LARGEST_DEGREE
from nldyn.system.stop import LARGEST_EXPONENT

SMALLEST, LARGEST = 1e-50, 1e50


def _plausible(value: float) -> float:
    """Refuse what no unit explains, before its powers leave the range of floating-point numbers."""
    if value != 0.0 and not SMALLEST <= abs(value) <= LARGEST:
        raise ValueError(f"must be 0 or from {SMALLEST:g} to {LARGEST:g} in size, not {value:g}")
    return value


def _no_truth_value(value: object) -> object:
    if isinstance(value, bool):
        raise ValueError("must be 1 or -1")
    return value


Number = Annotated[float, AfterValidator(_plausible)]
Positive = Annotated[Number, Field(gt=0)]
NotNegative = Annotated[Number, Field(ge=0)]
Frequency = Annotated[float, Field(ge=1e-6, le=LARGEST_FREQUENCY)]
ModeFrequency = Annotated[NotNegative, Field(le=1e12)]
Period = Annotated[int, Field(ge=1, le=100)]
Matrix = list[list[Number]]
Triple = Annotated[list[Number], Field(min_length=3, max_length=3)]
Sign = Annotated[Literal[1, -1], BeforeValidator(_no_truth_value)]
Axis = Literal["x", "y", "z", "-x", "-y", "-z"]
Direction = Literal["x", "y", "rotation", "z", "rotation_x", "rotation_y", "rotation_z"]


class Table(BaseModel):
    """A TOML table: no unknown keys, no conversions between types, finite numbers only."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, allow_inf_nan=False)


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
        _exactly_one(self, "at", "box")
        return self


class PartTable(Table):
    """``[parts.NAME]``: material of one part of the mesh, and what it is: a beam, a shell, ..."""

    _made: Any = PrivateAttr(None)
    kind: Literal["beam", "truss", "solid", "shell"] = "beam"
    """`"beam"`, `"truss"`, `"solid"`, or in space `"shell"`."""
    youngs_modulus: Positive
    """[N/m²] Young's modulus."""
    density: Positive
    """[kg/m³] Density."""
    poissons_ratio: Annotated[float, Field(gt=-1, lt=0.5)] | None = None
    """Poisson's ratio, above -1 and below 0.5. Solids, shells, Timoshenko beams and beams in
    space need it."""
    plane: Literal["stress", "strain"] | None = None
    """Of a solid of triangles or quadrilaterals: `"stress"` or `"strain"`."""
    thickness: Positive | None = None
    """[m] Of a solid in the plane, or of a shell."""
    integration: Literal["full", "reduced"] | None = None
    """Of a solid of `quad8` or `hexahedron20`: `"reduced"`, at 2 places in each direction, or
    `"full"`, at 3, which is too stiff where a thin part is curved. If left out as the file's types
    of elements say (`C3D20R`, `C3D20`), else reduced."""
    width: Positive | None = None
    """[m] Width of a rectangle, normal to the plane of the frame."""
    height: Positive | None = None
    """[m] Height of a rectangle, in the plane of the frame."""
    diameter: Positive | None = None
    """[m] Outer diameter of a round section."""
    bore: Positive | None = None
    """[m] Inner diameter of a tube."""
    taper: Annotated[list[str], Field(min_length=2, max_length=2)] | None = None
    """The two points of the mesh between which the section changes, `["from", "to"]`: from
    `width`, `height`, `diameter` and `bore` to the following ones, linearly on the straight way
    between the points."""
    width_end: Positive | None = None
    """[m] Width at the end of the taper; as at its start if left out."""
    height_end: Positive | None = None
    """[m] Height there."""
    diameter_end: Positive | None = None
    """[m] Outer diameter there."""
    bore_end: NotNegative | None = None
    """[m] Inner diameter there."""
    area: Positive | None = None
    """[m²] Area of a general section, or of a truss."""
    second_moment: Positive | None = None
    """[m⁴] Second moment of area of a general section, for bending in the plane (along the
    height)."""
    second_moment_across: Positive | None = None
    """[m⁴] Second moment of area of a general section, for bending along the width."""
    torsion_constant: Positive | None = None
    """[m⁴] Saint-Venant's torsion constant of a general section."""
    shear_area: Positive | None = None
    """[m²] Area that carries shear along the height, of a general section of a Timoshenko beam."""
    shear_area_across: Positive | None = None
    """[m²] The same along the width."""
    theory: Literal["euler-bernoulli", "timoshenko"] | None = None
    """`"euler-bernoulli"` (as if left out), or `"timoshenko"` with shear deformation and rotary
    inertia."""
    axial_force: Number | None = None
    """[N] Preload of a beam, positive for tension."""
    orientation: Triple | None = None
    """Direction (x, y, z) of the section's height. If left out, the height lies in planes
    z = constant; along z, all but round bars need it."""
    offset: Number | Annotated[list[Number], Field(min_length=2, max_length=2)] | None = None
    """[m] Place of the beam's axis (along the height, along the width) as seen from the line of
    the mesh. Of a shell one number: place of its middle surface along the
    normal as seen from the nodes, about which they run anticlockwise."""

    @field_validator("offset", mode="before")
    @classmethod
    def _one_or_two(cls, value: Any) -> Any:
        if isinstance(value, list) and len(value) != 2:
            raise ValueError(f"must be two numbers (of a beam) or one (of a shell), not {value}")
        return value

    @model_validator(mode="after")
    def _what_it_is(self) -> PartTable:
        if self.kind == "beam":
            _refuse(
                self, ("plane", "thickness", "integration"), "a beam; use kind 'solid' or 'shell'"
            )
            if isinstance(self.offset, float):
                raise ValueError("needs two numbers in 'offset' (along the height and the width)")
            return self._one_section()
        own = {
            "truss": ("area",),
            "solid": ("plane", "thickness", "integration"),
            "shell": ("thickness", "offset"),
        }[self.kind]
        common = ("kind", "youngs_modulus", "density", "poissons_ratio")
        others = (name for name in type(self).model_fields if name not in own + common)
        _refuse(self, tuple(others), f"a part of kind '{self.kind}'")
        needed = "area" if self.kind == "truss" else "poissons_ratio"
        if getattr(self, needed) is None:
            raise ValueError(f"needs '{needed}', as it is of kind '{self.kind}'")
        return self._one_thickness()

    def _one_thickness(self) -> PartTable:
        if self.kind == "solid" and (self.plane is None) != (self.thickness is None):
            raise ValueError("needs both 'plane' and 'thickness' (in the plane), or neither")
        if self.kind == "shell" and self.thickness is None:
            raise ValueError("needs 'thickness', as it is of kind 'shell'")
        if self.kind == "shell" and isinstance(self.offset, list):
            raise ValueError("needs one number in 'offset' (along the normal)")
        return self

    def _one_section(self) -> PartTable:
        keys = ("width", "height", "diameter", "bore", "area", "second_moment")
        given = {key for key in keys if getattr(self, key) is not None}
        wanted = ({"width", "height"}, {"diameter"}, {"diameter", "bore"})
        if given not in (*wanted, {"area", "second_moment"}):
            raise ValueError(
                "needs one section: 'width' and 'height', or 'diameter' (and 'bore'), or 'area' "
                f"and 'second_moment'; given: {quoted(key for key in keys if key in given)}"
            )
        if self.area is None:
            numbers = ("second_moment_across", "torsion_constant", "shear_area")
            _refuse(self, (*numbers, "shear_area_across"), "a section given by its dimensions")
        if self.bore and self.diameter and self.bore >= self.diameter:
            raise ValueError(f"has a 'bore' of {self.bore:g}, not less than its 'diameter'")
        return self._one_taper()

    def size(self, name: str, end: str) -> float | None:
        """A dimension of the section at its start or end; one that is not given stays the same."""
        value: float | None = getattr(self, name + end)
        start: float | None = getattr(self, name)
        return start if value is None else value

    def _one_taper(self) -> PartTable:
        keys = ("width_end", "height_end", "diameter_end", "bore_end")
        given = [key for key in keys if getattr(self, key) is not None]
        for key in given:
            if getattr(self, key.removesuffix("_end")) is None:
                raise ValueError(f"has '{key}' without '{key.removesuffix('_end')}'")
        if bool(given) != (self.taper is not None):
            raise ValueError(
                "needs 'taper' (the two points between which the section changes) together with"
                f" one of {quoted(keys)}"
            )
        outer, inner = self.size("diameter", "_end"), self.size("bore", "_end")
        if given and outer and inner and inner >= outer:
            raise ValueError("has a bore at its end that is not less than the diameter there")
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


class SpringTable(Table):
    """``[[springs]]``: a spring at an interface or, with a direction, at a point of the mesh."""

    at: str
    """Interface or, with a `direction`, point of the mesh."""
    direction: Direction | None = None
    """Direction of a spring of the mesh: from the point to the ground, and reduced with the
    mesh."""
    stiffness: Number | None = None
    """[N/m, N m/rad] Stiffness: above 0 with a `direction`; else a negative one must leave the
    structure stable."""
    coefficients: Annotated[list[Number], Field(min_length=1, max_length=LARGEST_DEGREE)] | None = (
        None
    )
    """[N/m^j] Of a nonlinear spring at an interface, instead of `stiffness`: F = k₁u + k₂u² +
    ..., up to nine, of either sign."""
    against: str | None = None
    """Interface at the other end; the ground unless given."""

    @model_validator(mode="after")
    def _one_kind(self) -> SpringTable:
        if self.direction is None:
            _exactly_one(self, "stiffness", "coefficients")
            _refuse_own(self)
            if self.coefficients is not None and not any(self.coefficients):
                raise ValueError("must have 'coefficients' that are not all zero")
            return self
        of_mesh = "a spring of the mesh, which has a 'direction'"
        _refuse(self, ("against", "coefficients"), of_mesh)
        if self.stiffness is None:
            raise ValueError("needs 'stiffness'")
        if self.stiffness <= 0.0:
            raise ValueError("must have a 'stiffness' above 0 where it has a 'direction'")
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


class ReductionTable(Table):
    """``[reduction]``: which modes of the mesh's model are kept."""

    modes: Annotated[int, Field(ge=0)] | None = None
    """Number of free-interface modes that an interface or a load vector sees, lowest first. Those
    that none sees do not move: they are left out and told."""
    cutoff_hz: Frequency | None = None
    """[Hz] Keep the modes up to this frequency."""
    tolerance: Annotated[float, Field(ge=1e-6, lt=1.0)] | None = None
    """Choose the modes: leaving the others out changes the harmonic response over the range of
    the continuation by at most this share, from 1e-6 to below 1; see
    [reduction_studies.md](../how-to/reduction_studies.md)."""
    residual: bool = True
    """`false` is short for `method = "truncation"`."""
    method: Literal["rubin", "craig-bampton", "guyan", "truncation"] = "rubin"
    """`"rubin"`, `"craig-bampton"`, `"guyan"` (takes none of these three) or `"truncation"`;
    see [cms.md](cms.md)."""

    @model_validator(mode="after")
    def _one_choice(self) -> ReductionTable:
        if not self.residual and self.method not in ("rubin", "truncation"):
            raise ValueError("has 'residual = false', which is method 'truncation'; keep one")
        if self.method == "guyan":
            names = ("modes", "cutoff_hz", "tolerance")
            _refuse(self, names, "method 'guyan', which keeps no modes")
            return self
        _exactly_one(self, "modes", "cutoff_hz", "tolerance")
        if not self.residual or self.method != "rubin":
            _refuse(self, ("tolerance",), "methods other than 'rubin'")
        return self


class ModalTable(Table):
    """``[modal]``: a structure given by its modes instead of a mesh."""

    frequencies_hz: Annotated[list[ModeFrequency], Field(min_length=1)]
    """[Hz] List of the modes' frequencies."""
    participation: Annotated[dict[str, list[Number]], Field(min_length=1)]
    """[1/√kg] `participation.NAME = [...]`: displacement of each mode at interface NAME. A mode
    with modal mass m if scaled to 1 at the interface has the participation 1/√m."""
    loads: dict[str, list[Number]] = {}
    """[√kg] `loads.NAME = [...]`: modal force of what acts on the whole structure, as a weight
    does: Φᵀ M r."""


class PlaceOfMatrices(Table):
    """``[matrices.interfaces.NAME]``: a row, rows with weights, or a node and its direction."""

    row: Annotated[int, Field(ge=1)] | None = None
    """The row of the load vector that is 1; rows are counted from 1."""
    rows: dict[str, Number] | None = None
    """Some rows with their weights: `rows = {12 = 1.0, 40 = -1.0}`."""
    node: Annotated[int, Field(ge=1)] | None = None
    """A node of files that tell nodes; it needs `direction`."""
    direction: Literal["x", "y", "z", "rotation_x", "rotation_y", "rotation_z"] | None = None
    """In which the node is moved."""

    @field_validator("rows")
    @classmethod
    def _row_numbers(cls, value: dict[str, float] | None) -> dict[str, float] | None:
        for name in value or ():
            if not re.fullmatch(r"[1-9][0-9]{0,8}", name):
                raise ValueError(f"must name rows by numbers from 1, not '{name}'")
        if value is not None and not any(value.values()):
            raise ValueError("must not be zero throughout: nothing could move there")
        return value

    @model_validator(mode="after")
    def _one_way(self) -> PlaceOfMatrices:
        _exactly_one(self, "row", "rows", "node")
        if (self.node is None) != (self.direction is None):
            raise ValueError("needs both 'node' and 'direction', or neither")
        return self


def _written_as(value: object) -> str:
    return "file" if isinstance(value, str) else "table" if isinstance(value, dict) else "numbers"


RowsOrFile = Annotated[
    Annotated[Annotated[Matrix, Field(min_length=1)], Tag("numbers")] | Annotated[str, Tag("file")],
    Discriminator(lambda value: "file" if isinstance(value, str) else "numbers"),
]
VectorOrPlace = Annotated[
    Annotated[list[Number], Tag("numbers")]
    | Annotated[PlaceOfMatrices, Tag("table")]
    | Annotated[str, Tag("file")],
    Discriminator(_written_as),
]


class SpinTable(Table):
    """``[matrices.spin]``: the speed of a shaft, and what is in proportion to it."""

    hz: Annotated[float, Field(ge=-LARGEST_FREQUENCY, le=LARGEST_FREQUENCY)]
    """[Hz] Speed of the shaft, of either sign. It is kept while the frequency changes; a study may
    vary it."""
    gyroscopic: RowsOrFile | None = None
    """[kg] Skew matrix, typed in or a file: times the speed in rad/s it adds to the damping."""
    circulatory: RowsOrFile | None = None
    """[N s/m] Skew matrix, typed in or a file: times the speed in rad/s it adds to the
    stiffness."""

    @model_validator(mode="after")
    def _some(self) -> SpinTable:
        if self.gyroscopic is None and self.circulatory is None:
            raise ValueError("needs 'gyroscopic' or 'circulatory'")
        return self


class MatricesTable(Table):
    """``[matrices]``: a structure given by its matrices instead of a mesh."""

    mass: RowsOrFile
    """[kg] Mass matrix, symmetric and positive definite: a list of rows, or a file."""
    stiffness: RowsOrFile
    """[N/m] Stiffness matrix, symmetric: a list of rows, or a file."""
    damping: RowsOrFile | None = None
    """[N s/m] Damping matrix, symmetric; adds to the modal damping."""
    gyroscopic: RowsOrFile | None = None
    """[N s/m] Skew matrix, typed in or a file, that adds to the damping: of a rotor at one
    speed, which does not change with the excitation. A `[reduction]` projects it on its modes;
    it needs `modes` or `cutoff_hz`."""
    circulatory: RowsOrFile | None = None
    """[N/m] Skew matrix, typed in or a file, that adds to the stiffness: the cross-coupling of
    bearings and seals. A stiffness K without symmetry is (K + Kᵀ)/2 and this, (K − Kᵀ)/2."""
    digits: Annotated[int, Field(ge=3, le=17)] | None = None
    """To how many decimal digits the entries were rounded, 17 if they are exact. Where it is not
    given it is [read off the entries](cms.md#matrices-of-other-codes)."""
    spin: SpinTable | None = None
    interfaces: Annotated[dict[str, VectorOrPlace], Field(min_length=1)]
    """`interfaces.NAME = ...`: load vector of interface NAME. Its displacement is the product
    of this vector with the coordinates."""
    loads: dict[str, VectorOrPlace] = {}
    """[kg] `loads.NAME = ...`: load vector M r of a weight or a moving base along r."""

    @property
    def skew(self) -> tuple[str, ...]:
        """Keys of what couples, as a skew matrix, what mass and stiffness do not."""
        keys = ("gyroscopic", "circulatory", "spin")
        return tuple(key for key in keys if getattr(self, key) is not None)


class DampingTable(Table):
    """``[damping]``: the damping ratio of the modes, one number or one per mode; Rayleigh's."""

    modal_ratio: float | list[float] = 0.0
    """Damping ratio of the modes, from 0 to below 1: one number for all, or a list with one per
    mode of the reduced model (residual modes are modes of it)."""
    rayleigh_mass: NotNegative = 0.0
    """[1/s] With a `[reduction]`: Rayleigh's damping, this times the mass matrix. It adds to
    that of the modes."""
    rayleigh_stiffness: NotNegative = 0.0
    """[s] The same with the stiffness matrix."""

    @field_validator("modal_ratio", mode="before")
    @classmethod
    def _ratios(cls, value: Any) -> float | list[float]:
        numbers = value if isinstance(value, list) else [value]
        for number in numbers:
            plain = isinstance(number, int | float) and not isinstance(number, bool)
            if not plain or not 0 <= number < 1:
                raise ValueError(
                    f"must be a number from 0 to below 1, or one per mode, not {show(number)}"
                )
        return [float(n) for n in numbers] if isinstance(value, list) else float(value)

    @property
    def rayleigh(self) -> tuple[float, float]:
        """Factors (1/s, s) of the mass and of the stiffness in the damping of a mesh."""
        return self.rayleigh_mass, self.rayleigh_stiffness


class DamperTable(Table):
    """``[[dampers]]``: a damper between an interface and the ground or another one."""

    at: str
    """Interface."""
    coefficient: NotNegative
    """[N s/m] Coefficient c, 0 or more; above 0 in N s³/m³ or N s/m³ for the other laws."""
    law: Literal["linear", "cubic", "displacement"] = "linear"
    """`"linear"`, `"cubic"` for the force c u'³, or `"displacement"` for c u² u'."""
    against: str | None = None
    """Interface at the other end; the ground unless given."""

    @model_validator(mode="after")
    def _two_ends(self) -> DamperTable:
        _refuse_own(self)
        if self.law != "linear" and self.coefficient == 0.0:
            raise ValueError(f"needs a 'coefficient' above 0 for law '{self.law}'")
        return self


class FrictionTable(Table):
    """``[[friction]]``: [dry friction](../how-to/friction.md) along an interface."""

    at: str
    """Interface whose displacement lies along the surface."""
    coefficient: NotNegative
    """Coefficient μ of Coulomb's friction while it slides."""
    normal_force: Positive | None = None
    """[N] Constant force that presses it on. This, or `stop`."""
    stop: Annotated[int, Field(ge=0)] | None = None
    """Number of the stop whose force presses it on, counted from 0: friction acts while it is
    closed."""
    at_rest: NotNegative | None = None
    """Coefficient at rest, at least `coefficient`; the same unless given."""
    fading_speed: Positive | None = None
    """[m/s] Speed in which the coefficient falls from that at rest by 1 − 1/e of the difference.
    Needed where `at_rest` is larger."""
    base_speed: Number = 0.0
    """[m/s] Speed along the surface of what it slides on: of a belt or a rotor."""
    against: str | None = None
    """Interface at the other side; the ground unless given."""
    tangential_stiffness: Positive | None = None
    """[N/m] Stiffness of a spring along the surface before what slides, above 0: Jenkins' element.
    Several tables at one interface are an Iwan chain. Without it nothing gives way."""

    @model_validator(mode="after")
    def _two_ends(self) -> FrictionTable:
        _refuse_own(self)
        _exactly_one(self, "normal_force", "stop")
        if self.at_rest is not None and self.at_rest < self.coefficient:
            raise ValueError("needs an 'at_rest' of at least 'coefficient'")
        if (self.at_rest or 0.0) > self.coefficient and self.fading_speed is None:
            raise ValueError("has an 'at_rest' above 'coefficient', which needs a 'fading_speed'")
        if (self.at_rest or 0.0) > self.coefficient and self.tangential_stiffness is not None:
            raise ValueError("has a 'tangential_stiffness', before which 'at_rest' is no other one")
        return self


class RoundClearanceTable(Table):
    """``[[round_clearances]]``: [ring or pin](../how-to/round_clearances.md), touched anywhere."""

    plane: Annotated[list[str], Field(min_length=2, max_length=2)]
    """Two interfaces: the displacements of one place along two perpendicular directions."""
    clearance: Positive
    """[m] Radial clearance, above 0: how far the place may move from the centre of a ring, or how
    near it may come to that of a pin."""
    stiffness: Positive
    """[N/m^exponent] Stiffness of the contact, above 0."""
    law: Literal["hertz", "linear"] = "hertz"
    """`"hertz"`, or `"linear"` for a spring."""
    exponent: Annotated[float, Field(ge=1, le=LARGEST_EXPONENT)] | None = None
    """Exponent of the law `"hertz"`, from 1 to 4; 1.5 unless given."""
    eccentricity: Annotated[list[Number], Field(min_length=2, max_length=2)] = [0.0, 0.0]
    """[m] Where the centre lies beside the place at rest, along both directions."""
    inside: bool = True
    """`true` for a ring, in which the place is; `false` for a pin, from which it stays away."""
    against: Annotated[list[str], Field(min_length=2, max_length=2)] | None = None
    """Two interfaces of what is on the other side; the ground unless given."""
    dissipation: NotNegative = 0.0
    """[s/m] Loss of the contact (Hunt and Crossley): it grows with the penetration, 0 or more."""
    friction: NotNegative = 0.0
    """Coefficient of the friction along the circle; its surface slides all the time."""
    surface_speed: Number = 0.0
    """[m/s] Speed of the surface that turns, ΩR of a rotor, above 0 if it turns from the first
    direction to the second. Needed where there is `friction`."""

    @model_validator(mode="after")
    def _makes_sense(self) -> RoundClearanceTable:
        if self.plane[0] == self.plane[1]:
            raise ValueError("needs two different interfaces in 'plane'")
        if self.against is not None and set(self.against) & set(self.plane):
            raise ValueError("needs other interfaces than its own in 'against'")
        if self.law == "linear":
            _refuse(self, ("exponent",), "law 'linear'")
        if self.friction and not self.surface_speed:
            raise ValueError("has 'friction', which needs the 'surface_speed' of what turns")
        return self

    @property
    def ends(self) -> list[tuple[str, str | None]]:
        """Both directions: the interface, and that on the other side."""
        if self.against is None:
            return [(name, None) for name in self.plane]
        return list(zip(self.plane, self.against, strict=True))


class ContactAreaTable(Table):
    """``[[contact_areas]]``: [a face or an edge that touches](../how-to/contact_areas.md)."""

    at: str | list[str]
    """Face of solids or shells, edge of plane solids, part of beams or set of points of the mesh;
    or a list of interfaces."""
    name: str = ""
    """What reports call it; `at` unless given."""
    stiffness: Positive
    """[N/m^exponent per m², m or point] Stiffness of the contact: per area of a face, per length of
    an edge or of beams; at each point node by node, or of a list without `weights`."""
    law: Literal["linear", "hertz"] = "linear"
    """`"linear"` for a foundation that lifts off, or `"hertz"` for a power of the penetration."""
    exponent: Annotated[float, Field(ge=1, le=LARGEST_EXPONENT)] | None = None
    """Exponent of the law `"hertz"`, from 1 to 4; 1.5 unless given."""
    direction: Axis | Triple | None = None
    """Axis or vector of the normal, along which the structure moves to close the gap: `"y"`,
    `"-y"`, ... A mesh needs it."""
    closes: Sign = 1
    """Of a list of interfaces: `1` if positive displacements close the gap, `-1` if negative ones
    do."""
    points: Annotated[int, Field(ge=1, le=12)] | Literal["nodes"] = 1
    """Of a mesh: points of contact in each direction of a facet or beam, at Gauss's places, from 1
    to 12; or `"nodes"`: node by node."""
    weights: Annotated[list[Positive], Field(min_length=1)] | None = None
    """[m², m] Of a list of interfaces: areas or lengths that they stand for."""
    gap: Number | Annotated[list[Number], Field(min_length=1)] = 0.0
    """[m] Clearance at rest, one or at each point; a negative one is a preload."""
    slope: Triple | None = None
    """Of a mesh: change of the gap along x, y and z, where what it hits is a plane that is
    inclined; at `centre` it is `gap`."""
    radius: Number | None = None
    """[m] Of a mesh: what it hits is a cylinder of this radius with its axis along `axis`, nearest
    at `centre`, where the gap is `gap`; below 0 a hollow one."""
    axis: Axis | Triple | None = None
    """Axis of the cylinder; a ball unless given. In a plane frame `"z"`."""
    centre: Triple | None = None
    """[m] Place [x, y, z] of the mesh where the gap is `gap`; the middle of the points unless
    given."""
    against: str | Annotated[list[str], Field(min_length=1)] | None = None
    """What moves on the other side: beams of the same mesh, nodes that lie opposite to nodes, or a
    list of interfaces; the ground unless given."""
    dissipation: NotNegative = 0.0
    """[s/m] Loss of the contact (Hunt and Crossley): it grows with the penetration, 0 or more."""
    dashpot: NotNegative = 0.0
    """[N s/m per m², m or point] Dashpot parallel to the springs."""
    pulls: bool = True
    """`false`: the pressure of a linear law with a dashpot is never negative."""
    friction: NotNegative | None = None
    """Coefficient of Coulomb's friction at each point; needs `along`."""
    along: Axis | Triple | Annotated[list[str], Field(min_length=1)] | None = None
    """Axis or vector along the surface, in which it slides; of a list, interfaces."""
    along_against: Annotated[list[str], Field(min_length=1)] | None = None
    """The interfaces of the other side in that direction, of a list that has `against`."""
    surface: NotNegative = 0.0
    """[m] Of beams: distance of the surface from their axis."""
    surface_against: NotNegative = 0.0
    """[m] The same of the beams on the other side."""
    attachment_modes: Annotated[int, Field(ge=0)] | None = None
    """How many attachment modes the reduction gives to the area; chosen by `static_error` unless
    given. `nldyn check` tells both."""
    static_error: Annotated[float, Field(gt=0, lt=1)] = 1e-2
    """Share of the static deflection of structure and contact together, under any load at the
    points, that the attachment modes may miss."""

    @model_validator(mode="after")
    def _makes_sense(self) -> ContactAreaTable:
        if self.law == "linear":
            _refuse(self, ("exponent",), "law 'linear'")
        if (self.friction is None) != (self.along is None):
            raise ValueError("needs both 'friction' and 'along', or neither")
        if self.axis is not None and self.radius is None:
            raise ValueError("has 'axis', which needs the 'radius' of a cylinder")
        if self.radius == 0.0:
            raise ValueError("needs a 'radius' other than 0")
        of_mesh = (
            *("direction", "points", "slope", "radius", "axis", "centre"),
            *("surface", "surface_against", "attachment_modes", "static_error"),
        )
        listed = isinstance(self.at, list)
        if listed:
            _refuse(self, of_mesh, "a list of interfaces")
            if len(set(self.at)) < len(self.at):
                raise ValueError("must name each interface once in 'at'")
        else:
            _refuse(self, ("closes", "weights", "along_against"), "an area of a mesh")
            if self.direction is None:
                raise ValueError("needs 'direction', the normal along which the gap closes")
        for key in ("against", "along"):
            value = getattr(self, key)
            names = isinstance(value, list) and isinstance(value[0], str)
            if value is not None and names != listed:
                wanted = "a list of interfaces" if listed else "a name or an axis"
                raise ValueError(f"needs {wanted} in '{key}', as in 'at'")
        return self

    @property
    def called(self) -> str:
        """Its name."""
        return self.name or (self.at if isinstance(self.at, str) else "contact area")


class StopTable(Table):
    """``[[stops]]``: a stop that an interface hits."""

    at: str
    """Interface that hits the stop."""
    law: Literal["hertz", "linear", "rigid"] = "hertz"
    """`"hertz"`, `"linear"` for a one-sided spring, or `"rigid"` for
    [impacts](../how-to/rigid_stops.md) that take no time."""
    gap: Number = 0.0
    """[m] Clearance at rest. A negative gap is a preload: the stop presses on the structure at
    rest; a rigid one has none."""
    direction: Sign = 1
    """`1` if positive displacements close the gap, `-1` if negative ones do."""
    against: str | None = None
    """Another interface that carries the stop, so that the relative displacement counts; the
    ground unless given."""

    @model_validator(mode="after")
    def _two_ends(self) -> StopTable:
        _refuse_own(self)
        return self


class RigidStopTable(StopTable):
    """``[[stops]]`` with ``law = "rigid"``."""

    restitution: Annotated[float, Field(ge=0, le=1)]
    """Coefficient of restitution from 0 to 1."""

    @model_validator(mode="after")
    def _no_preload(self) -> RigidStopTable:
        if self.gap < 0.0:
            raise ValueError("needs a 'gap' of at least 0: a preload needs a stop with a stiffness")
        return self


class ElasticStopTable(StopTable):
    """What stops have that give way."""

    _beside: ClassVar[tuple[str, ...]] = ("impact_speed",)  # `restitution`
    dashpot: NotNegative = 0.0
    """[N s/m] Dashpot parallel to the spring (Kelvin and Voigt): the force jumps at the
    contact, and pulls at its end."""
    dissipation: NotNegative | None = None
    """[s/m] Loss of the contact (Hunt and Crossley): it grows with the penetration, 0 or more;
    none unless given."""
    restitution: Annotated[float, Field(ge=0, le=1)] | None = None
    """Coefficient of restitution, above 0, of a free body that hits the stop, instead of
    `dissipation`."""
    impact_speed: Positive | None = None
    """[m/s] Speed at which `restitution` holds; slower impacts lose less."""

    @model_validator(mode="after")
    def _one_loss(self) -> ElasticStopTable:
        if self.restitution == 0.0:
            raise ValueError("needs a 'restitution' above 0, or the law 'rigid'")
        given = [key for key in self._beside if getattr(self, key) is not None]
        if (self.restitution is not None) != bool(given):
            other = " or ".join(f"'{key}'" for key in self._beside)
            raise ValueError(f"needs both 'restitution' and {other}, or neither")
        if len(given) > 1:
            raise ValueError("has both 'impact_speed' and 'mass'; keep one")
        if self.restitution is not None:
            _refuse(self, ("dissipation",), "a stop whose 'restitution' is given")
        return self


class HertzStopTable(ElasticStopTable):
    """``[[stops]]`` with ``law = "hertz"``."""

    stiffness: Positive | None = None
    """[N/m^exponent] Stiffness, above 0. Needed unless `radius` is given."""
    exponent: Annotated[float, Field(ge=1, le=LARGEST_EXPONENT)] | None = None
    """Exponent, from 1 to 4; 1.5 unless given."""
    radius: Positive | None = None
    """[m] Radius of a sphere against a plane of the same material, instead of `stiffness`."""
    youngs_modulus: Positive | None = None
    """[N/m²] Young's modulus that goes with `radius`."""
    poissons_ratio: Annotated[float, Field(gt=-1, le=0.5)] | None = None
    """Poisson's ratio that goes with `radius`; 0.3 unless given."""

    @model_validator(mode="after")
    def _one_stiffness(self) -> HertzStopTable:
        if self.stiffness is not None:
            sphere = ("radius", "youngs_modulus", "poissons_ratio")
            _refuse(self, sphere, "a stop whose 'stiffness' is given")
        elif self.radius is None or self.youngs_modulus is None:
            raise ValueError(
                "needs 'stiffness' (N/m^exponent), or 'radius' and 'youngs_modulus' of a sphere"
            )
        else:
            _refuse(self, ("exponent",), "a stop given by its radius (it is 1.5)")
        return self


class LinearStopTable(ElasticStopTable):
    """``[[stops]]`` with ``law = "linear"``."""

    _beside = ("impact_speed", "mass")
    stiffness: Positive
    """[N/m] Stiffness, above 0."""
    pulls: bool = True
    """`false`: the force of a stop with a dashpot is never negative; it lets go where it would
    pull."""
    mass: Positive | None = None
    """[kg] Mass of a free body whose `restitution` the stop has at every speed; its dashpot
    follows from that. Instead of `impact_speed`."""

    @model_validator(mode="after")
    def _one_dashpot(self) -> LinearStopTable:
        if self.mass is not None and self.dashpot:
            raise ValueError("has both 'mass' and 'dashpot'; keep one")
        if not self.pulls and self.mass is None:
            if not self.dashpot:
                raise ValueError("has 'pulls = false', which needs a 'dashpot' above 0")
            if self.dissipation or self.restitution is not None:
                raise ValueError(
                    "has 'pulls = false' beside 'dissipation' or 'restitution'; keep one"
                )
        return self


def _law_of(given: Any) -> str:
    """The law of a stop; of what has none that there is, the first one."""
    law = given.get("law") if isinstance(given, dict) else getattr(given, "law", None)
    return law if law in ("linear", "rigid") else "hertz"


AnyStopTable = Annotated[
    Annotated[HertzStopTable, Tag("hertz")]
    | Annotated[LinearStopTable, Tag("linear")]
    | Annotated[RigidStopTable, Tag("rigid")],
    Discriminator(_law_of),
]


# what each kind of excitation needs, and what it may have
_EXCITATION_KEYS: dict[str, tuple[tuple[str, ...], tuple[str, ...]]] = {
    "unbalance": (("at", "mass_times_radius"), ("phase_deg", "harmonic")),
    "harmonic": (("at", "amplitude"), ("phase_deg", "harmonic", "frequency_hz")),
    "constant": (("at", "force"), ()),
    "measured": (("at", "file"), ("harmonics", "closed")),
    "weight": (("acceleration",), ()),
    "base": (("amplitude",), ("at", "direction", "quantity", "phase_deg", "harmonic")),
}


class ExcitationTable(Table):
    """``[[excitation]]``: what moves the structure, by its kind."""

    kind: Literal["unbalance", "harmonic", "constant", "measured", "weight", "base"]
    """One of those above."""
    at: str | None = None
    """Interface, or a name in `loads` of `[matrices]` or `[modal]`."""
    mass_times_radius: Positive | None = None
    """[kg m] Unbalanced mass times its radius."""
    amplitude: Positive | None = None
    """[N; m, m/s or m/s² of a base] Amplitude."""
    force: Number | None = None
    """[N] Constant force."""
    phase_deg: Annotated[Number, Field(ge=-LARGEST_PHASE, le=LARGEST_PHASE)] | None = None
    """[degrees] Phase, up to 1e6 either way; 0 unless given."""
    harmonic: Annotated[int, Field(ge=1, le=MOST_HARMONIC)] | None = None
    """Multiple m of the frequency, a whole number up to 1000; 1 unless given. Where half orders
    act, the frequency is that of the whole cycle."""
    frequency_hz: Frequency | None = None
    """[Hz] A frequency of its own of a harmonic force, instead of `harmonic`: the scene is then for
    [`nldyn simulate`](../how-to/simulation.md#two-frequencies), as no motion has a period."""
    file: str | None = None
    """Samples at 0, T/n, ..., (n − 1) T/n, beside the scene; `#` begins a remark. What the
    harmonics leave out is told."""
    harmonics: Annotated[int, Field(ge=1, le=MOST_HARMONIC)] | None = None
    """How many harmonics of a measured force are taken; 20 unless given."""
    closed: bool | None = None
    """Whether the last sample is the first one again, at T. Needed where the two are equal."""
    acceleration: Annotated[list[Number], Field(min_length=2, max_length=3)] | None = None
    """[m/s²] Of the weight: `[0.0, -9.81]` in a plane frame, three components else."""
    direction: Literal["x", "y", "z"] | None = None
    """`"x"`, `"y"` or `"z"` of a moving base."""
    quantity: Literal["displacement", "velocity", "acceleration"] | None = None
    """What of a base keeps its amplitude at every frequency: `"displacement"`, `"velocity"` or
    `"acceleration"`; the first unless given."""

    @model_validator(mode="after")
    def _complete(self) -> ExcitationTable:
        needed, allowed = _EXCITATION_KEYS[self.kind]
        others = {key for keys in _EXCITATION_KEYS.values() for part in keys for key in part}
        uses = ", ".join(f"'{key}'" for key in needed if key != "at")
        _refuse(
            self,
            tuple(sorted(others.difference(needed, allowed))),
            f"kind '{self.kind}'; use {uses}",
        )
        for key in needed:
            if getattr(self, key) is None:
                raise ValueError(f"needs '{key}' for kind '{self.kind}'")
        if self.harmonic is not None and self.frequency_hz is not None:
            raise ValueError("has both 'harmonic' and 'frequency_hz'; keep one")
        if self.kind == "base" and (self.at is None) == (self.direction is None):
            raise ValueError(
                "needs 'direction' for kind 'base' of a mesh, or 'at' naming a load vector"
            )
        return self

    @property
    def load(self) -> str | None:
        """Name of the load vector that a mesh must have for it; None if it needs none."""
        if self.kind == "weight":
            return "weight"
        return f"base {self.direction}" if self.direction is not None else None


class ObserveTable(Table):
    """``[observe]``: the interface whose displacement is reported and drawn."""

    at: str
    """Interface whose displacement is tabulated and drawn. Without the table it is the first
    interface."""
    absolute: bool = False
    """With a moving base: its absolute displacement, not that relative to the base."""


class StartTable(Table):
    """``[start]``: where ``nldyn simulate`` begins; undeformed and without speed unless given.

    What is not given follows: of all states with these values it is the one of least energy.
    """

    at_rest: bool = False
    """Begin where the structure rests under its constant loads; what is given is added to that."""
    displacements: dict[str, Number] = {}
    """[m or rad] By interface, such as tip = 1e-3."""
    velocities: dict[str, Number] = {}
    """[m/s or rad/s] By interface."""


class ContinuationTable(Table):
    """``[continuation]``: which branches of periodic orbits are followed, and how far.

    They are followed over the excitation frequency, or over another number of the scene.
    """

    range_hz: list[Frequency] | None = None
    """[Hz] Lowest and highest excitation frequency; needed unless there is a `parameter`."""
    parameter: str | None = None
    """What changes in place of the frequency: a key such as `"stops.0.gap"` (tables in a list
    count from 0), `"stops.0.stiffness"`, `"stops.0.restitution"`, `"excitation.0.amplitude"`,
    `"dampers.0.coefficient"`, `"springs.0.stiffness"`, `"damping.modal_ratio"` or
    `"matrices.spin.hz"`; or in short `"gap"`, `"stiffness"`, `"restitution"` and so on of the first
    stop, `"force"`, the strength of the only load that moves the structure, `"damping"`, the ratio
    of all modes, and `"speed"` of a shaft that turns as fast as its load."""
    range: list[Number] | None = None
    """[unit of the parameter] Lowest and highest value of the parameter, in the unit of its key."""
    frequency_hz: Frequency | None = None
    """[Hz] Excitation frequency, held while the parameter changes."""
    periods: Annotated[list[Period], Field(min_length=1)] = [1, 2, 3]
    """Periods of the orbits to look for, in periods of the excitation: 1 is the harmonic
    branch, 3 the 1/3 subharmonics."""
    follow_doublings: Annotated[int, Field(ge=0, le=10)] = 0
    """How many more (up to 10) doublings to follow at the flips of branches whose doubled
    period is beyond `periods`: with 1 also the 1/4 subharmonics born from the 1/2 ones, with 2
    the 1/8 ones, and so on."""
    search_points: Annotated[int, Field(ge=1, le=1000)] = 12
    """Number of frequencies, or values of the parameter (up to 1000), spread over the range, at
    which time simulations look for orbits."""
    max_step: Annotated[float, Field(ge=0.01, le=1.0)] = 0.05
    """Longest step along a branch, relative: at 0.05 orbit or frequency change by 5 %, or a
    parameter whose range is not positive by 5 % of the range's width. Shorter
    steps (down to 0.01) give smoother curves and take longer."""
    rtol: Annotated[float, Field(ge=1e-13, le=1e-2)] = 1e-9
    """Relative error to aim at in the motion over a period, 1e-13 to 1e-2; multipliers are
    about ten times less exact."""
    events: list[Literal["amplitude resonance", "amplitude antiresonance", "phase resonance"]] = []
    """Further special points to mark: where the largest displacement is extremal along a branch,
    or where the displacement lags a quarter of a turn behind the only source that swings."""

    @field_validator("range_hz", "range")
    @classmethod
    def _ordered(cls, value: list[float] | None, about: ValidationInfo) -> list[float] | None:
        if value is None:
            return value
        one, several = ("frequency", "frequencies")
        if about.field_name == "range":
            one, several = ("value", "values")
        if len(value) != 2:
            raise ValueError(f"must be two {several}, [lowest, highest], not {show(value)}")
        if value[1] <= value[0]:
            raise ValueError(f"must run from the lower to the higher {one}, not {show(value)}")
        if value[1] - value[0] <= 1e-9 * max(abs(value[0]), abs(value[1])):
            raise ValueError(f"must be wider than 1e-9 of its {several}, not {show(value)}")
        return value

    @model_validator(mode="after")
    def _one_range(self) -> ContinuationTable:
        given = [key for key in ("range", "frequency_hz") if getattr(self, key) is not None]
        if self.parameter is None:
            if self.range_hz is None:
                raise ValueError("needs 'range_hz' (Hz)")
            if given:
                raise ValueError(f"has '{given[0]}', which goes with a 'parameter'")
        elif self.range_hz is not None:
            raise ValueError("has both 'range_hz' and 'parameter'; keep one")
        elif self.range is None:
            raise ValueError("needs 'range', the lowest and highest value of its 'parameter'")
        return self

    @property
    def limits(self) -> tuple[float, float]:
        """Lowest and highest frequency in Hz, or value of the parameter."""
        given = self.range_hz or self.range
        assert given is not None
        return given[0], given[1]

    @property
    def frequencies_hz(self) -> tuple[float, float]:
        """Lowest and highest excitation frequency in Hz."""
        if self.frequency_hz is not None:
            return self.frequency_hz, self.frequency_hz
        return self.limits

    @field_validator("periods")
    @classmethod
    def _different(cls, value: list[int]) -> list[int]:
        if len(set(value)) < len(value):
            raise ValueError(f"must name each period once, not {show(value)}")
        return value


class SeedTable(Table):
    """``[[subharmonics]]``: where to look for the start of a branch by time simulation."""

    period: Period
    """Period of the orbits, in periods of the excitation."""
    near_hz: Frequency | None = None
    """[Hz] Excitation frequency to look at; needed where `continuation` has a `range_hz`."""
    near: Number | None = None
    """[unit of the parameter] Value to look at where `continuation` has a `parameter`."""

    @property
    def place(self) -> float:
        """The frequency in Hz, or the value."""
        near = self.near if self.near_hz is None else self.near_hz
        assert near is not None  # checked with the continuation
        return near


class ExploreTable(Table):
    """``[explore]``: find all branches without naming places to look at."""

    max_period: Period = 8
    """Longest orbits wanted, in periods of the excitation."""
    spacing: Annotated[float, Field(ge=1e-6, le=0.5)] = 0.005
    """Largest relative distance of the frequencies, or of values of a parameter, at which motions
    are simulated, up to 0.5; where their range is not positive, the share of its width.
    What is stable in a narrower window only may be missed."""
    starts: Annotated[int, Field(ge=1, le=1000)] = 12
    """Random initial states at each of them (up to 1000), beside the motions carried over from
    the frequency before."""
    rounds: Annotated[int, Field(ge=1, le=1000)] = 1
    """Most searches through the range, each from other random states at frequencies between
    those before; one that finds no new branch is the last. With two or more the report
    estimates how many branches are missing."""
    settling: Annotated[int, Field(ge=1, le=10_000_000)] = 50000
    """Most periods of the excitation that a motion gets to settle. It gets four decay times of
    the slowest mode, and where this key cuts that, a line says so."""
    unstable_period: Annotated[int, Field(ge=0, le=100)] = 3
    """Longest unstable orbits looked for by near returns and deflation; 0 for none."""
    doubled_period: Period = 1
    """Longest orbits followed from flips, where that is longer than `max_period`."""
    doubled_points: Annotated[int, Field(ge=2, le=1_000_000)] | None = None
    """Most points in one direction of branches longer in period than `max_period`; those that
    are broken off are noted."""
    pseudo_orbits: Annotated[int, Field(ge=0, le=1_000_000)] = 10
    """Most closed sequences (up to 1 000 000) of pieces of known orbits, of each length up to
    `unstable_period`, beside which [orbits are looked for](../how-to/exploring.md) at each
    frequency on the way down."""
    mixtures: Annotated[int, Field(ge=0, le=1_000_000)] = 10
    """Mixtures (up to 1 000 000) of two known orbits, of each length up to `unstable_period`,
    beside which [orbits are looked for](../how-to/exploring.md) at each frequency on the way
    down."""
    walks: Annotated[int, Field(ge=0, le=1_000_000)] = 10
    """Most closed walks (up to 1 000 000) among random states, of each length up to
    `unstable_period`, beside which [orbits are looked for](../how-to/exploring.md) at each
    frequency on the way down."""
    walk_states: Annotated[int, Field(ge=1, le=100_000)] = 500
    """How many random states (up to 100 000) these walks are among."""
    seed: Annotated[int, Field(ge=0, le=2**32)] = 20
    """Seed of the random initial states."""


class StructureTables(Table):
    """The tables that describe a structure by a mesh or by matrices."""

    mesh: MeshTable | None = None
    places: dict[str, PlaceTable] = {}
    parts: dict[str, PartTable] = {}
    supports: list[SupportTable] = []
    point_masses: list[PointMassTable] = []
    springs: list[SpringTable] = []
    hinges: list[HingeTable] = []
    couplings: list[CouplingTable] = []
    foundations: list[FoundationTable] = []
    interfaces: dict[str, InterfaceTable] = {}
    reduction: ReductionTable | None = None
    matrices: MatricesTable | None = None


class ComponentTable(StructureTables):
    """``[components.NAME]``: one of several structures that are joined."""


class JointTable(Table):
    """``[[joints]]``: two interfaces that move as one, or one that the ground holds."""

    at: str
    """Interface of a component."""
    against: str | None = None
    """Interface of another one that moves with it; the ground holds it unless given."""

    @model_validator(mode="after")
    def _two_ends(self) -> JointTable:
        _refuse_own(self)
        return self

    @property
    def ends(self) -> tuple[str, ...]:
        """The interfaces that it joins."""
        return (self.at,) if self.against is None else (self.at, self.against)


class Scene(StructureTables):
    """A whole scene: a structure, what acts on it, and what to compute.

    Read one with `nldyn.scene.load_scene`. Units are SI; keys that end in ``_hz`` are in Hz.

    Examples
    --------
    >>> from nldyn.base.resources import example
    >>> from nldyn.scene.read import load_scene
    >>> scene = load_scene(example("one_dof.toml"))
    >>> scene.stops[0].stiffness
    5170000000.0
    """

    title: str = ""
    """Title of the diagram."""
    modal: ModalTable | None = None
    components: dict[str, ComponentTable] = {}
    joints: list[JointTable] = []
    damping: DampingTable = DampingTable()
    dampers: list[DamperTable] = []
    stops: list[AnyStopTable] = []
    round_clearances: list[RoundClearanceTable] = []
    contact_areas: list[ContactAreaTable] = []
    friction: list[FrictionTable] = []
    excitation: list[ExcitationTable] = []
    observe: ObserveTable | None = None
    start: StartTable | None = None
    continuation: ContinuationTable | None = None
    subharmonics: list[SeedTable] = []
    explore: ExploreTable | None = None

    _file: Path = PrivateAttr(default=Path("scene.toml"))
    _text: str = PrivateAttr(default="")
    _mesh_folders: tuple[Path, ...] = PrivateAttr(default=())
    _areas_found: Any = PrivateAttr(default=None)  # what `nldyn.scene.contact` found in the mesh

    @property
    def file(self) -> Path:
        """Where the scene was read from."""
        return self._file

    @property
    def text(self) -> str:
        """The text of the file, word for word."""
        return self._text

    @property
    def mesh_folders(self) -> tuple[Path, ...]:
        """Folders below which the mesh may be: of the scene, the current one, and further ones."""
        return self._mesh_folders

    @property
    def mesh_springs(self) -> dict[int, SpringTable]:
        """The springs that belong to the mesh, by their numbers in the file."""
        return {n: spring for n, spring in enumerate(self.springs) if spring.direction is not None}

    @property
    def interface_springs(self) -> dict[int, SpringTable]:
        """The others, which act at interfaces."""
        return {n: spring for n, spring in enumerate(self.springs) if spring.direction is None}

    @property
    def interface_names(self) -> list[str]:
        """Names of the interfaces, in the order of the file."""
        if self.modal is not None:
            return list(self.modal.participation)
        if self.matrices is not None:
            return list(self.matrices.interfaces)
        if self.components:
            parts = self.component_scenes.items()
            return [f"{name}.{at}" for name, part in parts for at in part.interface_names]
        return list(self.interfaces)

    def direction_at(self, interface: str) -> str:
        """The direction of an interface; empty where none is told."""
        part, name = self, interface
        if self.components:
            component, _, name = interface.partition(".")
            part = self.component_scenes[component]
        given = part.matrices.interfaces if part.matrices is not None else part.interfaces
        return getattr(given.get(name), "direction", None) or ""

    @property
    def rotations(self) -> frozenset[str]:
        """The interfaces that turn."""
        return frozenset(name for name in self.interface_names if is_angle(self.direction_at(name)))

    @property
    def load_names(self) -> list[str]:
        """Names of the load vectors that are given with modes or matrices."""
        if self.components:
            parts = self.component_scenes.items()
            return [f"{name}.{load}" for name, part in parts for load in part.load_names]
        given = self.modal or self.matrices
        return list(given.loads) if given else []

    @property
    def component_scenes(self) -> dict[str, Scene]:
        """A scene for each component, with what acts on the whole of it."""
        on_all = [table for table in self.excitation if table.load is not None]
        return {name: self._of_component(table, on_all) for name, table in self.components.items()}

    def _of_component(self, table: ComponentTable, on_all: list[ExcitationTable]) -> Scene:
        tables = {name: getattr(table, name) for name in ComponentTable.model_fields}
        part = Scene(**tables, excitation=on_all)
        part._file, part._mesh_folders = self._file, self._mesh_folders
        return part

    @property
    def observed(self) -> str:
        """The interface whose displacement is reported: ``observe.at``, else the first one."""
        return self.observe.at if self.observe else self.interface_names[0]


def _exactly_one(table: BaseModel, *names: str) -> None:
    given = [name for name in names if getattr(table, name) is not None]
    if len(given) != 1:
        chosen = given or names
        fault = ("has both" if len(given) == 2 else "has") if given else "needs one of"
        listed = ", ".join(f"'{name}'" for name in chosen[:-1]) + f" and '{chosen[-1]}'"
        raise ValueError(f"{fault} {listed}" + ("; keep one" if given else ""))


def ends_of(
    table: StopTable | FrictionTable | SpringTable | DamperTable | RoundClearanceTable,
) -> list[tuple[str, str | None]]:
    """The interfaces at both ends of an element, of a round clearance along both directions."""
    if isinstance(table, RoundClearanceTable):
        return table.ends
    return [(table.at, table.against)]


def _refuse_own(table: StopTable | FrictionTable | SpringTable | DamperTable | JointTable) -> None:
    if table.against == table.at:
        raise ValueError("needs another interface than its own in 'against'")


def exponent_of(table: HertzStopTable | RoundClearanceTable | ContactAreaTable) -> float:
    """Exponent of the law of a contact."""
    return 1.0 if table.law == "linear" else table.exponent or 1.5


def _refuse(table: BaseModel, names: tuple[str, ...], of: str) -> None:
    for name in names:
        if name in table.model_fields_set and getattr(table, name) is not None:
            raise ValueError(f"has '{name}', which is not a key of {of}")
