"""Backbones: the periodic free motions of a system that nothing damps, from a linear mode on.

The orbits of a conservative system come in families over the energy; each has its own frequency.
So the frequency is an unknown, a condition fixes the phase, and an unfolding number stands for what
would feed the motion: it is zero where an orbit closes (Muñoz-Almaraz et al. 2003). That is a curve
as those in two parameters are.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from nldyn.base.arrays import Real
from nldyn.base.errors import (
    ConvergenceError,
    LocateError,
    SystemModelError,
    check_positive,
    check_types,
    check_whole,
    is_finite,
)
from nldyn.base.optional import optional
from nldyn.bifurcations.chord import Chord
from nldyn.bifurcations.point import BranchNode, node_of
from nldyn.bifurcations.roots import root
from nldyn.branches.branch import Course, WalkEnd
from nldyn.branches.continuation import alike, make_branch
from nldyn.branches.endings import Ending, StopReason
from nldyn.branches.leg import Leg, LegBuilder
from nldyn.branches.step_control import ContinuationOptions
from nldyn.curves.curves import Curve
from nldyn.flow.flow_map import FlowMap, flow_of
from nldyn.orbits.bordered import OrbitFamily, correct
from nldyn.orbits.conditions import Phase
from nldyn.orbits.newton import spread
from nldyn.orbits.orbit import Orbit, check_observe
from nldyn.orbits.shooting import ShootingProblem, shooting_problem
from nldyn.system.chart import FREQUENCY, Chart
from nldyn.system.equilibrium import (
    at_rest,
    constant_force,
    potential_at,
    rest,
    tangent_stiffness,
)
from nldyn.system.parameters import Parameter
from nldyn.system.system import System

if TYPE_CHECKING:
    import pandas

KIND = "free motion"
# lengths relative to the size of the orbit; the number of contacts may change at any
STEPS = ContinuationOptions(
    first_step=0.05, max_step=0.3, min_step=1e-6, max_angle=0.3, grazing_step=0.3
)
EARLY = 0.1  # rad behind a turn, of which half a turn is a period of the linear mode
WIDEST = 1e3  # of the range of frequencies on either side of the linear one
SURELY = 1e-6  # beyond the unit circle, from which an orbit counts as unstable
SAME = 1e-9  # relative difference of squared frequencies that is rounding of the modes
UNSEEN = 1e-12  # share of a mode at an interface that is rounding


@dataclass(frozen=True, eq=False)
class Backbone:
    """A family of free periodic motions, in the order in which it was followed.

    Parameters
    ----------
    curve : Curve
        The orbits; their excitation frequency is that of the free motion.
    mode : int
        Linear mode at which the family begins, counted from 1.

    Examples
    --------
    >>> from nldyn import PolynomialSpring, System
    >>> duffing = System.from_matrices([[1.0]], [[1.0]], {"x": [1.0]},
    ...     springs=[PolynomialSpring("x", [0.0, 0.0, 1.0])])
    >>> found = backbone(duffing, amplitude_m=(0.01, 1.0))
    >>> found.orbits[-1].frequency_hz > found.orbits[0].frequency_hz
    True
    """

    curve: Curve
    mode: int

    @property
    def orbits(self) -> list[Orbit]:
        """The orbits, in order."""
        return self.curve.orbits

    @property
    def reason(self) -> StopReason:
        """Why it ends."""
        return self.curve.stop_reasons[1]

    @cached_property
    def rest_m(self) -> float:
        """Displacement at rest of the observed interface in m."""
        return _rest_m(self.orbits[0].system, self.orbits[0].observe)

    @cached_property
    def energy(self) -> Real:
        """Energy of each orbit in J, above that of rest, (k,)."""
        system = self.orbits[0].system
        push, place = constant_force(system), rest(system)
        least = potential_at(system, push, place)

        def above(orbit: Orbit) -> float:
            flow = orbit.problem.flow
            q, v = np.split(flow.to_modal(orbit.problem.nodes(orbit.point)[0]), 2)
            return potential_at(system, push, q) - least + 0.5 * float(v @ v)

        return np.array([above(orbit) for orbit in self.orbits])

    def __repr__(self) -> str:
        """One line: mode, range of frequencies and amplitudes, and why it ends."""
        hz, size = self.frequency_hz, self.amplitude
        return (
            f"<Backbone of mode {self.mode}: {len(self.orbits)} orbits from {hz[0]:.6g} to "
            f"{hz[-1]:.6g} Hz, {size[0]:.4g} to {size[-1]:.4g} m at '{self.orbits[0].observe}'; "
            f"{self.reason}>"
        )

    @cached_property
    def frequency_hz(self) -> Real:
        """Frequencies in Hz, (k,)."""
        return np.array([orbit.frequency_hz for orbit in self.orbits])

    @cached_property
    def amplitude(self) -> Real:
        """Largest displacements from rest in m at the observed interface, (k,)."""
        return np.array([farthest_from(self.rest_m, orbit) for orbit in self.orbits])

    @cached_property
    def stable(self) -> np.ndarray:
        """Whether no multiplier of an orbit lies outside the unit circle, (k,).

        Two multipliers are 1 in theory, one along the motion and one along the family; rounding
        parts them by up to the root of the flow map's error, which is allowed.
        """
        return np.array([_stable(orbit) for orbit in self.orbits])

    def extend(self, largest_m: float, *, max_orbits: int | None = None) -> Backbone:
        """Follow the family to larger amplitudes, also one that was loaded.

        Its orbits are those of one `backbone` up to there, to the last digit; the one at the end of
        before is left out. A backbone of a file of an earlier version is followed anew.

        Parameters
        ----------
        largest_m : float
            Largest displacement from rest in m at the observed interface.
        max_orbits : int, optional
            Most orbits; as many as before unless given.

        Returns
        -------
        Backbone

        Raises
        ------
        SystemModelError
            For an amplitude that is no larger than that of the last orbit.

        Examples
        --------
        >>> from nldyn import PolynomialSpring, System
        >>> duffing = System.from_matrices([[1.0]], [[1.0]], {"x": [1.0]},
        ...     springs=[PolynomialSpring("x", [0.0, 0.0, 1.0])])
        >>> longer = backbone(duffing, amplitude_m=(0.01, 0.5)).extend(1.0)
        >>> whole = backbone(duffing, amplitude_m=(0.01, 1.0))
        >>> longer.frequency_hz.tolist() == whole.frequency_hz.tolist()
        True
        """
        reached, nodes = float(self.amplitude[-1]), list(self.curve.points)
        check_positive("largest_m", largest_m)
        if largest_m <= reached:
            raise SystemModelError(
                f"largest_m: the backbone reaches {reached:.6g} m already, got {largest_m:g}"
            )
        course = self.curve.branch.course or _course(nodes[0].family, STEPS.max_points)
        if max_orbits is not None:
            check_whole("max_orbits", max_orbits, 2)
            options = replace(course.options, max_points=max_orbits - 1)
            course = replace(course, options=options)
        begins = self.curve.stop_reasons[0]
        leg = Leg(nodes, [], [], self.reason, course.ends[1])
        return _followed(leg, course, self.mode, largest_m, begins)

    def to_pandas(self) -> pandas.DataFrame:
        """Frequency, energy, amplitude, impacts, stability and error of each orbit."""
        return optional("pandas", "to_pandas").DataFrame(
            {
                "frequency_hz": self.frequency_hz,
                "energy_j": self.energy,
                "amplitude_m": self.amplitude,
                "impacts": [orbit.impacts for orbit in self.orbits],
                "stable": self.stable,
                "error": [orbit.error for orbit in self.orbits],
            }
        )


def farthest_from(place_m: float, orbit: Orbit) -> float:
    """Largest distance in m of the observed displacement from a place."""
    return float(np.abs(orbit.observed_extremes.values - place_m).max(initial=0.0))


def _stable(orbit: Orbit) -> bool:
    sizes = np.abs(orbit.multipliers)
    allowed = max(SURELY, 10.0 * math.sqrt(orbit.problem.flow.options.rtol))
    return bool(sizes.max() < 1.0 + allowed)


def backbone(
    system: System | FlowMap,
    mode: int = 1,
    *,
    amplitude_m: tuple[float, float],
    observe: str | None = None,
    max_orbits: int = 500,
) -> Backbone:
    """Follow the free motions of an undamped system from a linear mode on.

    Parameters
    ----------
    system : System or FlowMap
        Without damping and without excitation, but for constant forces.
    mode : int
        Mode of the small vibrations about the rest position, counted from 1.
    amplitude_m : (float, float)
        Smallest and largest displacement from rest in m at the observed interface: where the family
        begins and ends.
    observe : str, optional
        Interface; the first unless given.
    max_orbits : int
        Most orbits.

    Returns
    -------
    Backbone

    Raises
    ------
    SystemModelError
        For a system that is damped, loses energy at its stops, is excited or has no such mode, and
        for input that makes no sense.
    ConvergenceError
        If no orbit of the smallest amplitude is found.

    References
    ----------
    G. Kerschen, M. Peeters, J. C. Golinval, A. F. Vakakis (2009), *Mech. Syst. Signal Process.* 23,
    170-194; F. J. Muñoz-Almaraz et al. (2003), *Physica D* 181, 1-38.

    Examples
    --------
    >>> import numpy as np
    >>> from nldyn import Stop, System
    >>> bilinear = System.from_matrices([[1.0]], [[1.0]], {"x": [1.0]},
    ...     stops=[Stop.linear("x", 3.0)])
    >>> found = backbone(bilinear, amplitude_m=(0.01, 0.1))
    >>> exact = 2.0 / (1.0 + 0.5) / (2.0 * np.pi)  # half at 1 rad/s, half at 2 rad/s
    >>> bool(np.allclose(found.frequency_hz, exact, rtol=1e-9))
    True
    """
    flow = flow_of(system)
    name = check_observe(flow.system, observe)
    check_whole("mode", mode, 1, flow.system.size)
    check_whole("max_orbits", max_orbits, 2)
    low, high = _checked_range(amplitude_m)
    _check_conservative(flow.system)
    start = _begin(flow, name, mode, low)
    course = _course(start.family, max_orbits - 1)
    begins = Ending.BEGINS_AT.told(place=f"{low:g} m")
    return _followed(Leg([start], [], [], begins, None), course, mode, high, begins)


def _course(family: OrbitFamily, max_points: int) -> Course:
    """That of a backbone, at any frequency."""
    chart, options = family.charts[0], replace(STEPS, max_points=max_points)
    return Course((chart.low, chart.high), options, alike(family, []))


def _followed(leg: Leg, course: Course, mode: int, high: float, begins: StopReason) -> Backbone:
    """A backbone followed on up to an amplitude from rest."""
    trail = LegBuilder.going_on(leg, course)
    walk, nodes = trail.walk, list(trail.nodes)
    stride, kept = walk.stride, len(nodes) - 1
    rest_m = _rest_m(leg.nodes[0].family.system, leg.nodes[0].orbit.observe)

    def off(node: BranchNode) -> float:
        return farthest_from(rest_m, node.orbit) / high - 1.0

    reason = None
    for node in walk:
        if nodes and off(node) > 0.0:
            nodes.append(_where(off, Chord(nodes[-1], node)))
            reason = Ending.AMPLITUDE_RANGE_END.told()
            break
        nodes.append(node)
        if walk.stride is not None and walk.stride.here is node:
            stride, kept = walk.stride, len(nodes) - 1
    assert stride is not None
    end = WalkEnd(stride.step, stride.behind, stride.count, kept, kept, 0, 0)
    branch = make_branch("", nodes, [], (begins, reason or walk.stop_reason), [])
    branch = replace(branch, course=replace(course, ends=(None, end)))
    return Backbone(Curve(KIND, branch), mode)


def _where(off: Callable[[BranchNode], float], chord: Chord) -> BranchNode:
    """The point of a chord at which something is zero, its end if none is found."""
    try:
        return chord.at(root(lambda sigma: off(chord.at(sigma)))[0])
    except LocateError:
        return chord.last


def _checked_range(amplitude_m: object) -> tuple[float, float]:
    check_types(amplitude_m=(amplitude_m, (tuple, list)))
    values: Any = amplitude_m
    if len(values) != 2 or not all(map(is_finite, values)) or not 0.0 < values[0] < values[1]:
        raise SystemModelError(
            f"amplitude_m must be two ascending positive numbers, got {amplitude_m}"
        )
    return float(values[0]), float(values[1])


def _check_conservative(system: System) -> None:
    if not system.conservative:
        raise SystemModelError(
            "a backbone needs a system that nothing damps: leave out modal_damping, dampers, and "
            "what stops and springs take by their speed"
        )
    if np.any(system.total_damping):
        raise SystemModelError("backbones are not followed with gyroscopic matrices")
    if system.rigid_stops:
        raise SystemModelError(
            "backbones are not followed against rigid stops: give the stop a high stiffness"
        )
    if system.driven:
        raise SystemModelError(
            "a backbone is that of free motions: leave out all excitation but constant forces"
        )


def _begin(flow: FlowMap, observe: str, mode: int, amplitude: float) -> BranchNode:
    """The orbit of a small amplitude near a linear mode, heading to larger ones."""
    system, problem = flow.system, shooting_problem(flow, 1)
    place = rest(system)
    squares, shapes = np.linalg.eigh(tangent_stiffness(system, place))
    if not squares[mode - 1] > 0.0:
        raise SystemModelError(
            f"mode {mode} does not vibrate about the rest position: it is free or unstable"
        )
    shape = shapes[:, mode - 1]
    seen = float(shape @ system.participation[observe])
    if abs(seen) <= UNSEEN * np.linalg.norm(system.participation[observe]):
        raise SystemModelError(
            f"mode {mode} does not move interface '{observe}': observe another one"
        )
    begin = flow.to_state(np.append(place + amplitude / seen * shape, np.zeros(system.size)))
    omega = _returning(problem, begin, math.sqrt(squares[mode - 1]), observe)
    states = spread(problem, begin, omega).ravel()
    origin = np.tile(flow.to_state(at_rest(place)), problem.segments)
    hz = omega / (2.0 * math.pi)
    chart = Chart(Parameter(FREQUENCY), hz / WIDEST, hz * WIDEST)
    family = OrbitFamily(problem, observe, hz, (chart,), states - origin, origin=origin)
    guess = np.concatenate([states, [math.log(omega), 0.0]])
    outward = np.concatenate([states - origin, [0.0, 0.0]])
    row = outward / np.linalg.norm(outward)
    phase = Phase.of(family.at(guess))
    found = correct(family, guess, phase, row)
    if not found.converged:
        alike = np.flatnonzero(np.isclose(squares, squares[mode - 1], rtol=SAME, atol=0.0)) + 1
        shared = [f"mode {other}" for other in alike if other != mode]
        raise ConvergenceError(
            f"no free motion of {amplitude:g} m at '{observe}' was found near mode {mode}"
            + (f", whose frequency is that of {' and '.join(shared)}, too" if shared else "")
            + f": {found.failure}; begin with another amplitude"
        )
    return node_of(found, outward, 0.0)


def _returning(problem: ShootingProblem, begin: Real, omega: float, observe: str) -> float:
    """Rate at which a motion from a turn comes back to one, about that of its linear mode."""
    slow = 0.5 * omega
    nodes = spread(problem, begin, slow)
    unknown = np.zeros((len(nodes), begin.size, begin.size))
    point = np.append(nodes.ravel(), math.log(slow))
    tops = Orbit(problem, point, unknown, math.inf, observe).observed_extremes
    later = tops.phases[tops.is_maximum & (tops.phases > EARLY)]
    return slow * 2.0 * math.pi / float(later.min(initial=math.pi))


def _rest_m(system: System, observe: str) -> float:
    return float(rest(system) @ system.participation[observe])
