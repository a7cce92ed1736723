"""What the engine and its callers share: outcomes, columns and tables; `engine.h` has the same."""

from __future__ import annotations

import math
import struct
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from nldyn.base.arrays import Complex, Real
from nldyn.engine.numbers import address_of

Whole = NDArray[np.int64]
RECORD_COLUMNS = ("phase", "duration", "kind", "event", "start", "force", "depth")
FIRST_STATE = 4  # column of a record
_RECORD = struct.Struct("3q")

(
    OK, TOO_MANY_PIECES, CONTACT_FAILED, DIVERGED, SINGULAR, NOT_CONVERGED, RECORD_FULL, ROUNDED,
    TOO_MANY_STEPS, OTHER_CONTACTS, INTERRUPTED, OUT_OF_MEMORY, UNDECIDED,
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
    fading: float = 0.0  # speed in which that falls to 1/e; 0 for at once
    belt: float = 0.0  # speed of what it slides on
    normal: float = -1.0  # stop whose force presses it on, or -1
    pressing: float = 0.0  # force that does so in place of a stop's
    second: float = -1.0  # of a round clearance: row of its second direction, or -1
    lead: float = -1.0  # of that: row of the first one, or -1
    centre: float = 0.0  # of both: displacement along them of the centre
    sense: float = 1.0  # 1 for a ring, in which the body is, -1 for a pin, around which it is
    rub: float = 0.0  # coefficient of friction, in both of its rows as the next
    surface: float = 0.0  # speed of the surface on that of the other side, from first to second
    area: float = -1.0  # number of the area of contact that it is a point of, or -1
    share: float = 1.0  # what of that it stands for: change of its stiffness with the area's
    tangential: float = 0.0  # of a slider behind a spring: its stiffness
    place: float = -1.0  # entry of the state that is the slider's own place, or -1
    place_rate: float = 0.0  # rate of that entry where it sticks
    beside: float = -1.0  # of a slider over a plane: row of its other tangent, or -1
    mover: float = -1.0  # of both: row of the speed of its place
    moves: float = -1.0  # of that: row of the slider whose place it moves, or -1


FIRST_POWER = len(
    StopRow._fields
)  # column of the coefficient of u of a bond; those of u²... follow


class SystemData(NamedTuple):
    """Numbers of a system, as the engine needs them.

    Outputs are the penetrations of the stops, the displacements of sliders and bonds and those
    along the second directions of round clearances and of sliders over a plane, then those of the
    movers of these, which are the same again, then the observed displacements.
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
    common: Real  # (n_stops, n_stops) how far a unit force at one moves another at once


SYSTEM_FIELDS = 5 + len(SystemData._fields)  # as the engine has them: with its five counts


@dataclass(frozen=True, eq=False)
class Record:
    """Pieces of a trajectory, enough to evaluate the state at any instant.

    Parameters
    ----------
    block : (1 + capacity, width)
        A row for each piece, below one that begins with how many are in use: phase, duration, kind,
        event, state, forces, penetrations.
    size, n_stops : int
        Of the state, and of the stops and bonds.

    Examples
    --------
    >>> empty_record(3, 2, 1, 14)
    <Record of 0 pieces>
    """

    block: Real
    size: int
    n_stops: int

    def __repr__(self) -> str:
        """One line: how many pieces."""
        return f"<Record of {self.used} pieces>"

    @classmethod
    def of(
        cls, phase: Real, duration: Real, kind: Whole, event: Whole, start: Real, force: Real,
        depth: Real,
    ) -> Record:  # fmt: skip
        """The record of known pieces."""
        count, size = start.shape
        columns = np.stack([phase, duration, kind, event], axis=1)
        at_nodes = np.stack([force, depth], axis=1)
        rows = [columns, start, at_nodes.reshape(count, math.prod(at_nodes.shape[1:]))]
        block = np.vstack([np.zeros(sum(part.shape[1] for part in rows)), np.hstack(rows)])
        block[0, 0] = count
        return cls(block, size, force.shape[1])

    def fits(self, other: Record) -> bool:
        """Whether another record has as many numbers for a piece."""
        return bool(self.block.shape[1] == other.block.shape[1])

    def kept(self) -> Record:
        """The pieces in use, without room for others."""
        return Record(self.block[: 1 + self.used].copy(), self.size, self.n_stops)

    @property
    def packed(self) -> bytes:
        """The structure as the engine reads it."""
        rows, width = self.block.shape
        return _RECORD.pack(rows - 1, width, address_of(self.block))

    @property
    def used(self) -> int:
        """Number of pieces in use."""
        return int(self.block[0, 0])

    @property
    def phase(self) -> Real:
        """Forcing phases (n,) at which the pieces begin."""
        return self.block[1:, 0]

    @property
    def duration(self) -> Real:
        """Their durations (n,) in s."""
        return self.block[1:, 1]

    @property
    def kind(self) -> Whole:
        """-1 (n,) for a flight, else the kind of the panel's ends."""
        return self.block[1:, 2].astype(np.int64)

    @property
    def event(self) -> Whole:
        """Stop (n,) that opens or closes at the end, or -1."""
        return self.block[1:, 3].astype(np.int64)

    @property
    def start(self) -> Real:
        """States z (n, 2n) at the starts."""
        return self.block[1:, FIRST_STATE : FIRST_STATE + self.size]

    @property
    def force(self) -> Real:
        """Forces (n, n_stops, m) at the nodes of a panel, zero where a stop is open."""
        return self._at_nodes[:, 0]

    @property
    def depth(self) -> Real:
        """Penetrations (n, n_stops, m), likewise."""
        return self._at_nodes[:, 1]

    @property
    def _at_nodes(self) -> Real:
        rows = self.block[1:, FIRST_STATE + self.size :]
        nodes = rows.shape[1] // (2 * self.n_stops) if self.n_stops else 0
        return rows.reshape(len(rows), 2, self.n_stops, nodes)


def empty_record(capacity: int, size: int, n_stops: int, nodes: int) -> Record:
    """A record with room for so many pieces."""
    block = np.empty((1 + capacity, FIRST_STATE + size + 2 * n_stops * nodes))
    block[0] = 0.0
    return Record(block, size, n_stops)
