"""What is attached to points: supports, masses, springs, couplings, equations and matrices."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, fields

import numpy as np

from fem.base.errors import ModelError, check_positive, is_finite, quoted

DIRECTIONS = ("x", "y", "rotation")
"""In the plane; "rotation" is about z."""
SYMMETRIC = 1e-9  # of the largest entry: difference of two that are rounding
SPATIAL_DIRECTIONS = (*DIRECTIONS, "z", "rotation_x", "rotation_y", "rotation_z")


def known_direction(owner: str, direction: str) -> None:
    if direction not in SPATIAL_DIRECTIONS:
        raise ModelError(
            f"{owner}: there is no direction {direction!r}; use {quoted(DIRECTIONS)}, and in space"
            f" {quoted(SPATIAL_DIRECTIONS[3:])}"
        )


def vector(what: str, values: Sequence[float], length: int) -> tuple[float, ...]:
    """The values as a tuple of finite floats, or a ModelError.

    Examples
    --------
    >>> vector("offset", [0, 1], 2)
    (0.0, 1.0)
    """
    given = list(values) if isinstance(values, Iterable) else []
    if len(given) != length or not all(is_finite(value) for value in given):
        raise ModelError(f"{what} must be {length} finite numbers, not {values!r}")
    return tuple(float(value) for value in given)


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
class PointMass:
    """A lumped mass in kg at a point, with an optional rotary inertia in kg m².

    In space the inertia is about the centre of mass and the same about all axes, or given as
    three principal values about x, y and z; `offset` (x, y, z) in m is the place of the centre of
    mass as seen from the point, with which it is joined rigidly.
    """

    point: str
    mass: float
    rotary_inertia: float | Sequence[float] = 0.0
    offset: Sequence[float] = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        owner = f"point mass at {self.point!r}"
        object.__setattr__(self, "offset", vector(f"{owner}: offset", self.offset, 3))
        inertias: Sequence[float]
        if not isinstance(self.rotary_inertia, Sequence):
            inertias = (self.rotary_inertia,)
        else:
            inertias = vector(f"{owner}: rotary inertia", self.rotary_inertia, 3)
            object.__setattr__(self, "rotary_inertia", inertias)
        for name, value in (("mass", self.mass), *(("rotary inertia", i) for i in inertias)):
            if not (is_finite(value) and value >= 0.0):
                raise ModelError(
                    f"point mass at {self.point!r}: {name} must be finite and not negative,"
                    f" not {value!r}"
                )
        if self.mass == 0.0 and not any(inertias):
            raise ModelError(f"point mass at {self.point!r}: mass and rotary inertia are both zero")
        if self.mass == 0.0 and any(self.offset):
            raise ModelError(f"{owner}: an offset needs a mass")


@dataclass(frozen=True)
class PointSpring:
    """A spring from a point to the ground: N/m along "x" or "y", N m/rad for "rotation"."""

    point: str
    direction: str
    stiffness: float

    def __post_init__(self) -> None:
        known_direction(f"spring at {self.point!r}", self.direction)
        check_positive(f"spring at {self.point!r}", stiffness=self.stiffness)


@dataclass(frozen=True)
class Coupling:
    """Joins the nodes of a face to a point that has rotations.

    Parameters
    ----------
    point
        Name of the point: one of the mesh, or a new one.
    face
        Point set or group whose nodes are joined to it.
    kind
        "rigid": the nodes move with the point as one rigid body (RBE2). "averaging": the point
        moves with the face in the mean and does not stiffen it (RBE3): its motion is the rigid
        one nearest to the face's, in the sense of least squares over the area.
    at
        Place (x, y, z) in m of a new point; by default the centre of the face.
    directions
        Of a rigid coupling: the translations of the face that follow, by default all.
    weighting
        Of an averaging coupling: "area", or "nodes" where every node counts the same.

    Examples
    --------
    >>> Coupling("hub", "bore").kind
    'rigid'
    """

    point: str
    face: str
    kind: str = "rigid"
    at: Sequence[float] | None = None
    directions: Sequence[str] = ("x", "y", "z")
    weighting: str = "area"

    def __post_init__(self) -> None:
        owner = f"coupling of {self.face!r} to {self.point!r}"
        if self.weighting not in ("area", "nodes"):
            raise ModelError(f"{owner}: weighting is 'area' or 'nodes', not {self.weighting!r}")
        if self.kind not in ("rigid", "averaging"):
            raise ModelError(f"{owner}: kind must be 'rigid' or 'averaging', not {self.kind!r}")
        if self.at is not None:
            object.__setattr__(self, "at", vector(f"{owner}: at", self.at, 3))
        given = (self.directions,) if isinstance(self.directions, str) else tuple(self.directions)
        if not given or not set(given) <= {"x", "y", "z"} or len(set(given)) < len(given):
            raise ModelError(f"{owner}: directions must be out of 'x', 'y', 'z', not {given!r}")
        if self.kind == "averaging" and len(given) < 3:
            raise ModelError(f"{owner}: an averaging coupling has all directions")
        object.__setattr__(self, "directions", given)


@dataclass(frozen=True)
class Link:
    """A spring and a damper between two points, or between a point and the ground.

    Parameters
    ----------
    first, second
        Names of the points; no second one for the ground.
    directions
        The direction of each point, so that the elongation is the displacement of the first along
        its direction less that of the second along its own. None: along the line between the two.
    stiffness
        In N/m (N m/rad for rotations).
    damping
        In N s/m (N m s/rad).

    Examples
    --------
    >>> Link("tip", None, ("y",), damping=3.0)
    Link(first='tip', second=None, directions=('y',), stiffness=0.0, damping=3.0)
    """

    first: str
    second: str | None = None
    directions: Sequence[str] | None = None
    stiffness: float = 0.0
    damping: float = 0.0

    def __post_init__(self) -> None:
        ends = repr(self.first) if self.second is None else f"{self.first!r} and {self.second!r}"
        owner = f"link at {ends}"
        for name, value in (("stiffness", self.stiffness), ("damping", self.damping)):
            if not (is_finite(value) and value >= 0.0):
                raise ModelError(f"{owner}: {name} must be finite and not negative, not {value!r}")
        if self.second == self.first and self.directions is None:
            raise ModelError(f"{owner}: its two points are one, so that it has no direction")
        count = 1 if self.second is None else 2
        if self.directions is None:
            if self.second is None:
                raise ModelError(f"{owner}: a link to the ground needs a direction")
            return
        object.__setattr__(self, "directions", tuple(self.directions))
        if len(self.directions) != count:
            raise ModelError(f"{owner}: needs {count} directions, not {self.directions!r}")
        for direction in self.directions:
            known_direction(owner, direction)

    @property
    def points(self) -> tuple[str, ...]:
        """The names of its one or two points."""
        return (self.first,) if self.second is None else (self.first, self.second)


@dataclass(frozen=True)
class LinearEquation:
    """A linear equation between displacements: the sum of coefficient times displacement is zero.

    Parameters
    ----------
    terms
        (point, direction, coefficient); the first one that nothing holds follows from the others.
    origin
        What it comes from, for error texts.

    Examples
    --------
    >>> LinearEquation([("a", "x", 1.0), ("b", "x", -1.0)]).points
    ('a', 'b')
    """

    terms: Sequence[tuple[str, str, float]]
    origin: str = "equation"

    def __post_init__(self) -> None:
        terms = tuple((str(point), str(way), value) for point, way, value in self.terms)
        object.__setattr__(self, "terms", terms)
        if not any(value for _, _, value in terms):
            raise ModelError(f"{self.origin}: no term has a coefficient other than zero")
        for point, direction, value in terms:
            known_direction(f"{self.origin}: {point!r}", direction)
            if not is_finite(value):
                raise ModelError(f"{self.origin}: a coefficient must be finite, not {value!r}")

    @property
    def points(self) -> tuple[str, ...]:
        """Its points, in the order of the terms."""
        return tuple(point for point, _, _ in self.terms)


Matrix = Sequence[Sequence[float]]


@dataclass(frozen=True)
class PointMatrix:
    """Stiffness, mass and damping between directions of points, as symmetric matrices.

    Parameters
    ----------
    terms
        (point, direction) of each row, k of them.
    stiffness, mass, damping
        Rows of shape (k, k); empty for none. Units are N/m, kg and N s/m for translations.
    origin
        What it comes from, for error texts.

    Raises
    ------
    ModelError
        If a matrix has another shape, is not finite or is not symmetric.

    Examples
    --------
    >>> PointMatrix([("a", "x"), ("b", "y")], stiffness=[[2.0, 1.0], [1.0, 2.0]]).points
    ('a', 'b')
    """

    terms: Sequence[tuple[str, str]]
    stiffness: Matrix = ()
    mass: Matrix = ()
    damping: Matrix = ()
    origin: str = "matrix"

    def __post_init__(self) -> None:
        terms = tuple((str(point), str(way)) for point, way in self.terms)
        object.__setattr__(self, "terms", terms)
        for point, direction in terms:
            known_direction(f"{self.origin}: {point!r}", direction)
        for name in ("stiffness", "mass", "damping"):
            given = getattr(self, name)
            if not len(given):
                object.__setattr__(self, name, ())
                continue
            rows = np.array(given, dtype=np.float64)
            square = rows.shape == (len(terms), len(terms)) and bool(np.isfinite(rows).all())
            if not square or np.abs(rows - rows.T).max() > SYMMETRIC * np.abs(rows).max():
                raise ModelError(
                    f"{self.origin}: {name} must be a symmetric matrix of {len(terms)} rows"
                )
            object.__setattr__(self, name, tuple(map(tuple, rows.tolist())))

    @property
    def points(self) -> tuple[str, ...]:
        """Its points, in the order of the terms."""
        return tuple(point for point, _ in self.terms)


@dataclass(frozen=True)
class Attachments:
    """What a mesh file brings beside its cells; a model assembles it together with its own.

    Parameters
    ----------
    point_masses, links, couplings, equations, supports, matrices
        Their points are point sets of the mesh, made for the purpose where they had no name
        ("node 17").
    turning
        Names of point sets whose nodes have rotations, also where only solids meet them.
    loose
        Names of point sets of which directions that nothing resists are held.
    placeless
        Names of point sets whose nodes are degrees of freedom without a place: they take no part
        in rigid motions, and their mass has no weight and no centre.

    Examples
    --------
    >>> Attachments(links=[Link("node 2", None, ("x",), 1e4)])
    <Attachments: links: 1>
    >>> bool(Attachments())
    False
    """

    point_masses: Sequence[PointMass] = ()
    links: Sequence[Link] = ()
    couplings: Sequence[Coupling] = ()
    equations: Sequence[LinearEquation] = ()
    supports: Sequence[Support] = ()
    matrices: Sequence[PointMatrix] = ()
    turning: Sequence[str] = ()
    loose: Sequence[str] = ()
    placeless: Sequence[str] = ()

    def __post_init__(self) -> None:
        for each in fields(self):
            object.__setattr__(self, each.name, tuple(getattr(self, each.name)))

    @property
    def points(self) -> tuple[str, ...]:
        """The names of all points and faces that something is attached to."""
        names = [mass.point for mass in self.point_masses]
        names += [point for link in self.links for point in link.points]
        names += [point for equation in self.equations for point in equation.points]
        names += [name for item in self.couplings for name in (item.point, item.face)]
        names += [item.point for item in self.supports]
        names += [point for item in self.matrices for point in item.points]
        names += [*self.turning, *self.loose, *self.placeless]
        return tuple(dict.fromkeys(names))

    def __bool__(self) -> bool:
        return any(getattr(self, each.name) for each in fields(self))

    @property
    def measured(self) -> bool:
        """Whether something of it has a unit, which changes with that of the coordinates."""
        plain = ("supports", "turning", "loose", "placeless")
        return any(getattr(self, each.name) for each in fields(self) if each.name not in plain)

    def __str__(self) -> str:
        counts = [(len(getattr(self, f.name)), f.name.replace("_", " ")) for f in fields(self)]
        return ", ".join(f"{name}: {count}" for count, name in counts if count) or "none"

    def __repr__(self) -> str:
        return f"<Attachments: {self}>"

    def __add__(self, other: Attachments) -> Attachments:
        return Attachments(*(getattr(self, f.name) + getattr(other, f.name) for f in fields(self)))


@dataclass(frozen=True)
class LeftOut:
    """Something in a mesh file that is left out by intention, such as a load.

    Examples
    --------
    >>> print(LeftOut("*BOUNDARY", 2, "line 17", "supports are given by the scene"))
    *BOUNDARY (2, first in line 17): supports are given by the scene
    """

    keyword: str
    count: int
    place: str
    reason: str = ""

    def __str__(self) -> str:
        where = f"{self.keyword} ({self.count}, first in {self.place})"
        return f"{where}: {self.reason}" if self.reason else where
