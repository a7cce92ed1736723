"""What the kernels share: outcomes, tolerances, columns and tables."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from nldyn.base.arrays import Complex, Real
from nldyn.system.linear import Terms

(
    OK, TOO_MANY_PIECES, CONTACT_FAILED, DIVERGED, SINGULAR, NOT_CONVERGED, RECORD_FULL, ROUNDED,
    TOO_MANY_STEPS, OTHER_CONTACTS,
) = range(10)  # fmt: skip
FLIGHT = -1
# share of the speed at a stop that rounding of the penetration may cost in one contact, and share
# of the modes' speeds there that their rounding may cost where a stop's damping decides them
WORST_ROUNDING = 1e-6
MOST_STEPS = 10_000_000  # in the search for one contact: a second
# what a stop damps: a panel shows decay by e^-8 to 14 digits, and nothing is left of e^-40 of it
DECAY, FADED = 8.0, 40.0
# below this exponent a slope sets in almost at once: there nodes at the switch count, and less than
# the usual tail is accepted
ROUND, SHARP_TAIL = 1.5, 0.1
REST_TAIL = 0.01  # the same where a body rests: the error of a force that acts at once goes with it
CREEP = 100.0  # such an exponent over an elastic contact: the damping alone decides the speed
# an orbit closes to this share of its size, or to this one times the largest entry of its segments'
# Jacobians, which is what rounding costs; a short step of Newton's method does not tell
OPEN, NOISE = 1e-7, 1e-12
PRELOADED = 1e-14  # the same of the preloads' size: forces that hold each other up are rounded, too
STEADY = 1e-3  # share by which the Jacobians may change in a step that only shows rounding
RELEASED = 1e-11  # error allowed in the instant of a rigid stop's release, where nothing jumps
HALF_CONTACT = 2.5  # phase of the stiffness of a stop in half a contact, at most, in rad
# the share of a slope in a Jacobian's error, kick (4 tail)², is less than rtol, (tail / 0.3)², as
# long as KICK kick is less than one
KICK = 1.5
SUM_ROUNDING = 1e-15  # of a sum's terms, 4 units in the last place
HALF_ULP = 1e-16  # of a number
BLIND = 20.0  # roundings of a penetration: a Legendre tail within them tells nothing
MAPPED = 0.75  # share of a panel's length for a map that brings the nodes together at an end


class StopRow(NamedTuple):
    """Numbers of a stop: the columns of `stops`, in this order."""

    gap: float
    stiffness: float
    exponent: float
    dissipation: float
    dashpot: float
    mobility: float  # velocity jump per unit impulse in 1/kg
    duration: float  # of a free contact, over (peak penetration / speed)
    instant: float  # error allowed in the instant of an event, as a share of the panel
    restitution: float = -1.0  # of a rigid stop; -1 for an elastic one
    bond: float = 0.0  # 1 for what is no stop but acts all the time, with the law `bond_law`
    drag: float = 0.0  # of a bond: coefficients of u² u' and u'^3
    cubic: float = 0.0
    release: float = -1.0  # output δ + δ' dashpot/stiffness of a stop that never pulls, or -1


GAP, STIFFNESS, EXPONENT, DISSIPATION, DASHPOT, MOBILITY, DURATION, INSTANT, RESTITUTION = range(9)
BOND, DRAG, CUBIC, RELEASE = range(9, len(StopRow._fields))
FIRST_POWER = len(
    StopRow._fields
)  # column of the coefficient of u of a bond; those of u²... follow


class SystemData(NamedTuple):
    """Numbers of a system, as the kernels need them: few arrays, since each one costs compile time.

    Outputs are the penetrations of the stops, then the observed displacements.
    """

    blocks: Real  # (n, 2, 2)
    rows: Real  # (3, n_out, 2n) outputs, their velocities and accelerations in flight
    bound3: Real  # (n_out, 2n) |third derivative| <= Σ_b |bound3_b| |w_b| at any later time
    force: Real  # (2n, n_stops): w' = A w - force @ F
    orders: Real  # (h,) multiples of the excitation frequency at which something acts; 1 first
    drive: Complex  # (h, 3, 2n) excitation Σ Re(Σ_p ω^p drive[h, p] e^{i orders[h] ωt}) of z
    stops: Real  # (n_stops, ...), rows as `StopRow`, bonds last; then coefficients of bonds
    # (n_stops,) address of a compiled law (of a rigid stop: of its restitution), or 0
    laws: NDArray[np.int64]
    tail: float  # largest relative Legendre tail accepted on a contact panel
    node_angle: float  # phase of the fastest mode from node to node, in rad


class FlowData(NamedTuple):
    """Numbers of a system at one excitation frequency; see `SystemData`."""

    blocks: Real
    rows: Real
    bound3: Real
    force: Real
    stops: Real
    laws: NDArray[np.int64]
    terms: Terms  # k of them; none for most systems
    # (1 + k, 2 + n_parameters, 2n): amplitude of the steady response at order 1, z = w +
    # Re(response[0, 0] e^{iωt}), and of each further term; then their derivatives with respect to
    # ω and to each parameter
    response: Complex
    forced: Complex  # (1 + k, 2 + n_parameters, n_out) the same of the outputs
    # (n_parameters, 2): column of `stops`, or -1 for the excitation; and the index of the stop
    parameters: NDArray[np.int64]
    omega: float
    tail: float
    node_angle: float


class Record(NamedTuple):
    """Pieces of a trajectory, enough to evaluate the state at any instant.

    Parameters
    ----------
    phase, duration : (n_pieces,)
        Forcing phase at the start, duration in s.
    kind : (n_pieces,)
        -1 for a flight, else the kind of the panel's ends.
    event : (n_pieces,)
        Stop that opens or closes at the end, or -1.
    start : (n_pieces, 2n)
        State z at the start.
    force, depth : (n_pieces, n_stops, m)
        Forces and penetrations at the nodes of a panel (zero where a stop is open).
    used : (3,)
        Number of pieces in use; the first of those of a motion before that are still ahead. They
        stand at the end of the record and serve as guesses. Whether these are of another orbit.
    """

    phase: NDArray[np.float64]
    duration: NDArray[np.float64]
    kind: NDArray[np.int64]
    event: NDArray[np.int64]
    start: NDArray[np.float64]
    force: NDArray[np.float64]
    depth: NDArray[np.float64]
    used: NDArray[np.int64]


class Panel(NamedTuple):
    """Arrays of a contact panel with na stops, m nodes and n modes.

    They are filled by `solve_panel`; what depends on kind and length alone serves the next panel
    of the same stops too. Outputs are the na penetrations and, if a force depends on them, their
    na rates. That of a rigid stop is the acceleration with which the gap would close without its
    own force; the force is in proportion to it.
    """

    active: NDArray[np.int64]  # (na,) closed stops
    output: Real  # (n_outputs, m) values at the nodes
    F: Real  # (na, m) forces
    slope: Real  # (n_outputs, m) derivative of the force with respect to the output
    to: Real  # (n_outputs, m, 2n) row exp(A t_i)
    back: Real  # (na, 2n, m) exp(-A t_j) force
    G: Real  # (n_outputs m, na m) outputs at the nodes per force at the nodes
    factors: Real  # (na m, na m) of the matrix 1 + slope G, at these slopes or earlier ones
    order: NDArray[np.int64]  # (na m,) its row swaps
    kept: NDArray[np.bool_]  # (1,) whether `factors` are worth keeping
    made: Real  # (2,) kind and length for which to, back and G were filled
    rise: Real  # (na, m, 2n) row (exp(A t_i) - 1) of the penetrations
    # (4, na) penetration at the start and its rounding error, the same at the end: carried apart
    # from the state, in which rounding is a share of the displacement
    depth: Real
    # (2, na) exponent by which each stop has damped fast motion, before this panel and in it, since
    # the segment began, the last event, or another stop began to count
    decay: Real
