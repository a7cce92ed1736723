"""Which orbits a page shows, and what of each."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from fem.render.viewer import packed
from nldyn.base.arrays import Real
from nldyn.base.errors import ConvergenceError
from nldyn.bifurcations.kinds import title_of
from nldyn.branches.branch import Branch
from nldyn.longterm.impacts import units_where
from nldyn.orbits.axis import Axis
from nldyn.orbits.harmonics import harmonics
from nldyn.orbits.orbit import Orbit
from nldyn.plot.diagram import beside_stable, orbit_title, stop_places
from nldyn.plot.orbit import FLOOR, drawn_phases, motion_at
from nldyn.plot.words import Along
from nldyn.system.naming import slider_name, stop_name

MOST_POINTS = 120  # that can be looked at, beside the special points
MOST_SPECIAL = 600
STEPS = 300  # equal steps of a time history in each period of the excitation
SAMPLES = (300, 1500)  # of a time history, at least and at most
ALL_SAMPLES = 180_000  # of the time histories of a page, about
OF_SLIDERS = {
    "largest friction": "N",
    "distance": "m",
    "stuck": "share",
    "slid": "share",
    "open": "share",
    "loss": "J",
    "pressed distance": "N m",
}
SHOWN_INSTANTS = 36  # of a period, at which the structure is shown deflected


@dataclass(frozen=True, eq=False)
class ChosenOrbit:
    """An orbit of a diagram to be shown.

    Parameters
    ----------
    branch : int
        Number of its branch.
    place : float
        Number of the point of the branch; between two points for a special point.
    name : str
        What it is: ``point 12``, or the kind of special point.
    orbit : Orbit
        The orbit.
    special : int
        Number of the special point among those of the branch; -1 for a point.
    """

    branch: int
    place: float
    name: str
    orbit: Orbit
    special: int = -1


def chosen_orbits(
    branches: Sequence[Branch], heights: Sequence[Sequence[float]], most: int = MOST_POINTS
) -> list[ChosenOrbit]:
    """Choose orbits to show: at special points, at the highest points, and evenly spaced ones.

    Parameters
    ----------
    branches : sequence of Branch
        With their special points.
    heights : sequence of sequence of float
        The largest displacements of the points of each branch.
    most : int
        About how many points beside the special ones; every branch has at least its highest point
        and its highest stable one, whatever this is.

    Returns
    -------
    list of ChosenOrbit
        In order along the branches. All special points, or where there are more than
        `MOST_SPECIAL` those beside a stable orbit and evenly spaced ones of the others.

    Examples
    --------
    >>> from nldyn import System, Unbalance, continue_branch, solve_orbit
    >>> system = System.from_modal([13.1], {"middle": [0.635]}, modal_damping=0.0142,
    ...     excitation=[Unbalance("middle", 4.92e-6)])
    >>> branch = continue_branch(solve_orbit(system, frequency_hz=10.0), (9.0, 12.0))
    >>> found = chosen_orbits([branch], [branch.max_abs_displacement], most=5)
    >>> found[0].name, found[-1].place == len(branch.points) - 1
    ('point 0', True)
    """
    kept: list[ChosenOrbit] = []
    others: list[ChosenOrbit] = []
    for number, branch in enumerate(branches):
        for index, special in enumerate(branch.special_points):
            into = kept if beside_stable(branch, special) else others
            into.append(_at_special(branch, number, index))
    kept = [kept[i] for i in even(len(kept), MOST_SPECIAL)]
    kept += [others[i] for i in even(len(others), MOST_SPECIAL - len(kept))]
    share = most / max(sum(len(branch.points) for branch in branches), 1)
    points = [
        ChosenOrbit(number, float(i), f"point {i}", branch.points[i])
        for number, (branch, y) in enumerate(zip(branches, heights, strict=True))
        for i in sorted({*_highest(branch, y), *even(len(y), int(share * len(y)))})
    ]
    return sorted([*kept, *points], key=lambda chosen: (chosen.branch, chosen.place))


def _highest(branch: Branch, heights: Sequence[float]) -> set[int]:
    """Numbers of the highest point, and of the highest stable one if there is any."""
    highest = int(np.argmax(heights))
    stable = np.flatnonzero(branch.stable)
    return {
        highest,
        *([int(stable[np.argmax(np.asarray(heights)[stable])])] if stable.size else []),
    }


def even(count: int, most: int) -> list[int]:
    """At most so many of ``range(count)``, evenly spaced, the first and the last among them.

    Examples
    --------
    >>> even(9, 3), even(2, 5), even(9, 0)
    ([0, 4, 8], [0, 1], [])
    """
    number = max(0, min(count, most))
    return sorted(set(np.linspace(0, count - 1, number).round().astype(int).tolist()))


def _at_special(branch: Branch, number: int, index: int) -> ChosenOrbit:
    special = branch.special_points[index]
    lengths = [node.arclength for node in branch.nodes]
    after = int(np.searchsorted(lengths, special.point.arclength))
    return ChosenOrbit(number, after - 0.5, title_of(special.kind), special.orbit, index)


def samples_each(orbits: int) -> int:
    """How many samples of a time history each of so many orbits of a page has.

    Examples
    --------
    >>> samples_each(20), samples_each(300), samples_each(5000)
    (1500, 600, 300)
    """
    return int(np.clip(ALL_SAMPLES // max(orbits, 1), *SAMPLES))


def orbit_content(
    chosen: ChosenOrbit, axis: Axis, along: Along, samples: int = SAMPLES[1]
) -> dict[str, Any]:
    """What a page shows of an orbit, ready for JSON; arrays are packed as 32-bit numbers.

    In SI units, at about so many instants of a period. What cannot be computed is told under
    ``fault``, and then the rest is missing.
    """
    orbit, value = chosen.orbit, axis.value(chosen.orbit)
    told = {
        "branch": chosen.branch,
        "place": chosen.place,
        "special": chosen.special,
        "name": chosen.name,
        "period": orbit.period,
        "hz": float(orbit.frequency_hz),
        "x": float(value) / along.factor,
        "y": float(orbit.max_abs_displacement),
        "title": orbit_title(orbit, digits=7) + along.beside(value, 7),
        "walls": stop_places(orbit.system, orbit.observe),
        "stable": bool(orbit.stable),
    }
    try:
        return {**told, **_motion(orbit, samples), **_spectrum(orbit), **_figures(orbit)}
    except ConvergenceError as error:
        return {**told, "fault": str(error)}


def _motion(orbit: Orbit, samples: int) -> dict[str, Any]:
    """Displacement, velocity and contact forces over a period, all impacts, and what slides."""
    phases = drawn_phases(orbit, min(STEPS * orbit.period, samples // 2))
    phases = phases[even(phases.size, samples)]
    states = drawn_states(orbit, phases)
    y, speed = orbit.system.displacement(orbit.observe, states, phases, orbit.omega)
    start = motion_at(orbit, orbit.observe, 2.0 * math.pi * np.arange(orbit.period, dtype=float))
    return {
        "time": floats(phases / orbit.omega),
        "displacement": floats(y),
        "velocity": floats(speed),
        "forces": [floats(force) for force in orbit.history_at(phases, states).force.T],
        "strobe": [value.tolist() for value in start],
        "impacts": [
            [hit.time, hit.stop, hit.penetration, hit.force, hit.speed, hit.impulse]
            for hit in orbit.impact_list
        ],
        "friction": [
            [
                slider_name(orbit.system, number),
                *(each.peak_force, each.distance, each.stuck, each.slid, each.open),
                *(each.loss, each.pressed_distance),
            ]
            for number, each in enumerate(orbit.friction)
        ],
    }


def drawn_states(orbit: Orbit, phases: Real) -> Real:
    """Modal states (k, 2n) at ascending phases (k,) of one period, exact enough to be drawn."""
    return orbit.problem.flow.to_modal(orbit.trajectory.recorded_states(phases))


def halves(states: Real) -> tuple[Real, Real]:
    """Modal displacements and velocities, (k, n) each."""
    n = states.shape[1] // 2
    return states[:, :n], states[:, n:]


def _spectrum(orbit: Orbit) -> dict[str, Any]:
    """Amplitudes at multiples of the orbit's frequency, those above the floor."""
    lines = harmonics(orbit)
    shown = np.flatnonzero(lines.amplitude > FLOOR * lines.amplitude.max())
    return {
        "lines": shown.tolist(),
        "amplitudes": [float(f"{value:.6g}") for value in lines.amplitude[shown]],
    }


def _figures(orbit: Orbit) -> dict[str, Any]:
    """Multipliers and the errors that are claimed."""
    moduli = orbit.log_moduli
    return {
        "multipliers": [[value.real, value.imag] for value in orbit.multipliers.tolist()],
        "log_moduli": [known(value) for value in moduli],
        "uncertainties": [known(value) for value in orbit.log_modulus_uncertainties],
        "error": known(orbit.error),
        "liouville_error": known(orbit.liouville_error),
        "flow_error": [known(orbit.flow_error.state), known(orbit.flow_error.monodromy)],
    }


def modal_motion(orbit: Orbit) -> dict[str, Any]:
    """Modal displacements at instants of a period, for the viewer; at first the deepest contact.

    Without a contact the largest observed displacement is shown first.
    """
    deepest = max(orbit.impact_list, key=lambda hit: hit.penetration, default=None)
    if deepest is not None:
        first = orbit.omega * deepest.time
    else:
        extremes = orbit.observed_extremes
        largest = np.argmax(np.abs(extremes.values)) if extremes.values.size else None
        first = 0.0 if largest is None else float(extremes.phases[largest])
    phases = shown_phases(orbit, SHOWN_INSTANTS, first)
    return {
        "times": floats(phases / orbit.omega),
        "period": orbit.duration,
        "first": first / orbit.omega,
        "coordinates": floats(halves(drawn_states(orbit, phases))[0]),
    }


def shown_phases(orbit: Orbit, count: int, first: float) -> Real:
    """Phases at which a structure is shown: equal steps of a period, its contacts, one more."""
    end = 2.0 * math.pi * orbit.period
    steps = np.linspace(0.0, end, count, endpoint=False)
    contacts = [orbit.omega * hit.time for hit in orbit.impact_list[:count]]
    return np.unique(np.concatenate([steps, contacts, [first]]) % end)


def stops_of(orbit: Orbit) -> dict[str, Any]:
    """The stops' names, and which act on rotations."""
    system = orbit.system
    return {
        "names": [stop_name(system, index) for index in range(len(system.stops))],
        "turn": [system.unit(stop.at) == "rad" for stop in system.stops],
    }


def friction_columns(orbit: Orbit) -> list[str]:
    """Heads of the table of what sliders do in a period."""
    turns = np.array([orbit.system.unit(slider.at) == "rad" for slider in orbit.system.rubbing])
    units = units_where(OF_SLIDERS, turns) | {"pressed distance": "N m"}
    return ["slider", *(f"{name} ({unit})" for name, unit in units.items())]


def known(value: float) -> float | None:
    """A number for JSON, to six digits; None where it is nan or infinite.

    Examples
    --------
    >>> known(1 / 3), known(math.inf)
    (0.333333, None)
    """
    return float(f"{value:.6g}") if math.isfinite(value) else None


def floats(values: npt.ArrayLike) -> str:
    """Numbers as 32-bit ones in base64."""
    return packed(np.asarray(values), np.float32)
