"""The flow map: where a state goes, how it depends on its start and on the frequency.

Between contacts the modes are propagated in closed form; contact phases by Gauss collocation on
the contact forces. See ``docs/theory.md``.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from nldyn._kernels import CONTACT_FAILED, OK, TOO_MANY_PIECES, FlowData, Record, shoot
from nldyn._sample import local_extremes, sample_states
from nldyn.gauss import GaussTables, gauss_tables
from nldyn.system import Complex, Real, System

__all__ = ["FlowMap", "FlowOptions", "Segments", "Trajectory"]

_REASONS = {
    OK: "ok",
    TOO_MANY_PIECES: "too many contacts in one segment",
    CONTACT_FAILED: "a contact phase could not be resolved",
}


@dataclass(frozen=True)
class FlowOptions:
    """Accuracy of the flow map.

    Parameters
    ----------
    nodes : int
        Gauss nodes on a contact panel, 4 to 40; the end of a panel is accurate to order 2 nodes.
    tail : float
        A panel is halved until the last two Legendre coefficients of its force are below this
        fraction of the largest force. The error at its end goes with the square.
    """

    nodes: int = 12
    tail: float = 1e-4

    def __post_init__(self) -> None:
        if not 4 <= self.nodes <= 40:
            raise ValueError(f"FlowOptions: nodes must lie between 4 and 40, got {self.nodes}")
        if not 0.0 < self.tail < 1.0:
            raise ValueError(f"FlowOptions: tail must lie between 0 and 1, got {self.tail:g}")


@dataclass(frozen=True)
class Segments:
    """Results of k consecutive segments.

    Parameters
    ----------
    ends : (k, 2n)
        Packed states at the ends.
    jacobians : (k, 2n, 2n)
        Derivatives of the ends with respect to the starts.
    d_omega : (k, 2n)
        Derivatives of the ends with respect to ω at fixed phases.
    closings : (n_stops,)
        How often each stop closed.
    failure : str
        Empty, or why the segments could not be computed.
    """

    ends: Real
    jacobians: Real
    d_omega: Real
    closings: NDArray[np.int64]
    failure: str = ""


class FlowMap:
    """Exact flights and collocated contact phases of a system.

    States are packed modal coordinates w of the homogeneous response, `LinearPart.pack`: the
    physical state is ``Re(right @ (w + w_forced(phase)))``, see `to_packed` and `to_physical`.

    Parameters
    ----------
    system : System
        What to propagate.
    options : FlowOptions, optional
        Accuracy.

    Examples
    --------
    >>> import numpy as np
    >>> from nldyn import FlowMap, System, Unbalance
    >>> system = System.from_modal([13.1], {"middle": [0.635]}, modal_damping=0.0142,
    ...     excitation=[Unbalance("middle", 4.92e-6)])
    >>> flow = FlowMap(system)
    >>> segments = flow.shoot(np.zeros((1, 2)), np.array([0.0, 2 * np.pi]), 2 * np.pi * 20.0)
    >>> bool(np.all(segments.ends == 0.0))     # the steady linear response is w = 0
    True
    """

    def __init__(self, system: System, options: FlowOptions | None = None) -> None:
        self.system = system
        self.options = options or FlowOptions()

    @cached_property
    def tables(self) -> GaussTables:
        """Collocation tables."""
        return gauss_tables(self.options.nodes)

    @cached_property
    def rows(self) -> Complex:
        """Output rows (n_stops + n_interfaces, nz): penetrations first, then displacements."""
        s = self.system
        vectors = [s.stop_vector(stop) for stop in s.stops] + list(s.participation.values())
        return np.array([s.displacement_row(v) for v in vectors], dtype=complex).reshape(
            len(vectors), s.linear.eigenvalues.size
        )

    @cached_property
    def _stops(self) -> tuple[Real, Real, Real, Real, Real]:
        s = self.system
        vectors = [s.stop_vector(stop) for stop in s.stops]
        exponents = np.array([stop.exponent for stop in s.stops], dtype=float)
        factors = np.array([_duration_factor(p) for p in exponents], dtype=float)
        return (
            np.array([stop.gap for stop in s.stops], dtype=float),
            np.array([stop.stiffness for stop in s.stops], dtype=float),
            exponents,
            np.array([v @ v for v in vectors], dtype=float),
            factors,
        )

    @cached_property
    def _force(self) -> Complex:
        s = self.system
        columns = [s.force_column(s.stop_vector(stop)) for stop in s.stops]
        nz = s.linear.eigenvalues.size
        return np.ascontiguousarray(np.array(columns, dtype=complex).reshape(len(columns), nz).T)

    def data(self, omega: float) -> FlowData:
        """Numbers for the kernels at ω (rad/s)."""
        linear = self.system.linear
        forced = self.system.forced_response(omega)
        value = self.rows @ forced.positive + np.conj(self.rows @ forced.negative)
        slope = self.rows @ forced.d_positive + np.conj(self.rows @ forced.d_negative)
        gap, stiffness, exponent, mobility, duration_factor = self._stops
        return FlowData(
            linear.eigenvalues,
            self.rows,
            self._force,
            value,
            slope,
            gap,
            stiffness,
            exponent,
            mobility,
            duration_factor,
            linear.pack_mode,
            linear.pack_unit,
            float(omega),
            self.options.tail,
        )

    def shoot(
        self,
        nodes: Real,
        phases: Real,
        omega: float,
        *,
        sensitivities: bool = True,
        chained: bool = False,
    ) -> Segments:
        """Carry packed states over consecutive segments.

        Parameters
        ----------
        nodes : (k, 2n) array
            State at the start of each segment; only the first is used when `chained`.
        phases : (k + 1,) array
            Forcing phases ωt of the segment ends in radians.
        omega : float
            Excitation frequency in rad/s.
        sensitivities : bool
            Whether to compute the derivatives (without them the arrays hold no numbers of use).
        chained : bool
            Start each segment where the one before ended.

        Returns
        -------
        Segments
        """
        return self._run(self.data(omega), nodes, phases, sensitivities, chained, None)

    def trajectory(self, nodes: Real, phases: Real, omega: float) -> Trajectory:
        """Record the motion from phase to phase, restarted from each node state.

        Parameters
        ----------
        nodes : (k, 2n) array
            Packed states at the first k phases.
        phases : (k + 1,) array
            Forcing phases in radians.
        omega : float
            Excitation frequency in rad/s.

        Returns
        -------
        Trajectory
        """
        data = self.data(omega)
        capacity = 64 * len(nodes)
        while True:
            rec = self._record(capacity)
            segments = self._run(data, nodes, phases, False, False, rec)
            used = int(rec.used[0])
            if used < capacity or capacity > 1 << 20:
                pieces = Record(
                    rec.phase[:used].copy(),
                    rec.duration[:used].copy(),
                    rec.kind[:used].copy(),
                    rec.w[:used].copy(),
                    rec.force[:used].copy(),
                    rec.used,
                )
                return Trajectory(
                    self, data, pieces, float(phases[0]), segments.closings, segments.failure
                )
            capacity *= 4

    def _run(
        self,
        data: FlowData,
        nodes: Real,
        phases: Real,
        sensitivities: bool,
        chained: bool,
        rec: Record | None,
    ) -> Segments:
        ends, jacobians, d_omegas, closings, status = shoot(
            *data,
            *self.tables,
            *(self._no_record if rec is None else rec),
            np.ascontiguousarray(nodes, dtype=float),
            np.ascontiguousarray(phases, dtype=float),
            chained,
            sensitivities,
            rec is not None,
        )
        failure = "" if status == OK else _REASONS[status]
        return Segments(ends, jacobians, d_omegas, closings, failure)

    @cached_property
    def _no_record(self) -> Record:
        return self._record(1)

    def to_physical(self, packed: Real, phase: float, omega: float) -> Real:
        """Modal displacements and velocities (..., 2n) of packed states at a forcing phase."""
        linear = self.system.linear
        w = linear.unpack(np.asarray(packed)) + self.system.forced_response(omega).at_phase(phase)
        return np.asarray((w @ linear.right.T).real)

    def to_packed(self, state: Real, phase: float, omega: float) -> Real:
        """Packed states of modal displacements and velocities (..., 2n) at a forcing phase."""
        linear = self.system.linear
        w = np.asarray(state) @ linear.left.T
        return linear.pack(w - self.system.forced_response(omega).at_phase(phase))

    def _record(self, capacity: int) -> Record:
        nz, n_stops = self._force.shape
        return Record(
            np.empty(capacity),
            np.empty(capacity),
            np.empty(capacity, dtype=np.int64),
            np.empty((capacity, nz), dtype=complex),
            np.empty((capacity, n_stops, self.options.nodes)),
            np.zeros(1, dtype=np.int64),
        )


@dataclass(frozen=True)
class Trajectory:
    """Recorded motion: exact at any instant, not a table of samples.

    Parameters
    ----------
    flow : FlowMap
        What made it.
    data : FlowData
        Numbers at its frequency.
    record : Record
        Flights and contact panels.
    start_phase : float
        Forcing phase at the start.
    closings : (n_stops,)
        How often each stop closed.
    failure : str
        Empty, or why it stopped early.
    """

    flow: FlowMap
    data: FlowData
    record: Record
    start_phase: float
    closings: NDArray[np.int64]
    failure: str

    def homogeneous(self, phases: Real) -> Complex:
        """Homogeneous states w (k, nz) at ascending forcing phases within the motion."""
        return np.asarray(sample_states(*self._pieces, np.asarray(phases, dtype=float)))

    def extremes(self, output: int) -> Real:
        """Phase, value and kind (+1 maximum, -1 minimum) of an output's local extremes, (k, 3).

        The motion is taken as periodic. Outputs are the stops' penetrations without their gaps,
        then the interfaces' displacements.
        """
        row, forced = self.data.rows[output], self.data.forced[output]
        return np.asarray(local_extremes(*self._pieces, row, forced))

    @cached_property
    def _pieces(self) -> tuple[object, ...]:
        data, tables, rec = self.data, self.flow.tables, self.record
        return (
            data.eigenvalues,
            data.force,
            data.omega,
            tables.chi,
            tables.to_legendre,
            tables.nodes,
            rec.phase,
            rec.duration,
            rec.kind,
            rec.w,
            rec.force,
            int(rec.used[0]),
        )


def _duration_factor(p: float) -> float:
    """Contact duration of a free impact over (peak penetration / speed) for F = k δ^p.

    2 ∫ dx / sqrt(1 - x^(p+1)) from 0 to 1 = 2.94 for Hertz's law (Johnson 1985, eq. 11.24).
    """
    q = 1.0 / (p + 1.0)
    return 2.0 * math.sqrt(math.pi) * math.gamma(1.0 + q) / math.gamma(0.5 + q)
