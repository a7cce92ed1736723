"""What a part of a mesh is made of: its material, and what it is beside."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from fem.base.errors import ModelError, check_positive, is_finite, quoted
from fem.mesh.attachments import vector
from fem.model.plates import PlateSection
from fem.model.sections import (
    CircularSection,
    CrossSection,
    LinearSection,
    SectionRun,
    TaperedSection,
)

THEORIES = ("euler-bernoulli", "timoshenko")
PLANES = ("stress", "strain")
INTEGRATIONS = ("full", "reduced")
SHEAR_FACTOR = 5.0 / 6.0


@dataclass(frozen=True)
class Material:
    """A linear elastic material.

    Parameters
    ----------
    youngs_modulus
        E in N/m².
    density
        rho in kg/m³; 0 for what has stiffness alone.
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
        check_positive("material", youngs_modulus=self.youngs_modulus)
        if not (is_finite(self.density) and self.density >= 0.0):
            raise ModelError(
                f"material: density must be finite and not negative, not {self.density!r}"
            )
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
        frame, which beams along z cannot do. One vector, or one for each line of the part.
    offset
        In space: place (along the height, along the width) in m of the beam's axis as seen from
        the line between its nodes, for eccentric connections.
    end_offsets
        In space: places (x, y, z) in m of both ends of the axis as seen from the nodes, in the
        axes of the whole and beside `offset`; two, or two for each line.
    neutral_axis
        In space: place (along the height, along the width) in m of the line of the centroids as
        seen from that of the shear centres, about which the beam twists; `offset` and
        `end_offsets` then are those of the shear centres.
    released
        In space: directions in which an end of the beam is not joined to its node, for each end
        numbers out of 0 to 5: along and about the axes of the section, x along the beam, y along
        its height and z along its width. Two tuples, or two for each line.

    Examples
    --------
    A beam whose second end turns freely about its width:

    >>> material, section = Material(2.1e11, 7800.0, 0.3), CircularSection(0.02)
    >>> BeamPart(material, section, released=((), (5,))).released
    ((), (5,))
    """

    material: Material
    section: Any
    theory: str = "euler-bernoulli"
    axial_force: float = 0.0
    orientation: Any = None
    offset: Sequence[float] = (0.0, 0.0)
    end_offsets: Any = None
    released: Any = None
    neutral_axis: Sequence[float] = (0.0, 0.0)

    def __post_init__(self) -> None:
        if not isinstance(self.material, Material):
            raise ModelError(f"part: material must be a Material, not {self.material!r}")
        if not isinstance(self.section, TaperedSection | LinearSection | SectionRun):
            self._check_section(self.section)
        if self.theory not in THEORIES:
            raise ModelError(f"part: theory must be one of {quoted(THEORIES)}, not {self.theory!r}")
        if not is_finite(self.axial_force):
            raise ModelError(f"part: axial_force must be finite, not {self.axial_force!r}")
        object.__setattr__(self, "offset", vector("part: offset", self.offset, 2))
        axis = vector("part: neutral_axis", self.neutral_axis, 2)
        object.__setattr__(self, "neutral_axis", axis)
        self._take("orientation", (3,))
        self._take("end_offsets", (2, 3))
        if self.orientation is not None and not np.any(self.orientation, axis=-1).all():
            raise ModelError("part: orientation must not be the zero vector")
        if self.released is not None:
            object.__setattr__(self, "released", _tuples(self.released))
            each = np.ravel(np.array(_flat(self.released), dtype=object))
            if not all(isinstance(d, int) and 0 <= d <= 5 for d in each):
                raise ModelError("part: released must be directions out of 0 to 5 of both ends")

    def _take(self, name: str, shape: tuple[int, ...]) -> None:
        """Keep numbers of a shape, or of this shape for each line, as tuples."""
        given = getattr(self, name)
        if given is None:
            return
        try:
            values = np.array(given, dtype=np.float64)
        except (TypeError, ValueError):
            values = np.array([np.nan])
        if values.shape not in (shape, (len(values), *shape)) or not np.isfinite(values).all():
            raise ModelError(
                f"part: {name} must be finite numbers of shape {shape}, or of it for each line,"
                f" not {given!r}"
            )
        object.__setattr__(self, name, _tuples(values.tolist()))

    @staticmethod
    def _check_section(section: CrossSection) -> None:
        if not (hasattr(section, "area") and hasattr(section, "second_moment")):
            raise ModelError(
                f"part: section must have an area and a second_moment, not be {section!r}"
            )
        check_positive("section", area=section.area, second_moment=section.second_moment)


def _tuples(values: Any) -> Any:
    """Nested lists as nested tuples."""
    return tuple(map(_tuples, values)) if isinstance(values, list | tuple) else values


def _flat(values: Any) -> list[Any]:
    """The innermost values of nested tuples."""
    if not isinstance(values, tuple):
        return [values]
    return [one for each in values for one in _flat(each)]


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
class SolidPart:
    """A part of the mesh that is a solid body.

    Parameters
    ----------
    material
        With a Poisson's ratio.
    plane
        None for tetrahedra, pyramids, wedges and hexahedra; for triangles and quadrilaterals in
        the x-y plane, "stress" (a sheet) or "strain" (a slice of a long body).
    thickness
        In m, of a plane part.
    integration
        How ``quad8`` and ``hexahedron20`` are integrated: "reduced", at 2 places in each
        direction, or "full", at 3, which is too stiff where a thin part is curved. By default as
        the file's types of elements say (``C3D20R``, ``C3D20``), else reduced.

    Examples
    --------
    >>> steel = Material(2.1e11, 7800.0, poissons_ratio=0.3)
    >>> SolidPart(steel).plane is None, SolidPart(steel, "stress", 0.05).thickness
    (True, 0.05)
    """

    material: Material
    plane: str | None = None
    thickness: float | None = None
    integration: str | None = None

    def __post_init__(self) -> None:
        if not isinstance(self.material, Material):
            raise ModelError(f"part: material must be a Material, not {self.material!r}")
        self.material.poissons_ratio_for("solid part")
        if self.integration is not None and self.integration not in INTEGRATIONS:
            raise ModelError(
                f"solid part: integration must be one of {quoted(INTEGRATIONS)}, not"
                f" {self.integration!r}"
            )
        if self.plane is None and self.thickness is None:
            return
        if self.plane not in PLANES:
            raise ModelError(
                f"solid part: a thickness goes with plane {quoted(PLANES)}, not {self.plane!r}"
            )
        check_positive("solid part in the plane", thickness=self.thickness)

    @property
    def lame(self) -> tuple[float, float]:
        """Lamé's constants in N/m², the first one as plane stress needs it where it applies."""
        E, nu = self.material.youngs_modulus, self.material.poissons_ratio_for("solid part")
        mu = E / (2.0 * (1.0 + nu))
        first = E * nu / ((1.0 + nu) * (1.0 - 2.0 * nu))
        if self.plane == "stress":
            first = 2.0 * first * mu / (first + 2.0 * mu)
        return first, mu


@dataclass(frozen=True)
class ShellPart:
    """A part of the mesh that is a shell: triangles and quadrilaterals with a thickness.

    Parameters
    ----------
    material
        With a Poisson's ratio.
    thickness
        In m.
    offset
        Place in m of the middle surface as seen from the nodes, along the normal of the cells:
        right-handed about it their nodes are in order.
    section
        Stiffness and mass with directions or layers; the material and the thickness then are only
        for pictures and checks.
    direction
        Of the x axis of the section: a vector (x, y, z), whose part in each cell counts, or an
        angle in degrees from the side between the first two nodes of each cell.

    Examples
    --------
    >>> ShellPart(Material(2.1e11, 7800.0, poissons_ratio=0.3), thickness=0.001).offset
    0.0
    """

    material: Material
    thickness: float
    offset: float = 0.0
    section: PlateSection | None = None
    direction: float | Sequence[float] = 0.0

    def __post_init__(self) -> None:
        if not isinstance(self.material, Material):
            raise ModelError(f"part: material must be a Material, not {self.material!r}")
        self.material.poissons_ratio_for("shell part")
        if not (self.section is None or isinstance(self.section, PlateSection)):
            raise ModelError(f"shell part: section must be a PlateSection, not {self.section!r}")
        if isinstance(self.direction, Sequence):
            way = vector("shell part: direction", self.direction, 3)
            object.__setattr__(self, "direction", way)
        elif not is_finite(self.direction):
            raise ModelError(f"shell part: direction must be an angle, not {self.direction!r}")
        check_positive("shell part", thickness=self.thickness)
        if not is_finite(self.offset):
            raise ModelError(f"shell part: offset must be finite, not {self.offset!r}")

    @property
    def mass(self) -> float:
        """In kg/m²."""
        return self.material.density * self.thickness if self.section is None else self.section.mass

    @property
    def inertia(self) -> float:
        """Of turning fibres, in kg."""
        if self.section is not None:
            return self.section.inertia
        return self.material.density * self.thickness**3 / 12.0

    @property
    def stretching(self) -> float:
        """E t / (1 - nu²) in N/m."""
        nu = self.material.poissons_ratio_for("shell part")
        return self.material.youngs_modulus * self.thickness / (1.0 - nu**2)

    @property
    def shearing(self) -> float:
        """5/6 G t in N/m."""
        nu = self.material.poissons_ratio_for("shell part")
        modulus = self.material.youngs_modulus / (2.0 * (1.0 + nu))
        return SHEAR_FACTOR * modulus * self.thickness
