"""What may stand in a scene file: one class per table, one attribute per key.

Every key is described with its unit and its default in ``docs/reference/scene.md``. A class here
checks what can be judged inside one table; what joins two tables is checked in
``nldyn.scene.checks``.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import (
    AfterValidator,
    BaseModel,
    ConfigDict,
    Discriminator,
    Field,
    PrivateAttr,
    Tag,
    field_validator,
    model_validator,
)

from nldyn.base.errors import LARGEST_FREQUENCY
from nldyn.scene.messages import quoted, show
from nldyn.system.elements import LARGEST_EXPONENT, LARGEST_PHASE, MOST_HARMONIC
from nldyn.system.springs import LARGEST_DEGREE

SMALLEST, LARGEST = 1e-50, 1e50


def _plausible(value: float) -> float:
    """Refuse what no unit explains, before its powers leave the range of floating-point numbers."""
    if value != 0.0 and not SMALLEST <= abs(value) <= LARGEST:
        raise ValueError(f"must be 0 or from {SMALLEST:g} to {LARGEST:g} in size, not {value:g}")
    return value


Number = Annotated[float, AfterValidator(_plausible)]
Positive = Annotated[Number, Field(gt=0)]
NotNegative = Annotated[Number, Field(ge=0)]
Frequency = Annotated[float, Field(ge=1e-6, le=LARGEST_FREQUENCY)]
ModeFrequency = Annotated[NotNegative, Field(le=1e12)]
Period = Annotated[int, Field(ge=1, le=100)]
Matrix = list[list[Number]]
Triple = Annotated[list[Number], Field(min_length=3, max_length=3)]
Direction = Literal["x", "y", "rotation", "z", "rotation_x", "rotation_y", "rotation_z"]


class Table(BaseModel):
    """A TOML table: no unknown keys, no conversions between types, finite numbers only."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, allow_inf_nan=False)


class MeshTable(Table):
    """``[mesh]``: the file of the finite element mesh."""

    file: str
    model: Literal["frame", "structure"] = "frame"
    mirror: str | None = None
    parts_from_file: list[str] = []
    unit: Literal["m", "cm", "mm", "inch"] = "m"
    ignore: list[str] = []
    merge: bool | Positive = False
    separate: bool = False
    pinned: list[str] = []

    @model_validator(mode="after")
    def _one_mesh(self) -> MeshTable:
        if self.merge and self.separate:
            raise ValueError("has both 'merge' and 'separate'; keep one")
        for key in ("merge", "pinned"):
            if getattr(self, key) and self.model == "frame":
                raise ValueError(f"has '{key}', which needs model = \"structure\"")
        return self


class PlaceTable(Table):
    """``[places.NAME]``: a point set by coordinates or by a box, where the mesh has no name."""

    at: Triple | None = None
    box: Annotated[list[Triple], Field(min_length=2, max_length=2)] | None = None

    @model_validator(mode="after")
    def _one_way(self) -> PlaceTable:
        _exactly_one(self, "at", "box")
        return self


class PartTable(Table):
    """``[parts.NAME]``: material of one part of the mesh, and what it is: a beam, a shell, ..."""

    kind: Literal["beam", "truss", "solid", "shell"] = "beam"
    youngs_modulus: Positive
    density: Positive
    poissons_ratio: Annotated[float, Field(gt=-1, lt=0.5)] | None = None
    plane: Literal["stress", "strain"] | None = None
    thickness: Positive | None = None
    width: Positive | None = None
    height: Positive | None = None
    diameter: Positive | None = None
    bore: Positive | None = None
    taper: Annotated[list[str], Field(min_length=2, max_length=2)] | None = None
    width_end: Positive | None = None
    height_end: Positive | None = None
    diameter_end: Positive | None = None
    bore_end: NotNegative | None = None
    area: Positive | None = None
    second_moment: Positive | None = None
    second_moment_across: Positive | None = None
    torsion_constant: Positive | None = None
    shear_area: Positive | None = None
    shear_area_across: Positive | None = None
    theory: Literal["euler-bernoulli", "timoshenko"] | None = None
    axial_force: Number | None = None
    orientation: Triple | None = None
    offset: Number | Annotated[list[Number], Field(min_length=2, max_length=2)] | None = None

    @field_validator("offset", mode="before")
    @classmethod
    def _one_or_two(cls, value: Any) -> Any:
        if isinstance(value, list) and len(value) != 2:
            raise ValueError(f"must be two numbers (of a beam) or one (of a shell), not {value}")
        return value

    @model_validator(mode="after")
    def _what_it_is(self) -> PartTable:
        if self.kind == "beam":
            _refuse(self, ("plane", "thickness"), "a beam; use kind 'solid' or 'shell'")
            if isinstance(self.offset, float):
                raise ValueError("needs two numbers in 'offset' (along the height and the width)")
            return self._one_section()
        own = {
            "truss": ("area",),
            "solid": ("plane", "thickness"),
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
    fixed: Annotated[list[Direction], Field(min_length=1)]


class PointMassTable(Table):
    """``[[point_masses]]``: a lumped mass at a point set."""

    at: str
    mass: NotNegative
    rotary_inertia: (
        NotNegative | Annotated[list[NotNegative], Field(min_length=3, max_length=3)]
    ) = 0.0
    offset: Triple | None = None

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
    direction: Direction | None = None
    stiffness: Number | None = None
    coefficients: Annotated[list[Number], Field(min_length=1, max_length=LARGEST_DEGREE)] | None = (
        None
    )
    against: str | None = None

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
    part: str


class CouplingTable(Table):
    """``[[couplings]]``: joins the nodes of a face to a point."""

    at: str
    face: str
    kind: Literal["rigid", "averaging"] = "rigid"
    place: Triple | None = None
    directions: Annotated[list[Literal["x", "y", "z"]], Field(min_length=1)] = ["x", "y", "z"]


class FoundationTable(Table):
    """``[[foundations]]``: an elastic foundation under a face, an edge or a beam."""

    at: str
    stiffness: Annotated[list[NotNegative], Field(min_length=3, max_length=3)]


class InterfaceTable(Table):
    """``[interfaces.NAME]``: a point and direction where something acts or is observed."""

    at: str
    direction: Direction


class ReductionTable(Table):
    """``[reduction]``: which modes of the mesh's model are kept."""

    modes: Annotated[int, Field(ge=0)] | None = None
    cutoff_hz: Frequency | None = None
    tolerance: Annotated[float, Field(ge=1e-6, lt=1.0)] | None = None
    residual: bool = True
    method: Literal["rubin", "craig-bampton", "guyan", "truncation"] = "rubin"

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
    participation: Annotated[dict[str, list[Number]], Field(min_length=1)]
    loads: dict[str, list[Number]] = {}


class PlaceOfMatrices(Table):
    """``interfaces.NAME`` of matrices: a row, rows with weights, or a node and its direction."""

    row: Annotated[int, Field(ge=1)] | None = None
    rows: dict[str, Number] | None = None
    node: Annotated[int, Field(ge=1)] | None = None
    direction: Literal["x", "y", "z", "rotation_x", "rotation_y", "rotation_z"] | None = None

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


class MatricesTable(Table):
    """``[matrices]``: a structure given by its matrices instead of a mesh."""

    mass: RowsOrFile
    stiffness: RowsOrFile
    damping: RowsOrFile | None = None
    gyroscopic: RowsOrFile | None = None
    circulatory: RowsOrFile | None = None
    interfaces: Annotated[dict[str, VectorOrPlace], Field(min_length=1)]
    loads: dict[str, VectorOrPlace] = {}


class DampingTable(Table):
    """``[damping]``: the damping ratio of the modes, one number or one per mode; Rayleigh's."""

    modal_ratio: float | list[float] = 0.0
    rayleigh_mass: NotNegative = 0.0
    rayleigh_stiffness: NotNegative = 0.0

    @field_validator("modal_ratio", mode="plain")
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
    coefficient: NotNegative
    law: Literal["linear", "cubic", "displacement"] = "linear"
    against: str | None = None

    @model_validator(mode="after")
    def _two_ends(self) -> DamperTable:
        _refuse_own(self)
        if self.law != "linear" and self.coefficient == 0.0:
            raise ValueError(f"needs a 'coefficient' above 0 for law '{self.law}'")
        return self


class StopTable(Table):
    """``[[stops]]``: an elastic or rigid stop that an interface hits."""

    at: str
    law: Literal["hertz", "linear", "rigid"] = "hertz"
    stiffness: Positive | None = None
    exponent: Annotated[float, Field(ge=1, le=LARGEST_EXPONENT)] | None = None
    radius: Positive | None = None
    youngs_modulus: Positive | None = None
    poissons_ratio: Annotated[float, Field(gt=-1, le=0.5)] | None = None
    gap: Number = 0.0
    dissipation: NotNegative | None = None
    dashpot: NotNegative = 0.0
    pulls: bool = True
    restitution: Annotated[float, Field(ge=0, le=1)] | None = None
    impact_speed: Positive | None = None
    direction: Literal[1, -1] = 1
    against: str | None = None

    @field_validator("direction", mode="before")
    @classmethod
    def _no_truth_value(cls, value: object) -> object:
        if isinstance(value, bool):
            raise ValueError("must be 1 or -1")
        return value

    @model_validator(mode="after")
    def _complete(self) -> StopTable:
        _refuse_own(self)
        if self.law == "rigid":
            return self._complete_rigid()
        if self.restitution == 0.0:
            raise ValueError("needs a 'restitution' above 0, or the law 'rigid'")
        if (self.restitution is None) != (self.impact_speed is None):
            raise ValueError("needs both 'restitution' and 'impact_speed', or neither")
        if self.restitution is not None:
            _refuse(self, ("dissipation",), "a stop whose 'restitution' is given")
        if not self.pulls and (self.law != "linear" or not self.dashpot):
            raise ValueError(
                "has 'pulls = false', which needs law 'linear' and a 'dashpot' above 0"
            )
        if not self.pulls and (self.dissipation or self.restitution is not None):
            raise ValueError("has 'pulls = false' beside 'dissipation' or 'restitution'; keep one")
        sphere = ("radius", "youngs_modulus", "poissons_ratio")
        if self.law == "linear":
            _refuse(self, (*sphere, "exponent"), "a linear stop")
            if self.stiffness is None:
                raise ValueError("needs 'stiffness' (N/m)")
        elif self.stiffness is not None:
            _refuse(self, sphere, "a stop whose 'stiffness' is given")
        elif self.radius is None or self.youngs_modulus is None:
            raise ValueError(
                "needs 'stiffness' (N/m^exponent), or 'radius' and 'youngs_modulus' of a sphere"
            )
        else:
            _refuse(self, ("exponent",), "a stop given by its radius (it is 1.5)")
        return self

    def _complete_rigid(self) -> StopTable:
        elastic = ("stiffness", "exponent", "radius", "youngs_modulus", "poissons_ratio")
        _refuse(self, (*elastic, "dissipation", "impact_speed"), "a rigid stop")
        if self.dashpot:
            raise ValueError("has 'dashpot', which is not a key of a rigid stop")
        if self.restitution is None:
            raise ValueError("needs 'restitution' (from 0 to 1)")
        if self.gap < 0.0:
            raise ValueError("needs a 'gap' of at least 0: a preload needs a stop with a stiffness")
        return self


# what each kind of excitation needs, and what it may have
_EXCITATION_KEYS: dict[str, tuple[tuple[str, ...], tuple[str, ...]]] = {
    "unbalance": (("at", "mass_times_radius"), ("phase_deg", "harmonic")),
    "harmonic": (("at", "amplitude"), ("phase_deg", "harmonic")),
    "constant": (("at", "force"), ()),
    "measured": (("at", "file"), ("harmonics",)),
    "weight": (("acceleration",), ()),
    "base": (("amplitude",), ("at", "direction", "quantity", "phase_deg", "harmonic")),
}


class ExcitationTable(Table):
    """``[[excitation]]``: what moves the structure, by its kind."""

    kind: Literal["unbalance", "harmonic", "constant", "measured", "weight", "base"]
    at: str | None = None
    mass_times_radius: Positive | None = None
    amplitude: Positive | None = None
    force: Number | None = None
    phase_deg: Annotated[Number, Field(ge=-LARGEST_PHASE, le=LARGEST_PHASE)] | None = None
    harmonic: Annotated[int, Field(ge=1, le=MOST_HARMONIC)] | None = None
    file: str | None = None
    harmonics: Annotated[int, Field(ge=1, le=MOST_HARMONIC)] | None = None
    acceleration: Annotated[list[Number], Field(min_length=2, max_length=3)] | None = None
    direction: Literal["x", "y", "z"] | None = None
    quantity: Literal["displacement", "velocity", "acceleration"] | None = None

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


class ContinuationTable(Table):
    """``[continuation]``: which branches of periodic orbits are followed, and how far."""

    range_hz: list[Frequency]
    periods: Annotated[list[Period], Field(min_length=1)] = [1, 2, 3]
    follow_doublings: Annotated[int, Field(ge=0, le=10)] = 0
    search_points: Annotated[int, Field(ge=1, le=1000)] = 12
    max_step: Annotated[float, Field(ge=0.01, le=1.0)] = 0.05
    rtol: Annotated[float, Field(ge=1e-13, le=1e-2)] = 1e-9

    @field_validator("range_hz")
    @classmethod
    def _ordered(cls, value: list[float]) -> list[float]:
        if len(value) != 2:
            raise ValueError(f"must be two frequencies, [lowest, highest], not {show(value)}")
        if value[1] <= value[0]:
            raise ValueError(f"must run from the lower to the higher frequency, not {show(value)}")
        if value[1] <= value[0] * (1.0 + 1e-9):
            raise ValueError(f"must be wider than 1e-9 of its frequencies, not {show(value)}")
        return value

    @field_validator("periods")
    @classmethod
    def _different(cls, value: list[int]) -> list[int]:
        if len(set(value)) < len(value):
            raise ValueError(f"must name each period once, not {show(value)}")
        return value


class SeedTable(Table):
    """``[[subharmonics]]``: where to look for the start of a branch by time simulation."""

    period: Period
    near_hz: Frequency


class ExploreTable(Table):
    """``[explore]``: find all branches without naming places to look at."""

    max_period: Period = 8
    spacing: Annotated[float, Field(ge=1e-6, le=0.5)] = 0.005
    starts: Annotated[int, Field(ge=1, le=1000)] = 12
    rounds: Annotated[int, Field(ge=1, le=1000)] = 1
    settling: Annotated[int, Field(ge=1, le=10_000_000)] = 50000
    unstable_period: Annotated[int, Field(ge=0, le=100)] = 3
    doubled_period: Period = 1
    doubled_points: Annotated[int, Field(ge=2, le=1_000_000)] | None = None
    passing: Annotated[int, Field(ge=0, le=1000)] = 0
    pseudo_orbits: Annotated[int, Field(ge=0, le=1_000_000)] = 10
    mixtures: Annotated[int, Field(ge=0, le=1_000_000)] = 10
    walks: Annotated[int, Field(ge=0, le=1_000_000)] = 10
    walk_states: Annotated[int, Field(ge=1, le=100_000)] = 500
    seed: Annotated[int, Field(ge=0, le=2**32)] = 20


class Scene(Table):
    """A whole scene: a structure, what acts on it, and what to compute.

    Read one with `nldyn.load_scene`. Units are SI; keys that end in ``_hz`` are in Hz.

    Examples
    --------
    >>> from nldyn.base.resources import example
    >>> from nldyn.scene.read import load_scene
    >>> scene = load_scene(example("one_dof.toml"))
    >>> scene.stops[0].stiffness
    5170000000.0
    """

    title: str = ""
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
    modal: ModalTable | None = None
    matrices: MatricesTable | None = None
    damping: DampingTable = DampingTable()
    dampers: list[DamperTable] = []
    stops: list[StopTable] = []
    excitation: list[ExcitationTable] = []
    observe: ObserveTable | None = None
    continuation: ContinuationTable | None = None
    subharmonics: list[SeedTable] = []
    explore: ExploreTable | None = None

    _file: Path = PrivateAttr(default=Path("scene.toml"))
    _text: str = PrivateAttr(default="")
    _mesh_folders: tuple[Path, ...] = PrivateAttr(default=())

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
        return list(self.interfaces)

    @property
    def load_names(self) -> list[str]:
        """Names of the load vectors that are given with modes or matrices."""
        given = self.modal or self.matrices
        return list(given.loads) if given else []

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


def _refuse_own(table: StopTable | SpringTable | DamperTable) -> None:
    if table.against == table.at:
        raise ValueError("needs another interface than its own in 'against'")


def _refuse(table: BaseModel, names: tuple[str, ...], of: str) -> None:
    for name in names:
        if getattr(table, name) is not None:
            raise ValueError(f"has '{name}', which is not a key of {of}")
