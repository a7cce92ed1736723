"""What holds a component, and where it is joined to others."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from fem.base.errors import ModelError
from fem.mesh.attachments import known_direction, vector


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
