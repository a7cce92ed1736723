"""From where a picture is taken."""

from __future__ import annotations

from itertools import permutations

import numpy as np

from fem.base.arrays import FloatArray
from fem.base.errors import ModelError

MOTION = "motion"
OBLIQUE = (0.20, 0.42, 1.0)
VIEWS = {
    "oblique": OBLIQUE,
    "front": (0.0, 0.0, 1.0),
    "top": (0.0, 1.0, 0.0),
    "side": (1.0, 0.0, 0.0),
    "isometric": (1.0, 1.0, 1.0),
}
"""From where the structure is looked at: y is up, but from the top x is to the right. Beside these
there is `MOTION`, from where what moves is seen best."""
USUAL = 1.1  # how much better another view must be than that with x to the right and y up


def axes_of_view(view: str, points: FloatArray, moved: FloatArray) -> FloatArray:
    """Unit vectors (3, 3) to the right, up and towards the eye, of points (p, 3) that move.

    Raises
    ------
    ModelError
        If there is no such view.
    """
    if view == MOTION:
        return view_of_motion(points, moved)
    if view not in VIEWS:
        raise ModelError(f"view must be one of {', '.join([MOTION, *VIEWS])}, not {view!r}")
    return axes_towards(np.array(VIEWS[view]), np.array([0.0, 1.0, 0.0]))


def axes_towards(eye: FloatArray, up: FloatArray) -> FloatArray:
    """Unit vectors (3, 3) to the right, up and towards an eye, one axis up.

    Examples
    --------
    >>> axes_towards(np.array([0.0, 0.0, 2.0]), np.array([0.0, 1.0, 0.0])).tolist()
    [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
    """
    back = eye / np.linalg.norm(eye)
    right = np.cross(up, back)
    right = right / np.linalg.norm(right) if right.any() else np.array([1.0, 0.0, 0.0])
    return np.stack([right, np.cross(back, right), back])


def view_of_motion(points: FloatArray, moved: FloatArray) -> FloatArray:
    """The oblique view, with the axes turned so that structure and motion are seen.

    Of the six ways to put y or z up, that in which most of the motion and of the structure's box
    lies across the line of sight: a plate that moves along z is seen from its side, a little from
    above.

    Parameters
    ----------
    points, moved
        Undeformed points and their displacements, (p, 3) each.

    Examples
    --------
    >>> square = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    >>> right, up, back = view_of_motion(square, np.full((4, 3), [0.0, 0.0, 1.0]))
    >>> bool(up[2] > 0.9 and abs(back[2]) < 0.4)
    True
    """
    sides = np.ptp(points, axis=0)
    motion = np.linalg.norm(moved, axis=0)
    best, found = -1.0, np.eye(3)
    for across, up in permutations(range(3), 2):
        if up == 0:
            continue
        right, high = np.eye(3)[across], np.eye(3)[up]
        eye = OBLIQUE[0] * right + OBLIQUE[1] * high + OBLIQUE[2] * np.cross(right, high)
        axes = axes_towards(eye, high)
        seen = [float(np.linalg.norm(axes[:2] * each)) for each in (sides, motion)]
        value = (seen[0] or 1.0) * (seen[1] or 1.0) * (USUAL if (across, up) == (0, 1) else 1.0)
        # a structure lies along the picture, which is wider than high
        value *= 1.0 + 0.2 * float(np.linalg.norm(axes[0] * sides)) / (seen[0] or 1.0)
        if value > best:
            best, found = value, axes
    return found
