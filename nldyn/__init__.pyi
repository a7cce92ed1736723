"""The face of nldyn: the names that most need, and the sub-packages that hold the others.

Each name stands with its home, from which it is loaded when it is first asked for.
"""

# sub-packages, each with the list of what else it offers
from nldyn import bifurcations as bifurcations
from nldyn import branches as branches
from nldyn import curves as curves
from nldyn import io as io
from nldyn import longterm as longterm
from nldyn import orbits as orbits
from nldyn import plot as plot
from nldyn import reduction as reduction
from nldyn import runtime as runtime
from nldyn import scene as scene
from nldyn import search as search
from nldyn import system as system

# base: errors
from nldyn.base.errors import ConvergenceError as ConvergenceError
from nldyn.base.errors import LocateError as LocateError
from nldyn.base.errors import SceneError as SceneError
from nldyn.base.errors import SystemModelError as SystemModelError

# bifurcations: special points
from nldyn.bifurcations.events import Event as Event
from nldyn.bifurcations.normal_forms import describe_special as describe_special
from nldyn.bifurcations.normal_forms import normal_form as normal_form
from nldyn.bifurcations.point import SpecialPoint as SpecialPoint
from nldyn.bifurcations.switching import switch_branch as switch_branch

# branches: families of orbits in the frequency
from nldyn.branches.branch import Branch as Branch
from nldyn.branches.cascades import cascade as cascade
from nldyn.branches.continuation import continue_branch as continue_branch
from nldyn.branches.step_control import ContinuationOptions as ContinuationOptions

# curves: families in two parameters, and of free motions
from nldyn.curves.backbone import backbone as backbone
from nldyn.curves.curves import continue_constant as continue_constant
from nldyn.curves.curves import continue_special as continue_special
from nldyn.curves.resonances import phase_resonance as phase_resonance

# flow: from one state to the next
from nldyn.flow.flow_map import FlowMap as FlowMap
from nldyn.flow.options import FlowOptions as FlowOptions

# io: files of results
from nldyn.io.store import load as load
from nldyn.io.store import save as save

# longterm: what motions do
from nldyn.longterm.attractors import classify_attractor as classify_attractor
from nldyn.longterm.attractors import find_attractors as find_attractors
from nldyn.longterm.basins import StatePlane as StatePlane
from nldyn.longterm.basins import basins as basins
from nldyn.longterm.impacts import impacts as impacts
from nldyn.longterm.lyapunov import lyapunov_exponents as lyapunov_exponents
from nldyn.longterm.simulation import Motion as Motion
from nldyn.longterm.simulation import simulate as simulate
from nldyn.longterm.simulation import sweep as sweep

# orbits: one periodic orbit
from nldyn.orbits.harmonics import harmonics as harmonics
from nldyn.orbits.limit_cycle import limit_cycle as limit_cycle
from nldyn.orbits.orbit import Orbit as Orbit
from nldyn.orbits.solve import solve_orbit as solve_orbit
from nldyn.orbits.starts import find_orbits as find_orbits

# reduction: how many modes
from nldyn.reduction.convergence import convergence_study as convergence_study
from nldyn.reduction.load_case import LoadCase as LoadCase
from nldyn.reduction.selection import select_modes as select_modes

# scene: scenes and parameter studies
from nldyn.scene.study import parameter_study as parameter_study

# search: all branches
from nldyn.search.diagram import Diagram as Diagram
from nldyn.search.diagram import diagram as diagram
from nldyn.search.exploration import ExploreOptions as ExploreOptions
from nldyn.search.explore import explore as explore
from nldyn.search.extend import extend_diagram as extend_diagram
from nldyn.search.fixed_point_index import index_sum as index_sum

# system: what is computed
from nldyn.system.contact_area import contact_area as contact_area
from nldyn.system.loads import BaseMotion as BaseMotion
from nldyn.system.loads import ConstantForce as ConstantForce
from nldyn.system.loads import HarmonicForce as HarmonicForce
from nldyn.system.loads import Unbalance as Unbalance
from nldyn.system.measured import measured_force as measured_force
from nldyn.system.parameters import Parameter as Parameter
from nldyn.system.rigid_stop import RigidStop as RigidStop
from nldyn.system.round_stop import RoundStop as RoundStop
from nldyn.system.spin import Spin as Spin
from nldyn.system.springs_dampers import Damper as Damper
from nldyn.system.springs_dampers import PolynomialSpring as PolynomialSpring
from nldyn.system.springs_dampers import Spring as Spring
from nldyn.system.stop import Stop as Stop
from nldyn.system.stop import dashpot_for as dashpot_for
from nldyn.system.stop import dissipation_for as dissipation_for
from nldyn.system.stop import hertz_stiffness as hertz_stiffness
from nldyn.system.system import System as System

__version__: str
