"""The kinds of special points: what they are called, how they are marked, what is critical."""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass(frozen=True)
class Kind:
    """A kind of special points of branches.

    Parameters
    ----------
    words : str
        What it is.
    marker : str
        Matplotlib's name of its mark.
    multiplier : float
        The critical one of its orbits, nan unless it is one real number.
    """

    words: str
    marker: str
    multiplier: float = math.nan


CROSSING_SLIDING, GRAZING_SLIDING, ADDING_SLIDING = SLIDING = "CS", "GS", "AS"
KINDS = {
    "LP": Kind("cyclic fold", "o", 1.0),
    "PD": Kind("flip", "s", -1.0),
    "NS": Kind("Neimark-Sacker", "D"),
    "BP": Kind("branch point", "^", 1.0),
    "GR": Kind("grazing", "x"),
    CROSSING_SLIDING: Kind("crossing-sliding", "<"),
    GRAZING_SLIDING: Kind("grazing-sliding", "p"),
    ADDING_SLIDING: Kind("adding-sliding", ">"),
}
EVENT_MARKERS = {"phase resonance": "P", "amplitude antiresonance": "v", "Hopf": "h"}


def kind_of(name: str) -> Kind:
    """A kind by its name; that of an event is its own words."""
    return KINDS.get(name) or Kind(name, EVENT_MARKERS.get(name, "*"))


def title_of(name: str) -> str:
    """What a kind is, with its name where that is short for it.

    Examples
    --------
    >>> title_of("PD"), title_of("amplitude resonance")
    ('flip (PD)', 'amplitude resonance')
    """
    return f"{KINDS[name].words} ({name})" if name in KINDS else name
