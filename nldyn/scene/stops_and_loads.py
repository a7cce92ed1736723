"""Stops, dampers and excitation of a scene."""

from __future__ import annotations

import logging
from dataclasses import replace
from typing import Any

import numpy as np

from nldyn.base.errors import SystemModelError
from nldyn.scene.contact import area_stops
from nldyn.scene.faults import check_regular, told_as, unreadable
from nldyn.scene.messages import scene_error
from nldyn.scene.schema.connections import FrictionTable
from nldyn.scene.schema.loads import AnyExcitationTable, MeasuredTable
from nldyn.scene.schema.scene import Scene
from nldyn.system.loads import Excitation
from nldyn.system.measured import MeasuredForce, measured_force
from nldyn.system.rigid_stop import AnyStop, RigidStop
from nldyn.system.stop import Stop
from nldyn.system.system import Elements

logger = logging.getLogger("nldyn")


def acting_elements(scene: Scene) -> Elements:
    """The stops, dampers and excitation of a scene; a `SceneError` says what is wrong with one."""
    with told_as(scene, (), SystemModelError):
        return Elements(
            stops=(
                *_rough(scene, [stop.made() for stop in scene.stops]),
                *(each.made() for each in scene.round_clearances),
                *area_stops(scene),
            ),
            dampers=(
                *(each.made() for each in scene.dampers),
                *(each.made() for each in dry_tables(scene)),
            ),
            excitation=tuple(
                source
                for number, table in enumerate(scene.excitation)
                for source in _excitation(scene, number, table)
            ),
            springs=tuple(spring.made() for spring in scene.interface_springs.values()),
        )


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
        assert isinstance(stop, Stop | RigidStop)
        if stop.friction is not None:
            fault = "is one that has friction already: give each stop one friction"
            raise scene_error(scene.file, ("friction", number, "stop"), fault)
        rough: dict[str, Any] = {"tangent": table.at, "tangent_against": table.against}
        rough["friction"] = table.of_coulomb
        rough["second_tangent"] = table.second_tangent
        rough["second_tangent_against"] = table.second_tangent_against
        if isinstance(stop, Stop):
            rough["tangential_stiffness"] = table.tangential_stiffness
        elif table.tangential_stiffness is not None:
            fault = f"is not for stop {table.stop}, which is rigid and has no spring along it"
            raise scene_error(scene.file, ("friction", number, "tangential_stiffness"), fault)
        stops[table.stop] = replace(stop, **rough)
    return tuple(stops)


def _excitation(scene: Scene, number: int, table: AnyExcitationTable) -> tuple[Excitation, ...]:
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
    scene: Scene, number: int, table: AnyExcitationTable, at: str
) -> tuple[Excitation, ...]:
    if isinstance(table, MeasuredTable):
        force = _measured(scene, number, at, table)
        logger.info(f"excitation at '{at}': {force!r}")
        return force.sources
    return (table.made(at),)


def _measured(scene: Scene, number: int, at: str, table: MeasuredTable) -> MeasuredForce:
    """The force whose samples a file holds, one number in a line."""
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
        return measured_force(at, np.array(samples), table.harmonics, closed=table.closed)
