"""The motion at touches of rigid stops, by equations that are smooth through grazing.

The unknowns are the states z at the touches, their phases φ and ln ω. Behind a touch, where an
impact has taken (1 + e) v from the speed, the motion with the stops left out around the touches
leads to the next one, that behind the last to the first. There it has the speed v and the gap open
by d. With v > 0 and d = 0 that is an impact, with v = 0 and d > 0 a miss; where v = d = 0 at all of
them the orbit grazes.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from nldyn.base.arrays import Real
from nldyn.base.errors import ConvergenceError
from nldyn.flow.flow_map import Segments
from nldyn.orbits.conditions import Grazing
from nldyn.orbits.orbit import Orbit
from nldyn.orbits.passage import Passage, shoot_past
from nldyn.orbits.shooting import ShootingProblem
from nldyn.system.rigid_stop import RigidStop

STEPS = 8  # most of Newton's method
SMALL = 1e-12  # its last step, relative to the orbit
RATE = 1e-4  # forcing phase in rad over which rates of the state are differences
AT_ONE_INSTANT = 1e-3  # rad between two touches of which the order is not followed


@dataclass(frozen=True, eq=False)
class Touches:
    """The motion at all touches of an orbit that graze at once.

    Parameters
    ----------
    problem : ShootingProblem
        Of the orbit.
    passages : tuple of Passage
        Where the stops are left out.
    stops : tuple of int
        Which stop each touch is of, in the order of time.
    states : (m, 2n)
        States at the touches, before the impact if there is one.
    phases : (m,)
        Forcing phases, within one period.
    log_omega : float
        ln ω.
    size : float
        Largest coordinate of the orbit: where the gap is zero those of the touch may be, too.
    """

    problem: ShootingProblem
    passages: tuple[Passage, ...]
    stops: tuple[int, ...]
    states: Real
    phases: Real
    log_omega: float
    size: float

    @classmethod
    def of(cls, orbit: Orbit, times: int = 1, grazing: Grazing | None = None) -> Touches:
        """Those of an orbit that grazes, run through several times; all unless a grazing is given.

        Raises
        ------
        ConvergenceError
            If the flow map fails, or two touches are at one instant.
        SystemModelError
            If the orbit does not graze.
        """
        if grazing is None:
            grazing = Grazing.of(orbit).with_others(orbit).grazing_too(orbit)
        base, full = orbit.problem, 2.0 * math.pi * orbit.period
        found = sorted(
            ((each.phase + turn * each.every - base.start) % full + base.start, each.stop)
            for each in grazing.passages
            for turn in range(round(full / each.every))
        )
        phases, stops = np.array([phase for phase, _ in found]), [stop for _, stop in found]
        if np.diff(phases, append=phases[0] + full).min() < AT_ONE_INSTANT:
            raise ConvergenceError("two stops are grazed at one instant")
        problem = ShootingProblem(base.flow, times * base.period, times * base.segments)
        size = float(np.abs(orbit.point[:-1]).max())
        here = cls(problem, grazing.passages, tuple(stops * times), np.empty((0, base.size)),
                   (phases + full * np.arange(times)[:, None]).ravel(), orbit.point[-1], size)
        nodes = base.nodes(orbit.point)
        places = np.searchsorted(base.phases, phases, side="right") - 1
        states = [
            here.shoot(nodes[j], base.phases[j], phase).ends[0] if phase > base.phases[j]
            else nodes[j]
            for j, phase in zip(np.minimum(places, base.segments - 1), phases, strict=True)
        ]  # fmt: skip
        return replace(here, states=np.tile(states, (times, 1)))

    @property
    def omega(self) -> float:
        """Excitation frequency in rad/s."""
        return math.exp(self.log_omega)

    @property
    def ends(self) -> Real:
        """Phases (m,) of the next touches."""
        return np.append(self.phases[1:], self.phases[0] + 2.0 * math.pi * self.problem.period)

    @property
    def rows(self) -> tuple[Real, Real]:
        """Rows (m, 2n) of the penetrations and of their rates."""
        flow, stops = self.problem.flow, list(self.stops)
        return flow.rows[stops], flow.rate_rows[stops]

    @property
    def kicks(self) -> Real:
        """Changes (m, 2n) of the states by impulses that give the gaps the speed 1."""
        kicks = self.problem.flow.force_columns[:, list(self.stops)].T
        return np.asarray(kicks / (self.rows[1] * kicks).sum(1)[:, None])

    def losses(self, speeds: Real) -> Real:
        """1 + e (m,) at speeds (m,)."""
        stops = [self.problem.flow.system.stops[stop] for stop in self.stops]
        return np.array([
            1.0 + stop.restitution_at(speed)
            for stop, speed in zip(stops, speeds.tolist(), strict=True)
            if isinstance(stop, RigidStop)
        ])  # fmt: skip

    def after(self, speeds: Real) -> Real:
        """States (m, 2n) behind impacts of these speeds."""
        return np.asarray(self.states - (self.losses(speeds) * speeds)[:, None] * self.kicks)

    def shoot(self, state: Real, first: float, last: float) -> Segments:
        """Carry a state from phase to phase, past the stops around the touches."""
        phases = np.array([first, last])
        return shoot_past(
            self.problem, self.passages, state[None], phases, self.omega, True, size=self.size
        )

    def rate(self, state: Real, phase: float) -> Real:
        """Derivative (2n,) of the motion by the phase."""
        near, far = (self.shoot(state, phase, phase + x).ends[0] for x in (RATE, 2.0 * RATE))
        return np.asarray((4.0 * near - 3.0 * state - far) / (2.0 * RATE))

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
                log_omega=here.log_omega + float(step[hit.size * (n + 1)]),
            )  # fmt: skip
            amounts = amounts + np.insert(step[hit.size * (n + 1) + 1 :], lead, 0.0)
            if not np.abs(here.states - self.states).max() < self.size:
                break
            if np.abs(moves[:, :n]).max() < SMALL * self.size:
                return here, amounts
        raise ConvergenceError("no orbit was found beside the grazing")

    def _equations(self, hit: Real, amounts: Real, lead: int) -> tuple[Real, Real]:
        """Newton's matrix and what is missing, for z and φ of each touch, ln ω and the amounts."""
        m, n = self.states.shape
        speeds, clearances = np.where(hit, amounts, 0.0), np.where(hit, 0.0, amounts)
        after, losses, kicks = self.after(speeds), self.losses(speeds), self.kicks
        (rows, rates), ends = self.rows, self.ends
        gaps = np.array([self.problem.flow.system.stops[stop].gap for stop in self.stops])
        size = m * (n + 2)
        by_amount = np.zeros((size, m))
        matrix, missing = np.zeros((size, m * (n + 1) + 1)), np.empty(size)
        for i, follows in enumerate([*range(1, m), 0]):
            flight, here, there = slice(i * n, (i + 1) * n), i * (n + 1), follows * (n + 1)
            found = self.shoot(after[i], self.phases[i], ends[i])
            reached, jacobian = found.ends[0], found.jacobians[0]
            missing[flight] = reached - self.states[follows]
            matrix[flight, here : here + n] += jacobian
            matrix[flight, there : there + n] -= np.eye(n)
            matrix[flight, here + n] -= jacobian @ self.rate(after[i], self.phases[i])
            matrix[flight, there + n] += self.rate(reached, ends[i])
            matrix[flight, -1] = self.omega * found.d_omega[0]
            gap, pace = m * n + i, m * (n + 1) + i
            missing[gap] = rows[i] @ self.states[i] - gaps[i] + clearances[i]
            missing[pace] = rates[i] @ self.states[i] - speeds[i]
            matrix[gap, here : here + n], matrix[pace, here : here + n] = rows[i], rates[i]
            if hit[i]:
                by_amount[flight, i] = -losses[i] * (jacobian @ kicks[i])
                by_amount[pace, i] = -1.0
            else:
                by_amount[gap, i] = 1.0
        return np.hstack([matrix, np.delete(by_amount, lead, axis=1)]), missing

    def unknowns(self, speeds: Real) -> Real:
        """Shooting unknowns (N + 1,) of the orbit with impacts of these speeds."""
        problem = self.problem
        full, after = 2.0 * math.pi * problem.period, self.after(speeds)
        nodes = []
        for phase in problem.phases[:-1].tolist():
            past = (phase - self.phases) % full
            i = int(np.argmin(past))
            begin = float(self.phases[i])
            nodes.append(
                self.shoot(after[i], begin, begin + past[i]).ends[0] if past[i] > 0.0 else after[i]
            )
        return np.append(np.ravel(nodes), self.log_omega)
