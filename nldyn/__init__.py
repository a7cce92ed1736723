"""Periodic orbits of reduced structures against stops: flow map, shooting, continuation.

The names are loaded when they are first asked for: `import nldyn` itself takes no time, so that
the command line answers at once.
"""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from nldyn.base.errors import ConvergenceError, LocateError, SceneError, SystemModelError
    from nldyn.bifurcations.normal_forms import (
        NormalForm,
        describe,
        normal_form,
        switch_at_branch_point,
    )
    from nldyn.bifurcations.period_doubling import switch_at_flip
    from nldyn.bifurcations.point import BranchPoint, SpecialPoint
    from nldyn.branches.arclength import Walk
    from nldyn.branches.branch import Branch
    from nldyn.branches.cascades import Cascade, cascade, cascades_in
    from nldyn.branches.continuation import continue_branch
    from nldyn.branches.options import ContinuationOptions
    from nldyn.curves.curves import Curve, continue_constant, continue_in, continue_special
    from nldyn.curves.marks import LocatedPoint, refine_special
    from nldyn.flow.flow_map import FlowMap
    from nldyn.flow.options import FlowOptions
    from nldyn.io.branches import load_branch, load_branches, load_diagram, load_exploration
    from nldyn.io.curves import load_curve, load_curves, save_curves
    from nldyn.longterm.attractors import Attractor, AttractorOptions, classify, find_attractors
    from nldyn.longterm.basins import Basins, Plane, basins
    from nldyn.longterm.impacts import Impacts, impacts
    from nldyn.longterm.lifetimes import ChaosLifetime, chaos_lifetime
    from nldyn.longterm.lyapunov import LyapunovSpectrum, lyapunov_exponents
    from nldyn.longterm.manifolds import basin_edge, stable_manifold
    from nldyn.longterm.poincare import (
        BruteForce,
        brute_force,
        impact_section,
        stroboscopic_section,
    )
    from nldyn.longterm.simulation import Motion, simulate, sweep
    from nldyn.longterm.wear import (
        ContactMeasures,
        SpectraMap,
        contact_measures,
        measures_table,
        spectra_map,
        spectra_table,
    )
    from nldyn.orbits.harmonics import Spectrum, spectrum
    from nldyn.orbits.multipliers import Stability
    from nldyn.orbits.orbit import History, Orbit
    from nldyn.orbits.solve import solve_orbit
    from nldyn.orbits.starts import SearchOptions, find_orbits
    from nldyn.plot.curves import plot_curves, plot_orbit_curve
    from nldyn.plot.diagram import plot_diagram
    from nldyn.plot.longterm import (
        plot_basins,
        plot_brute_force,
        plot_section,
        plot_spectra,
        plot_sweep,
        plot_wear,
    )
    from nldyn.plot.orbit import (
        plot_contact_force,
        plot_history,
        plot_phase_portrait,
        plot_spectrum,
    )
    from nldyn.reduction.convergence import Study, converge
    from nldyn.reduction.selection import Selection, reduce_for
    from nldyn.reduction.setting import Setting
    from nldyn.runtime.executors import Outcome, TaskError, run_all
    from nldyn.scene.study import study
    from nldyn.search.by_pseudo_orbits import by_pseudo_orbits
    from nldyn.search.diagram import Diagram, Seed, diagram
    from nldyn.search.exploration import Coverage, Exploration, ExploreOptions
    from nldyn.search.explore import explore
    from nldyn.search.fixed_point_index import index_gaps, index_sum
    from nldyn.search.homotopy import by_detour
    from nldyn.search.mixtures import by_crossover
    from nldyn.search.random_walks import by_closed_walks
    from nldyn.system.elements import (
        Damper,
        HarmonicForce,
        Stop,
        Unbalance,
        dissipation_for,
        hertz_stiffness,
    )
    from nldyn.system.parameters import Parameter
    from nldyn.system.system import System

_HOMES = {
    "longterm.attractors": "Attractor AttractorOptions classify find_attractors",
    "longterm.basins": "Basins Plane basins",
    "branches.branch": "Branch BranchPoint SpecialPoint",
    "branches.cascades": "Cascade cascade cascades_in",
    "search.random_walks": "by_closed_walks",
    "branches.continuation": "continue_branch",
    "reduction.convergence": "Study converge",
    "search.mixtures": "by_crossover",
    "curves.marks": "LocatedPoint refine_special",
    "plot.curves": "plot_curves plot_orbit_curve",
    "io.curves": "load_curve load_curves save_curves",
    "curves.curves": "Curve continue_constant continue_in continue_special",
    "search.homotopy": "by_detour",
    "search.by_pseudo_orbits": "by_pseudo_orbits",
    "search.diagram": "Diagram Seed diagram",
    "bifurcations.period_doubling": "switch_at_flip",
    "system.elements": "Damper HarmonicForce Stop Unbalance dissipation_for hertz_stiffness",
    "base.errors": "SceneError SystemModelError",
    "runtime.executors": "Outcome TaskError run_all",
    "search.exploration": "Coverage Exploration ExploreOptions",
    "search.fixed_point_index": "index_gaps index_sum",
    "flow.flow_map": "FlowMap FlowOptions",
    "orbits.harmonics": "Spectrum spectrum",
    "longterm.impacts": "Impacts impacts",
    "longterm.lifetimes": "ChaosLifetime chaos_lifetime",
    "plot.longterm": (
        "plot_basins plot_brute_force plot_section plot_spectra plot_sweep plot_wear"
    ),
    "longterm.lyapunov": "LyapunovSpectrum lyapunov_exponents",
    "longterm.manifolds": "basin_edge stable_manifold",
    "orbits.multipliers": "Stability",
    "bifurcations.normal_forms": "NormalForm describe normal_form switch_at_branch_point",
    "orbits.orbit": "ConvergenceError History Orbit solve_orbit",
    "plot.orbit": "plot_contact_force plot_history plot_phase_portrait plot_spectrum",
    "system.parameters": "Parameter",
    "plot.diagram": "plot_diagram",
    "bifurcations.roots": "LocateError",
    "orbits.starts": "SearchOptions find_orbits",
    "longterm.poincare": "BruteForce brute_force impact_section stroboscopic_section",
    "longterm.simulation": "Motion simulate sweep",
    "reduction.selection": "Selection reduce_for",
    "reduction.setting": "Setting",
    "branches.options": "ContinuationOptions",
    "io.branches": "load_branch load_branches load_diagram load_exploration",
    "scene.study": "study",
    "search.explore": "explore",
    "system.system": "System",
    "branches.arclength": "Walk",
    "longterm.wear": "ContactMeasures SpectraMap contact_measures measures_table spectra_map spectra_table",
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
