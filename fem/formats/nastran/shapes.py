"""Cross-sections of PBARL and PBEAML from their dimensions.

Each is made of rectangles, whose areas and second moments are exact. The torsion constant is exact
for solid and tubular round sections, a series for rectangles, Bredt's for thin boxes, and the sum
of length times thickness cubed over three for open ones.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from fem.model.sections import RectangularSection

Box = tuple[float, float, float, float]
"""A rectangle from z0 to z1 and from y0 to y1, as (z0, z1, y0, y1); a hole has z1 < z0."""


@dataclass(frozen=True)
class Numbers:
    """Area, second moments for bending along y, along z and mixed, and torsion constant.

    The shear centre lies at `shear_centre` (y, z) as seen from the centroid.
    """

    area: float
    along_y: float
    along_z: float
    mixed: float
    torsion: float
    shear_centre: tuple[float, float] = (0.0, 0.0)


def _boxes(boxes: Sequence[Box], torsion: float, shear: tuple[float, float] | None) -> Numbers:
    """Numbers of rectangles; the shear centre is given in their coordinates (y, z)."""
    areas = [(z1 - z0) * (y1 - y0) for z0, z1, y0, y1 in boxes]
    area = math.fsum(areas)
    y = math.fsum(a * (b[2] + b[3]) / 2 for a, b in zip(areas, boxes, strict=True)) / area
    z = math.fsum(a * (b[0] + b[1]) / 2 for a, b in zip(areas, boxes, strict=True)) / area
    along_y = along_z = mixed = 0.0
    for a, (z0, z1, y0, y1) in zip(areas, boxes, strict=True):
        dy, dz = (y0 + y1) / 2 - y, (z0 + z1) / 2 - z
        along_y += a * ((y1 - y0) ** 2 / 12 + dy**2)
        along_z += a * ((z1 - z0) ** 2 / 12 + dz**2)
        mixed += a * dy * dz
    centre = (0.0, 0.0) if shear is None else (shear[0] - y, shear[1] - z)
    return Numbers(area, along_y, along_z, mixed, torsion, centre)


def _thin(*walls: tuple[float, float]) -> float:
    """Torsion constant of open walls (length, thickness)."""
    return math.fsum(length * thickness**3 / 3.0 for length, thickness in walls)


def _round(outer: float, inner: float = 0.0) -> Numbers:
    area, second = math.pi * (outer**2 - inner**2), math.pi / 4.0 * (outer**4 - inner**4)
    return Numbers(area, second, second, 0.0, 2.0 * second)


def _bar(width: float, height: float) -> Numbers:
    torsion = RectangularSection(width, height).torsion_constant
    return _boxes([(0.0, width, 0.0, height)], torsion, None)


def _box1(w: float, h: float, top: float, bottom: float, left: float, right: float) -> Numbers:
    inner = (w - right, left, bottom, h - top)
    enclosed = (w - (left + right) / 2) * (h - (top + bottom) / 2)
    around = (w - (left + right) / 2) * (1 / top + 1 / bottom)
    around += (h - (top + bottom) / 2) * (1 / left + 1 / right)
    return _boxes([(0.0, w, 0.0, h), inner], 4.0 * enclosed**2 / around, None)


def _i(h: float, bottom: float, top: float, web: float, low: float, high: float) -> Numbers:
    walls = [(-bottom / 2, bottom / 2, 0.0, low), (-top / 2, top / 2, h - high, h)]
    walls.append((-web / 2, web / 2, low, h - high))
    upper, lower = high * top**3, low * bottom**3
    span = h - (low + high) / 2
    shear = low / 2 + span * upper / (upper + lower)
    return _boxes(walls, _thin((bottom, low), (top, high), (h - low - high, web)), (shear, 0.0))


def _i1(flange: float, web: float, inner: float, height: float) -> Numbers:
    t = (height - inner) / 2
    return _i(height, flange + web, flange + web, web, t, t)


def _t(width: float, height: float, flange: float, web: float) -> Numbers:
    """The flange on top."""
    walls = [
        (-width / 2, width / 2, height - flange, height),
        (-web / 2, web / 2, 0.0, height - flange),
    ]
    torsion = _thin((width, flange), (height - flange, web))
    return _boxes(walls, torsion, (height - flange / 2, 0.0))


def _t1(flange: float, web: float, thickness: float, web_thickness: float) -> Numbers:
    """The flange upright on the right, the web to its left."""
    walls = [
        (web, web + thickness, -flange / 2, flange / 2),
        (0.0, web, -web_thickness / 2, web_thickness / 2),
    ]
    torsion = _thin((flange, thickness), (web, web_thickness))
    return _boxes(walls, torsion, (0.0, web + thickness / 2))


def _t2(width: float, height: float, flange: float, web: float) -> Numbers:
    """The flange below."""
    walls = [(-width / 2, width / 2, 0.0, flange), (-web / 2, web / 2, flange, height)]
    return _boxes(walls, _thin((width, flange), (height - flange, web)), (flange / 2, 0.0))


def _l(width: float, height: float, flat: float, upright: float) -> Numbers:
    walls = [(0.0, width, 0.0, flat), (0.0, upright, flat, height)]
    torsion = _thin((width, flat), (height - flat, upright))
    return _boxes(walls, torsion, (flat / 2, upright / 2))


def _channel(width: float, height: float, web: float, flange: float) -> Numbers:
    """The web on the left, flanges to the right."""
    walls = [
        (0.0, web, 0.0, height),
        (web, width, 0.0, flange),
        (web, width, height - flange, height),
    ]
    b, h = width - web / 2, height - flange
    aside = 3.0 * b**2 * flange / (6.0 * b * flange + h * web)
    torsion = _thin((h, web), (b, flange), (b, flange))
    return _boxes(walls, torsion, (height / 2, web / 2 - aside))


def _channel1(flange: float, web: float, inner: float, height: float) -> Numbers:
    return _channel(flange + web, height, web, (height - inner) / 2)


def _channel2(leg: float, base: float, height: float, width: float) -> Numbers:
    """The base below, legs upwards."""
    walls = [(0.0, width, 0.0, base), (0.0, leg, base, height), (width - leg, width, base, height)]
    b, h = height - base / 2, width - leg
    aside = 3.0 * b**2 * leg / (6.0 * b * leg + h * base)
    return _boxes(walls, _thin((h, base), (b, leg), (b, leg)), (base / 2 - aside, width / 2))


def _z(flange: float, web: float, inner: float, height: float) -> Numbers:
    t = (height - inner) / 2
    walls = [(-web / 2, web / 2, -height / 2, height / 2)]
    walls += [(web / 2, web / 2 + flange, height / 2 - t, height / 2)]
    walls += [(-web / 2 - flange, -web / 2, -height / 2, -height / 2 + t)]
    torsion = _thin((height - t, web), (flange + web / 2, t), (flange + web / 2, t))
    return _boxes(walls, torsion, (0.0, 0.0))


def _h(inner: float, flanges: float, height: float, web: float) -> Numbers:
    """Upright flanges, their thickness together, and a flat web between them."""
    t = flanges / 2
    walls = [(-inner / 2, inner / 2, -web / 2, web / 2)]
    walls += [
        (
            s * (inner / 2) + min(0.0, s * t),
            s * (inner / 2) + max(0.0, s * t),
            -height / 2,
            height / 2,
        )
        for s in (-1.0, 1.0)
    ]
    return _boxes(walls, _thin((inner, web), (height, t), (height, t)), (0.0, 0.0))


def _cross(arms: float, web: float, height: float, arm: float) -> Numbers:
    half = arms / 2
    walls = [(-web / 2, web / 2, -height / 2, height / 2)]
    walls += [
        (web / 2, web / 2 + half, -arm / 2, arm / 2),
        (-web / 2 - half, -web / 2, -arm / 2, arm / 2),
    ]
    return _boxes(walls, _thin((height, web), (arms, arm)), (0.0, 0.0))


SHAPES: dict[str, tuple[int, Callable[..., Numbers]]] = {
    "ROD": (1, lambda radius: _round(radius)),
    "TUBE": (2, _round),
    "TUBE2": (2, lambda outer, wall: _round(outer, outer - wall)),
    "BAR": (2, _bar),
    "BOX": (4, lambda w, h, flat, side: _box1(w, h, flat, flat, side, side)),
    "BOX1": (6, _box1),
    "I": (6, _i),
    "I1": (4, _i1),
    "T": (4, _t),
    "T1": (4, _t1),
    "T2": (4, _t2),
    "L": (4, _l),
    "CHAN": (4, _channel),
    "CHAN1": (4, _channel1),
    "CHAN2": (4, _channel2),
    "Z": (4, _z),
    "H": (4, _h),
    "CROSS": (4, _cross),
}
"""The number of dimensions of each shape, and its numbers from them."""
