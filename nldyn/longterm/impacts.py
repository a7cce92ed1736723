"""Impacts of a motion: when, how fast, how hard, how long, and the energy in them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from nldyn.base.arrays import Real
from nldyn.base.errors import SystemModelError, check_types, check_whole
from nldyn.base.optional import optional
from nldyn.flow.gauss import fine_table, peaks
from nldyn.flow.rigid_impacts import compression_works, normal_losses, rigid_impacts
from nldyn.longterm.simulation import Motion, end_state, motion_of
from nldyn.orbits.orbit import Orbit
from nldyn.system.naming import turned
from nldyn.system.system import System

if TYPE_CHECKING:
    import pandas

AT_ONCE = 4000  # panels

UNITS = {
    "stop": "1",
    "rotation": "1",
    "time": "s",
    "phase_deg": "deg",
    "duration": "s",
    "speed": "m/s",
    "rebound_speed": "m/s",
    "penetration": "m",
    "peak_force": "N",
    "impulse": "N s",
    "work": "J",
    "loss": "J",
    "frequency_hz": "Hz",
}


@dataclass(frozen=True, eq=False)
class Impacts:
    """Complete contact phases in the order in which they begin; see `impacts`.

    Where a stop acts on a rotation, rad stands for m and N m for N.

    Parameters
    ----------
    stop : (k,) int
        Index of the stop.
    rotation : (k,) bool
        Whether the stop acts on a rotation.
    time : (k,)
        When the contact begins, in s.
    phase_deg : (k,)
        Forcing phase at the begin in degrees, from 0 to 360.
    duration : (k,)
        Length of the contact in s.
    speed, rebound_speed : (k,)
        Rate of penetration at its begin, and minus that at its end, in m/s.
    penetration : (k,)
        Deepest penetration in m.
    peak_force : (k,)
        Largest force in N; nan where the stop is rigid, whose impacts have an impulse only.
    impulse : (k,)
        Integral of the force over the contact in N s.
    work : (k,)
        Work done against the stop while the penetration grows, in J.
    loss : (k,)
        Work done by normal forces against the stop altogether, in J: rounding for a stop without
        dissipation. That of friction, of round clearances too, is left out.
    frequency_hz : (k,)
        Excitation frequency at the begin.
    """

    stop: NDArray[np.int64]
    rotation: NDArray[np.bool_]
    time: Real
    phase_deg: Real
    duration: Real
    speed: Real
    rebound_speed: Real
    penetration: Real
    peak_force: Real
    impulse: Real
    work: Real
    loss: Real
    frequency_hz: Real

    def __len__(self) -> int:
        return int(self.time.size)

    def __repr__(self) -> str:
        """How many, the largest speed and force, and of rigid stops the largest impulse."""
        if not len(self):
            return "<Impacts: none>"
        kinds = [kind for kind in (~self.rotation, self.rotation) if kind.any()]
        most = " and ".join(", ".join(self._most(kind)) for kind in kinds)
        return (
            f"<Impacts: {len(self)} from {self.time[0]:.4g} to {self.time[-1]:.4g} s, "
            f"at most {most}>"
        )

    def _most(self, kind: NDArray[np.bool_]) -> Iterator[str]:
        """The largest values of the impacts (k,) on rotations, or on none."""
        units = units_where(UNITS, self.rotation[kind])
        rigid = np.isnan(self.peak_force)
        for name, among in (
            ("speed", kind), ("peak_force", kind & ~rigid), ("impulse", kind & rigid)
        ):  # fmt: skip
            if among.any():
                yield f"{getattr(self, name)[among].max():.4g} {units[name]}"

    @property
    def units(self) -> dict[str, str]:
        """Unit of each column; of both kinds of stops both, that of displacements first."""
        return units_where(UNITS, self.rotation)

    def columns(self) -> dict[str, NDArray[Any]]:
        """The columns by name; their units are in `units`."""
        return {field.name: getattr(self, field.name) for field in fields(self)}

    def to_pandas(self) -> pandas.DataFrame:
        """The impacts as a table; its attribute ``attrs["units"]`` has the units."""
        frame = optional("pandas", "to_pandas").DataFrame(self.columns())
        frame.attrs["units"] = self.units
        return frame


def units_where(units: Mapping[str, str], rotation: NDArray[np.bool_]) -> dict[str, str]:
    """Units of columns of which some rows (k,), all or none are of rotations.

    Examples
    --------
    >>> [units_where({"speed": "m/s"}, np.array(rows)) for rows in ([False], [False, True])]
    [{'speed': 'm/s'}, {'speed': 'm/s or rad/s'}]
    """
    if not rotation.any():
        return dict(units)
    kinds = {name: (unit, turned(unit)) for name, unit in units.items()}
    if rotation.all():
        return {name: unit for name, (_, unit) in kinds.items()}
    return {name: " or ".join(dict.fromkeys(pair)) for name, pair in kinds.items()}


def check_stop(system: System, stop: object) -> None:
    """Refuse anything but the index of a stop of the system."""
    if not system.stops:
        raise SystemModelError("the system has no stops, so that nothing is hit")
    check_whole("stop", stop, 0, len(system.stops) - 1)


def impacts(motion: Motion | Orbit) -> Impacts:
    """List the impacts of a motion, or those of one period of an orbit.

    A contact that has begun before the motion, or is not over at its end, is left out. Of an orbit,
    a contact over the end of the period counts where it begins.

    Times, impulses and losses are as accurate as the flow map; peaks come from the polynomials of
    the contact panels and are good to about 1e-6, the work to about 1e-4. An impact with a rigid
    stop takes no time and has an impulse, no force.

    Parameters
    ----------
    motion : Motion or Orbit
        What `nldyn.simulate`, `nldyn.sweep` or `nldyn.solve_orbit` gave.

    Returns
    -------
    Impacts

    Examples
    --------
    >>> from nldyn import Stop, System, Unbalance, impacts, solve_orbit
    >>> system = System.from_matrices([[2.48]], [[16877.0]], {"middle": [1.0]},
    ...     modal_damping=0.0142, stops=[Stop("middle", stiffness=5.17e9)],
    ...     excitation=[Unbalance("middle", 4.92e-6)])
    >>> found = impacts(solve_orbit(system, frequency_hz=25.3))
    >>> len(found), f"{found.speed[0]:.3f} m/s"
    (1, '0.018 m/s')
    """
    check_types(motion=(motion, Motion, Orbit))
    if isinstance(motion, Orbit):
        found = _complete(motion_of(motion, 2))
        within = found.time < motion.duration
        return Impacts(*(column[within] for column in found.columns().values()))
    return _complete(motion)


@dataclass(frozen=True)
class _Pieces:
    """All pieces of a motion, one after the other."""

    time: Real  # (P,) begin
    phase: Real  # (P,) forcing phase at the begin
    duration: Real  # (P,)
    hz: Real  # (P,)
    event: NDArray[np.int64]  # (P,)
    ends: Real  # (P + 1, S) penetrations at the begins, and at the end of the last
    speed: Real  # (P + 1, S) their rates
    depth: Real  # (P, S, m) of a panel, zero in flights and where a stop is open
    force: Real  # (P, S, m) normal forces
    kind: NDArray[np.int64]  # (P,)


def _pieces(motion: Motion) -> _Pieces:
    records = [stretch.record for stretch in motion.stretches]
    contacts = [stretch.contacts_at_nodes for stretch in motion.stretches]
    omegas = [stretch.omega for stretch in motion.stretches]
    times = [
        begin + (rec.phase - rec.phase[0]) / omega
        for begin, rec, omega in zip(motion.begins, records, omegas, strict=False)
    ]
    hz = [
        np.full(rec.phase.size, w / (2.0 * np.pi)) for rec, w in zip(records, omegas, strict=True)
    ]
    last = end_state(motion.stretches[-1])[None]
    states = motion.flow.to_modal(np.concatenate([*(rec.start for rec in records), last]))
    ends, speed = motion.system.depths_and_speeds(states)
    return _Pieces(
        np.concatenate(times),
        np.concatenate([rec.phase for rec in records]),
        np.concatenate([rec.duration for rec in records]),
        np.concatenate(hz),
        np.concatenate([rec.event for rec in records]),
        ends,
        speed,
        np.concatenate([depth for depth, _ in contacts]),
        np.concatenate([force for _, force in contacts]),
        np.concatenate([rec.kind for rec in records]),
    )


def _complete(motion: Motion) -> Impacts:
    pieces = _pieces(motion)
    tables = [_of_stop(motion, pieces, stop) for stop in range(len(motion.flow.system.stops))]
    columns = {
        field.name: np.concatenate([table[field.name] for table in tables] or [np.empty(0)])
        for field in fields(Impacts)
    }
    columns["rotation"] = columns["rotation"].astype(bool)
    order = np.argsort(columns["time"], kind="stable")
    return Impacts(**{name: column[order] for name, column in columns.items()})


@dataclass(frozen=True, eq=False)
class PanelTable:
    """Integrals and peaks over contact panels of one stop, each (p,).

    Parameters
    ----------
    duration : (p,)
        In s.
    impulse, square : (p,)
        Integrals of the force and of its square.
    work, loss : (p,)
        Work done against the stop while the penetration grows, and altogether.
    penetration, peak_force : (p,)
        Largest values.
    """

    duration: Real
    impulse: Real
    square: Real
    work: Real
    loss: Real
    penetration: Real
    peak_force: Real


def panel_table(motion: Motion, stop: int) -> PanelTable:
    """Integrals over all contact panels of a stop, also of contacts that are not complete."""
    pieces = _pieces(motion)
    closed = np.flatnonzero(pieces.depth[:, stop].any(axis=1))
    return _panel_table(motion, pieces, stop, closed)


def _panel_table(
    motion: Motion, pieces: _Pieces, stop: int, panels: NDArray[np.intp]
) -> PanelTable:
    """As `panel_table`, of some panels, so many at once that the points on them need no room."""
    blocks = [panels[k : k + AT_ONCE] for k in range(0, max(len(panels), 1), AT_ONCE)]
    tables = [_table_of_block(motion, pieces, stop, block) for block in blocks]
    names = [field.name for field in fields(PanelTable)]
    return PanelTable(*(np.concatenate([getattr(t, name) for t in tables]) for name in names))


def _table_of_block(
    motion: Motion, pieces: _Pieces, stop: int, panels: NDArray[np.intp]
) -> PanelTable:
    flow, kind = motion.flow, pieces.kind[panels]
    weights = pieces.duration[panels, None] * flow.tables.weights[kind]
    force, depth = pieces.force[panels, stop], pieces.depth[panels, stop]
    ends = pieces.ends[:, stop]
    if flow.system.stops[stop].impulsive:  # at rest, where its depths are accelerations
        ends, depth = np.zeros_like(ends), np.zeros_like(depth)
    ways = flow.tables.ways(np.column_stack([ends[panels], depth, ends[panels + 1]]))
    fine = fine_table(flow.tables.nodes.size)
    fine_depth, fine_force = depth @ fine.T, force @ fine.T
    mean_force = 0.5 * (fine_force[:, 1:] + fine_force[:, :-1])
    work = mean_force * np.diff(fine_depth, axis=1)
    return PanelTable(
        pieces.duration[panels],
        np.einsum("pm,pm->p", weights, force),
        np.einsum("pm,pm->p", weights, force**2),
        np.maximum(work, 0.0).sum(axis=1),
        np.einsum("pm,pm->p", force, ways),
        peaks(fine_depth),
        peaks(fine_force),
    )


def _of_stop(motion: Motion, pieces: _Pieces, stop: int) -> dict[str, NDArray[Any]]:
    """Columns of the complete contacts with one stop."""
    if motion.flow.system.stops[stop].impulsive:
        return _of_rigid_stop(motion, stop)
    first, last, panels, group = contact_runs(pieces.depth[:, stop], pieces.event, stop)
    table = _panel_table(motion, pieces, stop, panels)
    count = first.size
    speed = pieces.speed[:, stop]
    end = pieces.time[last] + pieces.duration[last]
    return {
        "stop": np.full(count, stop, dtype=np.int64),
        "rotation": np.full(count, _turns(motion, stop)),
        "time": pieces.time[first],
        "phase_deg": np.degrees(pieces.phase[first]) % 360.0,
        "duration": end - pieces.time[first],
        "speed": speed[first],
        "rebound_speed": -speed[last + 1],
        "penetration": _largest(group, table.penetration, count),
        "peak_force": _largest(group, table.peak_force, count),
        "impulse": np.bincount(group, table.impulse, count),
        "work": np.bincount(group, table.work, count),
        "loss": np.bincount(group, table.loss, count),
        "frequency_hz": pieces.hz[first],
    }


def _turns(motion: Motion, stop: int) -> bool:
    """Whether a stop acts on a rotation."""
    system = motion.flow.system
    return system.unit(system.stops[stop].at) == "rad"


def _of_rigid_stop(motion: Motion, stop: int) -> dict[str, NDArray[Any]]:
    """Columns of the impacts with a rigid stop, which take no time and no way."""
    parts = []
    for begin, stretch in zip(motion.begins, motion.stretches, strict=False):
        hits = rigid_impacts(stretch, stop)
        time = begin + (hits.phase - stretch.record.phase[0]) / stretch.omega
        hz = np.full(time.shape, stretch.omega / (2.0 * np.pi))
        loss = normal_losses(stretch.flow, stop, hits)
        work = compression_works(stretch.flow, stop, hits)
        each = (time, hits.phase, hits.speed, hits.rebound, hits.impulse, work, loss, hz)
        parts.append(np.array(each))
    time, phase, speed, rebound, impulse, work, loss, hz = np.concatenate(parts, axis=1)
    none = np.zeros(time.shape)
    return {
        "stop": np.full(time.shape, stop, dtype=np.int64),
        "rotation": np.full(time.shape, _turns(motion, stop)),
        "time": time,
        "phase_deg": np.degrees(phase) % 360.0,
        "duration": none,
        "speed": speed,
        "rebound_speed": rebound,
        "penetration": none,
        "peak_force": np.full(time.shape, np.nan),
        "impulse": impulse,
        "work": work,
        "loss": loss,
        "frequency_hz": hz,
    }


def contact_runs(
    depth: Real, event: NDArray[np.int64], stop: int
) -> tuple[NDArray[np.intp], NDArray[np.intp], NDArray[np.intp], NDArray[np.intp]]:
    """First and last piece (k,) of each complete contact with a stop, its panels and their contact.

    A contact ends where the next piece has the stop open, or at the event of the stop itself: it
    may close again at once.

    Parameters
    ----------
    depth : (P, m)
        Penetrations at the nodes of each piece; all zero where the stop is open.
    event : (P,)
        Stop that opens or closes at the end of each piece.
    stop : int
        Which one.
    """
    closed = np.flatnonzero(depth.any(axis=1))
    if not closed.size:
        empty = np.empty(0, dtype=np.intp)
        return empty, empty, empty, empty
    new = np.ones(closed.size, dtype=bool)
    new[1:] = (np.diff(closed) > 1) | (event[closed[:-1]] == stop)
    run = np.cumsum(new) - 1
    first = closed[new]
    last = closed[np.append(new[1:], True)]
    keep = (first > 0) & ((last < len(event) - 1) | (event[last] == stop))
    number = np.cumsum(keep) - 1
    inside = keep[run]
    return first[keep], last[keep], closed[inside], number[run[inside]]


def _largest(group: NDArray[np.intp], values: Real, count: int) -> Real:
    largest = np.zeros(count)
    np.maximum.at(largest, group, values)
    return largest
