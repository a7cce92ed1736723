"""The flow map: where a state goes, how it depends on its start and on the frequency.

Between contacts the modes are propagated in closed form; contact phases by Gauss collocation on
the contact forces. See ``docs/explanation/theory.md``.
"""

from __future__ import annotations

import copy
import itertools
import math
import operator
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from nldyn.base.arrays import SLACK, Complex, Real
from nldyn.base.errors import (
    LARGEST_FREQUENCY,
    SMALLEST_FREQUENCY,
    SystemModelError,
    check_types,
    check_whole,
    is_finite,
    shown,
)
from nldyn.engine.layout import (
    CONTACT_FAILED,
    DIVERGED,
    NOT_CONVERGED,
    OK,
    OTHER_CONTACTS,
    RECORD_FULL,
    ROUNDED,
    SINGULAR,
    TOO_MANY_PIECES,
    TOO_MANY_STEPS,
    UNDECIDED,
    Record,
    StopRow,
    SystemData,
    empty_record,
)
from nldyn.engine.library import Packed
from nldyn.engine.newton import Corrector, Found, newton, packed_system
from nldyn.engine.sample import local_extremes, of_stop, sample_states, touches
from nldyn.flow.gauss import GaussTables, gauss_tables
from nldyn.flow.options import FlowOptions, PanelBounds, _floats, _nodes_for_switch
from nldyn.flow.packing import (
    bond_row,
    mover_row,
    of_areas,
    parameter_tables,
    second_row,
    second_tangent_row,
    slider_row,
    stop_row,
)
from nldyn.system.contact_law import law_address
from nldyn.system.linear import ForcedResponse
from nldyn.system.parameters import Parameter
from nldyn.system.ride import NO_RIDE, Ride
from nldyn.system.system import Clock, System, same_system

__all__ = ["FlowMap", "FlowOptions", "Segments", "Trajectory"]

_NONE = Corrector(np.empty(0), 0.0, 0.0, 0.0, 0.0, 0, np.empty(0), -1, 0.0)
SHALLOW = 1e-3  # of the deepest extreme: depths up to it are told exactly where stops are touched
BUNCH = 20  # excitation periods in one compiled call, where many follow each other
_REASONS = {
    TOO_MANY_PIECES: "more than 20000 flights and contact panels in one segment: too many contacts "
    "or too fast a mode (more `segments` of solve_orbit help)",
    TOO_MANY_STEPS: "a stop stays so close to a touch that the search for it takes too many steps",
    CONTACT_FAILED: "a contact phase could not be resolved",
    ROUNDED: "a contact is hidden by rounding: the displacements are too large beside its depth, "
    "or the damping of a stop beside its force",
    DIVERGED: "Newton's method diverged",
    SINGULAR: "singular Jacobian",
    NOT_CONVERGED: "Newton's method did not converge",
    OTHER_CONTACTS: "the number of contacts changes within the step",
    UNDECIDED: "with the friction at the rigid stop at '{at}' (stop {stop}) no force, or more than "
    "one, holds what rests on it at phase {phase:.6g} rad, since it is so large (Painlevé's "
    "paradox) or friction at another stop shares that force: what happens there is not decided",
}


@dataclass(frozen=True)
class Segments:
    """Results of k consecutive segments.

    Parameters
    ----------
    ends : (k, 2n)
        States at the ends.
    jacobians : (k, 2n, 2n)
        Derivatives of the ends with respect to the starts.
    d_omega : (k, 2n)
        Derivatives of the ends with respect to ω at fixed phases.
    d_parameters : (k, 2n, n_parameters)
        Derivatives of the ends with respect to the parameters asked for, at fixed phases.
    closings : (n_stops,)
        How often each stop closed.
    failure : str
        Empty, or why the segments could not be computed.
    """

    ends: Real
    jacobians: Real
    d_omega: Real
    d_parameters: Real
    closings: NDArray[np.int64]
    failure: str

    @property
    def monodromy(self) -> Real:
        """Product of the segments' Jacobians, (2n, 2n)."""
        return chain(self.jacobians)


@dataclass(frozen=True)
class FlowError:
    """Relative errors of the flow map over segments, in the norm of the coordinates z.

    Parameters
    ----------
    state : float
        Of the states at the ends of the segments.
    monodromy : float
        Of the monodromy matrix.
    d_omega : float
        Of the derivatives with respect to ω.
    d_parameters : float
        Of those with respect to the parameters asked for, in the columns' own units; the largest.
    """

    state: float
    monodromy: float
    d_omega: float
    d_parameters: float = 0.0


class Solution(NamedTuple):
    """Outcome of Newton's method for the shooting equations.

    Parameters
    ----------
    point : (N + 1,)
        States at the k phases and ln ω.
    along : (N + 1,)
        Direction of the branch, of no particular length or sense.
    jacobians : (k, 2n, 2n)
        Of the segments, at the point before the last step.
    motion : Trajectory
        From the point before the last step.
    iterations : int
    first_step, last_step : float
        Lengths of the first and the last Newton step: the error left is far below the last.
    failure : str
        Empty, or why it did not converge.
    """

    point: Real
    along: Real
    jacobians: Real
    motion: Trajectory
    iterations: int
    first_step: float
    last_step: float
    failure: str

    @property
    def converged(self) -> bool:
        """Whether a solution was found."""
        return not self.failure


def chain(jacobians: Real) -> Real:
    """Product of the Jacobians (k, 2n, 2n) of consecutive segments, (2n, 2n)."""
    product = np.asarray(jacobians[0])
    for jacobian in jacobians[1:]:
        product = jacobian @ product
    return product


class FlowMap:
    """Exact flights and collocated contact phases of a system.

    States z are the pairs of coordinates of `LinearPart`; `to_state` and `to_modal` translate.

    Parameters
    ----------
    system : System
        What to propagate.
    options : FlowOptions, optional
        Accuracy.
    clock : Clock, optional
        Of a system with forces of frequencies of their own: where in time the phases from 0 to 2π
        lie. Without it they are refused.

    Examples
    --------
    >>> import numpy as np
    >>> from nldyn import FlowMap, System, Unbalance
    >>> system = System.from_modal([13.1], {"middle": [0.635]}, modal_damping=0.0142,
    ...     excitation=[Unbalance("middle", 4.92e-6)])
    >>> flow = FlowMap(system)
    >>> omega = 2 * np.pi * 20.0
    >>> steady = system.steady(omega)[None]
    >>> segments = flow.shoot(steady, np.array([0.0, 2 * np.pi]), omega)
    >>> bool(np.allclose(segments.ends, steady, rtol=1e-12))
    True
    """

    def __repr__(self) -> str:
        """One line: the system and the accuracy."""
        return f"<FlowMap to {self.options.rtol:g} of {self.system!r}>"

    def __init__(
        self, system: System, options: FlowOptions | None = None, clock: Clock | None = None
    ) -> None:
        check_types(system=(system, System), options=(options, FlowOptions, None))
        self.system = system
        self.options = options or FlowOptions()
        self.clock = clock

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle what defines the map alone: a compiled law has another address elsewhere."""
        return FlowMap, (self.system, self.options, self.clock)

    def at(self, omega: float, start: float) -> FlowMap:
        """The map of the period from a time in s on, where forces have frequencies of their own.

        Without such forces it is this map.
        """
        if not self.system.tones:
            return self
        _ = self._unforced  # which both share
        other = copy.copy(self)
        for own in ("_data", "_packed"):
            vars(other).pop(own, None)
        other.clock = Clock(omega, start)
        return other

    @cached_property
    def tables(self) -> GaussTables:
        """Collocation tables."""
        exponents = [stop.exponent for stop in self.system.elastic_stops.values()]
        smooth = all(float(2.0 * exponent).is_integer() for exponent in exponents)
        power = 2 if smooth else 4
        nodes, tail, _ = self._bounds
        for stop in self.system.elastic_stops.values():
            viscous = stop.dissipation != 0.0 or stop.dashpot != 0.0
            nodes = _nodes_for_switch(stop.exponent, power, viscous, nodes, tail)
        return gauss_tables(nodes, power)

    @cached_property
    def _bounds(self) -> PanelBounds:
        """What bounds its panels."""
        return self.options.panels_for(self.system.size, len(self.system.stops))

    @cached_property
    def rows(self) -> Real:
        """Output rows (n_out, 2n): penetrations, displacements of sliders, bonds, interfaces.

        Of a round clearance there are those along both directions, see `round_rows`. Then, of each
        stop that never pulls, its force over its stiffness.
        """
        s = self.system
        vectors = [*self._pushed, *s.participation.values()]
        rows = [s.displacement_row(v) for v in vectors]
        for i, stop in s.elastic_stops.items():
            if not stop.pulls:
                slowing = stop.dashpot / stop.stiffness
                rows.append(rows[i] + slowing * s.linear.times_block(rows[i]))
        sizes = zip(self._place_rows, s.place_sizes, strict=True)
        for place, (of_place, size) in enumerate(sizes, s.size):
            for row in of_place:  # the strain of the spring before the slider
                rows[row] = rows[row] - size * np.eye(s.state_size)[2 * place]
        return np.array(rows).reshape(len(rows), s.state_size)

    @cached_property
    def _pushed(self) -> list[Real]:
        """Modal vectors (n,) of what forces push, in this order.

        Those of stops, sliders and bonds, and along the second directions of round clearances, then
        along second tangents, and of the movers of both, see `plane_rows`.
        """
        s = self.system
        between = [(e.at, e.against) for e in s.sliders] + [(e.at, e.against) for e in s.bonds]
        between += [stop.ends[1] for stop in s.round_stops.values()]
        planes = [s.sliders[i] for i in s.over_planes]
        between += [slider.ends[1] for slider in planes]
        between += [ends for i in s.over_planes if i in s.sprung for ends in s.sliders[i].ends]
        return [s.stop_vector(stop) for stop in s.stops] + [s.vector_between(*e) for e in between]

    @cached_property
    def force_columns(self) -> Real:
        """What the forces of `_pushed` do to the rates of z, (2n, n_forces)."""
        columns = [self.system.force_column(v) for v in self._pushed]
        for entry, (of_place, size) in enumerate(
            zip(self._place_rows, self.system.place_sizes, strict=True), self.system.size
        ):
            for mover in of_place[1:]:
                columns[mover] = -np.eye(self.system.state_size)[2 * entry] / size
        return np.ascontiguousarray(np.array(columns).reshape(-1, self.system.state_size).T)

    def mobility(self, outputs: Sequence[int]) -> Real:
        """Speeds (k, k) at stops, sliders and bonds that unit impulses at them take, by columns."""
        rows = list(outputs)
        return np.asarray(self.rate_rows[rows] @ self.force_columns[:, rows])

    def ride(self, output: int, omega: float) -> Ride:
        """What a moving base adds to an output at ω, see `System.with_absolute`."""
        s = self.system
        place = output - len(self._pushed)
        observed = 0 <= place < len(s.interfaces)
        return s.ride(s.interfaces[place], omega) if observed else NO_RIDE

    def _bends(self, output: int) -> bool:
        """Whether an output is no linear function of the state: of a ring, or coupled stops."""
        s = self.system
        return output in s.round_stops or (output < len(s.stops) and s.coupled.involves(output))

    @cached_property
    def first_alike(self) -> list[int]:
        """For each output the first one of the same row: an interface may be where a stop is."""
        riding = len(self.rows) if self.system.rides else 0
        keys = [
            (place if riding or self._bends(place) else None, row.tobytes())
            for place, row in enumerate(self.rows)
        ]
        return [keys.index(key) for key in keys]

    def outputs_at(self, output: int, states: Real) -> Real:
        """An output (k,) at states z (k, 2n), without what a moving base adds.

        Of a stop it is the penetration without its gap.
        """
        if not self._bends(output):
            return np.asarray((states * self.rows[output]).sum(axis=1))
        stop = self.system.stops[output]
        return self.system.depth_and_speed(stop, self.to_modal(states))[0] + stop.gap

    def output_row(self, output: int, state: Real) -> Real:
        """Derivative (2n,) of an output by the state z (2n,)."""
        stop = self.system.round_stops.get(output)
        if stop is None and self._bends(output):
            rows = self.rows[: len(self._gaps)]
            maps = self.system.coupled.maps((rows @ state - self._gaps)[None])
            return np.asarray(maps[0, output] @ rows)
        if stop is None:
            return np.asarray(self.rows[output])
        normal = self.system.round_polar(stop, self.to_modal(state[None])).normal[0]
        return np.asarray(stop.sense * normal @ self.rows[self.round_rows[output]])

    @cached_property
    def plane_rows(self) -> dict[int, list[int]]:
        """The outputs of sliders over a plane: along both tangents, and of movers behind springs.

        What a mover pushes is the place of the slider, by the speed at which that goes.
        """
        s = self.system
        second = len(s.stops) + len(s.sliders) + len(s.bonds) + len(s.round_stops)
        movers = itertools.count(second + len(s.over_planes))
        return {
            number: [
                len(s.stops) + number,
                second + i,
                *itertools.islice(movers, 2 if number in s.sprung else 0),
            ]
            for i, number in enumerate(s.over_planes)
        }

    @cached_property
    def _place_rows(self) -> list[list[int]]:
        """For each place the outputs of its strain: of its slider and, over a plane, its mover."""
        s, planes = self.system, self.plane_rows
        first = [[len(s.stops) + i, *planes.get(i, [])[2:3]] for i in s.sprung]
        return first + [[planes[i][1], planes[i][3]] for i in s.sprung if i in planes]

    @cached_property
    def round_rows(self) -> dict[int, list[int]]:
        """The outputs along both directions of the round clearances."""
        numbers = list(self.system.round_stops)
        first = len(self.system.stops) + len(self.system.sliders) + len(self.system.bonds)
        return {stop: [stop, first + place] for place, stop in enumerate(numbers)}

    @cached_property
    def stop_rows(self) -> Real:
        """Rows of the displacements at stops, at round clearances those along both directions."""
        stops = range(len(self.system.stops))
        seconds = [second for _, second in self.round_rows.values()]
        return self.rows[[*stops, *seconds]]

    @cached_property
    def _gaps(self) -> Real:
        return np.array([stop.gap for stop in self.system.stops])

    @cached_property
    def rate_rows(self) -> Real:
        """Rows of the outputs' velocities in flight."""
        return self.system.linear.times_block(self.rows)

    def slider_rows(self, number: int) -> list[int]:
        """The outputs of a slider along its tangents."""
        rows = self.plane_rows.get(number, [len(self.system.stops) + number])
        return rows[: len(self.system.sliders[number].ends)]

    def slips(self, number: int, states: Real) -> Real:
        """Speeds (k, 1), over a plane (k, 2), of a slider on what it slides on, at states z."""
        slider, rows = self.system.sliders[number], self.slider_rows(number)
        return np.asarray(
            states @ self.rate_rows[rows].T - slider.friction.base_speeds[: len(rows)]
        )

    def response(self, omega: float) -> ForcedResponse:
        """Response of the linear part at ω (rad/s), see `System.response`."""
        return self.system.response(omega, self.clock)

    @cached_property
    def _packed(self) -> Packed:
        """The system as the engine reads it."""
        return packed_system(self._data)

    @cached_property
    def _packed_tables(self) -> Packed:
        """The collocation tables as the engine reads them."""
        return self.tables.packed()

    @cached_property
    def _data(self) -> SystemData:
        """What the engine needs to know of the system."""
        orders, drive = self.system.forcing(self.clock)
        return self._unforced._replace(orders=orders, drive=drive)

    @cached_property
    def _unforced(self) -> SystemData:
        """The same without what excites it."""
        s, linear = self.system, self.system.linear
        vectors = self._pushed
        accelerations = linear.times_block(self.rate_rows)
        thirds = np.abs(linear.times_block(accelerations))
        growth = np.repeat(linear.growth, 2)
        bounds = np.multiply(thirds, growth, out=np.zeros_like(thirds), where=thirds > 0.0)
        releases = itertools.count(float(len(vectors) + len(s.participation)))
        stops = [
            stop_row(stop, float(v @ v), self.options, releases)
            for stop, v in zip(s.stops, vectors, strict=False)
        ]
        places = {number: 2 * (s.size + i) for i, number in enumerate(s.sprung)}
        stops += [
            slider_row(slider, float(v @ v), self.options, places.get(number, -1))
            for (number, slider), v in zip(
                enumerate(s.sliders), vectors[len(s.stops) :], strict=False
            )
        ]
        stops = of_areas(s, stops)
        first_bond = len(stops)
        stops += [
            bond_row(bond, float(v @ v))
            for bond, v in zip(s.bonds, vectors[first_bond:], strict=False)
        ]
        for i, (_, second) in self.round_rows.items():
            v = vectors[second]
            stops[i] = stops[i]._replace(second=float(second))
            stops.append(second_row(s.round_stops[i], i, float(v @ v), self.options))
        stops += self._plane_stops(stops)
        powers = np.zeros((len(stops), max((len(b.coefficients) for b in s.bonds), default=0)))
        for row, bond in enumerate(s.bonds, first_bond):
            powers[row, : len(bond.coefficients)] = bond.coefficients
        unlawful = len(vectors) - len(s.stops)
        return SystemData(
            linear.blocks,
            np.array([self.rows, self.rate_rows, accelerations]),
            bounds,
            self.force_columns,
            np.ones(1),
            np.zeros((1, 3, s.state_size), dtype=complex),
            np.hstack([np.array(stops, dtype=float).reshape(-1, len(StopRow._fields)), powers]),
            np.array([law_address(e.law) for e in s.stops] + [0] * unlawful, dtype=np.int64),
            self._bounds.tail,
            self._bounds.node_angle,
            np.pad(s.coupled.common, (0, len(stops) - len(s.stops))),
        )

    def _plane_stops(self, stops: list[StopRow]) -> list[StopRow]:
        """Rows of second tangents and movers; first tangents, in `stops`, are told of theirs."""
        places = itertools.count(2 * (self.system.size + len(self.system.sprung)), 2)
        seconds, movers = [], []
        for number, (first, second, *both) in self.plane_rows.items():
            slider, (own, other) = self.system.sliders[number], both or (-1, -1)
            mobility = [float(self._pushed[of] @ self._pushed[of]) for of in (first, second)]
            place = next(places) if both else -1
            row = second_tangent_row(stops[first], slider, mobility[1], place)
            seconds.append(row._replace(beside=float(first), mover=float(other)))
            stops[first] = stops[first]._replace(beside=float(second), mover=float(own))
            pairs = zip((first, second), mobility, strict=True)
            movers += [mover_row(of, size) for of, size in pairs if both]
        return seconds + movers

    def shoot(
        self,
        nodes: Real,
        phases: Real,
        omega: float,
        *,
        sensitivities: bool = True,
        chained: bool = False,
        parameters: Sequence[Parameter] = (),
    ) -> Segments:
        """Carry states over consecutive segments.

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
        parameters : sequence of Parameter
            Numbers of stops and excitation with respect to which derivatives are wanted, too.

        Returns
        -------
        Segments

        Raises
        ------
        SystemModelError
            For a parameter that the system does not have, or arrays of the wrong shape or with
            numbers that make no sense.
        """
        found = self._fly(
            self.no_record, False, nodes, phases, omega, chained, sensitivities, parameters
        )
        return Segments(*found[5:], self._reason(found))

    def error(
        self,
        nodes: Real,
        phases: Real,
        omega: float,
        *,
        chained: bool = False,
        parameters: Sequence[Parameter] = (),
    ) -> FlowError:
        """Estimate the errors of `shoot` by a finer map; infinite where either fails.

        Parameters and exceptions are those of `shoot`.

        Examples
        --------
        >>> import numpy as np
        >>> import nldyn
        >>> system = nldyn.System.from_modal(
        ...     [10.0], {"a": [1.0]}, stops=[nldyn.Stop("a", 1e9)],
        ...     excitation=[nldyn.HarmonicForce("a", 1.0)],
        ... )
        >>> flow = nldyn.FlowMap(system)
        >>> flow.error(np.zeros((1, 2)), np.array([0.0, 2.0 * np.pi]), 50.0).state < 1e-9
        True
        """
        here, finer = (
            flow.shoot(nodes, phases, omega, chained=chained, parameters=parameters)
            for flow in (self, self.finer)
        )
        if here.failure or finer.failure:
            return FlowError(math.inf, math.inf, math.inf, math.inf if parameters else 0.0)
        columns = zip(here.d_parameters.T, finer.d_parameters.T, strict=True)
        return FlowError(
            relative_error(here.ends, finer.ends),
            relative_error(here.monodromy, finer.monodromy),
            relative_error(here.d_omega, finer.d_omega),
            max((relative_error(a, b) for a, b in columns), default=0.0),
        )

    def strobe(self, state: Real, omega: float, periods: int) -> Segments:
        """Carry a state (2n,) over excitation periods from phase zero on, without derivatives."""
        check_whole("periods", periods, 1)
        phases = np.linspace(0.0, 2.0 * np.pi * periods, periods + 1)
        nodes = _floats("state", state)[None]
        parts: list[Segments] = []
        for first in range(0, periods, BUNCH):  # between two of them Ctrl-C is answered
            some = phases[first : first + BUNCH + 1]
            parts.append(self.shoot(nodes, some, omega, sensitivities=False, chained=True))
            if parts[-1].failure:
                break
            nodes = parts[-1].ends[-1:]
        return replace(
            parts[-1],
            ends=np.concatenate([part.ends for part in parts]),
            closings=np.sum([part.closings for part in parts], axis=0),
        )

    def _check_segments(self, nodes: Real, phases: Real, omega: float, chained: bool) -> None:
        ends = phases.tolist() if phases.ndim == 1 else []
        if len(ends) < 2 or not all(map(operator.lt, ends, ends[1:])):
            raise SystemModelError("phases must be two or more ascending numbers")
        size = self.system.state_size
        rows = 1 if chained else phases.size - 1
        if nodes.ndim != 2 or nodes.shape[1] != size or len(nodes) < rows:
            raise SystemModelError(
                f"nodes must have shape ({rows}, {size}) for {phases.size - 1} segments of "
                f"{self.system.size} modes, got {nodes.shape}"
            )
        if not math.isfinite(float(nodes.sum()) + ends[-1] - ends[0]):
            raise SystemModelError("nodes and phases must be finite")
        full = 2.0 * math.pi
        if not (
            is_finite(omega) and full * SMALLEST_FREQUENCY <= omega <= full * LARGEST_FREQUENCY
        ):
            raise SystemModelError(
                f"omega must be positive, that of {SMALLEST_FREQUENCY:g} to "
                f"{LARGEST_FREQUENCY:g} Hz, got {shown(omega)}"
            )

    def trajectory(
        self, nodes: Real, phases: Real, omega: float, *, chained: bool = False
    ) -> Trajectory:
        """Record the motion from phase to phase, restarted from each node state.

        Parameters
        ----------
        nodes : (k, 2n) array
            States at the first k phases; only the first is used when `chained`.
        phases : (k + 1,) array
            Forcing phases in radians.
        omega : float
            Excitation frequency in rad/s.
        chained : bool
            Start each segment where the one before ended.

        Returns
        -------
        Trajectory
        """
        capacity = (16 if chained else 64) * np.size(phases)
        while True:
            record = self._record(capacity)
            found = self._fly(record, True, nodes, phases, omega, chained, False)
            if found.outcome != RECORD_FULL:
                return self._motion(omega, record, found)
            capacity *= 4

    def newton(
        self, guess: Real, corrector: Corrector, phases: Real, like: Trajectory | None = None
    ) -> Solution:
        """Solve the shooting equations on a plane.

        Parameters
        ----------
        guess : (N + 1,) array
            States at the k phases, one after the other, and ln ω.
        corrector : Corrector
            The plane and when to stop.
        phases : (k + 1,) array
            Forcing phases of the segment ends.
        like : Trajectory, optional
            A motion nearby over the same phases, whose contact panels are the first guesses.

        Returns
        -------
        Solution

        Raises
        ------
        SystemModelError
            If the arrays do not fit the segments.
        """
        guess = np.ascontiguousarray(guess, dtype=float)
        unknowns = self.system.state_size * (phases.size - 1) + 1
        row, aim = corrector.row, corrector.aim
        if not guess.shape == row.shape == aim.shape == (unknowns,):  # or the kernel leaves memory
            raise SystemModelError(
                f"guess and row must have shape ({unknowns},) for {phases.size - 1} segments of "
                f"{self.system.size} modes, got {guess.shape} and {row.shape}"
            )
        capacity = 64 * phases.size
        while True:
            point, record = guess.copy(), self._record(capacity)
            found = self._call(
                record, True, 0.0, point, phases, False, True, (), corrector,
                like.record if like is not None and like.record.fits(record) else None,
            )  # fmt: skip
            if found.outcome != RECORD_FULL:
                motion = self._motion(math.exp(point[-1]), record, found)
                return Solution(
                    point, found.along, found.jacobians, motion, found.iterations, found.first,
                    found.last, motion.failure,
                )  # fmt: skip
            capacity *= 4

    def _fly(
        self,
        record: Record,
        recording: bool,
        nodes: Real,
        phases: Real,
        omega: float,
        chained: bool,
        sensitivities: bool,
        parameters: Sequence[Parameter] = (),
    ) -> Found:
        """The flow map alone."""
        nodes, phases = _floats("nodes", nodes), np.ascontiguousarray(_floats("phases", phases))
        self._check_segments(nodes, phases, omega, chained)
        return self._call(
            record, recording, float(omega), np.ascontiguousarray(nodes), phases, chained,
            sensitivities, parameters,
        )  # fmt: skip

    def _call(
        self,
        record: Record,
        recording: bool,
        omega: float,
        point: Real,
        phases: Real,
        chained: bool,
        sensitivities: bool,
        parameters: Sequence[Parameter],
        corrector: Corrector | None = None,
        like: Record | None = None,
    ) -> Found:
        """The engine, which corrects the point (N + 1,) or, without corrector, only flies."""
        table, drive_by = (
            parameter_tables(self.system, parameters) if parameters else self._no_parameters
        )
        found = newton(
            self._packed, self._packed_tables, record, recording, omega, point, phases, chained,
            sensitivities, table, drive_by, corrector or _NONE, len(self._pushed), like,
        )  # fmt: skip
        if len(self._pushed) > len(self.system.stops):  # what comes after the stops never closes
            return found._replace(closings=found.closings[: len(self.system.stops)])
        return found

    def _reason(self, found: Found) -> str:
        """Why the engine gave up; empty if they did not."""
        status = found.outcome
        if status == OK:
            return ""
        if status == UNDECIDED:
            number = int(found.first)
            stop = self.system.rigid_stops[number]
            return _REASONS[status].format(at=stop.at, stop=number, phase=found.last)
        softens = any(bond.coefficients and not bond.bounded for bond in self.system.bonds)
        if status == CONTACT_FAILED and softens:
            return "the motion runs away along a spring that softens"
        return _REASONS[status]

    @cached_property
    def no_record(self) -> Record:
        """A record without room, for what need not be recorded."""
        return self._record(0)

    @cached_property
    def _no_parameters(self) -> tuple[NDArray[np.int64], Complex]:
        drive = self._unforced.drive
        return np.zeros((0, 2), dtype=np.int64), np.zeros((0, *drive.shape), dtype=complex)

    def _motion(self, omega: float, rec: Record, found: Found) -> Trajectory:
        """The motion in a record, of which only the used part is kept."""
        return Trajectory(self, omega, rec.kept(), found.closings, self._reason(found))

    @cached_property
    def finer(self) -> FlowMap:
        """The same map at a setting whose errors are negligible beside those of this one."""
        return FlowMap(self.system, self.options.finer)

    def to_modal(self, states: Real) -> Real:
        """Modal displacements and velocities (..., 2n) of states z."""
        states = _columns("states", states, self.system.state_size)
        return np.asarray(states @ self.system.linear.right.T)

    def to_start(self, states: Real) -> Real:
        """The same, and the places in m of the sliders behind springs: all that goes on."""
        return np.concatenate([self.to_modal(states), self.places(states)], axis=-1)

    def places(self, states: Real) -> Real:
        """Places in m of what is behind springs, `System.place_ends`, at states z."""
        states = _columns("states", states, self.system.state_size)
        return np.asarray(states[..., 2 * self.system.size :: 2] * self.system.place_sizes)

    def to_state(self, modal: Real) -> Real:
        """States z of modal displacements and velocities (..., 2n).

        Sliders behind springs are at rest in the middle, unless their places follow as in
        `to_start`.
        """
        size, more = 2 * self.system.size, len(self.system.place_ends)
        placed = more and np.shape(modal)[-1:] == (size + more,)
        modal = _columns("modal", modal, size + more if placed else size)
        states = np.asarray(modal[..., :size] @ self.system.linear.left.T)
        if placed:
            states[..., size::2] = modal[..., size:] / self.system.place_sizes
        return states

    def _record(self, capacity: int) -> Record:
        return empty_record(
            capacity, self.system.state_size, len(self._pushed), self.tables.nodes.size
        )


def pinned(system: System, jacobians: Real) -> Real:
    """Jacobians (k, N, N) of all segments of an orbit, without places that never move.

    What sticks behind its spring all the time may have its place anywhere within its friction: the
    one that it has is given, and its multiplier zero.
    """
    found = np.asarray(jacobians)
    for place in range(2 * system.size, system.state_size, 2):
        still = np.eye(system.state_size)[place]
        if np.array_equal(found[:, place], np.tile(still, (len(found), 1))):
            found = found.copy()
            found[-1, place] = 0.0
    return found


def kept_places(system: System, jacobians: Real) -> list[int]:
    """Entries of the state that are such places, by Jacobians (k, N, N) that are `pinned`."""
    found = []
    for place in range(2 * system.size, system.state_size, 2):
        still = np.zeros((len(jacobians), system.state_size))
        still[:-1, place] = 1.0
        if np.array_equal(jacobians[:, place], still):
            found.append(place)
    return found


def _columns(name: str, values: Real, count: int) -> Real:
    values = _floats(name, values)
    if values.ndim == 0 or values.shape[-1] != count:
        raise SystemModelError(f"{name} must have {count} columns, got an array {values.shape}")
    return values


def relative_error(value: Real, reference: Real) -> float:
    """Length of the difference over that of the reference; without it where the latter is zero."""
    size = float(np.linalg.norm(reference))
    return float(np.linalg.norm(value - reference)) / (size or 1.0)


def flow_of(system: System | FlowMap, *, periodic: bool = True) -> FlowMap:
    """The flow map itself, or that of a system at the default accuracy.

    Raises
    ------
    SystemModelError
        If a force has a frequency of its own where motions must be `periodic`.
    """
    flow = system if isinstance(system, FlowMap) else FlowMap(system)
    if periodic:
        flow.system.check_periodic()
    return flow


def same_flow(a: FlowMap, b: FlowMap) -> bool:
    """Whether two flow maps have the same numbers and laws, and states in the same coordinates."""
    return a is b or (
        a.options == b.options
        and same_system(a.system, b.system)
        and np.array_equal(a.system.linear.right, b.system.linear.right)
    )


@dataclass(frozen=True)
class Trajectory:
    """Recorded motion: exact at any instant, not a table of samples.

    Parameters
    ----------
    flow : FlowMap
        What made it.
    omega : float
        Excitation frequency in rad/s.
    record : Record
        Flights and contact panels.
    closings : (n_stops,)
        How often each stop closed.
    failure : str
        Empty, or why it stopped early.
    """

    flow: FlowMap
    omega: float
    record: Record
    closings: NDArray[np.int64]
    failure: str

    def states(self, phases: Real) -> Real:
        """States z (k, 2n) at ascending forcing phases (k,) within the motion.

        Raises
        ------
        SystemModelError
            For phases that are no such list.
        """
        states = self.recorded_states(phases)
        inside, solved = self._solved_in_contact(_floats("phases", phases))
        states[inside] = solved
        return states

    def recorded_states(self, phases: Real) -> Real:
        """The same by the recorded polynomials: fast, and in contacts good to 1e-6."""
        phases = _floats("phases", phases)
        if phases.ndim != 1 or not (phases[1:] >= phases[:-1]).all():
            raise SystemModelError("phases must be a list of ascending numbers")
        first, last = self.span
        slack = SLACK * max(1.0, abs(last))
        if phases.size and not first - slack <= phases[0] <= phases[-1] <= last + slack:
            raise SystemModelError(
                f"phases must lie within the motion, {first:g} to {last:g}, got "
                f"{phases[0]:g} to {phases[-1]:g}"
            )
        flow = self.flow
        return sample_states(flow._packed, flow._packed_tables, self.record, self.omega, phases)

    def _solved_in_contact(self, phases: Real) -> tuple[NDArray[np.intp], Real]:
        """Which of some ascending phases lie in contact panels, and the flow map's states (k, 2n).

        Between the ends of a panel its polynomial is less accurate. Each state is solved for anew
        from the start of its panel, or from before the contact where the panel begins it. The map
        also runs from each phase to where the next one begins, which lies before: that takes no
        time. None are told if it fails.
        """
        rec, flow = self.record, self.flow
        none = np.empty(0, dtype=np.intp), np.empty((0, rec.start.shape[1]))
        if not (rec.kind >= 0).any():
            return none
        piece = np.maximum(np.searchsorted(rec.phase, phases, side="right") - 1, 0)
        inside = np.flatnonzero(rec.kind[piece] >= 0)[::-1]
        if not inside.size:
            return none
        begins = rec.kind // 2 == 1
        start = np.maximum.accumulate(np.where(begins, 0, np.arange(begins.size)))[piece[inside]]
        legs = np.stack([rec.phase[start], phases[inside]], axis=1).ravel()
        nodes = np.repeat(rec.start[start], 2, axis=0)[:-1]
        found = flow._call(flow.no_record, False, self.omega, nodes, legs, False, False, ())
        return (inside, found.ends[::2]) if found.outcome == OK else none

    @cached_property
    def span(self) -> tuple[float, float]:
        """Forcing phases at which the motion begins and ends."""
        rec = self.record
        if not rec.phase.size:
            return math.nan, math.nan
        return float(rec.phase[0]), float(rec.phase[-1] + self.omega * rec.duration[-1])

    def extremes(self, output: int) -> Real:
        """Phase, value and kind (+1 maximum, -1 minimum) of an output's local extremes, (k, 3).

        The motion is taken as periodic. Outputs are the stops' penetrations without their gaps,
        then the interfaces' displacements.

        Raises
        ------
        SystemModelError
            If there is no such output.
        """
        found = self.recorded_extremes(output)
        return self.with_exact_values(found, output, np.ones(len(found), dtype=bool))

    def recorded_extremes(self, output: int) -> Real:
        """The same with the values of the recorded polynomials, in contacts good to 1e-6."""
        flow = self.flow
        check_whole("output", output, 0, len(flow.rows) - 1)
        first = flow.first_alike[output]
        if first not in self._extremes:
            if first < len(flow.system.stops):
                found = of_stop(self.recorded_touches[0], first)
            else:
                ride = flow.ride(first, self.omega)
                found = local_extremes(
                    flow._packed, flow._packed_tables, self.record, self.omega, ride.orders,
                    ride.amplitudes, first,
                )  # fmt: skip
            kinds = 2.0 * (found[:, 2] % 2.0) - 1.0
            self._extremes[first] = np.stack([found[:, 0], found[:, 3], kinds], axis=1)
        return self._extremes[first]

    @cached_property
    def recorded_touches(self) -> tuple[Real, list[int]]:
        """Extremes of the penetrations, and how many are shallow, see `engine.sample.touches`."""
        flow = self.flow
        return touches(
            flow._packed, flow._packed_tables, self.record, self.omega, flow._gaps, SHALLOW
        )

    @cached_property
    def _extremes(self) -> dict[int, Real]:
        return {}

    def with_exact_values(self, found: Real, output: int, wanted: NDArray[np.bool_]) -> Real:
        """Extremes (k, 3) of an output, those wanted (k,) with the values of the flow map."""
        places, values = self.exact_values(found, output, wanted)
        exact = found.copy()
        exact[places, 1] = values
        return exact

    def exact_values(
        self, found: Real, output: int, wanted: NDArray[np.bool_]
    ) -> tuple[NDArray[np.intp], Real]:
        """Which of the extremes (k, 3) wanted (k,) lie in contacts, and the flow map's values."""
        order = np.argsort(found[:, 0], kind="stable")
        order = order[wanted[order]]
        inside, solved = self._solved_in_contact(found[order, 0])
        places = order[inside]
        carried = self.flow.ride(output, self.omega).at(found[places, 0])
        # BLAS would sum in an order that depends on how many are wanted
        return places, self.flow.outputs_at(output, solved) + carried

    @cached_property
    def contacts_at_nodes(self) -> tuple[Real, Real]:
        """Penetrations and normal forces (n_pieces, n_stops, m) at the nodes of contact panels.

        Zero where a stop is open. Those of a stop that is held are accelerations.
        """
        stops, rec = len(self.flow.system.stops), self.record
        depth, force = rec.depth[:, :stops], rec.force[:, :stops]
        if not self.flow.round_rows:
            return depth, force
        depth, force = depth.copy(), force.copy()
        for i, rows in self.flow.round_rows.items():
            stop = self.flow.system.round_stops[i]
            closed = np.asarray(rec.depth[:, rows].any(axis=(1, 2))).reshape(-1, 1)
            away, pushed = rec.depth[:, rows], stop.sense * rec.force[:, rows]
            radius = np.hypot(away[:, 0], away[:, 1])
            depth[:, i] = np.where(closed, stop.sense * radius - stop.gap, 0.0)
            radial = (away * pushed).sum(axis=1) / np.where(radius > 0.0, radius, 1.0)
            force[:, i] = np.where(closed, radial, 0.0)
        return depth, force

    def contact_quadrature(self) -> tuple[Real, Real]:
        """Forcing phases (k,) of all nodes of contact panels, and their weights in s (k,)."""
        tables, rec = self.flow.tables, self.record
        contact = rec.kind >= 0
        kind, duration = rec.kind[contact], rec.duration[contact, None]
        phases = rec.phase[contact, None] + self.omega * duration * tables.chi[kind]
        return phases.ravel(), (duration * tables.weights[kind]).ravel()
