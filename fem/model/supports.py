"""What holds a component, and where it is joined to others."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from fem.base.errors import ModelError
from fem.mesh.attachments import known_direction, vector


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


@dataclass(frozen=True)
class Foundation:
    """An elastic foundation under a face, an edge or a beam.

    Parameters
    ----------
    face
        Point set or group: a face of solids, an edge of plane solids, cells of shells, or lines of
        beams.
    stiffness
        (x, y, z): N/m³ under a face (force per area and displacement), N/m² along an edge or a
        beam (force per length and displacement).

    Examples
    --------
    >>> Foundation("bottom", (0.0, 0.0, 1e8)).stiffness
    (0.0, 0.0, 100000000.0)
    """

    face: str
    stiffness: Sequence[float]

    def __post_init__(self) -> None:
        owner = f"foundation of {self.face!r}"
        object.__setattr__(self, "stiffness", vector(f"{owner}: stiffness", self.stiffness, 3))
        if min(self.stiffness) < 0.0 or not any(self.stiffness):
            raise ModelError(f"{owner}: stiffness must not be negative and not all zero")
