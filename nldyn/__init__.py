"""Periodic orbits of reduced structures against stops: flow map, shooting, continuation."""

from nldyn.elements import Damper, HarmonicForce, Stop, Unbalance, hertz_stiffness
from nldyn.errors import SceneError, SystemModelError
from nldyn.flow import FlowMap, FlowOptions
from nldyn.system import System

__all__ = [
    "Damper",
    "FlowMap",
    "FlowOptions",
    "HarmonicForce",
    "SceneError",
    "Stop",
    "System",
    "SystemModelError",
    "Unbalance",
    "hertz_stiffness",
]
