"""Stops, dampers and excitation of a scene."""

from __future__ import annotations

from typing import NamedTuple

from nldyn.base.errors import SystemModelError
from nldyn.scene.faults import told_as
from nldyn.scene.schema import ExcitationTable, Scene, StopTable
from nldyn.system.elements import (
    Damper,
    Excitation,
    HarmonicForce,
    Stop,
    Unbalance,
    dissipation_for,
    hertz_stiffness,
)


class Acting(NamedTuple):
    """What acts at the interfaces of a structure."""

    stops: tuple[Stop, ...]
    dampers: tuple[Damper, ...]
    excitation: tuple[Excitation, ...]


def acting_elements(scene: Scene) -> Acting:
    """The stops, dampers and excitation of a scene; a `SceneError` says what is wrong with one."""
    with told_as(scene, (), SystemModelError):
        return Acting(
            tuple(_stop(stop) for stop in scene.stops),
            tuple(Damper(damper.at, damper.coefficient) for damper in scene.dampers),
            tuple(_excitation(table) for table in scene.excitation),
        )


def _stop(table: StopTable) -> Stop:
    stiffness = table.stiffness
    if stiffness is None:
        assert table.radius is not None and table.youngs_modulus is not None
        ratio = 0.3 if table.poissons_ratio is None else table.poissons_ratio
        stiffness = hertz_stiffness(table.radius, table.youngs_modulus, ratio)
    exponent = 1.0 if table.law == "linear" else table.exponent or 1.5
    loss = table.dissipation or 0.0
    if table.restitution is not None and table.impact_speed is not None:
        loss = dissipation_for(table.restitution, table.impact_speed)
    return Stop(table.at, stiffness, exponent, table.gap, table.direction, table.against, loss)


def _excitation(table: ExcitationTable) -> Excitation:
    if table.mass_times_radius is not None:
        return Unbalance(table.at, table.mass_times_radius, table.phase_deg)
    assert table.amplitude is not None
    return HarmonicForce(table.at, table.amplitude, table.phase_deg)
