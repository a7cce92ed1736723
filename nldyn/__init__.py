"""Periodic orbits of reduced structures against stops: flow map, shooting, continuation."""

from nldyn.kernel_cache import ensure_cache

ensure_cache()  # before the kernels are imported

# ruff: noqa: E402
from nldyn.branch import Branch, BranchPoint, SpecialPoint
from nldyn.continuation import ContinuationOptions, Walk, continue_branch, switch_at_flip
from nldyn.diagram import Diagram, Seed, diagram
from nldyn.elements import Damper, HarmonicForce, Stop, Unbalance, hertz_stiffness
from nldyn.errors import SceneError, SystemModelError
from nldyn.flow import FlowMap, FlowOptions
from nldyn.orbit import ConvergenceError, History, Orbit, solve_orbit
from nldyn.search import SearchOptions, find_orbits
from nldyn.special import LocateError
from nldyn.system import System

__all__ = [
    "Branch",
    "BranchPoint",
    "ContinuationOptions",
    "ConvergenceError",
    "Damper",
    "Diagram",
    "FlowMap",
    "FlowOptions",
    "HarmonicForce",
    "History",
    "LocateError",
    "Orbit",
    "SceneError",
    "SearchOptions",
    "Seed",
    "SpecialPoint",
    "Stop",
    "System",
    "SystemModelError",
    "Unbalance",
    "Walk",
    "continue_branch",
    "diagram",
    "find_orbits",
    "hertz_stiffness",
    "solve_orbit",
    "switch_at_flip",
]
