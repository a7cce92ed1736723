"""Periodic orbits of reduced structures against stops: flow map, shooting, continuation.

The names are loaded when they are first asked for: `import nldyn` itself takes no time, so that
the command line answers at once.
"""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from nldyn.branch import Branch, BranchPoint, SpecialPoint
    from nldyn.cascades import Cascade, cascade, cascades_in
    from nldyn.continuation import ContinuationOptions, Walk, continue_branch, switch_at_flip
    from nldyn.diagrams import Diagram, Seed, diagram
    from nldyn.elements import (
        Damper,
        HarmonicForce,
        Stop,
        Unbalance,
        dissipation_for,
        hertz_stiffness,
    )
    from nldyn.errors import SceneError, SystemModelError
    from nldyn.flow import FlowMap, FlowOptions
    from nldyn.multipliers import Stability
    from nldyn.normal_forms import NormalForm, describe, normal_form, switch_at_branch_point
    from nldyn.orbit import ConvergenceError, History, Orbit, solve_orbit
    from nldyn.parameters import Parameter
    from nldyn.search import SearchOptions, find_orbits
    from nldyn.special import LocateError
    from nldyn.system import System

_HOMES = {
    "branch": "Branch BranchPoint SpecialPoint",
    "cascades": "Cascade cascade cascades_in",
    "continuation": "ContinuationOptions Walk continue_branch switch_at_flip",
    "diagrams": "Diagram Seed diagram",
    "elements": "Damper HarmonicForce Stop Unbalance dissipation_for hertz_stiffness",
    "errors": "SceneError SystemModelError",
    "flow": "FlowMap FlowOptions",
    "multipliers": "Stability",
    "normal_forms": "NormalForm describe normal_form switch_at_branch_point",
    "orbit": "ConvergenceError History Orbit solve_orbit",
    "parameters": "Parameter",
    "search": "SearchOptions find_orbits",
    "special": "LocateError",
    "system": "System",
}

__all__ = [
    "Branch",
    "BranchPoint",
    "Cascade",
    "ContinuationOptions",
    "ConvergenceError",
    "Damper",
    "Diagram",
    "FlowMap",
    "FlowOptions",
    "HarmonicForce",
    "History",
    "LocateError",
    "NormalForm",
    "Orbit",
    "Parameter",
    "SceneError",
    "SearchOptions",
    "Seed",
    "SpecialPoint",
    "Stability",
    "Stop",
    "System",
    "SystemModelError",
    "Unbalance",
    "Walk",
    "cascade",
    "cascades_in",
    "continue_branch",
    "describe",
    "diagram",
    "dissipation_for",
    "find_orbits",
    "hertz_stiffness",
    "normal_form",
    "solve_orbit",
    "switch_at_branch_point",
    "switch_at_flip",
]


def __getattr__(name: str) -> object:
    for home, names in _HOMES.items():
        if name in names.split():
            return getattr(import_module(f"nldyn.{home}"), name)
    raise AttributeError(f"module 'nldyn' has no attribute '{name}'")
