"""Bodies that nothing but rigid stops holds: their branches are followed, or end with a sentence.

`event_driven.integrate` shares no code with nldyn: an orbit comes back to where it began.
"""

import numpy as np
import pytest
from event_driven import integrate

from nldyn import (
    ConstantForce,
    HarmonicForce,
    RigidStop,
    System,
    continue_branch,
    find_orbits,
    solve_orbit,
)
from nldyn.base.errors import ConvergenceError, LocateError, SystemModelError, failing_as
from nldyn.branches.endings import Ending


def pair(damping, restitution, gap, amplitude, constant):
    """A body between two flanks."""
    return System.from_matrices(
        [[1.0]], [[0.0]], {"x": [1.0]}, damping=[[damping]],
        stops=[RigidStop("x", restitution, gap=gap, direction=side) for side in (1, -1)],
        excitation=[HarmonicForce("x", amplitude), ConstantForce("x", constant)],
    )  # fmt: skip


def check_orbits(branch, damping, restitution, gap, amplitude, constant):
    """Check some orbits by an integrator with events, but for the growth of its errors."""
    one, stops = np.array([1.0]), []
    stops = [(side * one, gap, restitution) for side in (1.0, -1.0)]
    for orbit in branch.points[:: len(branch.points) // 3]:
        state = orbit.states(np.zeros(1))[0]
        after, hits, _ = integrate(
            np.eye(1), np.zeros((1, 1)), np.array([[damping]]),
            lambda t, omega=orbit.omega: np.array([amplitude * np.cos(omega * t) + constant]),
            stops, state, orbit.duration, max_step=0.05 * orbit.duration,
        )  # fmt: skip
        growth = max(1.0, abs(orbit.largest_multiplier))
        assert np.abs(after - state).max() < 1e-11 * growth * np.abs(state).max() + 1e-10
        assert hits.sum() == orbit.impacts


def test_a_branch_of_period_two_goes_on_where_newtons_steps_leave_all_frequencies():
    numbers = 0.6, 0.9, 0.6, 2.0 * np.pi**2, 2.4 * np.pi
    guess = np.array([0.5287945894657209, 5.102729090844848])
    orbit = solve_orbit(pair(*numbers), 1.0954451150103324, 2, guess=guess)
    branch = continue_branch(orbit, (0.4, 1.2))
    assert branch.stop_reasons[0].ending is Ending.GRAZES_RIGID
    assert branch.stop_reasons[1].ending is Ending.RANGE_END
    check_orbits(branch, *numbers)


def test_branches_with_one_impact_end_with_a_sentence_where_the_other_flank_is_grazed():
    numbers = 0.5, 0.5, 1.0, 10.0, 5.0
    orbits = [o for o in find_orbits(pair(*numbers), 2.0, 1) if o.impacts == 1]
    ends = set()
    for orbit in orbits:
        branch = continue_branch(orbit, (0.5, 3.0))
        ends |= {reason.ending for reason in branch.stop_reasons}
        check_orbits(branch, *numbers)
    assert ends == {Ending.RANGE_END, Ending.GRAZES_RIGID}


@pytest.mark.parametrize("kind", [ConvergenceError, LocateError])
@pytest.mark.parametrize(
    "fault",
    [OverflowError("too large"), ZeroDivisionError("zero"), np.linalg.LinAlgError("singular"),
     SystemModelError("no such system"), LocateError("lost"), ConvergenceError("diverged")],
)  # fmt: skip
def test_whatever_a_computation_ends_in_is_told_as_its_failure(kind, fault):
    @failing_as(kind)
    def compute():
        raise fault

    with pytest.raises(kind, match=str(fault)):
        compute()


def test_a_mistake_in_the_program_is_not_hidden():
    with pytest.raises(TypeError), failing_as(LocateError):
        raise TypeError
