"""The surface of a frame: cross-sections swept along the deflected elements."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from fem.assembly.frame import Component
from fem.base.arrays import FloatArray, IntArray
from fem.base.errors import ModelError
from fem.elements.tapers import along
from fem.model.parts import TrussPart
from fem.model.sections import CircularSection, CrossSection, RectangularSection, SectionRun

CIRCLE_POINTS = 32
BoolArray = npt.NDArray[np.bool_]


def hermite(s: FloatArray) -> FloatArray:
    """Cubic Hermite polynomials on [0, 1], for (value, slope) at 0, then at 1.

    Parameters
    ----------
    s
        Places, shape (m,).

    Returns
    -------
    ndarray
        Shape (m, 4).

    Examples
    --------
    >>> hermite(np.array([0.0, 0.5, 1.0]))[:, 0].tolist()
    [1.0, 0.5, 0.0]
    """
    return np.stack(
        [
            1 - 3 * s**2 + 2 * s**3,
            s - 2 * s**2 + s**3,
            3 * s**2 - 2 * s**3,
            s**3 - s**2,
        ],
        axis=-1,
    )


def hermite_slope(s: FloatArray) -> FloatArray:
    """Derivatives of the polynomials of `hermite`, shape (m, 4)."""
    return np.stack(
        [6 * s**2 - 6 * s, 1 - 4 * s + 3 * s**2, 6 * s - 6 * s**2, 3 * s**2 - 2 * s], axis=-1
    )


def deflection(
    ends: FloatArray, lengths: FloatArray, directions: FloatArray, s: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Displacement along straight elements and its derivative with respect to length.

    The interpolation is that of the elements: linear along the axis, cubic across it.

    Parameters
    ----------
    ends
        (ux, uy, rotation) at both ends, shape (e, 2, 3).
    lengths, directions
        In m, shape (e,), and unit vectors (cos, sin), shape (e, 2).
    s
        Places between 0 (first end) and 1, shape (m,).

    Returns
    -------
    displacement, derivative
        In the directions x and y of the frame, both of shape (e, m, 2).
    """
    across = np.stack([-directions[:, 1], directions[:, 0]], axis=-1)
    axial = np.einsum("eax,ex->ea", ends[:, :, :2], directions)
    bending = np.einsum("eax,ex->ea", ends[:, :, :2], across)
    slope = ends[:, :, 2] * lengths[:, None]
    values = np.stack([bending[:, 0], slope[:, 0], bending[:, 1], slope[:, 1]], axis=-1)
    along = axial[:, :1] * (1 - s) + axial[:, 1:] * s
    stretch = (axial[:, 1] - axial[:, 0]) / lengths
    w = values @ hermite(s).T
    turn = values @ hermite_slope(s).T / lengths[:, None]
    e, n = directions[:, None, :], across[:, None, :]
    displacement = along[..., None] * e + w[..., None] * n
    derivative = stretch[:, None, None] * e + turn[..., None] * n
    return displacement, derivative


def outline(section: CrossSection | SectionRun) -> FloatArray:
    """Corners of a cross-section as (across the axis in the plane, z), shape (k, 2).

    A section known only by its area and second moment becomes the rectangle that has both; those
    of a taper at places (e, m) have their corners, (e, m, k, 2).
    """
    if isinstance(section, SectionRun):
        found = np.array([outline(each) for each in section.sections])
        return found.reshape(*section.shares.shape, *found.shape[1:])
    if isinstance(section, CircularSection):
        angle = 2 * np.pi * np.arange(CIRCLE_POINTS) / CIRCLE_POINTS
        return section.diameter / 2 * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    if isinstance(section, RectangularSection):
        height, width = section.height, section.width
    else:
        height = float(np.sqrt(12.0 * section.second_moment / section.area))
        width = section.area / height
    return np.array([[-height, -width], [height, -width], [height, width], [-height, width]]) / 2


@dataclass(frozen=True, eq=False)
class PartSurface:
    """Elements of one part, each with its outline at m places: points (e, m, k) in this order.

    The outline is the same everywhere, (k, 2), or is given at each place, (e, m, k, 2).
    """

    elements: IntArray
    outline: FloatArray
    places: FloatArray
    open_ends: tuple[tuple[int, int], ...]

    @property
    def shape(self) -> tuple[int, int, int]:
        """Elements, places along each, corners of the outline."""
        return len(self.elements), len(self.places), self.outline.shape[-2]

    def faces(self) -> Iterator[IntArray]:
        """Arrays of polygons, (f, 4) for the sides and (1, k) for each open end."""
        index = np.arange(np.prod(self.shape)).reshape(self.shape)
        turned = np.roll(index, -1, axis=2)
        sides = [index[:, :-1], turned[:, :-1], turned[:, 1:], index[:, 1:]]
        yield np.stack(sides, axis=-1).reshape(-1, 4)
        for element, end in self.open_ends:
            yield index[element, -end][None, :]

    def edges(self) -> Iterator[IntArray]:
        """Index pairs (f, 2) of the sharp edges: along the corners and around the open ends."""
        index = np.arange(np.prod(self.shape)).reshape(self.shape)
        if self.shape[2] < CIRCLE_POINTS:
            yield np.stack([index[:, :-1], index[:, 1:]], axis=-1).reshape(-1, 2)
        for element, end in self.open_ends:
            ring = index[element, -end]
            yield np.stack([ring, np.roll(ring, -1)], axis=-1)


@dataclass(frozen=True, eq=False)
class FrameSurface:
    """The surface of a whole frame, made by `frame_surface`.

    Parameters
    ----------
    component
        The assembled frame.
    parts
        How each part is swept.
    mirror
        None, or a point (2,) and a unit normal (2,) of the plane in which the frame is repeated.
    """

    component: Component
    parts: tuple[PartSurface, ...]
    mirror: tuple[FloatArray, FloatArray] | None = None

    def place(
        self, u: FloatArray, scale: float = 1.0, shrinkage: float = 1.0
    ) -> tuple[FloatArray, FloatArray]:
        """Points of the surface of the deflected frame.

        The sections stay perpendicular to the drawn axis and keep their size at any scale.

        Parameters
        ----------
        u
            Displacements of the free degrees of freedom, shape (N,).
        scale
            Factor on the displacements.
        shrinkage
            Factor on the sections.

        Returns
        -------
        points, displacement
            In m, shape (P, 3), and the length of the displacement of the axis in m, not
            scaled, shape (P,).
        """
        ends = straight_ends(self.component, self.component.element_shape(u))
        swept = [self._place_part(part, ends, scale, shrinkage) for part in self.parts]
        points = np.concatenate([points for points, _ in swept])
        size = np.concatenate([size for _, size in swept])
        if self.mirror is None:
            return points, size
        return np.concatenate([points, reflected(points, *self.mirror)]), np.tile(size, 2)

    def faces(self) -> list[IntArray]:
        """Arrays of polygons, each of shape (f, number of corners)."""
        return self._shifted([list(part.faces()) for part in self.parts])

    def edges(self) -> list[IntArray]:
        """Arrays of index pairs of the sharp edges, each of shape (f, 2)."""
        return self._shifted([list(part.edges()) for part in self.parts])

    def _place_part(
        self, part: PartSurface, ends: FloatArray, scale: float, shrinkage: float
    ) -> tuple[FloatArray, FloatArray]:
        mesh = self.component.model.mesh
        lengths = mesh.lengths[part.elements]
        directions = mesh.spans[part.elements, :2] / lengths[:, None]
        moved, change = deflection(ends[part.elements], lengths, directions, part.places)
        start = mesh.points[mesh.lines[part.elements, 0]]
        along = part.places[None, :, None] * (lengths[:, None] * directions)[:, None, :]
        axis = start[:, None, :2] + along + scale * moved
        tangent = directions[:, None, :] + scale * change
        tangent = tangent / np.linalg.norm(tangent, axis=-1, keepdims=True)
        normal = np.stack([-tangent[..., 1], tangent[..., 0]], axis=-1)
        corners = shrinkage * part.outline
        points = np.empty((*part.shape, 3))
        points[..., :2] = axis[:, :, None, :] + corners[..., :1] * normal[:, :, None, :]
        points[..., 2] = start[:, None, None, 2] + corners[..., 1]
        size = np.repeat(np.linalg.norm(moved, axis=-1)[..., None], part.shape[2], axis=-1)
        return points.reshape(-1, 3), size.ravel()

    def _shifted(self, cells: list[list[IntArray]]) -> list[IntArray]:
        counts = np.array([np.prod(part.shape) for part in self.parts])
        starts = np.concatenate([[0], np.cumsum(counts)[:-1]])
        found = [
            array + start for arrays, start in zip(cells, starts, strict=True) for array in arrays
        ]
        if self.mirror is None:
            return found
        return found + [array + counts.sum() for array in found]


def straight_ends(component: Component, ends: FloatArray) -> FloatArray:
    """Displacements at both ends (e, 2, 3) with the rotations of straight lines for trusses."""
    model, found = component.model, ends.copy()
    for name, elements in model.element_parts().items():
        if isinstance(model.parts[name], TrussPart):
            span, moved = model.mesh.spans[elements], ends[elements, 1] - ends[elements, 0]
            turn = span[:, 0] * moved[:, 1] - span[:, 1] * moved[:, 0]
            found[elements, :, 2] = (turn / model.mesh.lengths[elements] ** 2)[:, None]
    return found


def reflected(points: FloatArray, origin: FloatArray, normal: FloatArray) -> FloatArray:
    """Points (P, 3) reflected in the plane through `origin` (2,) with the normal (2,)."""
    mirrored = points.copy()
    distance = (points[:, :2] - origin) @ normal
    mirrored[:, :2] -= 2.0 * distance[:, None] * normal
    return mirrored


def frame_surface(
    component: Component, mirror: str | None = None, places: int | None = None
) -> FrameSurface:
    """The surface of a frame with its true sections.

    Parameters
    ----------
    component
        The assembled frame.
    mirror
        A point on a plane of symmetry, to draw a half model whole. A support there must hold
        ("x", "rotation") or ("y", "rotation") and so say which way the plane lies.
    places
        How many places along each element; by default as many as make the whole frame smooth.

    Returns
    -------
    FrameSurface

    Raises
    ------
    ModelError
        If there is no such point, or no support makes it one of a plane of symmetry.

    Examples
    --------
    >>> import fem
    >>> mesh = fem.frame_mesh({"root": (0, 0), "tip": (1, 0)}, [("arm", "root", "tip", 1)])
    >>> component = fem.assemble(fem.FrameModel(
    ...     mesh,
    ...     parts={"arm": fem.BeamPart(fem.Material(2e11, 7800.0),
    ...                                fem.RectangularSection(width=0.2, height=0.1))},
    ...     supports=[fem.Support("root", ("x", "y", "rotation"))],
    ... ))
    >>> points, displacement = frame_surface(component).place(np.array([0.0, 0.3, 0.4]))
    >>> points[displacement == 0].min(axis=0).tolist()
    [0.0, -0.05, -0.1]
    """
    model = component.model
    if places is None:
        places = int(np.clip(600 // len(model.mesh.lines), 4, 32)) + 1
    s = np.linspace(0.0, 1.0, places)
    plane = None if mirror is None else symmetry_plane(component, mirror)
    joined = nodes_on(component, plane)
    parts = tuple(
        PartSurface(
            elements,
            outline(
                along(
                    model.parts[name], model.mesh, model.mesh.lines[elements], f"part {name!r}", s
                ).section
            ),
            s,
            open_ends(model.mesh.lines[elements], joined),
        )
        for name, elements in model.element_parts().items()
        if len(elements)
    )
    return FrameSurface(component, parts, plane)


def open_ends(lines: IntArray, joined: BoolArray) -> tuple[tuple[int, int], ...]:
    """(position among `lines` (e, 2), end 0 or 1) of the ends where the part stops.

    These are the ends that no other of the lines meets and that are not among the nodes
    `joined` (n,) to the mirror image.
    """
    meeting = np.bincount(lines.ravel())
    stops = (meeting[lines] == 1) & ~joined[lines]
    return tuple((int(e), int(end)) for e, end in np.argwhere(stops))


def nodes_on(component: Component, plane: tuple[FloatArray, FloatArray] | None) -> BoolArray:
    """Which nodes lie on a plane given by a point and a unit normal, shape (n,)."""
    points = component.model.mesh.points
    if plane is None:
        return np.zeros(len(points), dtype=np.bool_)
    origin, normal = plane
    distance = np.abs((points[:, :2] - origin) @ normal)
    return np.asarray(distance < 1e-9 * np.linalg.norm(np.ptp(points, axis=0)), dtype=np.bool_)


def symmetry_plane(component: Component, point: str) -> tuple[FloatArray, FloatArray]:
    """Point (2,) and unit normal (2,) of the plane of symmetry that the supports make there."""
    model = component.model
    origin = model.mesh.points[model.mesh.node(point), :2]
    normal = symmetry_normal(component, point)
    if normal is None:
        raise ModelError(
            f"{model.mesh.source}: {point!r} is not on a plane of symmetry, where a support holds"
            " ('x', 'rotation') or ('y', 'rotation')"
        )
    return origin, normal


def symmetry_normal(component: Component, point: str) -> FloatArray | None:
    """Unit normal (2,) of the plane of symmetry that the supports at a point make, if they do."""
    model = component.model
    node = model.mesh.node(point)
    held = {
        name
        for support in model.supports
        if node in model.mesh.nodes(support.point)
        for name in support.directions
    }
    normals = {"x": np.array([1.0, 0.0]), "y": np.array([0.0, 1.0])}
    for direction, normal in normals.items():
        if held == {direction, "rotation"}:
            return normal
    return None
