"""What the engine and its callers share: outcomes, columns and tables; `engine.h` has the same."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from nldyn.base.arrays import Complex, Real

(
    OK, TOO_MANY_PIECES, CONTACT_FAILED, DIVERGED, SINGULAR, NOT_CONVERGED, RECORD_FULL, ROUNDED,
    TOO_MANY_STEPS, OTHER_CONTACTS, INTERRUPTED, OUT_OF_MEMORY, SLIDING_TURNS,
) = range(13)  # fmt: skip
ROUND = 1.5  # below this exponent a slope sets in almost at once: nodes at the switch count


class StopRow(NamedTuple):
    """Numbers of a stop: the columns of `stops`, in this order."""

    gap: float
    stiffness: float
    exponent: float
    dissipation: float
    dashpot: float
    mobility: float  # velocity jump per unit impulse in 1/kg
    duration: float  # of a free contact, over (peak penetration / speed)
    instant: float  # error allowed in the instant of an event, as a share of the panel
    restitution: float = -1.0  # of a rigid stop; -1 for an elastic one
    bond: float = 0.0  # 1 for what is no stop but acts all the time, with the law `bond_law`
    drag: float = 0.0  # of a bond: coefficients of u² u' and u'^3
    cubic: float = 0.0
    release: float = -1.0  # output δ + δ' dashpot/stiffness of a stop that never pulls, or -1
    friction: float = -1.0  # of a slider: coefficient while it slides; -1 for what is none
    adhesion: float = 0.0  # by how much more it is at rest
    fading: float = 0.0  # speed in which that falls to 1/e; 0 where there is none
    belt: float = 0.0  # speed of what it slides on
    normal: float = -1.0  # stop whose force presses it on, or -1
    pressing: float = 0.0  # force that does so in place of a stop's
    second: float = -1.0  # of a round clearance: row of its second direction, or -1
    lead: float = -1.0  # of that: row of the first one, or -1
    centre: float = 0.0  # of both: displacement along them of the centre
    sense: float = 1.0  # 1 for a ring, in which the body is, -1 for a pin, around which it is
    rub: float = 0.0  # coefficient of friction in the sense of sliding, from first to second
    surface: float = 0.0  # speed in that sense of the surface on that of the other side
    area: float = -1.0  # number of the area of contact that it is a point of, or -1
    share: float = 1.0  # what of that it stands for: change of its stiffness with the area's
    tangential: float = 0.0  # of a slider behind a spring: its stiffness
    place: float = -1.0  # entry of the state that is the slider's own place, or -1
    place_rate: float = 0.0  # rate of that entry where it sticks


FIRST_POWER = len(
    StopRow._fields
)  # column of the coefficient of u of a bond; those of u²... follow


class SystemData(NamedTuple):
    """Numbers of a system, as the engine needs them.

    Outputs are the penetrations of the stops, the displacements of sliders and bonds and those
    along the second directions of round clearances, then the observed displacements.
    """

    blocks: Real  # (n, 2, 2)
    rows: Real  # (3, n_out, 2n) outputs, their velocities and accelerations in flight
    bound3: Real  # (n_out, 2n) |third derivative| <= Σ_b |bound3_b| |w_b| at any later time
    force: Real  # (2n, n_stops): w' = A w - force @ F
    orders: Real  # (h,) multiples of the excitation frequency at which something acts; 1 first
    drive: Complex  # (h, 3, 2n) excitation Σ Re(Σ_p ω^p drive[h, p] e^{i orders[h] ωt}) of z
    stops: Real  # (n_stops, ...), of stops, sliders and bonds: `StopRow`, coefficients of bonds
    # (n_stops,) address of a law (of a rigid stop: of its restitution), or 0
    laws: NDArray[np.int64]
    tail: float  # largest relative Legendre tail accepted on a contact panel
    node_angle: float  # phase of the fastest mode from node to node, in rad


class Record(NamedTuple):
    """Pieces of a trajectory, enough to evaluate the state at any instant.

    Parameters
    ----------
    phase, duration : (n_pieces,)
        Forcing phase at the start, duration in s.
    kind : (n_pieces,)
        -1 for a flight, else the kind of the panel's ends.
    event : (n_pieces,)
        Stop that opens or closes at the end, or -1.
    start : (n_pieces, 2n)
        State z at the start.
    force, depth : (n_pieces, n_stops, m)
        Forces and penetrations at the nodes of a panel (zero where a stop is open).
    used : (3,)
        Number of pieces in use; the first of those of a motion before that are still ahead. They
        stand at the end of the record and serve as guesses. Whether these are of another orbit.
    """

    phase: NDArray[np.float64]
    duration: NDArray[np.float64]
    kind: NDArray[np.int64]
    event: NDArray[np.int64]
    start: NDArray[np.float64]
    force: NDArray[np.float64]
    depth: NDArray[np.float64]
    used: NDArray[np.int64]


def empty_record(capacity: int, size: int, n_stops: int, nodes: int) -> Record:
    """A record with room for so many pieces."""
    return Record(
        np.empty(capacity),
        np.empty(capacity),
        np.empty(capacity, dtype=np.int64),
        np.empty(capacity, dtype=np.int64),
        np.empty((capacity, size)),
        np.empty((capacity, n_stops, nodes)),
        np.empty((capacity, n_stops, nodes)),
        np.zeros(3, dtype=np.int64),
    )
