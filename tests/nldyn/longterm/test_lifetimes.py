"""How long chaos lasts: escape rates of transients against simulation, and attractors that stay."""

from __future__ import annotations

import math

import numpy as np
import pytest
from problems import make_one_dof
from scipy.stats import poisson

from nldyn import SystemModelError, classify_attractor
from nldyn.longterm import chaos_lifetime
from nldyn.longterm.attractors import Attractor, AttractorOptions
from nldyn.longterm.lifetimes import LOOK, ChaosLifetime, _ended


@pytest.fixture(scope="module")
def lasting() -> Attractor:
    return classify_attractor(make_one_dof(), 36.0)


@pytest.fixture(scope="module")
def passing() -> Attractor:
    """Chaos near 35.38 Hz that ends on an orbit of period 9, from a start where it lasts.

    So it does from nearly half of them.
    """
    short = AttractorOptions(transient=200, periods=200, confirmations=0)
    starts = ([s * 1e-6, 0.0] for s in range(40))
    runs = (classify_attractor(make_one_dof(), 35.38, start=s, options=short) for s in starts)
    return next(found for found in runs if found.kind == "chaotic")


def test_chaos_that_lasts_lasts_from_every_state(lasting):
    found = chaos_lifetime(lasting, states=4, periods=2000)
    assert (found.lasting, found.settled, found.followed) == (4, 0, 8000)
    assert found.escape_rate == 0.0 and found.lifetime == math.inf
    assert "4 of 4 motions are chaotic for 2000 periods more; the mean is" in found.evidence


def test_transient_chaos_ends_and_says_when(passing):
    found = chaos_lifetime(passing, states=6, periods=8000)
    assert found.settled >= 3
    for ended, state in zip(found.ended, _states(passing, 6), strict=True):
        if ended > 0:  # an independent verdict: from there on the motion is periodic
            later = state
            for _ in range(int(ended) // LOOK):  # in the same pieces: chaos shows their rounding
                later = passing.flow.strobe(later, 2.0 * np.pi * 35.38, LOOK).ends[-1]
            start = passing.flow.to_modal(later)
            assert classify_attractor(passing.flow, 35.38, start=start).kind == "periodic"


def _states(attractor: Attractor, count: int) -> np.ndarray:
    return attractor.states[np.linspace(0, len(attractor.states) - 1, count).round().astype(int)]


def test_rate_and_bound_are_those_of_a_poisson_process():
    found = ChaosLifetime(30.0, 1000, np.array([250, 500, 0, 0, -1, 0]))
    assert (found.count, found.lasting, found.settled, found.followed) == (6, 3, 2, 4750)
    assert [found.lasting_for(n) for n in (249, 250, 499, 500, 1000)] == [5, 4, 4, 3, 3]
    assert found.escape_rate == pytest.approx(2 / 4750)
    # at the upper bound of the rate so few ends, unclear ones included, have a probability of 5 %
    assert poisson.cdf(3, found.largest_escape_rate * 4750) == pytest.approx(0.05)
    assert "2 settle after 2400 in the mean, 1 do neither" in found.evidence
    never = ChaosLifetime(30.0, 1000, np.zeros(3, dtype=int))
    assert never.least_lifetime == pytest.approx(3000 / -math.log(0.05))


def test_lifetimes_drawn_at_a_known_rate_are_covered_by_the_bound():
    rng = np.random.default_rng(4)
    covered = 0
    for _ in range(400):
        drawn = np.ceil(rng.exponential(3000.0, 8)).astype(int)
        found = ChaosLifetime(30.0, 5000, np.where(drawn > 5000, 0, drawn))
        covered += found.least_lifetime <= 3000.0
    assert 0.93 <= covered / 400 <= 0.99


def test_what_has_settled_is_found_settled(lasting):
    orbit = classify_attractor(make_one_dof(), 50.0)
    assert _ended(orbit.flow, 50.0, 1000, orbit.states[0]) == 250


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (lambda a: chaos_lifetime(None), "attractor must be an Attractor, got None"),
        (lambda a: chaos_lifetime(a, states=0), "chaos_lifetime: states must be a whole number"),
        (lambda a: chaos_lifetime(a, states=10**6), "whole number from 1 to 1000, got 1000000"),
        (lambda a: chaos_lifetime(a, periods=10), "periods must be a whole number from 1000"),
        (lambda a: chaos_lifetime(a, executor=3), "executor must be an Executor or None"),
        (
            lambda a: chaos_lifetime(classify_attractor(make_one_dof(), 50.0)),
            "the one at 50 Hz is period 2",
        ),
    ],
)
def test_bad_input_is_one_sentence(lasting, call, said):
    with pytest.raises(SystemModelError, match=said):
        call(lasting)
