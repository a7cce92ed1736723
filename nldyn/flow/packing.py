"""A system's numbers as the engine takes them."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from nldyn.base.arrays import Complex
from nldyn.base.errors import check_types
from nldyn.engine.layout import FIRST_POWER, StopRow
from nldyn.flow.options import FlowOptions
from nldyn.system.contact_law import duration_factor
from nldyn.system.friction import Slider
from nldyn.system.parameters import (
    OF_AREAS,
    OF_ROUND,
    OF_SLIDERS,
    OF_SPRINGS,
    OF_STOPS,
    Parameter,
    check_exact,
)
from nldyn.system.rigid_stop import AnyStop, RigidStop
from nldyn.system.round_stop import RoundStop
from nldyn.system.springs_dampers import Bond
from nldyn.system.system import System

_NO_STOP = StopRow(0.0, 1.0, 1.0, 0.0, 0.0, 1.0, 1.0, 0.0)  # what has no elastic contact
_COLUMNS = {name: StopRow._fields.index(name) for name in OF_STOPS}
_EXCITATION = -1
_OF_SLIDERS = {
    "friction": "friction",
    "normal_force": "pressing",
    "tangential_stiffness": "tangential",
}


def stop_row(
    stop: AnyStop, mobility: float, options: FlowOptions, releases: Iterator[float]
) -> StopRow:
    """Numbers of a stop as the engine takes them, with its mobility in 1/kg.

    `releases` are the outputs that tell when stops let go that never pull.
    """
    if isinstance(stop, RigidStop):
        restitution = 0.0 if callable(stop.restitution) else float(stop.restitution)
        return _NO_STOP._replace(
            gap=stop.gap,
            mobility=mobility,
            instant=options.instant(0.0),
            restitution=restitution,
        )
    if isinstance(stop, RoundStop) and stop.restitution is not None:
        rigid = _NO_STOP._replace(
            mobility=mobility, instant=options.instant(0.0), restitution=stop.restitution
        )
        return _around(rigid, stop, 0)
    row = StopRow(
        gap=stop.gap,
        stiffness=stop.stiffness,
        exponent=stop.exponent,
        dissipation=stop.dissipation,
        dashpot=stop.dashpot,
        mobility=mobility,
        duration=duration_factor(stop.exponent),
        instant=options.instant(0.0 if stop.dashpot else stop.exponent),
        release=-1.0 if stop.pulls else next(releases),
    )
    return _around(row, stop, 0) if isinstance(stop, RoundStop) else row


def _around(row: StopRow, stop: RoundStop, direction: int) -> StopRow:
    """A row with the numbers of one direction of a round clearance."""
    return row._replace(
        gap=stop.clearance if direction == 0 else row.gap,
        centre=stop.eccentricity[direction],
        sense=stop.sense,
        rub=stop.friction,
        surface=stop.sliding_speed,
    )


def second_row(stop: RoundStop, lead: int, mobility: float, options: FlowOptions) -> StopRow:
    """Numbers of the second direction of a round clearance as the engine takes them."""
    row = _NO_STOP._replace(
        mobility=mobility,
        exponent=stop.exponent,
        instant=options.instant(0.0 if stop.friction else stop.exponent),
        lead=float(lead),
    )
    return _around(row, stop, 1)


def of_areas(system: System, rows: Sequence[StopRow]) -> list[StopRow]:
    """Rows of stops and sliders with the areas of contact that they belong to."""
    area = {i: float(number) for number, of in enumerate(system.areas.values()) for i in of}
    places = [*range(len(system.stops)), *(slider.stop for slider in system.sliders)]
    shares = [getattr(stop, "share", 1.0) for stop in system.stops]
    return [
        row._replace(area=area[place], share=shares[place]) if place in area else row
        for row, place in zip(rows, places, strict=True)
    ]


def bond_row(bond: Bond, mobility: float) -> StopRow:
    """Numbers of a bond as the engine takes them, but for the coefficients of its powers."""
    return _NO_STOP._replace(mobility=mobility, bond=1.0, drag=bond.drag, cubic=bond.cubic)


def slider_row(slider: Slider, mobility: float, options: FlowOptions, place: int) -> StopRow:
    """Numbers of a slider as the engine takes them; its place in the state if it has a spring."""
    friction = slider.friction
    row = _NO_STOP._replace(
        mobility=mobility,
        instant=options.instant(0.0),
        friction=friction.coefficient,
        adhesion=friction.adhesion,
        fading=friction.fading_speed or 0.0,
        belt=friction.base_speeds[0],
        normal=float(slider.stop),
        pressing=slider.normal_force,
    )
    if slider.tangential_stiffness is None:
        return row
    return row._replace(
        tangential=slider.tangential_stiffness,
        place=float(place),
        place_rate=friction.base_speeds[0] / math.sqrt(mobility),
        belt=0.0,  # the place goes with it
    )


def second_tangent_row(first: StopRow, slider: Slider, mobility: float, place: int) -> StopRow:
    """Numbers of the second tangent of a slider over a plane, by those of its first one."""
    if slider.tangential_stiffness is None:
        return first._replace(mobility=mobility, belt=slider.friction.base_speeds[1])
    return first._replace(
        mobility=mobility,
        place=float(place),
        place_rate=slider.friction.base_speeds[1] / math.sqrt(mobility),
    )


def mover_row(slider: int, mobility: float) -> StopRow:
    """Numbers of what moves the place of a slider over a plane, along one of its tangents."""
    return _NO_STOP._replace(mobility=mobility, moves=float(slider))


def parameter_tables(
    system: System, parameters: Sequence[Parameter]
) -> tuple[NDArray[np.int64], Complex]:
    """What the engine needs to know of parameters: see `engine.newton.newton`.

    Raises
    ------
    SystemModelError
        For a parameter that the system does not have.
    """
    check_types(parameters=(parameters, Sequence))
    for parameter in parameters:
        check_types(**{"parameters: entry": (parameter, Parameter)})
    table = np.zeros((len(parameters), 2), dtype=np.int64)
    drive_by = np.zeros((len(parameters), *system.drive.shape), dtype=complex)
    for row, parameter in enumerate(parameters):
        check_exact(system, parameter)
        name, index = parameter.name, parameter.index
        if name in OF_AREAS:
            table[row] = StopRow._fields.index(OF_AREAS[name]), -2 - index
        elif name in _COLUMNS:
            table[row] = _COLUMNS[name], index
        elif name in OF_ROUND:
            before = len(system.stops) + len(system.sliders) + len(system.bonds)
            second = before + list(system.round_stops).index(index)
            column = {"clearance": "gap", "rubbing_friction": "rub"}.get(name, "centre")
            of = second if name == "second_eccentricity" else index
            table[row] = StopRow._fields.index(column), of
        elif name in OF_SLIDERS:
            column = _OF_SLIDERS[name]
            table[row] = StopRow._fields.index(column), len(system.stops) + index
        elif name in OF_SPRINGS:
            spring = system.springs[index]
            place = [(bond.at, bond.against) for bond in system.bonds]
            before = len(system.stops) + len(system.sliders)
            bond = before + place.index((spring.at, spring.against))
            table[row] = FIRST_POWER + OF_SPRINGS.index(name), bond
        else:
            table[row] = _EXCITATION, index
            size: dict[str, Any] = {name: 1.0}
            unit = replace(system.excitation[index], **size)
            drive_by[row] = system.drive_of([unit])
    return table, drive_by
