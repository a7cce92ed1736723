"""Speed at equal error."""

import math

import pytest

from bench.ratios import envelope, seconds_at, times_faster

FAST = [(10.0**-k, 1e-5 * 10.0 ** (k / 4)) for k in range(2, 13, 2)]
SLOW = [(10.0**-k, 1e-3 * 10.0 ** (k / 2)) for k in range(1, 12, 2)]


@pytest.mark.parametrize("error", [1e-3, 10**-4.7, 1e-8])
def test_ratio_on_power_laws_is_exact(error):
    k = -math.log10(error)
    assert times_faster(FAST, SLOW, error) == pytest.approx(100.0 * 10.0 ** (k / 4), rel=1e-12)


def test_an_error_that_is_not_reached_has_no_time():
    assert seconds_at(SLOW, 1e-12) is None
    assert times_faster(FAST, SLOW, 1e-12) is None
    assert seconds_at([], 1e-3) is None


def test_an_engine_that_is_always_better_counts_with_its_fastest_point():
    assert seconds_at(FAST, 0.5) == FAST[0][1]


def test_points_that_are_beaten_do_not_count():
    noisy = [*SLOW, (1e-4, 1e9), (math.nan, 1e-9), (0.3, 1e9)]
    assert envelope(noisy) == SLOW
