"""The surface of a structure and how each of its modes moves it, for a page in a browser."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

import cms
from fem.render import StopSphere
from fem.render.pictures import AnyComponent, surface_of
from fem.render.viewer import surface_data

MOST_NUMBERS = 2_000_000  # of 16 bits, that the motion of the surface may take
LOWEST = 1e-6  # of the highest frequency: below it a mode is pushed as one of this frequency


def surface_content(
    component: AnyComponent,
    reduced: cms.ReducedModel,
    mirror: str | None = None,
    stops: Sequence[StopSphere] = (),
) -> dict[str, Any]:
    """A surface, what stands around it, and how far each mode moves the points.

    Parameters
    ----------
    component
        The frame or structure.
    reduced
        What it was reduced to.
    mirror
        A point on a plane of symmetry, to draw half a frame whole.
    stops
        The stops to draw.

    Returns
    -------
    dict
        What `fem.render.viewer.surface_data` gives of the modes; it is seen from where it is seen
        best how the interfaces move when they are pushed. If the surface is too large for a page,
        only ``fault``, which says so.
    """
    rest, _ = surface_of(component, mirror).place(np.zeros(len(component.free)))
    if rest.size * (reduced.size + 1) > MOST_NUMBERS:
        most = MOST_NUMBERS // (3 * (reduced.size + 1))
        return {
            "fault": f"The surface has {len(rest)} points; with {reduced.size} modes this page has "
            f"room for {most}. 'nldyn render' draws it."
        }
    hz = np.maximum(reduced.frequencies_hz, LOWEST * np.max(reduced.frequencies_hz))
    pushed = sum(np.asarray(phi) / hz**2 for phi in reduced.participation.values())
    return surface_data(
        component, reduced.basis, mirror=mirror, stops=stops, seen=reduced.expand(pushed)
    )
