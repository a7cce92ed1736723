"""Stops, dampers and excitation of a scene."""

from __future__ import annotations

import logging
from dataclasses import replace

import numpy as np

from nldyn.base.errors import SystemModelError
from nldyn.scene.contact import area_stops
from nldyn.scene.faults import check_regular, told_as, unreadable
from nldyn.scene.messages import scene_error
from nldyn.scene.schema import (
    DamperTable,
    ElasticStopTable,
    ExcitationTable,
    FrictionTable,
    HertzStopTable,
    LinearStopTable,
    RigidStopTable,
    RoundClearanceTable,
    Scene,
    SpringTable,
    StopTable,
    exponent_of,
)
from nldyn.system.friction import DryFriction, Friction
from nldyn.system.loads import BaseMotion, ConstantForce, Excitation, HarmonicForce, Unbalance
from nldyn.system.measured import MeasuredForce, measured_force
from nldyn.system.rigid_stop import AnyStop, RigidStop
from nldyn.system.round_stop import RoundStop
from nldyn.system.springs_dampers import CubicDamper, Damper, PolynomialSpring, Spring
from nldyn.system.stop import Stop, dashpot_for, dissipation_for, hertz_stiffness
from nldyn.system.system import AnyDamper, AnySpring, Elements

logger = logging.getLogger("nldyn")


def acting_elements(scene: Scene) -> Elements:
    """The stops, dampers and excitation of a scene; a `SceneError` says what is wrong with one."""
    with told_as(scene, (), SystemModelError):
        return Elements(
            stops=(
                *_rough(scene, [_stop(stop) for stop in scene.stops]),
                *map(_round_stop, scene.round_clearances),
                *area_stops(scene),
            ),
            dampers=(*map(_damper, scene.dampers), *map(_dry, dry_tables(scene))),
            excitation=tuple(
                source
                for number, table in enumerate(scene.excitation)
                for source in _excitation(scene, number, table)
            ),
            springs=tuple(_spring(spring) for spring in scene.interface_springs.values()),
        )


def _damper(table: DamperTable) -> AnyDamper:
    if table.law == "linear":
        return Damper(table.at, table.coefficient, table.against)
    by = "speed" if table.law == "cubic" else table.law
    return CubicDamper(table.at, table.coefficient, table.against, by)


def dry_tables(scene: Scene) -> list[FrictionTable]:
    """The tables of what a constant force presses on."""
    return [table for table in scene.friction if table.stop is None]


def slider_of(scene: Scene, number: int) -> int:
    """Which of the sliders of a system a table of friction is.

    Those of stops come first, then those of areas of contact.
    """
    stops = sorted(table.stop for table in scene.friction if table.stop is not None)
    table = scene.friction[number]
    if table.stop is not None:
        return stops.index(table.stop)
    of_areas = sum(stop.friction is not None for stop in area_stops(scene))
    return len(stops) + of_areas + len([t for t in scene.friction[:number] if t.stop is None])


def _law_of_friction(table: FrictionTable) -> Friction:
    return Friction(table.coefficient, table.at_rest, table.fading_speed, table.base_speed)


def _dry(table: FrictionTable) -> DryFriction:
    assert table.normal_force is not None
    law, spring = _law_of_friction(table), table.tangential_stiffness
    return DryFriction(table.at, table.normal_force, law, table.against, spring)


def _rough(scene: Scene, stops: list[AnyStop]) -> tuple[AnyStop, ...]:
    """The stops with the friction of those that have some."""
    for number, table in enumerate(scene.friction):
        if table.stop is None:
            continue
        if table.stop >= len(stops):
            known = f"there are {len(stops)}, counted from 0" if stops else "there are none"
            fault = f"is {table.stop}, but no stop has that number; {known}"
            raise scene_error(scene.file, ("friction", number, "stop"), fault)
        stop = stops[table.stop]
        if not isinstance(stop, Stop) or stop.friction is not None:
            fault = "is one that has friction already" if isinstance(stop, Stop) else "is rigid"
            fault += ": give each stop one friction" if isinstance(stop, Stop) else ", without any"
            raise scene_error(scene.file, ("friction", number, "stop"), fault)
        law = _law_of_friction(table)
        stops[table.stop] = replace(
            stop, tangent=table.at, friction=law, tangent_against=table.against,
            tangential_stiffness=table.tangential_stiffness,
        )  # fmt: skip
    return tuple(stops)


def _spring(table: SpringTable) -> AnySpring:
    if table.coefficients is not None:
        return PolynomialSpring(table.at, table.coefficients, table.against)
    assert table.stiffness is not None
    return Spring(table.at, table.stiffness, table.against)


def _stop(table: StopTable) -> AnyStop:
    if isinstance(table, RigidStopTable):
        return RigidStop(table.at, table.restitution, table.gap, table.direction, table.against)
    if isinstance(table, LinearStopTable):
        return _linear_stop(table)
    assert isinstance(table, HertzStopTable)
    stiffness = table.stiffness
    if stiffness is None:
        assert table.radius is not None and table.youngs_modulus is not None
        ratio = 0.3 if table.poissons_ratio is None else table.poissons_ratio
        stiffness = hertz_stiffness(table.radius, table.youngs_modulus, ratio)
    place = table.gap, table.direction, table.against
    loss = _dissipation(table)
    return Stop(table.at, stiffness, exponent_of(table), *place, loss, dashpot=table.dashpot)


def _round_stop(table: RoundClearanceTable) -> RoundStop:
    """One of those that come after the stops."""
    x, y = table.eccentricity
    (first, other), (second, beside) = table.ends
    against = None if other is None or beside is None else (other, beside)
    return RoundStop(
        (first, second),
        table.stiffness,
        table.clearance,
        exponent_of(table),
        (x, y),
        table.inside,
        against,
        table.dissipation,
        friction=table.friction,
        surface_speed=table.surface_speed,
    )


def _linear_stop(table: LinearStopTable) -> Stop:
    dashpot = table.dashpot
    if table.restitution is not None and table.mass is not None:
        dashpot = dashpot_for(table.restitution, table.stiffness, table.mass, pulls=table.pulls)
    return Stop.linear(
        table.at, table.stiffness, gap=table.gap, direction=table.direction, against=table.against,
        dissipation=_dissipation(table), dashpot=dashpot, pulls=table.pulls or not dashpot,
    )  # fmt: skip


def _dissipation(table: ElasticStopTable) -> float:
    if table.restitution is not None and table.impact_speed is not None:
        return dissipation_for(table.restitution, table.impact_speed)
    return table.dissipation or 0.0


def _excitation(scene: Scene, number: int, table: ExcitationTable) -> tuple[Excitation, ...]:
    if table.load is None:
        assert table.at is not None
        return _excitation_at(scene, number, table, table.at)
    loads = [f"{name}.{table.load}" for name in scene.components] or [table.load]
    return tuple(one for at in loads for one in _excitation_at(scene, number, table, at))


def sources_before(scene: Scene, number: int) -> int:
    """How many of the loads of a system come of the tables before one."""
    tables = enumerate(scene.excitation[:number])
    return sum(len(_excitation(scene, each, table)) for each, table in tables)


def _excitation_at(
    scene: Scene, number: int, table: ExcitationTable, at: str
) -> tuple[Excitation, ...]:
    phase, harmonic = table.phase_deg or 0.0, table.harmonic or 1
    if table.kind == "measured":
        force = _measured(scene, number, at, table)
        logger.info(f"excitation at '{at}': {force!r}")
        return force.sources
    if table.kind == "weight":
        return (ConstantForce(at, 1.0),)  # the load vector holds the acceleration
    if table.force is not None:
        return (ConstantForce(at, table.force),)
    if table.mass_times_radius is not None:
        return (Unbalance(at, table.mass_times_radius, phase, harmonic),)
    assert table.amplitude is not None
    if table.kind == "base":
        return (BaseMotion(at, table.amplitude, table.quantity or "displacement", phase, harmonic),)
    return (HarmonicForce(at, table.amplitude, phase, harmonic, table.frequency_hz),)


def _measured(scene: Scene, number: int, at: str, table: ExcitationTable) -> MeasuredForce:
    """The force whose samples a file holds, one number in a line."""
    assert table.file is not None
    path, key = scene.file.parent / table.file, ("excitation", number, "file")
    try:
        check_regular(path)
        lines = path.read_text(encoding="utf-8").splitlines()
    except (OSError, ValueError) as error:
        raise scene_error(scene.file, key, f"names {path}, which {unreadable(error)}") from None
    samples: list[float] = []
    hole = 0  # the last blank line since a sample
    for place, line in enumerate(lines, 1):
        text = line.split("#")[0].strip()
        if not text:
            hole = place if samples and "#" not in line else hole
            continue
        if hole:
            fault = f"{path}, line {hole}: is blank between samples, as if one were left out"
            raise scene_error(scene.file, key, fault, sep=": ")
        try:
            samples.append(float(text.rstrip(",;")))
        except ValueError:
            fault = f"{path}, line {place}: must be one number, the force in N, not '{line[:40]}'"
            raise scene_error(scene.file, key, fault, sep=": ") from None
    with told_as(scene, key, SystemModelError):
        return measured_force(at, np.array(samples), table.harmonics or 20, closed=table.closed)
