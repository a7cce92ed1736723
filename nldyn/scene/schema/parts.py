"""Tables of the parts of a mesh: beams, trusses, solids and shells."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field, PrivateAttr, Tag, model_validator

from nldyn.scene.messages import quoted
from nldyn.scene.schema.table import NotNegative, Number, Positive, Table, Triple, by_key, refuse

PoissonsRatio = Annotated[float, Field(gt=-1, lt=0.5)]


class PartTable(Table):
    """``[parts.NAME]``: material of one part of the mesh, and what it is: a beam, a shell, ..."""

    _made: Any = PrivateAttr(None)
    kind: Literal["beam", "truss", "solid", "shell"] = "beam"
    """`"beam"`, `"truss"`, `"solid"`, or in space `"shell"`."""
    youngs_modulus: Positive
    """[N/m²] Young's modulus."""
    density: Positive
    """[kg/m³] Density."""
    poissons_ratio: PoissonsRatio | None = None
    """Poisson's ratio, above -1 and below 0.5. Solids, shells, Timoshenko beams and beams in
    space need it."""


class TrussTable(PartTable):
    """``[parts.NAME]`` with ``kind = "truss"``."""

    kind: Literal["truss"] = "truss"
    area: Positive
    """[m²] Area."""


class SolidTable(PartTable):
    """``[parts.NAME]`` with ``kind = "solid"``."""

    kind: Literal["solid"] = "solid"
    poissons_ratio: PoissonsRatio
    plane: Literal["stress", "strain"] | None = None
    """Of triangles or quadrilaterals: `"stress"` or `"strain"`."""
    thickness: Positive | None = None
    """[m] In the plane."""
    integration: Literal["full", "reduced"] | None = None
    """Of `quad8` or `hexahedron20`: `"reduced"`, at 2 places in each direction, or
    `"full"`, at 3, which is too stiff where a thin part is curved. If left out as the file's types
    of elements say (`C3D20R`, `C3D20`), else reduced."""

    @model_validator(mode="after")
    def _in_plane(self) -> SolidTable:
        if (self.plane is None) != (self.thickness is None):
            raise ValueError("needs both 'plane' and 'thickness' (in the plane), or neither")
        return self


class ShellTable(PartTable):
    """``[parts.NAME]`` with ``kind = "shell"``."""

    kind: Literal["shell"] = "shell"
    poissons_ratio: PoissonsRatio
    thickness: Positive
    """[m] Thickness."""
    offset: Number | None = None
    """[m] Place of its middle surface along the normal as seen from the nodes, about which they run
    anticlockwise."""


class BeamTable(PartTable):
    """``[parts.NAME]`` with ``kind = "beam"``."""

    kind: Literal["beam"] = "beam"
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
    """[m²] Area of a general section."""
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
    offset: Annotated[list[Number], Field(min_length=2, max_length=2)] | None = None
    """[m] Place of its axis (along the height, along the width) as seen from the line of the
    mesh."""

    @model_validator(mode="after")
    def _one_section(self) -> BeamTable:
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
            refuse(self, (*numbers, "shear_area_across"), "a section given by its dimensions")
        if self.bore and self.diameter and self.bore >= self.diameter:
            raise ValueError(f"has a 'bore' of {self.bore:g}, not less than its 'diameter'")
        return self

    def size(self, name: str, end: str) -> float | None:
        """A dimension of the section at its start or end; one that is not given stays the same."""
        value: float | None = getattr(self, name + end)
        start: float | None = getattr(self, name)
        return start if value is None else value

    @model_validator(mode="after")
    def _one_taper(self) -> BeamTable:
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


AnyPartTable = Annotated[
    Annotated[BeamTable, Tag("kind 'beam'")]
    | Annotated[TrussTable, Tag("kind 'truss'")]
    | Annotated[SolidTable, Tag("kind 'solid'")]
    | Annotated[ShellTable, Tag("kind 'shell'")],
    by_key("kind", "beam", "truss", "solid", "shell", default="beam"),
]
