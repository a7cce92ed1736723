"""A search for an orbit ends with a sentence when its time is spent."""

import itertools

import numpy as np
import pytest
from problems import make_one_dof

from nldyn import (
    ConvergenceError,
    FlowMap,
    HarmonicForce,
    PolynomialSpring,
    RoundStop,
    System,
    SystemModelError,
    solve_orbit,
)
from nldyn.engine import library
from nldyn.engine.looking import looking
from nldyn.orbits import solve, time_limit
from nldyn.orbits.time_limit import OutOfTimeError


def test_a_search_without_time_tells_what_it_was_at():
    says = (
        r"no orbit of period 1 found at 30 Hz within 1e-09 s, spent up to period \d+ of 200 of "
        "the motion from rest; more `seconds`"
    )
    with pytest.raises(ConvergenceError, match=says):
        solve_orbit(make_one_dof(), 30.0, seconds=1e-9)


def test_a_search_tells_its_progress_and_finds_what_it_finds_without():
    told = []
    orbit = solve_orbit(make_one_dof(), 30.0, seconds=1e4, progress=lambda *news: told.append(news))
    assert {hz for _, hz, _ in told} == {30.0}
    shares = [done for *_, done in told]
    assert shares == sorted(shares) and 0.0 <= shares[0] <= shares[-1] < 1.0
    assert told[0][0].startswith("period 0 of 200") and told[-1][0] == "Newton's method"
    assert (orbit.point == solve_orbit(make_one_dof(), 30.0, seconds=1e4).point).all()


@pytest.mark.parametrize("seconds", [0.0, -1.0, float("nan"), "5", None])
def test_a_time_that_is_none_is_refused(seconds):
    with pytest.raises(SystemModelError, match="seconds must be a positive number"):
        solve_orbit(make_one_dof(), 30.0, seconds=seconds)


def test_a_progress_that_cannot_be_called_is_refused():
    with pytest.raises(SystemModelError, match="progress"):
        solve_orbit(make_one_dof(), 30.0, progress=3)


def test_why_the_motion_failed_is_told_where_more_damping_spends_the_time(monkeypatch):
    """A force of twice the stiffness pushes u'' + u - u³ over its hilltop at u = 1."""
    softening = System.from_matrices(
        [[1.0]], [[1.0]], {"x": [1.0]}, damping=[[0.05]], excitation=[HarmonicForce("x", 2.0)],
        springs=[PolynomialSpring("x", [0.0, 0.0, -1.0])],
    )  # fmt: skip

    def too_slow(*_):
        raise OutOfTimeError("a way back")

    monkeypatch.setattr(solve, "_by_more_damping", too_slow)
    with pytest.raises(ConvergenceError, match="the motion runs away along a spring that softens"):
        solve_orbit(softening, 0.15)


def rattling():
    """A body in a rigid ring that takes little from it: hundreds of impacts in a period."""
    return System.from_matrices(
        np.eye(2), np.eye(2), {"x": [1.0, 0.0], "y": [0.0, 1.0]}, modal_damping=1e-3,
        stops=[RoundStop.rigid(("x", "y"), 0.9, 1e-2)],
        excitation=[HarmonicForce("x", 1.0), HarmonicForce("y", 0.3)],
    )  # fmt: skip


def test_the_time_bounds_a_search_within_one_call_of_the_engine(monkeypatch):
    """By a clock that goes on by 1 s whenever it is read, and an engine that looks at each piece.

    Read only before each bunch of periods, it would let the search go on for three of them.
    """
    clock = itertools.count()
    monkeypatch.setattr(library, "PAUSE", 0.0)
    monkeypatch.setattr(time_limit.time, "thread_time", lambda: float(next(clock)))
    with pytest.raises(ConvergenceError, match="spent up to period 0 of 200"):
        solve_orbit(rattling(), 0.12, seconds=5.0)
    assert next(clock) == 7  # read at the beginning, before the call, and until 6 s are spent


def test_what_a_look_raises_ends_the_call_and_leaves_the_map_as_it_was(monkeypatch):
    monkeypatch.setattr(library, "PAUSE", 0.0)
    flow, period = FlowMap(rattling()), np.array([0.0, 2.0 * np.pi])
    looks = itertools.count()

    def look():
        if next(looks) == 9:
            raise LookupError("enough")

    before = flow.shoot(np.zeros((1, 4)), period, 0.75)
    with looking(look):
        with pytest.raises(LookupError, match="enough"):
            flow.shoot(np.zeros((1, 4)), period, 0.75)
        assert next(looks) == 10
        again = flow.shoot(np.zeros((1, 4)), period, 0.75)
    assert not before.failure and (again.ends == before.ends).all()
