"""Areas of contact: many stops that share a law and a name."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from nldyn.base.arrays import Real
from nldyn.base.errors import SystemModelError, check_types, numbers
from nldyn.system.friction import Friction
from nldyn.system.rigid_stop import RigidStop
from nldyn.system.stop import Stop


def contact_area(
    name: str,
    points: Sequence[str],
    stiffness: float,
    *,
    weights: ArrayLike | None = None,
    exponent: float = 1.0,
    gap: ArrayLike = 0.0,
    direction: int = 1,
    against: Sequence[str] | None = None,
    dissipation: float = 0.0,
    dashpot: float = 0.0,
    pulls: bool = True,
    friction: Friction | float | None = None,
    tangents: Sequence[str] | None = None,
    tangents_against: Sequence[str] | None = None,
    tangential_stiffness: float | None = None,
    second_tangents: Sequence[str] | None = None,
    second_tangents_against: Sequence[str] | None = None,
) -> tuple[Stop | RigidStop, ...]:
    r"""Stops at the points of a face or an edge, with one law of the pressure among them.

    The pressure is :math:`p = k\,\delta^p (1 + a\dot\delta) + c\,\dot\delta` per area, or per
    length of an edge; the force at a point is this times the weight of the point in a quadrature.
    Each point closes and opens by itself.

    Parameters
    ----------
    name : str
        Name of the area: of its row in reports, and of its parameters.
    points : sequence of str
        Interfaces of the points, along the normal of the area.
    stiffness : float
        k in N/m^p per m² of an area, or per m of an edge; without weights N/m^p at each point.
        ``math.inf`` for rigid contact, at points without mass: a massless boundary.
    weights : (n,) array_like, optional
        Areas in m², or lengths in m, that the points stand for; node by node, without, they are 1.
    exponent : float
        p: 1 for a foundation that lifts off (Winkler's), 1.5 for Hertz's law.
    gap : float or (n,) array_like
        Distance in m at rest, of all points or of each.
    direction : {1, -1}
        Sign of the displacement that closes the gap.
    against : sequence of str, optional
        Interfaces of what is on the other side, point by point; the ground unless given.
    dissipation, dashpot, pulls
        As for `Stop`; the dashpot per area or length.
    friction : Friction or float, optional
        Coulomb's friction, see `Stop`.
    tangents, tangents_against : sequences of str, optional
        Interfaces of the same points whose displacement lies along the surface.
    tangential_stiffness : float, optional
        Of springs along the surface, see `Stop`; in N/m per area or length.
    second_tangents, second_tangents_against : sequences of str, optional
        The same as `tangents` perpendicular to them, of points that slide over a plane.

    Returns
    -------
    tuple of Stop or RigidStop
        To be given among the stops of a `System`.

    Raises
    ------
    SystemModelError
        For no points, one that is named twice, lists that are not of one length, a weight that is
        not positive, or rigid contact with what only a law has; else as `Stop`.

    Examples
    --------
    >>> from nldyn import System
    >>> edge = contact_area("edge", ["left", "right"], 1e6, weights=[0.1, 0.3], gap=1e-3)
    >>> [stop.stiffness for stop in edge]
    [100000.0, 300000.0]
    >>> System.from_modal([10.0, 20.0], {"left": [1.0, 1.0], "right": [1.0, -1.0]},
    ...     stops=edge).areas
    {'edge': (0, 1)}
    """
    check_types(**{"contact_area: name": (name, str)})
    owner = f"contact area '{name}'"
    count = len(points)
    if not count:
        raise SystemModelError(f"{owner}: there are no points")
    if twice := [at for i, at in enumerate(points) if at in points[:i]]:
        raise SystemModelError(f"{owner}: points must name each interface once, not '{twice[0]}'")
    shares = _of_points(owner, "weights", 1.0 if weights is None else weights, count)
    gaps = _of_points(owner, "gap", gap, count)
    others = [
        [None] * count if ends is None else _listed(owner, what, ends, count)
        for what, ends in (
            ("against", against),
            ("tangents", tangents),
            ("tangents_against", tangents_against),
            ("second_tangents", second_tangents),
            ("second_tangents_against", second_tangents_against),
        )
    ]
    if not np.all(shares > 0.0):
        raise SystemModelError(f"{owner}: weights must be positive, got {shares.min():g}")
    if stiffness == math.inf:
        given = (tangential_stiffness, second_tangents, second_tangents_against)
        bare = not (dissipation or dashpot) and all(each is None for each in given)
        if exponent != 1.0 or not pulls or not bare:
            raise SystemModelError(
                f"{owner}: rigid contact has no exponent, dissipation, dashpot, pulls, tangential "
                "stiffness nor second tangents"
            )
        along, beside = others[1:3]
        return tuple(
            RigidStop(at, 1.0, each, direction, other, tangent, friction, under, name, share)
            for at, share, each, other, tangent, under in zip(
                points, shares.tolist(), gaps.tolist(), others[0], along, beside, strict=True
            )
        )
    return tuple(
        Stop(
            at,
            stiffness * share,
            exponent,
            each,
            direction,
            other,
            dissipation,
            dashpot=dashpot * share,
            pulls=pulls,
            tangent=along,
            friction=friction,
            tangent_against=beside,
            area=name,
            share=share,
            tangential_stiffness=None
            if tangential_stiffness is None
            else tangential_stiffness * share,
            second_tangent=across,
            second_tangent_against=beside_across,
        )
        for at, share, each, other, along, beside, across, beside_across in zip(
            points, shares.tolist(), gaps.tolist(), *others, strict=True
        )
    )


def gap_beside(
    places: ArrayLike,
    normal: ArrayLike,
    centre: ArrayLike,
    *,
    slope: ArrayLike | None = None,
    radius: float | None = None,
    axis: ArrayLike | None = None,
) -> Real:
    """How much wider the gap to a second profile is at places than at its centre, (k,) in m.

    Parameters
    ----------
    places : (k, 3) array_like
        Points in m.
    normal : (3,) array_like
        Along which the gap closes.
    centre : (3,) array_like
        Where it is none.
    slope : (3,) array_like, optional
        Of a plane: change along x, y and z.
    radius : float, optional
        In m, of a cylinder, or of a ball without an axis, that is nearest at the centre; below 0 of
        a hollow one.
    axis : (3,) array_like, optional
        Of the cylinder.

    Raises
    ------
    SystemModelError
        For a place farther from the centre than the radius, or an axis along the normal.

    Examples
    --------
    >>> gap_beside([[0.0, 0, 0], [0.3, 0, 0]], [0, 1, 0], [0, 0, 0], radius=0.5).round(12).tolist()
    [0.0, 0.1]
    """
    n = numbers("normal", normal)
    away = np.atleast_2d(numbers("places", places)) - numbers("centre", centre)
    wider = np.zeros(len(away))
    if slope is not None:
        wider += away @ numbers("slope", slope)
    if radius is None:
        return wider
    across = away - np.outer(away @ n, n)
    if axis is not None:
        along = numbers("axis", axis) - (numbers("axis", axis) @ n) * n
        if not np.linalg.norm(along) > 0.0:
            raise SystemModelError("the axis of a cylinder lies along the normal")
        along /= np.linalg.norm(along)
        across -= np.outer(across @ along, along)
    far = np.linalg.norm(across, axis=1)
    if np.any(far > abs(radius)):
        raise SystemModelError(
            f"a point lies {far.max():g} m from the centre, beyond the radius of {abs(radius):g} m"
        )
    sagitta = far**2 / (abs(radius) + np.sqrt(radius**2 - far**2))  # R - √(R² - s²), no digits lost
    return np.asarray(wider + np.copysign(sagitta, radius))


def _of_points(owner: str, name: str, values: ArrayLike, count: int) -> Real:
    """A number of each point, (n,)."""
    found = numbers(f"{owner}: {name}", values)
    if found.shape not in ((), (count,)):
        raise SystemModelError(
            f"{owner}: {name} must be one number or one for each of {count} points, got "
            f"{found.size}"
        )
    return np.broadcast_to(found, (count,))


def _listed(owner: str, name: str, ends: Sequence[str], count: int) -> Sequence[str]:
    if len(ends) != count:
        raise SystemModelError(f"{owner}: {name} must name {count} interfaces, got {len(ends)}")
    return ends
