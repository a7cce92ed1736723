"""Motions that a rigid stop lets pass where they graze it, so that grazing is a smooth condition.

A slight impact changes a motion by the root of its depth. Without the stop around that instant the
motion, and the depth of its extreme there, change smoothly through grazing, at which both are one
(Nordmark 1991; di Bernardo, Budd, Champneys and Kowalczyk 2008, *Piecewise-smooth Dynamical
Systems*, ch. 6).
"""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass
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

    def cuts(self, first: float, last: float) -> list[float]:
        """Phases within a segment at which the passage begins or ends."""
        earliest = math.floor((first - self.end) / self.every)
        latest = math.ceil((last - self.begin) / self.every)
        turns = self.every * np.arange(earliest, latest + 1)
        ends = np.concatenate([self.begin + turns, self.end + turns])
        return [float(end) for end in ends[(first < ends) & (ends < last)]]

    def holds(self, phase: float) -> bool:
        """Whether a phase lies within."""
        return self._apart(phase) < self.half

    def overlaps(self, other: Passage) -> bool:
        """Whether they have phases in common."""
        return self._apart(other.phase) < self.half + other.half

    def _apart(self, phase: float) -> float:
        every = self.every
        return abs((phase - self.phase + 0.5 * every) % every - 0.5 * every)


def opened(flow: FlowMap, left_out: Collection[int], size: float) -> FlowMap:
    """The flow map without some stops, for states of a size."""
    if not left_out:
        return flow
    stops = list(flow.system.stops)
    for stop in left_out:
        reach = size * max(float(np.linalg.norm(flow.rows[stop])), 1.0)
        left = flow.system.rigid_stops[stop]
        stops[stop] = left.out_of_reach(OUT_OF_REACH * (abs(left.gap) + reach))
    return FlowMap(flow.system.with_elements(stops=tuple(stops)), flow.options)


def shoot_past(
    problem: ShootingProblem,
    passages: Sequence[Passage],
    nodes: Real,
    phases: Real,
    omega: float,
    sensitivities: bool,
    parameters: Sequence[Parameter] = (),
    size: float = 0.0,
) -> Segments:
    """What `FlowMap.shoot` gives for states (k, 2n) at phases (k + 1,), past stops in passages.

    A stop left out is out of reach of states of their size, or of `size` if that is larger.

    Raises
    ------
    ConvergenceError
        If the flow map fails.
    """
    flow = problem.flow
    if not passages:
        return _shot(flow, nodes, phases, omega, sensitivities, parameters)
    size = max(size, float(np.abs(nodes).max()))
    flows: dict[frozenset[int], FlowMap] = {}
    found = []
    for node, first, last in zip(nodes, phases[:-1].tolist(), phases[1:].tolist(), strict=True):
        cuts = sorted({first, last, *(x for each in passages for x in each.cuts(first, last))})
        pieces = []
        for begin, end in pairwise(cuts):
            middle = 0.5 * (begin + end)
            left_out = frozenset(each.stop for each in passages if each.holds(middle))
            if left_out not in flows:
                flows[left_out] = opened(flow, left_out, size)
            pieces.append((flows[left_out], np.array([begin, end])))
        found.append(_chained(pieces, node, omega, sensitivities, parameters))
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
    pieces: Sequence[tuple[FlowMap, Real]],
    node: Real,
    omega: float,
    sensitivities: bool,
    parameters: Sequence[Parameter],
) -> Segments:
    """One segment, by the flow maps of its pieces."""
    whole: Segments | None = None
    for flow, phases in pieces:
        piece = _shot(flow, node[None], phases, omega, sensitivities, parameters)
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
    problem: ShootingProblem, passages: Sequence[Passage], nodes: Real, omega: float, which: int = 0
) -> tuple[float, float]:
    """Phase and penetration of the maximum nearest to the middle of a passage, past the stops.

    Raises
    ------
    ConvergenceError
        If there is none, or the flow map fails.
    """
    flow, phases, passage = problem.flow, problem.phases, passages[which]
    full = 2.0 * math.pi * problem.period
    begin = (passage.begin - problem.start) % full + problem.start
    j = min(int(np.searchsorted(phases, begin, side="right")) - 1, problem.segments - 1)
    state, size = nodes[j], float(np.abs(nodes).max())
    if begin > phases[j]:
        carried = np.array([phases[j], begin])
        state = shoot_past(problem, passages, state[None], carried, omega, False, size=size).ends[0]
    beside = {each.stop for each in passages if each.overlaps(passage)}
    motion = opened(flow, beside, size).trajectory(
        state[None], np.array([begin, begin + 2.0 * passage.half]), omega
    )
    if motion.failure:
        raise ConvergenceError(motion.failure)
    peaks = motion.extremes(passage.stop)
    peaks = peaks[peaks[:, 2] > 0.0]
    if not len(peaks):
        raise ConvergenceError("an extreme has vanished")
    apart = np.abs(peaks[:, 0] - begin - passage.half)
    phase, value, _ = peaks[int(np.argmin(apart))].tolist()
    return phase % full, value - flow.system.stops[passage.stop].gap
