"""Phase resonance: forced motions whose displacement lags the force by a quarter of a turn.

There the force does all its work against the damping, and a lightly damped motion is nearly a free
one: the curve begins at an orbit of a backbone.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from nldyn.base.arrays import Real
from nldyn.base.errors import ConvergenceError, SystemModelError, check_types, check_whole
from nldyn.branches.step_control import ContinuationOptions
from nldyn.curves.curves import Curve, CurveFile, continue_constant
from nldyn.flow.flow_map import FlowMap, flow_of
from nldyn.orbits.bordered import OrbitFamily, correct
from nldyn.orbits.conditions import MONITORS, Held, driving_source
from nldyn.orbits.orbit import Orbit, check_observe
from nldyn.orbits.shooting import shooting_problem
from nldyn.system.chart import FREQUENCY, Chart
from nldyn.system.parameters import Parameter, strength_name
from nldyn.system.system import System, same_system

SAMPLES = 512  # of a free motion, as a guess
LAG, QUARTER = "phase_lag_deg", 90.0


def phase_resonance(
    system: System | FlowMap,
    start: Orbit,
    amplitudes: tuple[float, float],
    range_hz: tuple[float, float],
    *,
    options: ContinuationOptions | None = None,
    progress: Callable[[Real], None] | None = None,
    checkpoint: CurveFile | None = None,
) -> Curve:
    """Follow the phase resonance over the strength of the force.

    The fundamental of the observed displacement lags the excitation by 90 degrees.

    Parameters
    ----------
    system : System or FlowMap
        Damped, with one source that swings, of harmonic 1.
    start : Orbit
        A free motion of the same structure without damping, as those of a `Backbone`; or a forced
        orbit of the system itself, from which the resonance is looked for over the frequency.
    amplitudes : (float, float)
        Strengths of the source between which to stay, in the unit of its kind.
    range_hz : (float, float)
        Frequencies between which to stay.
    options, progress, checkpoint
        As for `continue_constant`.

    Returns
    -------
    Curve
        Its values are the frequency and the strength; its marks are LP, PD, NS and GR.

    Raises
    ------
    SystemModelError
        For a system that nothing damps, that has no such source or several, a start of another
        structure, and ranges that do not hold the start.
    ConvergenceError
        If no forced orbit is found beside the free one.

    References
    ----------
    M. Peeters, G. Kerschen, J. C. Golinval (2011), *J. Sound Vib.* 330, 486-509.

    Examples
    --------
    >>> import numpy as np
    >>> from nldyn import HarmonicForce, System, backbone
    >>> free = System.from_matrices([[1.0]], [[1.0]], {"x": [1.0]})
    >>> forced = System.from_matrices([[1.0]], [[1.0]], {"x": [1.0]}, damping=[[0.01]],
    ...     excitation=[HarmonicForce("x", 0.01)])
    >>> first = backbone(free, amplitude_m=(0.9, 1.0)).orbits[0]
    >>> curve = phase_resonance(forced, first, (0.005, 0.02), (0.1, 0.2))
    >>> bool(np.allclose(curve.values[:, 0], 1.0 / (2.0 * np.pi), rtol=1e-8))
    True
    """
    flow = flow_of(system)
    check_types(start=(start, Orbit))
    source, index = driving_source(flow.system)
    if source.harmonic != 1:
        raise SystemModelError("phase resonance needs a source of harmonic 1")
    if flow.system.rigid_stops:
        raise SystemModelError(
            "phase resonance is not followed against rigid stops: give one a high stiffness"
        )
    strength = Parameter(strength_name(source), index)
    if not same_system(start.system, flow.system):
        charts = Chart.of(Parameter(FREQUENCY), range_hz), Chart.of(strength, amplitudes)
        start = _forced(flow, start, charts)
    parameters: Any = (Parameter(FREQUENCY), strength)
    return continue_constant(
        start, LAG, parameters, (range_hz, amplitudes), value=QUARTER,
        options=options, progress=progress, checkpoint=checkpoint,
    )  # fmt: skip


def _forced(flow: FlowMap, free: Orbit, charts: tuple[Chart, Chart]) -> Orbit:
    """The forced orbit in phase resonance beside a free motion, of about its size."""
    system = flow.system
    if system.size != free.system.size or system.interfaces != free.system.interfaces:
        raise SystemModelError("the free motion is one of another structure")
    check_whole("start: period", free.period, 1, 1)
    observe = check_observe(system, free.observe)
    source, index = driving_source(system)
    line = _fundamental(free, system.participation[observe])
    shift = float(np.angle(source.phasor) - np.angle(line)) - math.radians(QUARTER)
    problem = shooting_problem(flow, 1)
    nodes = np.array([flow.to_state(z) for z in free.states(problem.phases[:-1] + shift)])
    name = charts[1].parameter.name
    value = strength_of(system, free)
    sources = list(system.excitation)
    changed: dict[str, Any] = {name: value}
    sources[index] = replace(source, **changed)
    forced = FlowMap(system.with_elements(excitation=tuple(sources)), flow.options)
    family = OrbitFamily(replace(problem, flow=forced), observe, free.frequency_hz, charts)
    held = [charts[0].coordinate(free.frequency_hz), charts[1].coordinate(value)]
    guess = np.append(nodes.ravel(), held)
    row = family.metric(guess) * guess
    row[family.n_states :] = 0.0
    row /= np.linalg.norm(row)
    quadrature = Held(LAG, MONITORS[LAG], QUARTER)
    found = correct(family, guess, quadrature, row, float(row @ guess))
    if not found.converged:
        raise ConvergenceError(
            f"no forced motion in phase resonance was found beside the free one at "
            f"{free.frequency_hz:g} Hz: {found.failure}; begin at a smaller one"
        )
    return found.orbit


def strength_of(system: System, free: Orbit) -> float:
    """Strength of the source that does the work which the damping takes from a free motion.

    Raises
    ------
    SystemModelError
        If the system has no damping, or the source does not act on what moves.
    """
    source, _ = driving_source(system)
    v = _sampled(free)[:, system.size :]
    taken = float(np.einsum("ti,ij,tj->", v, system.total_damping, v)) / SAMPLES
    if not taken > 0.0:
        raise SystemModelError(
            "phase resonance needs a system with damping, as that of its modes: without it no "
            "force belongs to a free motion"
        )
    reached = abs(_fundamental(free, system.load_vector(source.at)))
    if not reached > 0.0:
        raise SystemModelError(f"the free motion does not move '{source.at}', where the force acts")
    force = 2.0 * taken / (free.omega * reached)
    unit: dict[str, Any] = {strength_name(source): 1.0}
    return force / (abs(replace(source, **unit).phasor) * free.omega**source.power)


def _sampled(free: Orbit) -> Real:
    """Modal states (SAMPLES, 2n) over a period of a free motion, good enough for a guess."""
    phases = 2.0 * np.pi * np.arange(SAMPLES) / SAMPLES
    return free.problem.flow.to_modal(free.trajectory.recorded_states(phases))


def _fundamental(free: Orbit, row: Real) -> complex:
    """Complex amplitude of the fundamental of a displacement ``row @ q``."""
    turns = np.exp(-2j * np.pi * np.arange(SAMPLES) / SAMPLES)
    return complex(2.0 / SAMPLES * turns @ _sampled(free)[:, : row.size] @ row)
