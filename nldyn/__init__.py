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
    from nldyn.convergence import Study, converge
    from nldyn.curve_marks import LocatedPoint, refine_special
    from nldyn.curve_plots import plot_curves
    from nldyn.curve_store import load_curve, load_curves, save_curves
    from nldyn.curves import Curve, continue_constant, continue_in, continue_special
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
    from nldyn.exploration import Coverage, Exploration, ExploreOptions, explore
    from nldyn.flow import FlowMap, FlowOptions
    from nldyn.fourier import Spectrum, spectrum
    from nldyn.multipliers import Stability
    from nldyn.normal_forms import NormalForm, describe, normal_form, switch_at_branch_point
    from nldyn.orbit import ConvergenceError, History, Orbit, solve_orbit
    from nldyn.orbit_plots import (
        plot_contact_force,
        plot_history,
        plot_phase_portrait,
        plot_spectrum,
    )
    from nldyn.parameters import Parameter
    from nldyn.plot import plot_diagram
    from nldyn.search import SearchOptions, find_orbits
    from nldyn.selection import Selection, reduce_for
    from nldyn.setting import Setting
    from nldyn.special import LocateError
    from nldyn.store import load_branch, load_branches, load_diagram, load_exploration
    from nldyn.system import System

_HOMES = {
    "branch": "Branch BranchPoint SpecialPoint",
    "cascades": "Cascade cascade cascades_in",
    "continuation": "ContinuationOptions Walk continue_branch switch_at_flip",
    "convergence": "Study converge",
    "curve_marks": "LocatedPoint refine_special",
    "curve_plots": "plot_curves",
    "curve_store": "load_curve load_curves save_curves",
    "curves": "Curve continue_constant continue_in continue_special",
    "diagrams": "Diagram Seed diagram",
    "elements": "Damper HarmonicForce Stop Unbalance dissipation_for hertz_stiffness",
    "exploration": "Coverage Exploration ExploreOptions explore",
    "errors": "SceneError SystemModelError",
    "flow": "FlowMap FlowOptions",
    "multipliers": "Stability",
    "fourier": "Spectrum spectrum",
    "normal_forms": "NormalForm describe normal_form switch_at_branch_point",
    "orbit": "ConvergenceError History Orbit solve_orbit",
    "orbit_plots": "plot_contact_force plot_history plot_phase_portrait plot_spectrum",
    "parameters": "Parameter",
    "plot": "plot_diagram",
    "search": "SearchOptions find_orbits",
    "selection": "Selection reduce_for",
    "setting": "Setting",
    "special": "LocateError",
    "store": "load_branch load_branches load_diagram load_exploration",
    "system": "System",
}

__all__ = [
    "Branch",
    "BranchPoint",
    "Cascade",
    "ContinuationOptions",
    "ConvergenceError",
    "Coverage",
    "Curve",
    "Damper",
    "Diagram",
    "Exploration",
    "ExploreOptions",
    "FlowMap",
    "FlowOptions",
    "HarmonicForce",
    "History",
    "LocateError",
    "LocatedPoint",
    "NormalForm",
    "Orbit",
    "Parameter",
    "SceneError",
    "SearchOptions",
    "Seed",
    "Selection",
    "Setting",
    "SpecialPoint",
    "Spectrum",
    "Stability",
    "Stop",
    "Study",
    "System",
    "SystemModelError",
    "Unbalance",
    "Walk",
    "cascade",
    "cascades_in",
    "continue_branch",
    "continue_constant",
    "continue_in",
    "continue_special",
    "converge",
    "describe",
    "diagram",
    "dissipation_for",
    "explore",
    "find_orbits",
    "hertz_stiffness",
    "load_branch",
    "load_branches",
    "load_curve",
    "load_curves",
    "load_diagram",
    "load_exploration",
    "normal_form",
    "plot_contact_force",
    "plot_curves",
    "plot_diagram",
    "plot_history",
    "plot_phase_portrait",
    "plot_spectrum",
    "reduce_for",
    "refine_special",
    "save_curves",
    "solve_orbit",
    "spectrum",
    "switch_at_branch_point",
    "switch_at_flip",
]


def __getattr__(name: str) -> object:
    for home, names in _HOMES.items():
        if name in names.split():
            return getattr(import_module(f"nldyn.{home}"), name)
    raise AttributeError(f"module 'nldyn' has no attribute '{name}'")
