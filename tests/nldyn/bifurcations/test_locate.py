"""Roots of test functions between two points of a branch."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from nldyn import Stop, System, Unbalance, continue_branch, solve_orbit
from nldyn.base.errors import LocateError
from nldyn.bifurcations.roots import root


class Counted:
    """A function that counts how often it is called."""

    def __init__(self, f):
        self.f, self.calls = f, 0

    def __call__(self, x):
        self.calls += 1
        return self.f(x)


@given(
    st.floats(0.001, 0.999), st.floats(-0.3, 0.3), st.floats(-0.3, 0.3),
    st.sampled_from([-1e-9, 1.0, 1e6]),
)  # fmt: skip
def test_root_of_a_smooth_function_needs_few_values(exact, slope, curvature, scale):
    f = Counted(lambda x: scale * (x - exact) * (1.0 + slope * x + curvature * x**2))
    x, error = root(f)
    assert abs(x - exact) < 1e-9
    assert error <= 1e-9
    assert f.calls <= 10  # bisection needs 30


@pytest.mark.parametrize("exact", [0.03, 0.4, 0.97])
@pytest.mark.parametrize("sense", [1.0, -1.0])
@pytest.mark.parametrize("steep", [1.0, 1e-2, 1e2])
def test_root_where_a_stop_is_touched(exact, sense, steep):
    """A depth: smooth while the stop is open, behind it with the power 0.4 of a stiff contact."""

    def depth(x):
        d = sense * (x - exact)
        return 1e-6 * (d + d * d if d < 0.0 else steep * d**0.4)

    f = Counted(depth)
    x, error = root(f)
    assert abs(x - exact) <= max(error, 1e-9)
    assert error <= 1e-6
    assert f.calls <= 30  # bisection needs as many


@pytest.mark.parametrize("noise", [1e-9, 1e-8, 1e-7])
def test_error_of_a_root_covers_the_rounding_of_the_function(noise):
    for exact in (0.123, 0.5001, 0.77):
        f = Counted(lambda x, c=exact: math.sin(x - c) + noise * math.sin(1e12 * x))
        x, error = root(f)
        assert abs(x - exact) <= 1.5 * noise
        assert error <= 1e-6
        assert f.calls < 15


@pytest.mark.parametrize("exact", [0.123, 0.77])
def test_error_of_a_root_reaches_to_where_the_trials_ended(exact):
    """At a flat root rounding changes the sign often; the smallest value may lie elsewhere."""
    values = {}

    def f(x):
        values[x] = (x - exact) * abs(x - exact) + 1e-6 * math.sin(1e12 * x)
        return values[x]

    x, error = root(f)
    reach = error + 1e-9
    assert max(at for at, y in values.items() if y < 0.0) >= x - reach
    assert min(at for at, y in values.items() if y > 0.0) <= x + reach


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_error_of_a_root_reaches_to_where_the_function_jumps(side):
    """Its smallest value lies at an end, or within, away from its change of sign."""
    for before in (lambda x: 1.0 + x, lambda x: abs(x - 0.3) + 1e-3):
        x, error = root(lambda x, f=before: side * (-1e-4 * f(x) if x < 0.7 else 1.0))
        assert abs(x - 0.7) <= 1.001 * error + 1e-9


def test_a_function_of_one_sign_has_no_root():
    with pytest.raises(LocateError, match="no change of sign"):
        root(lambda x: 1.0 + x)


def test_root_at_an_end():
    assert root(lambda x: x) == (0.0, 0.0)
    assert root(lambda x: x - 1.0) == (1.0, 0.0)


def test_a_function_without_numbers_has_no_root():
    with pytest.raises(LocateError, match="no root"):
        root(lambda x: math.nan)


@pytest.mark.slow
def test_an_orbit_that_cannot_be_recorded_does_not_cost_the_branch():
    """Two preloaded linear stops just let go: rounding makes countless flights of it."""
    stops = [
        Stop("a", 143142.76459195476, 1.0, gap=-2.4424100187720894e-05, direction=side)
        for side in (1, -1)
    ]
    system = System.from_modal(
        [10.0, 52.217790140028356], {"a": [1.0, 1.0880950293220755]},
        modal_damping=0.028925669976244014, stops=stops, excitation=[Unbalance("a", 1e-4)],
    )  # fmt: skip
    branch = continue_branch(solve_orbit(system, 30.0), (28.0, 36.0))
    assert branch.stop_reasons == ("end of the frequency range",) * 2
    assert [s.kind for s in branch.special_points if s.kind == "BP"] == ["BP", "BP"]
    grazings = [s.frequency_hz for s in branch.special_points if s.kind == "GR"]
    noted = any("32.60" in note and "may be missing" in note for note in branch.notes)
    assert noted or min(abs(hz - 32.60348) for hz in grazings) < 1e-5
