"""All orbits of a branch at requested frequencies."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from problems import RANGE_HZ, make_one_dof

from nldyn import System, SystemModelError, Unbalance, continue_branch, solve_orbit


def monotone_pieces(branch):
    """Frequencies at the ends of the pieces between folds, a pair for each."""
    folds = sorted(s.point.arclength for s in branch.special_points if s.kind == "LP")
    hz = {s.point.arclength: s.frequency_hz for s in branch.special_points}
    hz |= {node.arclength: node.orbit.frequency_hz for node in branch.nodes}
    edges = [branch.nodes[0].arclength, *folds, branch.nodes[-1].arclength]
    return [(hz[a], hz[b]) for a, b in pairwise(edges)]


@given(share=st.floats(0.001, 0.999))
def test_every_piece_between_folds_gives_one_orbit(harmonic_branch, share):
    frequency = RANGE_HZ[0] * (RANGE_HZ[1] / RANGE_HZ[0]) ** share
    passes = sum(min(a, b) < frequency < max(a, b) for a, b in monotone_pieces(harmonic_branch))
    assert len(harmonic_branch.at(frequency)) == passes


@pytest.mark.parametrize("beyond", [1e-5, 1e-7, 1e-9])
def test_both_orbits_beside_a_fold_are_found(harmonic_branch, beyond):
    """They move apart with the root of the distance from it."""
    for fold in (s for s in harmonic_branch.special_points if s.kind == "LP"):
        found = []
        for sign in (-1.0, 1.0):
            frequency = fold.frequency_hz * (1.0 + sign * beyond)
            near = [
                orbit
                for orbit in harmonic_branch.at(frequency)
                if np.linalg.norm(orbit.point[:-1] - fold.orbit.point[:-1])
                < 20.0 * beyond**0.5 * np.linalg.norm(fold.orbit.point[:-1])
            ]
            found.append(len(near))
        assert sorted(found) == [0, 2]


def test_requested_orbits_are_periodic_at_exactly_these_frequencies(one_dof):
    wanted = [26.0, 12.2, 20.0, 25.3]
    branch = continue_branch(solve_orbit(one_dof, 26.0), (12.0, 30.0), at=wanted)
    lengths = [point.arclength for point in branch.requested]
    assert lengths == sorted(lengths)
    table = branch.table("requested")
    assert set(table["frequency_hz"]) == set(wanted)
    passes = {hz: len(branch.at(hz)) for hz in wanted}
    assert passes[12.2] == 3
    assert len(branch.requested) == sum(passes.values())
    for point in branch.requested:
        orbit = point.orbit
        nearest = min(wanted, key=lambda hz: abs(hz - orbit.frequency_hz))
        assert orbit.frequency_hz == pytest.approx(nearest, rel=1e-15)
        problem, nodes = orbit.problem, orbit.problem.nodes(orbit.point)
        ends = problem.flow.shoot(nodes, problem.phases, 2.0 * np.pi * nearest).ends
        assert np.abs(ends - np.roll(nodes, -1, axis=0)).max() < 1e-12 * problem.scale(orbit.point)


def test_requested_orbits_are_those_of_a_direct_solution():
    """Without a stop the response is known in closed form."""
    system = System.from_modal(
        [13.0], {"tip": [0.6]}, modal_damping=0.02, excitation=[Unbalance("tip", 5e-6)]
    )
    branch = continue_branch(solve_orbit(system, 10.0), (8.0, 20.0), at=[8.0, 13.0, 20.0])
    for point, hz in zip(branch.requested, (8.0, 13.0, 20.0), strict=True):
        omega, natural = 2.0 * np.pi * hz, 2.0 * np.pi * 13.0
        force = 5e-6 * omega**2 * 0.6**2
        amplitude = force / abs(natural**2 - omega**2 + 2j * 0.02 * natural * omega)
        assert point.orbit.max_abs_displacement == pytest.approx(amplitude, rel=1e-9)


def test_points_of_the_branch_are_found_once_and_frequencies_outside_never(harmonic_branch):
    for node in harmonic_branch.nodes[100:120]:
        near = [
            orbit
            for orbit in harmonic_branch.at(node.orbit.frequency_hz)
            if np.allclose(orbit.point, node.orbit.point, rtol=1e-7)
        ]
        assert len(near) == 1
    assert harmonic_branch.at(RANGE_HZ[0] * 0.99) == []
    assert len(harmonic_branch.at(RANGE_HZ[0])) == len(harmonic_branch.at(RANGE_HZ[1])) == 1


@pytest.mark.parametrize(
    ("at", "words"),
    [
        ([20.0, 31.0], "at: 31 Hz lies outside"),
        ([-1.0], "at: each frequency must be positive"),
        (["a"], "at: each frequency must be positive"),
        (20.0, "at must be a list"),
    ],
)
def test_requests_that_make_no_sense_are_refused_before_the_work(at, words):
    orbit = solve_orbit(make_one_dof(), 26.0)
    with pytest.raises(SystemModelError, match=words):
        continue_branch(orbit, (20.0, 30.0), at=at, progress=lambda _: pytest.fail("computed"))
