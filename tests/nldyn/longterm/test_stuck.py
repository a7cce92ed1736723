"""Motions in which something sticks behind its spring all the time, at any of many places."""

import math

import numpy as np
import pytest

from nldyn import (
    HarmonicForce,
    PolynomialSpring,
    StatePlane,
    System,
    SystemModelError,
    basins,
    find_attractors,
)
from nldyn.longterm.attractors import side_by_side
from nldyn.orbits.newton import refine
from nldyn.orbits.orbit import same_orbit
from nldyn.system import DryFriction

OMEGA, FORCE, SPRING, LIMIT = 1.0, 0.1, 3.0, 0.2
HZ = OMEGA / (2.0 * math.pi)


def damped(*springs, force=FORCE):
    """A mass of 1 kg and a Jenkins element that slides at 0.2 N."""
    return System.from_matrices(
        [[1.0]], [[1.0]], {"x": [1.0]}, damping=[[0.2]], springs=list(springs),
        dampers=[DryFriction("x", LIMIT, 1.0, tangential_stiffness=SPRING)],
        excitation=[HarmonicForce("x", force)],
    )  # fmt: skip


def test_motions_that_stick_at_any_place_are_one_attractor():
    """Its spring pulls with less than its friction: u = F / |k + k_t - m ω² + i c ω|."""
    found = find_attractors(damped(), HZ, starts=12)
    assert [share.count for share in found] == [12]
    (low, high) = found[0].attractor.span
    swing = FORCE / math.hypot(1.0 + SPRING - OMEGA**2, 0.2 * OMEGA)
    assert (high - low) / 2.0 == pytest.approx(swing, rel=1e-9) and SPRING * swing < LIMIT


def test_they_have_no_basins():
    plane = StatePlane.at_interface(damped(), (-0.5, 0.5), (-0.5, 0.5))
    with pytest.raises(SystemModelError, match="'x' something sticks behind its spring all the ti"):
        basins(damped(), HZ, plane, shape=(3, 3), starts=2, checks=1)


def test_where_it_slides_there_is_one_attractor_with_a_basin():
    """With 2 N it would pull with more than its friction."""
    system = damped(force=2.0)
    plane = StatePlane.at_interface(system, (-0.5, 0.5), (-0.5, 0.5))
    found = basins(system, HZ, plane, shape=(3, 3), starts=2, checks=3)
    assert len(found.attractors) == 1 and found.wrong == 0 and found.undecided == 0.0


def test_motions_in_two_wells_stay_two_whose_springs_may_stick_at_one_place():
    """k + k_t = -1 N/m: from the places of one to those of the other leads no way past the hill."""
    system = damped(PolynomialSpring("x", [-5.0, 0.0, 40.0]), force=1e-3)
    starts = [[0.2, 0.0], [-0.2, 0.0]]
    orbits = [share.attractor.orbit for share in find_attractors(system, HZ, starts=starts)]
    assert len(orbits) == 2 and not same_orbit(*orbits)
    one = orbits[0]
    moved = one.problem.nodes(one.point) + np.array([0.0, 0.0, 1e-3, 0.0])
    beside = refine(one.problem, moved, one.omega, "x")
    assert side_by_side(one, beside) and not same_orbit(one, beside)
    assert not side_by_side(*orbits)
