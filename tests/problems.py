"""Systems that many tests compute."""

import numpy as np
from hypothesis import strategies as st
from scipy import sparse

import cms
from nldyn import Damper, HarmonicForce, LoadCase, Stop, System, Unbalance
from nldyn.orbits.axis import Axis, Section
from nldyn.orbits.bordered import OrbitFamily, Solved
from nldyn.orbits.orbit import Orbit

RANGE_HZ = (5.7, 90.0)
THREE_HZ = (36.0, 38.5)  # where there are branches of three periods up to 3


def in_frequency(orbit: Orbit) -> Solved:
    """An orbit as one of a family in the frequency."""
    return OrbitFamily.in_frequency(orbit).place(orbit)


def make_one_dof(**changes) -> System:
    """m = 2.48 kg, k = 16877 N/m, ζ = 0.0142, k_s = 5.17e9 N/m^1.5, m_e r_e = 4.92e-6 kg m."""
    elements = {
        "stops": [Stop("middle", stiffness=5.17e9)],
        "excitation": [Unbalance("middle", 4.92e-6)],
        **changes,
    }
    return System.from_matrices(
        [[2.48]], [[16877.0]], {"middle": [1.0]}, modal_damping=0.0142, **elements
    )


def between_stops(mismatch: float = 0.0) -> System:
    """A mode between two linear stops, one of them farther off by a share of the gap."""
    stops = [
        Stop("m", 1e6, 1.0, gap=5e-6),
        Stop("m", 1e6, 1.0, gap=5e-6 * (1.0 + mismatch), direction=-1),
    ]
    unbalance = [Unbalance("m", 4.92e-6)]
    return System.from_modal(
        [13.13], {"m": [0.635]}, modal_damping=0.02, stops=stops, excitation=unbalance
    )


THREE_MODES_HZ = [13.1, 117.5, 326.5]
THREE_MODES_AT = {"middle": [0.63, 0.8, -0.5], "end": [-0.4, 0.9, 0.7]}


def three_modes(**changes) -> System:
    elements = {
        "modal_damping": 0.01,
        "stops": [Stop("middle", stiffness=5e9)],
        "dampers": [Damper("end", 6.0)],
        "excitation": [Unbalance("middle", 5e-6)],
        **changes,
    }
    return System.from_modal(THREE_MODES_HZ, THREE_MODES_AT, **elements)


THREE_MODES_STATES = st.lists(st.floats(-1.0, 1.0), min_size=6, max_size=6).map(
    lambda values: np.array(values) * [5e-6, 2e-6, 1e-6, 4e-3, 4e-3, 4e-3]
)


MASSES, MASS, SPRING = 41, 0.05, 141000.0
SETTING = LoadCase(
    (30.0, 45.0),
    stops=(Stop("middle", stiffness=2e7),),
    excitation=(Unbalance("middle", 2e-4),),
    modal_damping=0.03,
)


def string(extra=None) -> cms.Matrices:
    """Masses on a string that hits a stop in its middle, held at both ends.

    Frequencies from 20 to 534 Hz; every second mode has a node in the middle.
    """
    off = -np.ones(MASSES - 1)
    K = SPRING * sparse.diags_array([off, np.full(MASSES, 2.0), off], offsets=[-1, 0, 1])
    loads = {"middle": np.eye(MASSES)[MASSES // 2], **(extra or {})}
    return cms.Matrices(K.tocsc(), MASS * sparse.eye_array(MASSES, format="csc"), loads)


def torus_system() -> System:
    """Two modes and a soft stop: a pair of multipliers leaves the unit circle near 11.5 Hz."""
    return System.from_modal(
        [10.0, 34.0], {"m": [0.635, 0.3]}, modal_damping=0.02,
        stops=[Stop("m", stiffness=1.2e7, gap=1e-5)], excitation=[Unbalance("m", 4.92e-6)],
    )  # fmt: skip


def driven(power: float) -> System:
    """x'' + x |x|^(p - 1) = sin ωt, as one stop on either side of a mass without a spring."""
    stops = [Stop("x", 1.0, power), Stop("x", 1.0, power, direction=-1)]
    force = HarmonicForce("x", 1.0, phase_deg=-90.0)
    return System.from_matrices([[1.0]], [[0.0]], {"x": [1.0]}, stops=stops, excitation=[force])


def section(flow, hz: float) -> Section:
    """The motions of a flow map at a frequency."""
    return Axis.in_frequency((0.5 * hz, 2.0 * hz)).at(flow, hz)


def section_of(branch, hz: float) -> Section:
    """The motions of a branch's system at a frequency."""
    return section(branch.points[0].problem.flow, hz)
