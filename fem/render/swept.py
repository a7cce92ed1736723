"""Cross-sections swept along the lines of beams."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from fem.base.arrays import FloatArray, IntArray
from fem.model.sections import CircularSection, CrossSection, RectangularSection, SectionRun

CIRCLE_POINTS = 32
BoolArray = npt.NDArray[np.bool_]


def outline(section: CrossSection | SectionRun) -> FloatArray:
    """Corners of a cross-section as (along its height, along its width), shape (k, 2).

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
    """A number of elements of one part, each with its outline at m places: points (e, m, k).

    The outline is the same everywhere, (k, 2), or is given at each place, (e, m, k, 2).
    """

    count: int
    outline: FloatArray
    places: FloatArray
    open_ends: tuple[tuple[int, int], ...]

    @property
    def shape(self) -> tuple[int, int, int]:
        """Elements, places along each, corners of the outline."""
        return self.count, len(self.places), self.outline.shape[-2]

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


def open_ends(lines: IntArray, joined: BoolArray) -> tuple[tuple[int, int], ...]:
    """(position among `lines` (e, 2), end 0 or 1) of the ends where the part stops.

    These are the ends that no other of the lines meets and that are not among the nodes
    `joined` (n,) to the mirror image.
    """
    meeting = np.bincount(lines.ravel())
    stops = (meeting[lines] == 1) & ~joined[lines]
    return tuple((int(e), int(end)) for e, end in np.argwhere(stops))
