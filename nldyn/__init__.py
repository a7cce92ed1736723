"""Periodic orbits of reduced structures against stops: flow map, shooting, continuation.

The names are loaded when they are first asked for: `import nldyn` itself takes no time, so that
the command line answers at once.
"""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from nldyn.attractors import Attractor, AttractorOptions, classify, find_attractors
    from nldyn.basin_maps import Basins, Plane, basins
    from nldyn.branch import Branch, BranchPoint, SpecialPoint
    from nldyn.cascades import Cascade, cascade, cascades_in
    from nldyn.closed_walks import by_closed_walks
    from nldyn.contacts import Impacts, impacts
    from nldyn.continuation import continue_branch
    from nldyn.convergence import Study, converge
    from nldyn.crossover import by_crossover
    from nldyn.curve_marks import LocatedPoint, refine_special
    from nldyn.curve_plots import plot_curves, plot_orbit_curve
    from nldyn.curve_store import load_curve, load_curves, save_curves
    from nldyn.curves import Curve, continue_constant, continue_in, continue_special
    from nldyn.detour_search import by_detour
    from nldyn.diagrams import Diagram, Seed, diagram
    from nldyn.doubling import switch_at_flip
    from nldyn.elements import (
        Damper,
        HarmonicForce,
        Stop,
        Unbalance,
        dissipation_for,
        hertz_stiffness,
    )
    from nldyn.errors import SceneError, SystemModelError
    from nldyn.executors import Outcome, TaskError, run_all
    from nldyn.exploration import Coverage, Exploration, ExploreOptions
    from nldyn.fixed_point_index import index_gaps, index_sum
    from nldyn.flow import FlowMap, FlowOptions
    from nldyn.fourier import Spectrum, spectrum
    from nldyn.lifetimes import ChaosLifetime, chaos_lifetime
    from nldyn.long_term_plots import (
        plot_basins,
        plot_brute_force,
        plot_section,
        plot_spectra,
        plot_sweep,
        plot_wear,
    )
    from nldyn.lyapunov import LyapunovSpectrum, lyapunov_exponents
    from nldyn.manifolds import basin_edge, stable_manifold
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
    from nldyn.pseudo_orbit_search import by_pseudo_orbits
    from nldyn.roots import LocateError
    from nldyn.search import SearchOptions, find_orbits
    from nldyn.sections import BruteForce, brute_force, impact_section, stroboscopic_section
    from nldyn.selection import Selection, reduce_for
    from nldyn.setting import Setting
    from nldyn.simulation import Motion, simulate, sweep
    from nldyn.step_control import ContinuationOptions
    from nldyn.store import load_branch, load_branches, load_diagram, load_exploration
    from nldyn.studies import study
    from nldyn.survey import explore
    from nldyn.system import System
    from nldyn.walk import Walk
    from nldyn.wear import (
        ContactMeasures,
        SpectraMap,
        contact_measures,
        measures_table,
        spectra_map,
        spectra_table,
    )

_HOMES = {
    "attractors": "Attractor AttractorOptions classify find_attractors",
    "basin_maps": "Basins Plane basins",
    "branch": "Branch BranchPoint SpecialPoint",
    "cascades": "Cascade cascade cascades_in",
    "closed_walks": "by_closed_walks",
    "continuation": "continue_branch",
    "convergence": "Study converge",
    "crossover": "by_crossover",
    "curve_marks": "LocatedPoint refine_special",
    "curve_plots": "plot_curves plot_orbit_curve",
    "curve_store": "load_curve load_curves save_curves",
    "curves": "Curve continue_constant continue_in continue_special",
    "detour_search": "by_detour",
    "pseudo_orbit_search": "by_pseudo_orbits",
    "diagrams": "Diagram Seed diagram",
    "doubling": "switch_at_flip",
    "elements": "Damper HarmonicForce Stop Unbalance dissipation_for hertz_stiffness",
    "errors": "SceneError SystemModelError",
    "executors": "Outcome TaskError run_all",
    "exploration": "Coverage Exploration ExploreOptions",
    "fixed_point_index": "index_gaps index_sum",
    "flow": "FlowMap FlowOptions",
    "fourier": "Spectrum spectrum",
    "contacts": "Impacts impacts",
    "lifetimes": "ChaosLifetime chaos_lifetime",
    "long_term_plots": (
        "plot_basins plot_brute_force plot_section plot_spectra plot_sweep plot_wear"
    ),
    "lyapunov": "LyapunovSpectrum lyapunov_exponents",
    "manifolds": "basin_edge stable_manifold",
    "multipliers": "Stability",
    "normal_forms": "NormalForm describe normal_form switch_at_branch_point",
    "orbit": "ConvergenceError History Orbit solve_orbit",
    "orbit_plots": "plot_contact_force plot_history plot_phase_portrait plot_spectrum",
    "parameters": "Parameter",
    "plot": "plot_diagram",
    "roots": "LocateError",
    "search": "SearchOptions find_orbits",
    "sections": "BruteForce brute_force impact_section stroboscopic_section",
    "simulation": "Motion simulate sweep",
    "selection": "Selection reduce_for",
    "setting": "Setting",
    "step_control": "ContinuationOptions",
    "store": "load_branch load_branches load_diagram load_exploration",
    "studies": "study",
    "survey": "explore",
    "system": "System",
    "walk": "Walk",
    "wear": "ContactMeasures SpectraMap contact_measures measures_table spectra_map spectra_table",
}

__all__ = [
    "Attractor",
    "AttractorOptions",
    "Basins",
    "Branch",
    "BranchPoint",
    "BruteForce",
    "Cascade",
    "ChaosLifetime",
    "ContactMeasures",
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
    "Impacts",
    "LocateError",
    "LocatedPoint",
    "LyapunovSpectrum",
    "Motion",
    "NormalForm",
    "Orbit",
    "Outcome",
    "Parameter",
    "Plane",
    "SceneError",
    "SearchOptions",
    "Seed",
    "Selection",
    "Setting",
    "SpecialPoint",
    "SpectraMap",
    "Spectrum",
    "Stability",
    "Stop",
    "Study",
    "System",
    "SystemModelError",
    "TaskError",
    "Unbalance",
    "Walk",
    "basin_edge",
    "basins",
    "brute_force",
    "by_closed_walks",
    "by_crossover",
    "by_detour",
    "by_pseudo_orbits",
    "cascade",
    "cascades_in",
    "chaos_lifetime",
    "classify",
    "contact_measures",
    "continue_branch",
    "continue_constant",
    "continue_in",
    "continue_special",
    "converge",
    "describe",
    "diagram",
    "dissipation_for",
    "explore",
    "find_attractors",
    "find_orbits",
    "hertz_stiffness",
    "impact_section",
    "impacts",
    "index_gaps",
    "index_sum",
    "load_branch",
    "load_branches",
    "load_curve",
    "load_curves",
    "load_diagram",
    "load_exploration",
    "lyapunov_exponents",
    "measures_table",
    "normal_form",
    "plot_basins",
    "plot_brute_force",
    "plot_contact_force",
    "plot_curves",
    "plot_diagram",
    "plot_history",
    "plot_orbit_curve",
    "plot_phase_portrait",
    "plot_section",
    "plot_spectra",
    "plot_spectrum",
    "plot_sweep",
    "plot_wear",
    "reduce_for",
    "refine_special",
    "run_all",
    "save_curves",
    "simulate",
    "solve_orbit",
    "spectra_map",
    "spectra_table",
    "spectrum",
    "stable_manifold",
    "stroboscopic_section",
    "study",
    "sweep",
    "switch_at_branch_point",
    "switch_at_flip",
]


def __getattr__(name: str) -> object:
    for home, names in _HOMES.items():
        if name in names.split():
            return getattr(import_module(f"nldyn.{home}"), name)
    raise AttributeError(f"module 'nldyn' has no attribute '{name}'")
