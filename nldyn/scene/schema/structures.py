"""Tables of a structure: its reduction, modes and matrices, and all of one component."""

from __future__ import annotations

import re
from typing import Annotated, Literal

from pydantic import Discriminator, Field, Tag, field_validator, model_validator

from nldyn.base.errors import LARGEST_FREQUENCY
from nldyn.scene.schema.connections import AnySpringTable
from nldyn.scene.schema.mesh import (
    CouplingTable,
    FoundationTable,
    HingeTable,
    InterfaceTable,
    MeshTable,
    PlaceTable,
    PointMassTable,
    SupportTable,
)
from nldyn.scene.schema.parts import AnyPartTable
from nldyn.scene.schema.table import (
    Frequency,
    Matrix,
    ModeFrequency,
    Number,
    Table,
    TwoEnds,
    exactly_one,
    refuse,
)


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
    method: Literal["rubin", "craig-bampton", "guyan", "macneal", "truncation"] = "rubin"
    """`"rubin"`, `"craig-bampton"`, `"guyan"` (takes none of these three), `"macneal"` (needs
    `massless`) or `"truncation"`; see [cms.md](cms.md)."""
    massless: list[str] = []
    """Interfaces, or areas of contact for all of their points, where stops alone act; they carry no
    mass: [rigid contact without mass](../how-to/massless_boundary.md)."""

    @model_validator(mode="after")
    def _one_choice(self) -> ReductionTable:
        if not self.residual and self.method not in ("rubin", "truncation"):
            raise ValueError("has 'residual = false', which is method 'truncation'; keep one")
        if self.method == "guyan":
            names = ("modes", "cutoff_hz", "tolerance")
            refuse(self, (*names, "massless"), "method 'guyan', which keeps no modes")
            return self
        exactly_one(self, "modes", "cutoff_hz", "tolerance")
        if (self.method == "macneal") != bool(self.massless):
            raise ValueError("needs both method = \"macneal\" and 'massless', or neither")
        if not self.residual or self.method != "rubin":
            refuse(self, ("tolerance",), "methods other than 'rubin'")
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
        exactly_one(self, "row", "rows", "node")
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


class StructureTables(Table):
    """The tables that describe a structure by a mesh or by matrices."""

    mesh: MeshTable | None = None
    places: dict[str, PlaceTable] = {}
    parts: dict[str, AnyPartTable] = {}
    supports: list[SupportTable] = []
    point_masses: list[PointMassTable] = []
    springs: list[AnySpringTable] = []
    hinges: list[HingeTable] = []
    couplings: list[CouplingTable] = []
    foundations: list[FoundationTable] = []
    interfaces: dict[str, InterfaceTable] = {}
    reduction: ReductionTable | None = None
    matrices: MatricesTable | None = None


class ComponentTable(StructureTables):
    """``[components.NAME]``: one of several structures that are joined."""


class JointTable(TwoEnds):
    """``[[joints]]``: two interfaces that move as one, or one that the ground holds."""

    at: str
    """Interface of a component."""
    against: str | None = None
    """Interface of another one that moves with it; the ground holds it unless given."""

    @property
    def joined(self) -> tuple[str, ...]:
        """The interfaces that it joins."""
        return (self.at,) if self.against is None else (self.at, self.against)
