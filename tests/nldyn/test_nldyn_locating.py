"""Roots of test functions between two points of a branch."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from nldyn.special import LocateError, root


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


def test_root_at_an_end():
    assert root(lambda x: x) == (0.0, 0.0)
    assert root(lambda x: x - 1.0) == (1.0, 0.0)


def test_a_function_without_numbers_has_no_root():
    with pytest.raises(LocateError, match="no root"):
        root(lambda x: math.nan)
