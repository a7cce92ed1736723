"""Laws of one's own are held to the stiffness and the exponent that they are declared with."""

from __future__ import annotations

import pytest

from nldyn import Stop, SystemModelError

K = 1e5


def two_slopes(depth, speed):
    """A kink at 1e-5 m."""
    if depth < 1e-5:
        return K * depth, K, 0.0
    return K * 1e-5 + 20 * K * (depth - 1e-5), 20 * K, 0.0


def linear(depth, speed):
    return K * depth, K, 0.0


@pytest.mark.parametrize("declared", [1.0, 1e3, 0.98 * K, 1.02 * K, 1e9])
@pytest.mark.parametrize("law", [linear, two_slopes])
def test_another_stiffness_than_declared_is_refused(declared, law):
    with pytest.raises(SystemModelError, match="declare those with which the law begins") as told:
        Stop("x", declared, 1.0, gap=1e-3, law=law)
    assert "\n" not in str(told.value) and "stop at 'x'" in str(told.value)


def test_another_exponent_than_declared_is_refused():
    with pytest.raises(SystemModelError, match=r"exponent 1\.5 say"):
        Stop("x", K, 1.5, law=linear)


@pytest.mark.parametrize("kink", [1e-12, 1e-9, 1e-5, 1e-3])
def test_a_kink_is_found_within_eleven_decades_of_the_unit(kink):
    """The unit is the depth of 1 N, 1e-5 m."""

    def law(depth, speed):
        rest = max(depth - kink, 0.0)
        return K * (depth + rest), K * (1.0 + (rest > 0.0)), 0.0

    with pytest.raises(SystemModelError, match=r"stop at 'x': law"):
        Stop("x", K, 1.0, law=law)


def test_a_law_that_hardens_is_declared_by_its_beginning():
    def law(depth, speed):
        return K * depth * (1.0 + 1e4 * depth), K * (1.0 + 2e4 * depth), 0.0

    assert Stop("x", K, 1.0, law=law).law is law
