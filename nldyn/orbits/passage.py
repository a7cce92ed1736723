"""Motions that a rigid stop lets pass where they graze it, so that grazing is a smooth condition.

A slight impact changes a motion by the root of its depth. Without the stop around that instant the
motion, and the depth of its extreme there, change smoothly through grazing, at which both are one
(Nordmark 1991; di Bernardo, Budd, Champneys and Kowalczyk 2008, *Piecewise-smooth Dynamical
Systems*, ch. 6).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from nldyn.base.arrays import Real
from nldyn.base.errors import ConvergenceError
from nldyn.flow.flow_map import FlowMap, Segments
from nldyn.orbits.shooting import ShootingProblem
from nldyn.system.parameters import Parameter

OUT_OF_REACH = 1e6  # of an orbit's size: gap of a stop that is not met


@dataclass(frozen=True)
class Passage:
    """A stretch in which a rigid stop is not there, again and again.

    Parameters
    ----------
    stop : int
        Which stop.
    phase, half : float
        Forcing phase of its middle and half of its width, in rad.
    every : float
        Forcing phase after which it comes again: that of the orbit's period, or of one of the
        excitation where the orbit grazes in each.
    """

    stop: int
    phase: float
    half: float
    every: float

    @property
    def begin(self) -> float:
        """Forcing phase at which it begins."""
        return self.phase - self.half

    @property
    def end(self) -> float:
        """Forcing phase at which it ends."""
        return self.phase + self.half

    def opened(self, flow: FlowMap, size: float) -> FlowMap:
        """The flow map without the stop, for states of a size."""
        stops = list(flow.system.stops)
        reach = size * max(float(np.linalg.norm(flow.rows[self.stop])), 1.0)
        gap = OUT_OF_REACH * (stops[self.stop].gap + reach)
        stops[self.stop] = replace(stops[self.stop], gap=gap)
        return FlowMap(flow.system.with_elements(stops=tuple(stops)), flow.options)

    def cuts(self, first: float, last: float) -> tuple[list[float], list[bool]]:
        """Phases (k + 1,) that cut a segment where the passage begins and ends, and its pieces.

        Each piece (k,) lies within it or not.
        """
        ends = {first, last}
        earliest = math.floor((first - self.end) / self.every)
        latest = math.ceil((last - self.begin) / self.every)
        for turn in range(earliest, latest + 1):
            both = (self.begin + turn * self.every, self.end + turn * self.every)
            ends.update(phase for phase in both if first < phase < last)
        phases = sorted(ends)
        middles = [0.5 * (a + b) for a, b in pairwise(phases)]
        return phases, [self.holds(middle) for middle in middles]

    def holds(self, phase: float) -> bool:
        """Whether a phase lies within."""
        every = self.every
        return abs((phase - self.phase + 0.5 * every) % every - 0.5 * every) < self.half


def shoot_past(
    problem: ShootingProblem,
    passage: Passage | None,
    nodes: Real,
    phases: Real,
    omega: float,
    sensitivities: bool,
    parameters: Sequence[Parameter] = (),
    size: float = 0.0,
) -> Segments:
    """What `FlowMap.shoot` gives for states (k, 2n) at phases (k + 1,), past a stop if there is a
    passage.

    The stop left out is out of reach of states of their size, or of `size` if that is larger.

    Raises
    ------
    ConvergenceError
        If the flow map fails.
    """
    flow = problem.flow
    if passage is None:
        return _shot(flow, nodes, phases, omega, sensitivities, parameters)
    open_flow = passage.opened(flow, max(size, float(np.abs(nodes).max())))
    found = []
    for node, first, last in zip(nodes, phases[:-1].tolist(), phases[1:].tolist(), strict=True):
        cuts, within = passage.cuts(first, last)
        found.append(
            _chained(open_flow, flow, cuts, within, node, omega, sensitivities, parameters)
        )
    return Segments(
        np.concatenate([segment.ends for segment in found]),
        np.concatenate([segment.jacobians for segment in found]),
        np.concatenate([segment.d_omega for segment in found]),
        np.concatenate([segment.d_parameters for segment in found]),
        np.sum([segment.closings for segment in found], axis=0),
        "",
    )


def _shot(
    flow: FlowMap,
    nodes: Real,
    phases: Real,
    omega: float,
    sensitivities: bool,
    parameters: Sequence[Parameter],
) -> Segments:
    """What `FlowMap.shoot` gives, unless it fails."""
    found = flow.shoot(nodes, phases, omega, sensitivities=sensitivities, parameters=parameters)
    if found.failure:
        raise ConvergenceError(found.failure)
    return found


def _chained(
    open_flow: FlowMap,
    flow: FlowMap,
    phases: Sequence[float],
    within: Sequence[bool],
    node: Real,
    omega: float,
    sensitivities: bool,
    parameters: Sequence[Parameter],
) -> Segments:
    """One segment, piece by piece."""
    whole: Segments | None = None
    for first, last, inside in zip(phases[:-1], phases[1:], within, strict=True):
        across, phases_here = open_flow if inside else flow, np.array([first, last])
        piece = _shot(across, node[None], phases_here, omega, sensitivities, parameters)
        node = piece.ends[0]
        if whole is None:
            whole = piece
            continue
        jacobian = piece.jacobians[0]
        whole = Segments(
            piece.ends,
            (jacobian @ whole.jacobians[0])[None],
            piece.d_omega + whole.d_omega @ jacobian.T,
            piece.d_parameters + (jacobian @ whole.d_parameters[0])[None],
            whole.closings + piece.closings,
            "",
        )
    assert whole is not None
    return whole


def peak_past(
    problem: ShootingProblem, passage: Passage, nodes: Real, omega: float
) -> tuple[float, float]:
    """Phase and penetration of the maximum nearest to the middle of a passage, past its stop.

    Raises
    ------
    ConvergenceError
        If there is none, or the flow map fails.
    """
    flow, phases = problem.flow, problem.phases
    full = 2.0 * math.pi * problem.period
    begin = (passage.begin - problem.start) % full + problem.start
    j = min(int(np.searchsorted(phases, begin, side="right")) - 1, problem.segments - 1)
    state = nodes[j]
    if begin > phases[j]:
        state = _shot(flow, state[None], np.array([phases[j], begin]), omega, False, ()).ends[0]
    open_flow = passage.opened(flow, float(np.abs(nodes).max()))
    motion = open_flow.trajectory(state[None], np.array([begin, begin + 2.0 * passage.half]), omega)
    if motion.failure:
        raise ConvergenceError(motion.failure)
    peaks = motion.extremes(passage.stop)
    peaks = peaks[peaks[:, 2] > 0.0]
    if not len(peaks):
        raise ConvergenceError("an extreme has vanished")
    apart = np.abs(peaks[:, 0] - begin - passage.half)
    phase, value, _ = peaks[int(np.argmin(apart))].tolist()
    return phase % full, value - flow.system.stops[passage.stop].gap
