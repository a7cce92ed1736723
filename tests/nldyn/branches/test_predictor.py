"""Where a branch goes on by its last points, and what a walk spares on the way to the next one."""

import numpy as np
import pytest
from problems import make_one_dof

from nldyn import continue_branch, solve_orbit
from nldyn.branches.predictor import predicted

PLACES = np.array([0.0, -0.1, -0.25, -0.3, -0.45])  # newest first


def curve(x, coefficients):
    """Points and tangents (m, 2) of the graph of a polynomial without constant and slope at 0."""
    polynomial = np.polynomial.Polynomial([0.0, 0.0, *coefficients])
    slope = polynomial.deriv()(x)
    tangents = np.stack([np.ones_like(x), slope], axis=-1) / np.hypot(1.0, slope)[..., None]
    return np.stack([x, polynomial(x)], axis=-1), tangents


@pytest.mark.parametrize("count", [2, 3, 4, 5])
def test_a_polynomial_that_the_points_determine_is_continued_exactly(count):
    """m points and tangents determine a polynomial of degree 2m - 1 over the tangent."""
    coefficients = np.array([0.3, -0.2, 0.1, 0.4, -0.3, 0.2, 0.1, -0.1])[: 2 * count - 2]
    points, tangents = curve(PLACES[:count], coefficients)
    behind = np.stack([points[1:], tangents[1:]], axis=1).reshape(-1, 2)
    _, best = predicted(points[0], tangents[0], behind, np.ones(2), 0.08)
    assert best == pytest.approx(curve(np.array(0.08), coefficients)[0], abs=1e-12)


def test_one_point_is_followed_along_its_tangent():
    tangent = np.array([0.6, 0.8])
    found = predicted(np.zeros(2), tangent, np.empty((0, 2)), np.ones(2), 0.5)
    assert found == (pytest.approx(0.5 * tangent),) * 2


def test_orbits_of_a_walk_are_those_of_newtons_method_to_its_end():
    """A walk foretells Newton's last step and starts from the contacts of the orbit before."""
    branch = continue_branch(solve_orbit(make_one_dof(), 30.0), (27.0, 33.0))
    for node in branch.nodes[::7]:
        problem, point = node.orbit.problem, node.orbit.point
        row = problem.metric(point) * node.tangent
        exact = problem.correct(point, row)
        off = exact.point - point
        assert np.sqrt(off @ (problem.metric(point) * off)) < 1e-10
        size = np.abs(exact.jacobians).max()
        assert np.abs(exact.jacobians - node.orbit.jacobians).max() < 1e-7 * size
