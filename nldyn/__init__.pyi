"""The public names of nldyn, each with its home; `nldyn/__init__.py` loads them from this list."""

# base
from nldyn.base.errors import ConvergenceError as ConvergenceError
from nldyn.base.errors import LocateError as LocateError
from nldyn.base.errors import SceneError as SceneError
from nldyn.base.errors import SystemModelError as SystemModelError

# bifurcations
from nldyn.bifurcations.normal_forms import NormalForm as NormalForm
from nldyn.bifurcations.normal_forms import describe_special as describe_special
from nldyn.bifurcations.normal_forms import normal_form as normal_form
from nldyn.bifurcations.point import SpecialPoint as SpecialPoint
from nldyn.bifurcations.switching import switch_branch as switch_branch

# branches
from nldyn.branches.backbone import Backbone as Backbone
from nldyn.branches.backbone import backbone as backbone
from nldyn.branches.branch import Branch as Branch
from nldyn.branches.cascades import Cascade as Cascade
from nldyn.branches.cascades import cascade as cascade
from nldyn.branches.continuation import continue_branch as continue_branch
from nldyn.branches.step_control import ContinuationOptions as ContinuationOptions

# curves
from nldyn.curves.curves import Curve as Curve
from nldyn.curves.curves import continue_constant as continue_constant
from nldyn.curves.curves import continue_orbit as continue_orbit
from nldyn.curves.curves import continue_special as continue_special
from nldyn.curves.marks import refine_special as refine_special
from nldyn.curves.phase_resonance import phase_resonance as phase_resonance

# flow
from nldyn.flow.flow_map import FlowMap as FlowMap
from nldyn.flow.options import FlowOptions as FlowOptions

# io
from nldyn.io.checkpoint import CheckpointFile as CheckpointFile
from nldyn.io.history_files import write_history as write_history
from nldyn.io.store import load as load
from nldyn.io.store import save as save

# longterm
from nldyn.longterm.attractors import Attractor as Attractor
from nldyn.longterm.attractors import classify_attractor as classify_attractor
from nldyn.longterm.attractors import find_attractors as find_attractors
from nldyn.longterm.basins import Basins as Basins
from nldyn.longterm.basins import StatePlane as StatePlane
from nldyn.longterm.basins import basins as basins
from nldyn.longterm.contact_measures import contact_measures as contact_measures
from nldyn.longterm.contact_measures import spectra_map as spectra_map
from nldyn.longterm.impacts import impacts as impacts
from nldyn.longterm.lifetimes import chaos_lifetime as chaos_lifetime
from nldyn.longterm.lyapunov import lyapunov_exponents as lyapunov_exponents
from nldyn.longterm.manifolds import basin_edge as basin_edge
from nldyn.longterm.manifolds import stable_manifold as stable_manifold
from nldyn.longterm.poincare import brute_force as brute_force
from nldyn.longterm.poincare import impact_section as impact_section
from nldyn.longterm.poincare import stroboscopic_section as stroboscopic_section
from nldyn.longterm.simulation import Motion as Motion
from nldyn.longterm.simulation import simulate as simulate
from nldyn.longterm.simulation import sweep as sweep

# orbits
from nldyn.orbits.harmonics import Harmonics as Harmonics
from nldyn.orbits.harmonics import harmonics as harmonics
from nldyn.orbits.history import History as History
from nldyn.orbits.multipliers import Stability as Stability
from nldyn.orbits.orbit import Orbit as Orbit
from nldyn.orbits.solve import solve_orbit as solve_orbit
from nldyn.orbits.starts import OrbitSearchOptions as OrbitSearchOptions
from nldyn.orbits.starts import find_orbits as find_orbits

# reduction
from nldyn.reduction.convergence import ConvergenceStudy as ConvergenceStudy
from nldyn.reduction.convergence import convergence_study as convergence_study
from nldyn.reduction.load_case import LoadCase as LoadCase
from nldyn.reduction.selection import ModeSelection as ModeSelection
from nldyn.reduction.selection import select_modes as select_modes

# runtime
from nldyn.runtime.executors import run_all as run_all

# scene
from nldyn.scene.study import parameter_study as parameter_study

# search
from nldyn.search.diagram import Diagram as Diagram
from nldyn.search.diagram import SubharmonicSeed as SubharmonicSeed
from nldyn.search.diagram import diagram as diagram
from nldyn.search.exploration import Exploration as Exploration
from nldyn.search.exploration import ExploreOptions as ExploreOptions
from nldyn.search.explore import explore as explore
from nldyn.search.extend import extend_diagram as extend_diagram
from nldyn.search.fixed_point_index import index_sum as index_sum
from nldyn.search.mixtures import Mixtures as Mixtures
from nldyn.search.pseudo_orbits import PseudoOrbits as PseudoOrbits
from nldyn.search.random_walks import ClosedWalks as ClosedWalks

# system
from nldyn.system.loads import BaseMotion as BaseMotion
from nldyn.system.loads import ConstantForce as ConstantForce
from nldyn.system.loads import HarmonicForce as HarmonicForce
from nldyn.system.loads import Unbalance as Unbalance
from nldyn.system.measured import MeasuredForce as MeasuredForce
from nldyn.system.measured import measured_force as measured_force
from nldyn.system.parameters import Parameter as Parameter
from nldyn.system.rigid_stop import RigidStop as RigidStop
from nldyn.system.spin import Spin as Spin
from nldyn.system.springs_dampers import CubicDamper as CubicDamper
from nldyn.system.springs_dampers import Damper as Damper
from nldyn.system.springs_dampers import PolynomialSpring as PolynomialSpring
from nldyn.system.springs_dampers import Spring as Spring
from nldyn.system.stop import Stop as Stop
from nldyn.system.stop import dashpot_for as dashpot_for
from nldyn.system.stop import dissipation_for as dissipation_for
from nldyn.system.stop import hertz_stiffness as hertz_stiffness
from nldyn.system.system import System as System
