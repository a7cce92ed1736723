"""The motion at a touch of a rigid stop, by equations that are smooth through grazing.

The unknowns are the state z at the touch, its phase φ and ln ω. Beginning where the impact
has taken (1 + e) v from the speed, the motion over the period, with the stop left out around the
touch, comes back to z, which has the speed v there and the gap open by d. With v > 0 and d = 0 that
is the orbit with the impact, with v = 0 and d > 0 the one without; v = d = 0 is the grazing.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from nldyn.base.arrays import Real
from nldyn.base.errors import ConvergenceError
from nldyn.flow.flow_map import Segments
from nldyn.orbits.conditions import Grazing
from nldyn.orbits.orbit import Orbit
from nldyn.orbits.passage import shoot_past
from nldyn.orbits.shooting import ShootingProblem
from nldyn.system.rigid_stop import RigidStop

STEPS = 8  # most of Newton's method
SMALL = 1e-12  # its last step, relative to the orbit
RATE = 1e-4  # forcing phase in rad over which rates of the state are differences


@dataclass(frozen=True, eq=False)
class Touch:
    """The motion at a touch of a rigid stop.

    Parameters
    ----------
    problem : ShootingProblem
        Of the orbit.
    grazing : Grazing
        Which touch; the stop is left out around it.
    state : (2n,)
        State at the touch, before the impact if there is one.
    phase : float
        Forcing phase.
    log_omega : float
        ln ω.
    size : float
        Largest coordinate of the orbit: where the gap is zero those of the touch may be, too.
    """

    problem: ShootingProblem
    grazing: Grazing
    state: Real
    phase: float
    log_omega: float
    size: float

    @classmethod
    def of(cls, orbit: Orbit, grazing: Grazing) -> Touch:
        """That of an orbit that grazes.

        Raises
        ------
        ConvergenceError
            If the flow map fails.
        """
        problem = orbit.problem
        full, phases = 2.0 * math.pi * problem.period, problem.phases
        phase = (grazing.phase - problem.start) % full + problem.start
        j = min(int(np.searchsorted(phases, phase, side="right")) - 1, problem.segments - 1)
        node, size = problem.nodes(orbit.point)[j], float(np.abs(orbit.point[:-1]).max())
        here = cls(problem, grazing, node, phases[j], orbit.point[-1], size)
        if phase <= phases[j]:
            return here
        return replace(here, state=here.shoot(here.state, phases[j], phase).ends[0], phase=phase)

    @property
    def omega(self) -> float:
        """Excitation frequency in rad/s."""
        return math.exp(self.log_omega)

    @property
    def kick(self) -> Real:
        """Change (2n,) of the state by an impulse that gives the gap the speed 1."""
        flow = self.problem.flow
        kick = flow.force_columns[:, self.grazing.stop]
        return np.asarray(kick / (flow.rate_rows[self.grazing.stop] @ kick))

    def loss(self, speed: float) -> float:
        """1 + e at a speed."""
        stop = self.problem.flow.system.stops[self.grazing.stop]
        assert isinstance(stop, RigidStop)
        return 1.0 + stop.restitution_at(speed)

    def shoot(self, state: Real, first: float, last: float) -> Segments:
        """Carry a state from phase to phase, past the stop around the touch."""
        phases = np.array([first, last])
        return shoot_past(
            self.problem, self.grazing.passage, state[None], phases, self.omega, True,
            size=self.size,
        )  # fmt: skip

    def rate(self, state: Real, phase: float) -> Real:
        """Derivative (2n,) of the motion by the phase."""
        near, far = (self.shoot(state, phase, phase + x).ends[0] for x in (RATE, 2.0 * RATE))
        return np.asarray((4.0 * near - 3.0 * state - far) / (2.0 * RATE))

    def moved(self, speed: float, clearance: float) -> Touch:
        """The same on a neighbouring orbit whose touch has a speed and a clearance.

        Raises
        ------
        ConvergenceError
            If there is none nearby.
        """
        flow, stop = self.problem.flow, self.grazing.stop
        row, rate_row, size = flow.rows[stop], flow.rate_rows[stop], len(self.state)
        gap = flow.system.stops[stop].gap - clearance
        full = 2.0 * math.pi * self.problem.period
        lost = self.loss(speed) * speed * self.kick
        here = self
        for _ in range(STEPS):
            after, end = here.state - lost, here.phase + full
            around = here.shoot(after, here.phase, end)
            reached, jacobian = around.ends[0], around.jacobians[0]
            matrix = np.zeros((size + 2, size + 2))
            matrix[:size, :size] = jacobian - np.eye(size)
            matrix[:size, size] = here.rate(reached, end) - jacobian @ here.rate(after, here.phase)
            matrix[:size, size + 1] = here.omega * around.d_omega[0]
            matrix[size, :size], matrix[size + 1, :size] = row, rate_row
            missing = np.append(
                reached - here.state, [row @ here.state - gap, rate_row @ here.state - speed]
            )
            step = np.linalg.solve(matrix, -missing)
            here = replace(
                here, state=here.state + step[:size], phase=here.phase + float(step[size]),
                log_omega=here.log_omega + float(step[size + 1]),
            )  # fmt: skip
            if not np.abs(here.state - self.state).max() < self.size:
                break
            if np.abs(step[:size]).max() < SMALL * self.size:
                return here
        raise ConvergenceError("no orbit was found beside the grazing")

    def unknowns(self, speed: float) -> Real:
        """Shooting unknowns (N + 1,) of the orbit with this impact."""
        problem = self.problem
        full = 2.0 * math.pi * problem.period
        after = self.state - self.loss(speed) * speed * self.kick
        later = (problem.phases[:-1] - self.phase) % full
        nodes = [
            self.shoot(after, self.phase, self.phase + x).ends[0] if x > 0.0 else after
            for x in later.tolist()
        ]
        return np.append(np.ravel(nodes), self.log_omega)
