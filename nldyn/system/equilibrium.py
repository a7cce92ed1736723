"""Rest under preload: where a structure lies that its stops press upon, and small motions there."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from nldyn.base.arrays import SLACK, TINY, Complex, Real
from nldyn.base.errors import SystemModelError
from nldyn.system.contact_law import power_law
from nldyn.system.rigid_stop import AnyStop
from nldyn.system.round_stop import Polar, RoundStop
from nldyn.system.springs_dampers import Bond
from nldyn.system.stop import Stop
from nldyn.system.system import System

MOST_STEPS = 200
SHORTEST = 1e-14  # last step, relative
SHORT = 1e-13  # the same of Newton's method where nothing has a potential
FLAT = 1e-12  # of the stops' largest stiffness, below which a rigid motion counts as not held
NOT_HELD = 1e-9  # share of a force, or of a direction, that counts as none
RIGID = 1e8  # stiffness of what stands in for a rigid stop, beside the structure's
MOST_STARTS = 100  # in the search for all rest positions
SAME = 1e-6  # share of their size by which two of them may differ
FARTHEST = 1e9  # m kg^0.5, where a motion counts as running away
BALANCED = 1e-9  # share of the forces that may be left at rest
RISES = 20  # steps in which the friction of round clearances grows from none
SHARE = 0.1  # of the decrease that the slope foretells, with which a step is taken
DOUBLINGS, SEEN = 20.0, 1e-12  # of the steps that look for a fall of the energy; one that is seen
FIRST_MOVE = 1e-3  # of the way to where the energy rises again: the start of a descent


def rest(system: System) -> Real:
    """Modal displacements (n,) at which the structure rests when nothing but constant forces act.

    They are zero unless a constant force acts or a stop is closed there (a negative gap). The
    forces have the potential ``q Ω² q / 2 - f q + Σ k δ^(m + 1) / (m + 1)``, which is convex
    but beside a pin, where the way goes downhill to one of its minima. Newton's method with
    shortened steps [Nocedal and Wright 2006, section 3.1] comes to its only
    minimum; a body that nothing holds yet moves along the force to the next stop. A stop with a law
    of its own counts with its stiffness and exponent, a rigid one as a spring 1e8 times as stiff
    as the structure. Where polynomial springs make several minima, it is the first of
    `rest_positions`.

    Raises
    ------
    SystemModelError
        If a constant force acts on a body that neither a spring nor a stop holds against it, or
        only one out of all reach.

    Examples
    --------
    >>> from nldyn import ConstantForce, Stop
    >>> stop = Stop.linear("tip", (20.0 * np.pi) ** 2, gap=-1e-3)
    >>> system = System.from_modal([10.0], {"tip": [1.0]}, stops=[stop])
    >>> float(rest(system)[0].round(9))
    -0.0005
    >>> free = System.from_modal([0.0], {"ship": [1.0]}, stops=[Stop.linear("ship", 50.0, gap=0.1)],
    ...     excitation=[ConstantForce("ship", 2.0)])
    >>> float(rest(free)[0].round(9))
    0.14
    """
    system = with_springs_for_rigid_stops(system)
    if system.bonds:
        return rest_positions(system)[0]
    q = _settled(system, np.zeros(system.size))
    if not np.all(np.isfinite(q)):
        raise SystemModelError(
            f"the structure rests farther away than {FARTHEST:g} m √kg: is a constant force or "
            "the gap of the stop that holds it in the right unit?"
        )
    return _with_friction(system, _off_saddles(system, q))


def _off_saddles(system: System, q: Real) -> Real:
    """Where the way goes on from q if a pin holds it there as on a crest, which is no rest."""
    if not _has_pins(system):
        return q
    for _ in range(system.size):
        values, vectors = np.linalg.eigh(tangent_stiffness(system, q))
        if values[0] >= -FLAT * float(np.abs(values).max()):
            break
        q = _settled(system, q + FIRST_MOVE * float(np.linalg.norm(q)) * vectors[:, 0])
    return q


def _has_pins(system: System) -> bool:
    """Whether there are pins, beside which the potential is not convex."""
    return not all(stop.inside for stop in system.round_stops.values())


def rest_positions(system: System) -> list[Real]:
    """All rest positions (n,) that are found, the one of least energy first.

    There is one without polynomial springs. With them, Newton's method goes downhill from zero,
    from where each spring alone with the structure behind it would rest, and to both sides of a
    saddle.

    Raises
    ------
    SystemModelError
        If nothing holds the structure, or it runs away along a spring that softens.

    Examples
    --------
    >>> from nldyn import PolynomialSpring
    >>> wells = System.from_matrices([[1.0]], [[0.0]], {"tip": [1.0]},
    ...     springs=[PolynomialSpring("tip", [-4.0, 0.0, 1.0])])
    >>> [abs(float(q[0].round(9))) for q in rest_positions(wells)]
    [2.0, 2.0]
    """
    if not system.bonds:
        return [rest(system)]
    system = with_springs_for_rigid_stops(system)
    push = constant_force(system)
    starts = [np.zeros(system.size), *_rests_of_bonds(system, push)]
    found: list[Real] = []
    for start in starts:
        q = _settled(system, start)
        if not (np.all(np.isfinite(q)) and _balanced(system, push, q)):
            continue
        values, vectors = np.linalg.eigh(tangent_stiffness(system, q))
        flat = FLAT * float(np.abs(values).max())
        falls = values[0] <= flat and _falls(system, push, q, vectors[:, 0])
        if values[0] < -flat or falls:
            if len(starts) < MOST_STARTS:
                away = _beside(system, push, q, vectors[:, 0])
                starts += [q + away, q - away]
        elif not any(np.linalg.norm(q - p) <= SAME * _length(system, q, p) for p in found):
            found.append(q)
    if not found:
        raise SystemModelError(
            f"{_what_runs_away(system)}, so that the structure has no rest position"
        )
    found.sort(key=lambda q: potential_at(system, push, q))
    return [_with_friction(system, q) for q in found]


def _what_runs_away(system: System) -> str:
    soft = [bond for bond in system.bonds if bond.coefficients and not bond.bounded]
    if not soft:
        return "excitation is constant, and nothing holds the structure against it"
    between = f"'{soft[0].at}'" + (f" against '{soft[0].against}'" if soft[0].against else "")
    bounds = "a last coefficient of an odd power and above 0 would bound them"
    return f"springs at {between} let it run away ({bounds})"


def _rests_of_bonds(system: System, push: Real) -> Iterator[Real]:
    """Where the forces along each bond alone vanish."""
    for bond in system.bonds:
        c = _vector(system, bond)
        way = c / float(c @ c) if np.any(c) else c
        forces = np.zeros(max(len(bond.coefficients), 1) + 1)
        forces[1 : len(bond.coefficients) + 1] = bond.coefficients
        forces[:2] += -float(push @ way), float(way @ system.stiffness @ way)
        forces = np.trim_zeros(forces, "b")
        for root in np.polynomial.polynomial.polyroots(forces) if forces.size > 1 else ():
            if abs(root.imag) <= SLACK * abs(root):
                yield root.real * way


def _balanced(system: System, push: Real, q: Real) -> bool:
    """Whether the forces at q cancel."""
    size = _sum_of_forces(system, push, q)
    return float(np.linalg.norm(force_at(system, push, q))) <= BALANCED * size


def _sum_of_forces(system: System, push: Real, q: Real) -> float:
    """Sum of the sizes of all forces at q, friction left out."""
    parts = [push, system.stiffness @ q]
    parts += [stop_force * c for c, stop_force in _pushes(system, q)]
    return sum(float(np.linalg.norm(part)) for part in parts)


def _pushes(system: System, q: Real) -> Iterator[tuple[Real, float]]:
    """Vectors and forces of the closed stops and of the bonds."""
    for each in _closed(system.elastic_stops, system, q):
        yield each.vector, _elastic(each.stop, each.depth)[0]
    for bond in system.bonds:
        c = _vector(system, bond)
        yield c, float(bond.force(c @ q))


def _falls(system: System, push: Real, q: Real, way: Real) -> bool:
    """Whether the energy falls from q along a direction without curvature, either way."""
    here = potential_at(system, push, q)
    size = max(float(np.abs(_vector(system, bond) @ way)) for bond in system.bonds) or 1.0
    for step in 2.0 ** np.arange(-DOUBLINGS, DOUBLINGS) / size:
        sides = np.array([potential_at(system, push, q + s * way) for s in (step, -step)]) - here
        if np.abs(sides).max() > SEEN * abs(here) + TINY:
            return bool(sides.min() < 0.0)
    return False


def _beside(system: System, push: Real, q: Real, way: Real) -> Real:
    """Step from a saddle along a direction, a thousandth of that to where the energy is lowest."""
    steps = 2.0 ** np.arange(-60.0, 60.0)
    size = max(float(np.abs(_vector(system, bond) @ way)) for bond in system.bonds) or 1.0
    energies = [
        min(potential_at(system, push, q + s * way), potential_at(system, push, q - s * way))
        for s in steps / size
    ]
    rises = np.flatnonzero(np.diff(energies) > 0.0)
    rises = rises[np.array(energies)[rises] < energies[0]]
    return np.asarray(FIRST_MOVE * steps[rises[0] if rises.size else 0] / size * way)


def _length(system: System, *states: Real) -> float:
    return max(float(np.linalg.norm(q)) for q in states) or 1.0


def _settled(system: System, q: Real) -> Real:
    """Where Newton's method goes downhill from q; not finite if it runs away."""
    push = constant_force(system)
    for _ in range(MOST_STEPS):
        slope = force_at(system, push, q)
        step = _downhill(system, q, slope)
        if not np.linalg.norm(q) < FARTHEST:
            return np.full(system.size, np.nan)
        size, potential = 1.0, potential_at(system, push, q)
        steepness = float(np.linalg.norm(slope))
        while size > SHORTEST:
            there = q + size * step
            foretold = potential + SHARE * size * float(slope @ step)
            # near the minimum the potential is rounding, the forces are not
            if (
                potential_at(system, push, there) <= foretold
                or np.linalg.norm(force_at(system, push, there)) < steepness
            ):
                break
            size *= 0.5
        else:
            break
        q = there
        if size * float(np.linalg.norm(step)) <= SHORTEST * float(np.linalg.norm(q)):
            break
    return q


def with_springs_for_rigid_stops(system: System) -> System:
    """The system with a stiff linear stop in the place of each rigid one."""
    if not system.rigid_stops:
        return system
    push = float(np.linalg.norm(constant_force(system)))
    stops: list[AnyStop] = []
    for stop in system.stops:
        if stop.impulsive:
            c = float(np.linalg.norm(system.stop_vector(stop)))
            pace = float(system.natural_frequencies.max()) ** 2 / (c * c or 1.0)
            stiffness = RIGID * (pace or c * push or 1.0)
            if isinstance(stop, RoundStop):
                stop = replace(stop, stiffness=stiffness, exponent=1.0, restitution=None)
            else:
                stop = Stop.linear(
                    stop.at, stiffness, gap=stop.gap, direction=stop.direction, against=stop.against
                )
        stops.append(stop)
    return system.with_elements(stops=tuple(stops))


def constant_force(system: System) -> Real:
    """Modal force (n,) of all that acts constantly."""
    push = np.zeros(system.size)
    for source in system.excitation:
        if source.harmonic == 0:
            push += source.phasor.real * system.load_vector(source.at)
    return push


def _downhill(system: System, q: Real, slope: Real) -> Real:
    """Newton's step, or the way to the next stop along a force that nothing resists.

    Raises
    ------
    SystemModelError
        If no stop is there.
    """
    stiffness = tangent_stiffness(system, q)
    free = np.zeros(system.size)
    rigid = np.flatnonzero(system.natural_frequencies == 0.0)
    if rigid.size:
        values, vectors = np.linalg.eigh(stiffness[np.ix_(rigid, rigid)])
        flat = vectors[:, np.abs(values) <= FLAT * np.abs(values).max()]
        free[rigid] = -flat @ (flat.T @ slope[rigid])
    # what rounding shows of a force along a flat direction is none
    force = float(np.linalg.norm(free))
    if force <= NOT_HELD * np.linalg.norm(slope):
        return _newton_step(system, stiffness, slope)
    ways = []
    for stop in system.elastic_stops.values():
        c = system.stop_vector(stop)
        pace, left = float(c @ free) / force, stop.gap - float(c @ q)
        if isinstance(stop, RoundStop):
            pace, left = _way_round(system, stop, q, free / force)
        if pace > NOT_HELD * np.linalg.norm(c) and left >= 0.0:
            depth = (force / (stop.stiffness * pace)) ** (1.0 / stop.exponent)
            ways.append((left + depth) / pace)
    if ways:
        return np.asarray(min(ways) / force * free)
    if system.bonds:  # they may hold it elsewhere, where another start leads
        return _newton_step(system, stiffness, slope)
    raise SystemModelError(
        "excitation by a constant force acts on a body that neither a spring nor a stop holds "
        "against it; hold it, or turn the force or the stop round"
    )


def _way_round(system: System, stop: RoundStop, q: Real, way: Real) -> tuple[float, float]:
    """How fast it closes, where a way from q first meets a round clearance, and what is left of it.

    The pace is that of the penetration there, along the way, and zero if it never does.
    """
    at, rows = _at_round(system, stop, q)
    place, along = at.radius[0] * at.normal[0], rows @ way
    square = float(along @ along)
    a, b = float(place @ along), float(place @ place) - stop.clearance**2
    root = a * a - square * b
    if square == 0.0 or root < 0.0:
        return 0.0, 0.0
    step = (-a + stop.sense * math.sqrt(root)) / square
    there = place + step * along
    pace = stop.sense * float(there @ along) / stop.clearance
    return pace, step * pace


def _newton_step(system: System, stiffness: Real, slope: Real) -> Real:
    """Newton's step, with bonds and pins away from maxima, and none where there is no stiffness."""
    if not system.bonds and not _has_pins(system):
        return np.asarray(-np.linalg.lstsq(stiffness, slope, rcond=None)[0])
    values, vectors = np.linalg.eigh(stiffness)
    sizes = np.abs(values)
    stiff = sizes > FLAT * sizes.max()
    along = vectors[:, stiff]
    return np.asarray(-along @ ((along.T @ slope) / sizes[stiff]))


def closed_at_rest(system: System, q: Real) -> list[tuple[int, float, float]]:
    """Number, penetration in m and force in N of each stop that is closed at rest."""
    springs = with_springs_for_rigid_stops(system).elastic_stops
    return [
        (i, 0.0 if system.stops[i].impulsive else depth, float(stop.force(depth)))
        for i, stop, _, depth, *_ in _closed(springs, system, q)
    ]


def held_response(system: System, q: Real, omega: float) -> Complex:
    """Amplitude (n,) of the small steady motion q + Re(a e^{iωt}) about a rest position q."""
    system = with_springs_for_rigid_stops(system)
    force = np.zeros(system.size, dtype=complex)
    for source in system.excitation:
        if source.harmonic == 1:
            force += source.phasor * omega**source.power * system.load_vector(source.at)
    matrix = tangent_stiffness(system, q) - omega**2 * np.eye(system.size)
    found = np.linalg.lstsq(matrix + 1j * omega * system.total_damping, force, rcond=None)[0]
    return np.asarray(found)


def at_rest(q: Real) -> Real:
    """Modal displacements and velocities (2n,) of a structure that rests at q."""
    return np.append(q, np.zeros_like(q))


def held_motion(system: System, q: Real, omega: float, phases: Real) -> Real:
    """Modal displacements and velocities (k, 2n) of `held_response` at forcing phases (k,)."""
    turning = np.exp(1j * phases)[:, None] * held_response(system, q, omega)
    return np.hstack([q + turning.real, (1j * omega * turning).real])


def tangent_stiffness(system: System, q: Real) -> Real:
    """Stiffness (n, n) of the structure with its closed stops at modal displacements q."""
    matrix = np.array(system.stiffness)
    for _, stop, c, depth, along, _ in _closed(system.elastic_stops, system, q):
        force, stiffness = _elastic(stop, depth)
        matrix += stiffness * np.outer(c, along)
        if isinstance(stop, RoundStop):
            at, rows = _at_round(system, stop, q)
            across = at.across[0] @ rows
            matrix += stop.sense * force / float(at.radius[0]) * np.outer(across, across)
    for bond in system.bonds:
        c = _vector(system, bond)
        matrix += float(bond.stiffness(c @ q)) * np.outer(c, c)
    return matrix


def _vector(system: System, bond: Bond) -> Real:
    """Modal vector of the displacement at a bond."""
    return system.vector_between(bond.at, bond.against)


class Closed(NamedTuple):
    """A stop that is closed: its place, modal vector c, penetration, and what that goes with.

    That is the derivative (n,) of the penetration by the modal displacements: with stops that move
    each other at once not c alone. `free` is the penetration if no other one did.
    """

    place: int
    stop: Stop | RoundStop
    vector: Real
    depth: float
    along: Real
    free: float


def _closed(stops: Mapping[int, Stop | RoundStop], system: System, q: Real) -> Iterator[Closed]:
    """Those of some stops that are closed at modal displacements q."""
    alone = []
    for i, stop in stops.items():
        if isinstance(stop, RoundStop):
            at, rows = _at_round(system, stop, q)
            c, depth = stop.sense * at.normal[0] @ rows, float(at.depth[0])
        else:
            c = system.stop_vector(stop)
            depth = float(c @ q) - stop.gap
        alone.append(Closed(i, stop, c, depth, c, depth))
    if system.common_flexibility is not None:
        depths = np.full(len(system.stops), -1.0)
        vectors = np.zeros((len(system.stops), system.size))
        for each in alone:
            depths[each.place], vectors[each.place] = each.free, each.vector
        (together,) = system.coupled.maps(depths[None])
        alone = [
            each._replace(
                depth=float(together[each.place] @ depths), along=together[each.place] @ vectors
            )
            for each in alone
        ]
    yield from (each for each in alone if each.depth > 0.0)


def _at_round(system: System, stop: RoundStop, q: Real) -> tuple[Polar, Real]:
    """Where a structure at q is in a round clearance, and the vectors (2, n) of its directions."""
    return system.round_polar(stop, at_rest(q)[None]), np.array(system.stop_vectors(stop))


class Rubbed(NamedTuple):
    """What the forces leave over at rest with friction, and the slopes of that.

    The normal forces N of the round clearances are unknowns beside the displacements q: what gives
    way little, or not at all, keeps Newton's method else to steps as short as its penetration.

    Parameters
    ----------
    forces : (n,)
        What the forces leave over.
    misses : (r,)
        Penetrations, less those that belong to N; zero of what is open.
    slopes : (n + r, n + r)
        Derivatives of both by q and N.
    size : float
        Sum of the sizes of all forces.
    """

    forces: Real
    misses: Real
    slopes: Real
    size: float


def _with_friction(system: System, q: Real) -> Real:
    """Where it rests with the friction of round clearances, from where it would without.

    What does not turn may rest with any friction up to μN: it is taken to rest without.

    Raises
    ------
    SystemModelError
        If it does not: friction carries it round.
    """
    rounds = system.round_stops
    pressed = _pressed(system, q, np.zeros(len(rounds)))
    rubs = [stop.friction > 0.0 and stop.sliding_speed != 0.0 for stop in rounds.values()]
    if not np.any(pressed[rubs]):
        return q
    others = _without_rounds(system)
    for share in np.linspace(0.0, 1.0, RISES + 1)[1:]:
        q, pressed, left = _carried_on(system, others, q, pressed, share)
        if left > BALANCED:
            raise SystemModelError(
                "under constant forces and the friction of a round clearance it comes to no rest "
                "that Newton's method finds"
            )
    return q


def _pressed(system: System, q: Real, pressed: Real) -> Real:
    """Normal forces (r,) of the round clearances: where none is known, that of the penetration."""
    own = [
        _elastic(stop, max(float(_at_round(system, stop, q)[0].depth[0]), 0.0))[0]
        for stop in system.round_stops.values()
    ]
    return np.where(pressed > 0.0, pressed, own)


def _without_rounds(system: System) -> System:
    """The system with its round clearances out of reach."""
    stops = [s.out_of_reach(FARTHEST) if isinstance(s, RoundStop) else s for s in system.stops]
    return system.with_elements(stops=tuple(stops))


def _rubbed(system: System, others: System, q: Real, pressed: Real, share: float) -> Rubbed:
    """The forces at q with normal forces (r,) of round clearances and a share of their friction."""
    push, n = constant_force(system), q.size
    forces, misses = force_at(others, push, q), np.zeros(pressed.size)
    slopes = np.zeros((n + pressed.size, n + pressed.size))
    slopes[:n, :n] = tangent_stiffness(others, q)
    size = _sum_of_forces(others, push, q)
    for i, (stop, force) in enumerate(zip(system.round_stops.values(), pressed, strict=True), n):
        if force == 0.0:
            slopes[i, i] = 1.0
            continue
        at, rows = _at_round(system, stop, q)
        normal, across = at.normal[0] @ rows, at.across[0] @ rows
        rub = share * stop.rub if stop.sliding_speed else 0.0
        c = stop.sense * normal
        forces += force * (c + rub * across)
        size += force * float(np.linalg.norm(c))
        bent = stop.sense * across - rub * normal
        slopes[:n, :n] += force / float(at.radius[0]) * np.outer(bent, across)
        slopes[:n, i], slopes[i, :n] = c + rub * across, c
        depth = (force / stop.stiffness) ** (1.0 / stop.exponent)
        slopes[i, i] = -depth / (stop.exponent * force)
        misses[i - n] = float(at.depth[0]) - depth
    return Rubbed(forces, misses, slopes, size)


def _carried_on(
    system: System, others: System, q: Real, pressed: Real, share: float
) -> tuple[Real, Real, float]:
    """Where Newton's method comes from q with a share of the friction, and what is left over."""
    n, now = q.size, _rubbed(system, others, q, pressed, share)
    left = _left_over(system, now)
    for _ in range(MOST_STEPS):
        scale = np.ones(n + pressed.size)  # of N, with which its slopes are as those of q
        scale[n:] = np.abs(now.slopes[:n, :n]).max() or 1.0
        scale[n:] /= np.abs(now.slopes[n:]).max(axis=1)
        wrong = scale * np.append(now.forces, now.misses)
        step = scale * np.linalg.lstsq(scale[:, None] * now.slopes * scale, -wrong, rcond=None)[0]
        size = 1.0
        while size > SHORT:
            there = q + size * step[:n]
            forces = _pressed(system, there, pressed + size * step[n:])
            then = _rubbed(system, others, there, forces, share)
            if _left_over(system, then) < left:
                break
            size *= 0.5
        else:
            break
        q, pressed, now, left = there, forces, then, _left_over(system, then)
        if np.linalg.norm(step[:n]) <= SHORT * np.linalg.norm(q):
            break
    return q, pressed, left


def _left_over(system: System, found: Rubbed) -> float:
    """Share of the forces that is left over, and of the clearances by which penetrations miss."""
    rooms = [stop.clearance for stop in system.round_stops.values()]
    return float(np.linalg.norm([*found.forces / found.size, *found.misses / rooms]))


def _elastic(stop: Stop | RoundStop, depth: float) -> tuple[float, float]:
    """Force and stiffness of a closed stop at rest."""
    force, stiffness, _ = power_law(stop.stiffness, stop.exponent, 0.0, 0.0, depth, 0.0)
    return force, stiffness


def force_at(system: System, push: Real, q: Real) -> Real:
    """Modal force (n,) of all springs and closed stops at q, less a constant force."""
    slope = system.stiffness @ q - push
    for c, force in _pushes(system, q):
        slope += force * c
    return np.asarray(slope)


def potential_at(system: System, push: Real, q: Real) -> float:
    """Energy in J of all springs and closed stops at q, less that of a constant force."""
    energy = 0.5 * float(q @ system.stiffness @ q) - float(push @ q)
    for each in _closed(system.elastic_stops, system, q):  # what gives way at once stores, too
        force = _elastic(each.stop, each.depth)[0]
        energy += force * each.free / (each.stop.exponent + 1.0)
    for bond in system.bonds:
        energy += float(bond.energy(_vector(system, bond) @ q))
    return energy
