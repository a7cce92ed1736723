"""Cross-sections of beams."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from fem.base.errors import ModelError, check_positive, is_finite

SERIES_TERMS = 30


class CrossSection(Protocol):
    """Anything with an area in m² and a second moment of area in m⁴ for bending in the plane.

    A beam in space needs `second_moment_across` and `torsion_constant` too, and a Timoshenko beam
    `shear_areas`.
    """

    @property
    def area(self) -> float:
        """Area in m²."""

    @property
    def second_moment(self) -> float:
        """Second moment of area in m⁴ about the axis normal to the plane of the frame."""


@dataclass(frozen=True)
class Section:
    """A cross-section given by its numbers.

    Parameters
    ----------
    area
        In m².
    second_moment
        In m⁴, for bending in the plane of the frame, or along the height of a beam in space.
    second_moment_across
        In m⁴, for bending along the width; a beam in space needs it.
    torsion_constant
        Saint-Venant's J in m⁴; a beam in space needs it.
    shear_area, shear_area_across
        Area times shear coefficient in m², along the height and along the width; a Timoshenko
        beam needs them (the second only in space).
    added_mass, added_inertia
        What the beam carries beside its own mass, at its axis: kg/m, and kg m against twisting.

    Examples
    --------
    >>> Section(area=2.85e-3, second_moment=1.94e-5).area   # IPE 200
    0.00285
    """

    area: float
    second_moment: float
    second_moment_across: float | None = None
    torsion_constant: float | None = None
    shear_area: float | None = None
    shear_area_across: float | None = None
    added_mass: float = 0.0
    added_inertia: float = 0.0

    def __post_init__(self) -> None:
        check_positive("section", area=self.area, second_moment=self.second_moment)
        for name in ("added_mass", "added_inertia"):
            value = getattr(self, name)
            if not (is_finite(value) and value >= 0.0):
                raise ModelError(f"section: {name} must be finite and not negative, not {value!r}")
        names = ("second_moment_across", "torsion_constant", "shear_area", "shear_area_across")
        for name in names:
            if getattr(self, name) is not None:
                check_positive("section", **{name: getattr(self, name)})

    def shear_areas(self, poissons_ratio: float) -> tuple[float | None, float | None]:
        """Areas in m² that carry shear along the height and the width, as given."""
        return self.shear_area, self.shear_area_across


@dataclass(frozen=True)
class RectangularSection:
    """A rectangle: `width` in m normal to the plane of the frame, `height` in m within it.

    Examples
    --------
    >>> section = RectangularSection(width=0.09, height=0.01)
    >>> round(section.area, 6), round(section.second_moment * 1e9, 6)
    (0.0009, 7.5)
    """

    width: float
    height: float

    def __post_init__(self) -> None:
        check_positive("rectangular section", width=self.width, height=self.height)

    @property
    def area(self) -> float:
        """Area in m²."""
        return self.width * self.height

    @property
    def second_moment(self) -> float:
        """Second moment of area in m⁴: width height³ / 12."""
        return self.width * self.height**3 / 12.0

    @property
    def second_moment_across(self) -> float:
        """Second moment of area in m⁴ for bending along the width: height width³ / 12."""
        return self.height * self.width**3 / 12.0

    @property
    def torsion_constant(self) -> float:
        """Saint-Venant's torsion constant in m⁴.

        The series of S. P. Timoshenko and J. N. Goodier, Theory of Elasticity, 3rd ed., 1970,
        article 109.

        Examples
        --------
        >>> round(RectangularSection(1.0, 1.0).torsion_constant, 6)
        0.140577
        """
        a, b = max(self.width, self.height), min(self.width, self.height)
        series = math.fsum(
            math.tanh(n * math.pi * a / (2.0 * b)) / n**5 for n in range(1, 2 * SERIES_TERMS, 2)
        )
        return a * b**3 / 3.0 * (1.0 - 192.0 / math.pi**5 * b / a * series)

    def shear_areas(self, poissons_ratio: float) -> tuple[float, float]:
        """Areas in m² that carry shear, 10 (1 + nu) / (12 + 11 nu) of the whole (Cowper, 1966)."""
        area = 10.0 * (1.0 + poissons_ratio) / (12.0 + 11.0 * poissons_ratio) * self.area
        return area, area


@dataclass(frozen=True)
class CircularSection:
    """A round bar, or a tube if `bore` is not zero; both diameters in m.

    Examples
    --------
    >>> round(CircularSection(0.02).area * 1e6, 3)
    314.159
    """

    diameter: float
    bore: float = 0.0

    def __post_init__(self) -> None:
        check_positive("circular section", diameter=self.diameter)
        if not (is_finite(self.bore) and 0.0 <= self.bore < self.diameter):
            raise ModelError(
                f"circular section: bore must be at least 0 and less than the diameter"
                f" {self.diameter!r}, not {self.bore!r}"
            )

    @property
    def area(self) -> float:
        """Area in m²."""
        return math.pi / 4.0 * (self.diameter**2 - self.bore**2)

    @property
    def second_moment(self) -> float:
        """Second moment of area in m⁴: pi (diameter⁴ - bore⁴) / 64."""
        return math.pi / 64.0 * (self.diameter**4 - self.bore**4)

    @property
    def second_moment_across(self) -> float:
        """The same in all directions, in m⁴."""
        return self.second_moment

    @property
    def torsion_constant(self) -> float:
        """Polar second moment of area in m⁴."""
        return 2.0 * self.second_moment

    def shear_areas(self, poissons_ratio: float) -> tuple[float, float]:
        """Areas in m² that carry shear (G. R. Cowper, J. Appl. Mech. 33, 1966, p. 335).

        With m = bore / diameter the coefficient is
        6 (1 + nu) (1 + m²)² / ((7 + 6 nu) (1 + m²)² + (20 + 12 nu) m²).
        """
        nu, m = poissons_ratio, self.bore / self.diameter
        square = (1.0 + m * m) ** 2
        shape = (7.0 + 6.0 * nu) * square + (20.0 + 12.0 * nu) * m * m
        area = 6.0 * (1.0 + nu) * square / shape * self.area
        return area, area


@dataclass(frozen=True)
class TaperedSection:
    """A section that changes along a part, linearly in its dimensions, between two named points.

    Parameters
    ----------
    start, end
        Rectangles, or round bars and tubes, both of the same kind.
    from_point, to_point
        Points of the mesh where they are. In between a dimension follows the share of the way from
        one to the other, on the straight line that joins them.

    Raises
    ------
    ModelError
        If the sections are of other kinds, or the two points are the same.

    Examples
    --------
    >>> wedge = TaperedSection(
    ...     RectangularSection(1.0, 2.0), RectangularSection(1.0, 1.0), "root", "tip"
    ... )
    >>> wedge.at(0.25)
    RectangularSection(width=1.0, height=1.75)
    """

    start: RectangularSection | CircularSection
    end: RectangularSection | CircularSection
    from_point: str
    to_point: str

    def __post_init__(self) -> None:
        known = isinstance(self.start, RectangularSection | CircularSection)
        if not known or type(self.start) is not type(self.end):
            raise ModelError(
                "tapered section: start and end must be two RectangularSection or two"
                f" CircularSection, not {self.start!r} and {self.end!r}"
            )
        if self.from_point == self.to_point:
            raise ModelError(f"tapered section: it starts and ends at {self.from_point!r}")

    def at(self, share: float) -> RectangularSection | CircularSection:
        """The section at a share of the way between 0 and 1."""
        sizes = zip(vars(self.start).items(), vars(self.end).values(), strict=True)
        return type(self.start)(**{n: (1.0 - share) * a + share * b for (n, a), b in sizes})


@dataclass(frozen=True)
class LinearSection:
    """A section whose numbers change linearly from the first to the second end of every line.

    Parameters
    ----------
    start, end
        At the ends, with all numbers that the beam needs.

    Examples
    --------
    >>> LinearSection(Section(2.0, 1.0), Section(4.0, 3.0)).at(0.25).area
    2.5
    """

    start: Section
    end: Section

    def __post_init__(self) -> None:
        if not isinstance(self.start, Section) or not isinstance(self.end, Section):
            raise ModelError("linear section: start and end must be of the class Section")

    def at(self, share: float) -> Section:
        """The section at a share of the way between 0 and 1."""
        pairs = zip(vars(self.start).items(), vars(self.end).values(), strict=True)
        numbers: dict[str, Any] = {
            name: None if a is None or b is None else (1.0 - share) * a + share * b
            for (name, a), b in pairs
        }
        return Section(**numbers)


@dataclass(frozen=True, eq=False)
class SectionRun:
    """The numbers of a tapered section at places along lines, as arrays of the shape of `shares`.

    Parameters
    ----------
    taper
        The section.
    shares
        Of the way from its start to its end, shape (e, q).
    """

    taper: TaperedSection | LinearSection
    shares: npt.NDArray[np.float64]

    @cached_property
    def sections(self) -> list[Any]:
        """One after the other."""
        return [self.taper.at(float(share)) for share in self.shares.ravel()]

    def numbers(self, name: str) -> npt.NDArray[np.float64]:
        """An attribute of all sections, shape (e, q)."""
        values = np.array([getattr(section, name) for section in self.sections], dtype=np.float64)
        return values.reshape(self.shares.shape)

    @property
    def area(self) -> npt.NDArray[np.float64]:
        """In m²."""
        return self.numbers("area")

    @property
    def second_moment(self) -> npt.NDArray[np.float64]:
        """In m⁴, along the height."""
        return self.numbers("second_moment")

    @property
    def second_moment_across(self) -> npt.NDArray[np.float64]:
        """In m⁴, along the width."""
        return self.numbers("second_moment_across")

    @property
    def torsion_constant(self) -> npt.NDArray[np.float64]:
        """In m⁴."""
        return self.numbers("torsion_constant")

    def shear_areas(
        self, poissons_ratio: float
    ) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
        """In m², along the height and the width."""
        pairs = [section.shear_areas(poissons_ratio) for section in self.sections]
        first, second = np.array(pairs).T.reshape(2, *self.shares.shape)
        return first, second


def added(section: Any, name: str) -> Any:
    """The `added_mass` or `added_inertia` of a section, at its places if it is a run of them.

    Examples
    --------
    >>> added(Section(1.0, 1.0, added_mass=3.0), "added_mass")
    3.0
    """
    if isinstance(section, SectionRun):
        return section.numbers(name) if isinstance(section.taper, LinearSection) else 0.0
    return getattr(section, name, 0.0)


def section_number(section: CrossSection, name: str, what: str) -> Any:
    """A number of a section, or a ModelError that says which one is missing.

    Examples
    --------
    >>> section_number(CircularSection(1.0), "area", "part 'rod'") > 0.78
    True
    """
    value = getattr(section, name, None)
    if value is None:
        raise ModelError(f"{what}: a beam in space needs the section's {name}")
    if isinstance(section, SectionRun):
        return value
    check_positive(f"{what}: section", **{name: value})
    return float(value)


def shear_areas(
    section: CrossSection, poissons_ratio: float, what: str, directions: int = 2
) -> Sequence[Any]:
    """The areas that carry shear, or a ModelError that says that they are missing."""
    given = getattr(section, "shear_areas", lambda _: (None, None))(poissons_ratio)[:directions]
    if any(value is None for value in given):
        names = ("shear_area", "shear_area_across")[:directions]
        raise ModelError(f"{what}: a Timoshenko beam needs the section's {' and '.join(names)}")
    return [value for value in given if value is not None]
