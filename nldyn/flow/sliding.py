"""What slides with dry friction does in a recorded motion: forces, ways, shares and losses."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from nldyn.base.arrays import Real
from nldyn.flow.flow_map import Trajectory
from nldyn.flow.gauss import fine_table, peaks
from nldyn.flow.rigid_impacts import rigid_impacts, rubbed
from nldyn.system.friction import Slider

UNMOVED = 1e-9  # of the largest displacement: a way that counts as none where a slider is held
ROUNDING = 1e-13  # the same where it is not
ALIKE = 1e-6  # relative difference of a held slider's acceleration from what its force takes away
LESS = 1e-9  # of the most friction in a round clearance: by so much it is below where it sticks


@dataclass(frozen=True)
class SliderMeasures:
    """What one of `System.rubbing` does in a motion, such as a period of an orbit.

    Where it acts on a rotation, rad stands for m, and N m for N. The instants at which it sticks,
    slips and is let go are as exact as states need: at the default `rtol` of the flow map shares
    are good to about 1e-8, and ways at stops to 1e-7.

    Parameters
    ----------
    slider : Slider
        Where it is.
    rotation : bool
        Whether it acts on a rotation.
    peak_force : float
        Largest friction in N, sliding or sticking; by the recorded polynomials, good to 1e-6.
    distance : float
        How far it slides in m, to and fro, on what it slides on. A way below 1e-13 of its largest
        displacement counts as none.
    stuck, slid, open : float
        Shares of the time in which it sticks, slides, and is pressed on by nothing; their sum is 1.
    loss : float
        Energy in J that friction dissipates: the integral of friction times the speed of sliding.
    pressed_distance : float
        Integral of the normal force times the speed of sliding, in N m, with that of the impulses
        of impacts on rigid stops, as in `loss`: by Archard's law what
        wears off is this times a coefficient of wear over the hardness.
    power : float
        `loss` per second, in W.
    work_rate : float
        `pressed_distance` per second, in W. Tubes lose in their supports a volume per second that
        is this times a measured coefficient of wear.

    References
    ----------
    J. F. Archard (1953), *J. Appl. Phys.* 24, 981-988, for the law of wear; N. J. Fisher, A. B.
    Chow and M. K. Weckwerth (1995), *J. Pressure Vessel Technol.* 117, 312-320, for the work rate.

    Examples
    --------
    >>> import math
    >>> from nldyn import HarmonicForce, System, solve_orbit
    >>> from nldyn.system import DryFriction
    >>> block = System.from_matrices([[1.0]], [[1.0]], {"x": [1.0]},
    ...     dampers=[DryFriction("x", 1.0, 0.4)], excitation=[HarmonicForce("x", 1.0)])
    >>> orbit = solve_orbit(block, 0.8 / (2.0 * math.pi))
    >>> (measures,) = orbit.friction
    >>> round(measures.loss / orbit.max_abs_displacement, 9)    # 4 µ N of each m of amplitude
    1.6
    """

    slider: Slider
    rotation: bool
    peak_force: float
    distance: float
    stuck: float
    slid: float
    open: float
    loss: float
    pressed_distance: float
    power: float
    work_rate: float

    def __repr__(self) -> str:
        """One line: where, how far, which share it sticks, and what is lost."""
        unit = "rad" if self.rotation else "m"
        return (
            f"<SliderMeasures at '{self.slider.at}': slides {self.distance:.4g} {unit}, "
            f"stuck {self.stuck:.1%}, open {self.open:.1%}, loses {self.loss:.4g} J>"
        )


def slider_measures(motion: Trajectory) -> tuple[SliderMeasures, ...]:
    """What all that rubs does in a motion, in the order of `System.rubbing`.

    Integrals are Gauss quadratures of the flow map's own panels, which end where a slider turns,
    sticks, slips, or is let go.
    """
    system = motion.flow.system
    if not system.rubbing:
        return ()
    end = motion.states(np.array([motion.span[1]]))
    ends = np.concatenate([motion.record.start, end])
    sliders, over_planes = range(len(system.sliders)), system.over_planes
    return (
        *(
            _plane_measures(motion, number, ends)
            if number in over_planes
            else _measures_of(motion, number, ends)
            for number in sliders
        ),
        *(_round_measures(motion, ring, ends) for ring in system.rubbing[len(sliders) :]),
    )


def _measures_of(motion: Trajectory, number: int, ends: Real) -> SliderMeasures:
    """Measures of a slider, by the states z (pieces + 1, 2n) at the ends of all pieces."""
    flow, rec, tables = motion.flow, motion.record, motion.flow.tables
    slider, output = flow.system.sliders[number], len(flow.system.stops) + number
    panels = np.flatnonzero(rec.kind >= 0)
    if slider.stop >= 0:
        panels = _touching(motion, slider.stop)
    duration, place = rec.duration[panels], ends @ flow.rows[output]
    force, inner = rec.force[panels, output], rec.depth[panels, output]
    belt = slider.friction.base_speeds[0]
    if slider.tangential_stiffness is not None:  # what slides is not what the spring is fixed to
        place = flow.places(ends)[:, flow.system.sprung.index(number)]
        carried = belt * duration[:, None] * tables.chi[rec.kind[panels]]
        inner = place[panels, None] + carried + inner - force / slider.tangential_stiffness
    ways = np.diff(place)[panels] - belt * duration
    size = np.abs(place).max() + np.abs(belt * duration).max(initial=0.0)
    held = held_in_pieces(motion, number)[panels]
    mobility = float(flow.mobility([output])[0, 0])
    pulled = np.where(held, mobility * np.abs(force).max(axis=1, initial=0.0) * duration**2, 0.0)
    slides = np.abs(ways) > np.where(held, UNMOVED, ROUNDING) * (size + pulled)
    along = np.column_stack([place[panels], inner, place[panels + 1]])[slides]
    moved = flow.tables.ways(along)
    moved -= belt * _times_of_nodes(motion, panels[slides])
    pressed = rec.force[panels[slides], slider.stop] if slider.stop >= 0 else slider.normal_force
    loss = float((force[slides] * moved).sum())
    pressed_distance = float(np.abs(pressed * moved).sum())
    if slider.stop in flow.system.rigid_stops:
        pressed_distance += (in_impacts := _rubbed_in_impacts(motion, slider))
        loss += slider.friction.coefficient * in_impacts
    forces = force @ fine_table(tables.nodes.size).T
    largest, way = peaks(np.abs(forces)), float(np.abs(ways[slides]).sum())
    return _measures(motion, slider, largest, way, duration, slides, loss, pressed_distance)


def _rubbed_in_impacts(motion: Trajectory, slider: Slider) -> float:
    """Integral in N m of the sliding speed over the impulses of a rigid stop."""
    hits = rigid_impacts(motion, slider.stop)
    return float(rubbed(slider.friction.coefficient, hits).sum())


def _plane_measures(motion: Trajectory, number: int, ends: Real) -> SliderMeasures:
    """Measures of what slides over a plane.

    Its place goes along the strain e of the spring, by the speed along e less the rate of |e|. What
    the record has is the place of a strain whose length grows at a rate of its own, see
    `nldyn/engine/friction_disc.c`: that rate is taken off again.
    """
    flow, rec, tables = motion.flow, motion.record, motion.flow.tables
    slider, (first, second, *movers) = flow.system.sliders[number], flow.plane_rows[number]
    if not movers:
        return _hard_plane_measures(motion, number, ends)
    rows, spring = [first, second], slider.tangential_stiffness or 0.0
    panels = np.flatnonzero(rec.kind >= 0)
    if slider.stop >= 0:
        panels = _touching(motion, slider.stop)
    slides = np.asarray(rec.force[panels][:, movers].any(axis=(1, 2)))
    sliding, duration = panels[slides], rec.duration[panels]
    pulled, strain = rec.force[sliding][:, rows], rec.depth[sliding][:, rows]
    moved, size = rec.force[sliding][:, movers], np.hypot(*np.moveaxis(strain, 1, 0))
    force = np.hypot(*np.moveaxis(pulled, 1, 0))
    time = rec.duration[sliding, None] * tables.chi[rec.kind[sliding]]
    growth = (size[:, -1] - size[:, 0]) / (time[:, -1] - time[:, 0])
    along = (strain * moved).sum(axis=1) / np.where(size > 0.0, size, 1.0) + growth[:, None]
    along = np.where(force > 0.0, along, np.hypot(*np.moveaxis(moved, 1, 0)))
    way = along * _times_of_nodes(motion, sliding)
    lengths = np.hypot(*(ends @ flow.rows[rows].T).T)
    at_ends = np.where(force.any(axis=1), lengths[[sliding, sliding + 1]], 0.0)
    distance = float(way.sum() - (at_ends[1] - at_ends[0]).sum())
    loss = float((force * way).sum() - 0.5 * spring * (at_ends[1] ** 2 - at_ends[0] ** 2).sum())
    fine = rec.force[panels][:, rows] @ fine_table(tables.nodes.size).T
    mu, largest = slider.friction.coefficient, peaks(np.hypot(*np.moveaxis(fine, 1, 0)))
    pressed = loss / mu if mu > 0.0 else _pressed_way(motion, slider, sliding, way)
    return _measures(motion, slider, largest, distance, duration, slides, loss, pressed)


def _hard_plane_measures(motion: Trajectory, number: int, ends: Real) -> SliderMeasures:
    """The same without a spring, by the ways along both tangents."""
    flow, rec = motion.flow, motion.record
    slider, rows = flow.system.sliders[number], flow.plane_rows[number]
    panels = np.flatnonzero(rec.kind >= 0)
    if slider.stop >= 0:
        panels = _touching(motion, slider.stop)
    slides = ~held_in_pieces(motion, number)[panels]
    sliding, duration = panels[slides], rec.duration[panels]
    places = ends @ flow.rows[rows].T
    times, moved = _times_of_nodes(motion, sliding), []
    for tangent, (row, belt) in enumerate(zip(rows, slider.friction.base_speeds, strict=True)):
        at, inner = places[:, tangent], rec.depth[sliding, row]
        values = np.column_stack([at[sliding], inner, at[sliding + 1]])
        moved.append(flow.tables.ways(values) - belt * times)
    way, force = np.hypot(*moved), np.hypot(*np.moveaxis(rec.force[panels][:, rows], 1, 0))
    pressed = _pressed_way(motion, slider, sliding, way)
    fine = rec.force[panels][:, rows] @ fine_table(flow.tables.nodes.size).T
    largest = peaks(np.hypot(*np.moveaxis(fine, 1, 0)))
    loss = float((force[slides] * way).sum())
    if slider.stop in flow.system.rigid_stops:
        pressed += (in_impacts := _rubbed_in_impacts(motion, slider))
        loss += slider.friction.coefficient * in_impacts
    return _measures(motion, slider, largest, float(way.sum()), duration, slides, loss, pressed)


def _pressed_way(motion: Trajectory, slider: Slider, panels: NDArray[np.intp], way: Real) -> float:
    """Integral of the normal force over ways (k, m) of the nodes of panels."""
    pressed = motion.record.force[panels, slider.stop] if slider.stop >= 0 else slider.normal_force
    return float((pressed * way).sum())


def _times_of_nodes(motion: Trajectory, panels: NDArray[np.intp]) -> Real:
    """Times (k, m) that the nodes of panels stand for."""
    rec = motion.record
    return np.asarray(motion.flow.tables.weights[rec.kind[panels]] * rec.duration[panels, None])


def touching_pieces(motion: Trajectory, stop: int) -> NDArray[np.bool_]:
    """In which pieces (pieces,) of a motion a stop is closed."""
    rec, rows = motion.record, motion.flow.round_rows.get(stop, [stop])
    return np.asarray((rec.kind >= 0) & rec.depth[:, rows].any(axis=(1, 2)))


def _touching(motion: Trajectory, stop: int) -> NDArray[np.intp]:
    """The panels in which a stop is closed."""
    return np.flatnonzero(touching_pieces(motion, stop))


def _round_measures(motion: Trajectory, ring: Slider, ends: Real) -> SliderMeasures:
    """Measures of what slides in a round clearance."""
    flow, rec = motion.flow, motion.record
    stop, panels = flow.system.round_stops[ring.stop], _touching(motion, ring.stop)
    pressed, across, stuck = round_friction(motion, ring.stop)
    pressed, across, sticks = pressed[panels], across[panels], stuck[panels]
    places = []
    for row, centre in zip(flow.round_rows[ring.stop], stop.eccentricity, strict=True):
        at = ends @ flow.rows[row] - centre
        places.append(np.column_stack([at[panels], rec.depth[panels, row], at[panels + 1]]))
    x, y = (place[:, 1:-1] for place in places)
    dx, dy = (flow.tables.ways(place) for place in places)
    way = (x * dy - y * dx) / np.hypot(x, y)
    way = np.abs(way - ring.friction.base_speeds[0] * _times_of_nodes(motion, panels))
    way[sticks] = 0.0
    forces = np.abs(across @ fine_table(flow.tables.nodes.size).T)
    pressed_distance = float((pressed * way).sum())
    if stop.impulsive and stop.friction:
        pressed_distance += _rubbed_in_impacts(motion, ring)
    loss = ring.friction.coefficient * pressed_distance
    total, closed = float(way.sum()), rec.duration[panels]
    return _measures(motion, ring, peaks(forces), total, closed, ~sticks, loss, pressed_distance)


def _measures(
    motion: Trajectory,
    slider: Slider,
    largest: Real,
    way: float,
    closed: Real,
    slides: NDArray[np.bool_],
    loss: float,
    pressed_distance: float,
) -> SliderMeasures:
    """Measures of a slider by the durations (k,) of the panels in which it is pressed on."""
    time, system = float(motion.record.duration.sum()), motion.flow.system
    return SliderMeasures(
        slider,
        slider.stop not in system.round_stops and system.unit(slider.at) == "rad",
        float(largest.max(initial=0.0)),
        way,
        float(closed[~slides].sum()) / time,
        float(closed[slides].sum()) / time,
        1.0 - float(closed.sum()) / time,
        loss,
        pressed_distance,
        loss / time,
        pressed_distance / time,
    )


def round_friction(motion: Trajectory, stop: int) -> tuple[Real, Real, NDArray[np.bool_]]:
    """Normal force and friction (pieces, m) in a round clearance, and where it sticks, (pieces,).

    Friction is that from the first direction to the second, which holds the body back.
    """
    flow, rec = motion.flow, motion.record
    ring, rows = flow.system.round_stops[stop], flow.round_rows[stop]
    away, force = rec.depth[:, rows], rec.force[:, rows]
    radius = np.hypot(away[:, 0], away[:, 1])
    normal = away / np.where(radius > 0.0, radius, 1.0)[:, None]
    pressed = ring.sense * (normal * force).sum(axis=1)
    across = normal[:, 0] * force[:, 1] - normal[:, 1] * force[:, 0]
    most = ring.friction * pressed
    left = (most - np.abs(across)).max(axis=1) > LESS * most.max(axis=1)
    return pressed, across, np.asarray(left & (ring.friction > 0.0))


def slides_one_way(motion: Trajectory) -> bool:
    """Whether what rubs in round clearances slides the same way all the time, without impacts."""
    for number, stop in motion.flow.system.round_stops.items():
        if stop.friction:
            if stop.impulsive:
                return False
            _, across, sticks = round_friction(motion, number)
            ways = np.sign(across[_touching(motion, number)].sum(axis=1))
            if sticks.any() or np.unique(ways).size > 1:
                return False
    return True


def held_in_pieces(motion: Trajectory, number: int) -> NDArray[np.bool_]:
    """Whether a slider does not slide in the pieces of a motion, (pieces,), and has no spring.

    Where one is held its output is no displacement but the acceleration that the force takes away.
    """
    flow, rec = motion.flow, motion.record
    outputs = flow.plane_rows.get(number, [len(flow.system.stops) + number])
    if number in flow.system.sprung:
        return np.zeros(rec.phase.size, dtype=bool)
    mobility = np.diag(flow.mobility(outputs))[:, None]
    inner = rec.depth[:, outputs]
    off = np.abs(inner - mobility * rec.force[:, outputs]).max(axis=(1, 2))
    return np.asarray(off <= ALIKE * np.abs(inner).max(axis=(1, 2)))
