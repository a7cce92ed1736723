"""The motion at touches of rigid stops, by equations that are smooth through grazing.

The unknowns are the states z at the touches, their phases φ and a parameter x. Behind a touch,
where an impact has taken (1 + e) v from the speed, the motion with the stops left out around the
touches leads to the next one, that behind the last to the first. There it has the speed v and the
gap open by d. With v > 0 and d = 0 that is an impact, with v = 0 and d > 0 a miss; where v = d = 0
at all of them the orbit grazes.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from nldyn.base.arrays import Real
from nldyn.base.errors import ConvergenceError
from nldyn.flow.flow_map import Segments
from nldyn.flow.rigid_impacts import slider_of
from nldyn.orbits.bordered import Evaluation, OrbitFamily
from nldyn.orbits.conditions import Grazing
from nldyn.orbits.orbit import Orbit
from nldyn.orbits.passage import Passage, shoot_past
from nldyn.orbits.shooting import ShootingProblem

STEPS = 8  # most of Newton's method
SMALL = 1e-12  # its last step, relative to the orbit
DIFFERENCE = 1e-7  # of the parameter's coordinate: short, as slow impacts may begin or end beside
RATE = 1e-4  # forcing phase in rad over which rates of the state are differences, at most
TURN_OF_FASTEST = 1e-3  # by which the fastest mode turns meanwhile: its square is their error
AT_ONE_INSTANT = 1e-3  # rad between two touches of which the order is not followed


@dataclass(frozen=True, eq=False)
class Touches:
    """The motion at all touches of an orbit that graze at once.

    Parameters
    ----------
    family : OrbitFamily
        Of the orbit; with one parameter, that of which neighbouring orbits have other values.
    passages : tuple of Passage
        Where the stops are left out.
    stops : tuple of int
        Which stop each touch is of, in the order of time.
    states : (m, 2n)
        States at the touches, before the impact if there is one, in the family's coordinates.
    phases : (m,)
        Forcing phases, within one period.
    coordinate : float
        The parameter, on its chart.
    size : float
        Largest coordinate of the orbit: where the gap is zero those of the touch may be, too.
    """

    family: OrbitFamily
    passages: tuple[Passage, ...]
    stops: tuple[int, ...]
    states: Real
    phases: Real
    coordinate: float
    size: float

    @classmethod
    def of(
        cls,
        orbit: Orbit,
        times: int = 1,
        grazing: Grazing | None = None,
        family: OrbitFamily | None = None,
    ) -> Touches:
        """Those of an orbit that grazes, run through several times; all unless a grazing is given.

        Its neighbours have other frequencies, unless a family with another parameter is given.

        Raises
        ------
        ConvergenceError
            If the flow map fails, or two touches are at one instant.
        SystemModelError
            If the orbit does not graze.
        """
        if grazing is None:
            grazing = Grazing.of(orbit).with_others(orbit).grazing_too(orbit)
        if any(each.stop in orbit.system.round_stops for each in grazing.passages):
            raise ConvergenceError("beside the grazing of a rigid ring or pin nothing is followed")
        base, full = orbit.problem, 2.0 * math.pi * orbit.period
        found = sorted(
            ((each.phase + turn * each.every - base.start) % full + base.start, each.stop)
            for each in grazing.passages
            for turn in range(round(full / each.every))
        )
        phases, stops = np.array([phase for phase, _ in found]), [stop for _, stop in found]
        if np.diff(phases, append=phases[0] + full).min() < AT_ONE_INSTANT:
            raise ConvergenceError("two stops are grazed at one instant")
        family = family or OrbitFamily.in_frequency(orbit)
        point, size = family.unknowns(orbit), float(np.abs(orbit.point[:-1]).max())
        nodes = point[: family.n_states].reshape(base.segments, -1)
        here = cls(
            family.repeated(times),
            grazing.passages,
            tuple(stops * times),
            np.empty((0, base.size)),
            (phases + full * np.arange(times)[:, None]).ravel(),
            float(point[-1]),
            size,
        )
        places = np.searchsorted(base.phases, phases, side="right") - 1
        states = [
            here.end(nodes[j], base.phases[j], phase) if phase > base.phases[j]
            else nodes[j]
            for j, phase in zip(np.minimum(places, base.segments - 1), phases, strict=True)
        ]  # fmt: skip
        return replace(here, states=np.tile(states, (times, 1)))

    @cached_property
    def at(self) -> Evaluation:
        """The family's equations at the parameter's value."""
        return self.family.at(np.append(np.zeros(self.family.n_states), self.coordinate))

    @property
    def problem(self) -> ShootingProblem:
        """Shooting equations at the parameter's value."""
        return self.at.problem

    @property
    def omega(self) -> float:
        """Excitation frequency in rad/s."""
        return self.at.omega

    @property
    def ends(self) -> Real:
        """Phases (m,) of the next touches."""
        return np.append(self.phases[1:], self.phases[0] + 2.0 * math.pi * self.family.period)

    @property
    def rows(self) -> tuple[Real, Real]:
        """Rows (m, 2n) of the penetrations and of their rates."""
        flow, stops = self.problem.flow, list(self.stops)
        rows, rates = flow.rows[stops], flow.rate_rows[stops]
        if self.at.change is None:
            return rows, rates
        return rows @ self.at.change[0], rates @ self.at.change[0]

    @property
    def heights(self) -> Real:
        """Penetrations (m,) at the touches, less the gaps."""
        gaps = [self.problem.flow.system.stops[stop].gap for stop in self.stops]
        return np.asarray((self.rows[0] * self.states).sum(1) - gaps)

    @property
    def kicks(self) -> Real:
        """Changes (m, 2n) of the states by impulses that give the gaps the speed 1.

        With those of friction on what slides along the stops.
        """
        flow, states = self.problem.flow, self.states
        if self.at.change is not None:
            states = states @ self.at.change[0].T
        kicks = flow.force_columns[:, list(self.stops)].T.copy()
        for kick, stop, state in zip(kicks, self.stops, states, strict=True):
            number = slider_of(flow.system, stop)
            if number is None:
                continue
            slip, rows = flow.slips(number, state[None])[0], flow.slider_rows(number)
            size, friction = np.linalg.norm(slip), flow.system.sliders[number].friction
            way = slip / size if size > 0.0 else slip
            kick += friction.coefficient * flow.force_columns[:, rows] @ way
        if self.at.change is not None:
            kicks = kicks @ self.at.change[1].T
        return np.asarray(kicks / (self.rows[1] * kicks).sum(1)[:, None])

    def losses(self, speeds: Real) -> Real:
        """1 + e (m,) at speeds (m,)."""
        rigid = self.problem.flow.system.rigid_stops
        hits = zip(self.stops, speeds.tolist(), strict=True)
        return np.array([1.0 + rigid[stop].restitution_at(speed) for stop, speed in hits])

    def after(self, speeds: Real) -> Real:
        """States (m, 2n) behind impacts of these speeds."""
        return np.asarray(self.states - (self.losses(speeds) * speeds)[:, None] * self.kicks)

    def shoot(self, state: Real, first: float, last: float) -> tuple[Real, Real]:
        """State (2n,) at another phase, past the stops around the touches; Jacobian (2n, 2n)."""
        end, found = self._shot(state, first, last, True)
        jacobian, change = found.jacobians[0], self.at.change
        return end, jacobian if change is None else change[1] @ jacobian @ change[0]

    def end(self, state: Real, first: float, last: float) -> Real:
        """State (2n,) at another phase, past the stops around the touches."""
        return self._shot(state, first, last, False)[0]

    def _shot(
        self, state: Real, first: float, last: float, sensitivities: bool
    ) -> tuple[Real, Segments]:
        """State (2n,) at another phase, and the segment in the system's own coordinates."""
        change, phases = self.at.change, np.array([first, last])
        begin = state if change is None else change[0] @ state
        found = shoot_past(
            self.problem, self.passages, begin[None], phases, self.omega, sensitivities,
            size=self.size,
        )  # fmt: skip
        end = found.ends[0]
        return end if change is None else change[1] @ end, found

    def flights(self, states: Real) -> Real:
        """States (m, 2n) at the next touches of motions from states at these."""
        begins = zip(states, self.phases.tolist(), self.ends.tolist(), strict=True)
        return np.array([self.end(*each) for each in begins])

    def by_parameter(self, function: Callable[[Touches], Real]) -> Real:
        """Derivative by the parameter's coordinate of a function of the same states and phases."""
        before, behind = (
            function(replace(self, coordinate=self.coordinate + way * DIFFERENCE))
            for way in (-1.0, 1.0)
        )
        return np.asarray((behind - before) / (2.0 * DIFFERENCE))

    def rate(self, state: Real, phase: float) -> Real:
        """Derivative (2n,) of the motion by the phase."""
        fastest = float(self.problem.flow.system.natural_frequencies.max())
        step = min(RATE, TURN_OF_FASTEST * self.omega / max(fastest, self.omega))
        near, far = (self.end(state, phase, phase + x) for x in (step, 2.0 * step))
        return np.asarray((4.0 * near - 3.0 * state - far) / (2.0 * step))

    def moved(self, hits: Sequence[bool], amounts: Real, lead: int) -> tuple[Touches, Real]:
        """The same on a neighbouring orbit, and its amounts: speeds of hits and misses' clearances.

        Parameters
        ----------
        hits : (m,)
            Which of the touches are impacts.
        amounts : (m,)
            In m/s or m, roughly.
        lead : int
            The touch whose amount is met exactly.

        Raises
        ------
        ConvergenceError
            If there is none nearby.
        """
        here, hit = self, np.asarray(hits)
        n = self.states.shape[1]
        for _ in range(STEPS):
            matrix, missing = here._equations(hit, amounts, lead)
            step = np.linalg.solve(matrix, -missing)
            moves = step[: hit.size * (n + 1)].reshape(hit.size, n + 1)
            here = replace(
                here, states=here.states + moves[:, :n], phases=here.phases + moves[:, n],
                coordinate=here.coordinate + float(step[hit.size * (n + 1)]),
            )  # fmt: skip
            amounts = amounts + np.insert(step[hit.size * (n + 1) + 1 :], lead, 0.0)
            near = 0.5 < here.omega / self.omega < 2.0
            if not near or not np.abs(here.states - self.states).max() < self.size:
                break
            if np.abs(moves[:, :n]).max() < SMALL * self.size:
                return here, amounts
        raise ConvergenceError("no orbit was found beside the grazing")

    def _equations(self, hit: Real, amounts: Real, lead: int) -> tuple[Real, Real]:
        """Newton's matrix and what is missing, for z and φ of each touch, x and the amounts."""
        m, n = self.states.shape
        speeds, clearances = np.where(hit, amounts, 0.0), np.where(hit, 0.0, amounts)
        after, losses, kicks = self.after(speeds), self.losses(speeds), self.kicks
        (rows, rates), ends = self.rows, self.ends
        size = m * (n + 2)
        by_amount = np.zeros((size, m))
        matrix, reached = np.zeros((size, m * (n + 1) + 1)), np.empty((m, n))
        for i, follows in enumerate([*range(1, m), 0]):
            flight, here, there = slice(i * n, (i + 1) * n), i * (n + 1), follows * (n + 1)
            reached[i], jacobian = self.shoot(after[i], self.phases[i], ends[i])
            matrix[flight, here : here + n] += jacobian
            matrix[flight, there : there + n] -= np.eye(n)
            matrix[flight, here + n] -= jacobian @ self.rate(after[i], self.phases[i])
            matrix[flight, there + n] += self.rate(reached[i], ends[i])
            gap, pace = m * n + i, m * (n + 1) + i
            matrix[gap, here : here + n], matrix[pace, here : here + n] = rows[i], rates[i]
            if hit[i]:
                by_amount[flight, i] = -losses[i] * (jacobian @ kicks[i])
                by_amount[pace, i] = -1.0
            else:
                by_amount[gap, i] = 1.0

        def missing(touches: Touches, reached: Real) -> Real:
            late = reached - np.roll(self.states, -1, axis=0)
            paces = (touches.rows[1] * self.states).sum(1)
            return np.concatenate([late.ravel(), touches.heights + clearances, paces - speeds])

        matrix[:, -1] = self.by_parameter(
            lambda touches: missing(touches, touches.flights(touches.after(speeds)))
        )
        return np.hstack([matrix, np.delete(by_amount, lead, axis=1)]), missing(self, reached)

    def unknowns(self, speeds: Real) -> Real:
        """The family's unknowns (N + 1,) of the orbit with impacts of these speeds."""
        problem = self.problem
        full, after = 2.0 * math.pi * problem.period, self.after(speeds)
        nodes = []
        for phase in problem.phases[:-1].tolist():
            past = (phase - self.phases) % full
            i = int(np.argmin(past))
            begin = float(self.phases[i])
            nodes.append(self.end(after[i], begin, begin + past[i]) if past[i] > 0.0 else after[i])
        return np.append(np.ravel(nodes), self.coordinate)
