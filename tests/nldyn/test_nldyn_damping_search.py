"""Isolas are found by way of less damping, where other branches lead to them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from independent import Motion

from nldyn import (
    Diagram,
    HarmonicForce,
    Stop,
    System,
    SystemModelError,
    by_less_damping,
    continue_branch,
    index_sum,
    load_branches,
    solve_orbit,
)
from nldyn.damping import carried

RANGE_HZ = (7.2, 11.0)


def two_modes(modal_damping: float = 0.013513) -> System:
    """A stop that touches one of two modes, whose harmonic branch leaves an isola beside it."""
    return System.from_modal(
        [10.0, 30.307], {"tip": [1.0, -1.2178], "force": [1.0, 1.0309]},
        modal_damping=modal_damping, stops=[Stop("tip", 3.5791e7)],
        excitation=[HarmonicForce("force", 7.4926)],
    )  # fmt: skip


@pytest.fixture(scope="module")
def harmonic() -> Diagram:
    """The branch that is known."""
    branch = continue_branch(solve_orbit(two_modes(), 10.99), RANGE_HZ)
    return Diagram((branch,), RANGE_HZ, "tip", ())


@pytest.fixture(scope="module")
def found(harmonic) -> Diagram:
    """What less damping leads to."""
    return by_less_damping(harmonic, max_period=1, spacing=0.1)


def test_an_isola_that_joins_the_known_branch_at_less_damping_is_found(harmonic, found):
    assert found.branches[0] is harmonic.branches[0]
    (isola,) = found.branches[1:]
    assert isola.closed
    assert not any(harmonic.branches[0].contains(orbit) for orbit in isola.points)
    assert found.notes[-1].endswith("1 branch found so")
    less = continue_branch(solve_orbit(two_modes(0.5 * 0.013513), 10.99), RANGE_HZ)
    at_own, beside, at_less = (len(branch.at(8.0)) for branch in (*found.branches, less))
    assert at_less == at_own + beside > at_own


def test_orbits_of_the_isola_close_under_runge_kutta(found):
    for orbit in found.branches[1].at(8.0):
        start = orbit.states([0.0])[0]
        end, _ = Motion(two_modes()).run(start, (0.0, 2.0 * np.pi), orbit.omega, tangent=False)
        scale = np.repeat([1.0, orbit.omega], 2) * np.abs(start[:2]).max()
        assert np.abs((end - start) / scale).max() < 1e-8


def test_the_indices_add_up_to_one_with_the_isola_and_without(harmonic, found):
    for hz in (7.5, 8.0, 8.9, 10.0):
        assert index_sum(harmonic.branches, hz) == index_sum(found.branches, hz) == 1


@pytest.mark.parametrize("factor", [0.2, 0.9, 3.0])
def test_carried_to_another_damping_and_back_an_orbit_is_the_same(harmonic, factor):
    orbit = harmonic.branches[0].at(10.0)[0]
    other = carried(orbit.problem.flow, orbit, 0.0, np.log(factor))
    assert np.allclose(other.system.damping, factor * orbit.system.damping, rtol=1e-12)
    assert other.frequency_hz == pytest.approx(10.0, rel=1e-14)
    back = carried(orbit.problem.flow, other, np.log(factor), 0.0)
    assert np.abs(back.point - orbit.point).max() < 1e-9 * np.abs(orbit.point[:-1]).max()


def test_what_is_known_is_not_found_again(found):
    again = by_less_damping(found, 0.8, max_period=1, spacing=0.2)
    assert len(again.branches) == 2
    assert again.notes[:-1] == found.notes


def test_interrupted_it_goes_on_with_what_it_has_found(harmonic, found, tmp_path):
    place, seen = tmp_path / "found.h5", []

    def interrupt(what: str, frequency_hz: float) -> None:
        seen.append(what)
        if seen.count("back") in (3, 4):
            raise KeyboardInterrupt

    for _ in range(2):
        with pytest.raises(KeyboardInterrupt):
            by_less_damping(
                harmonic, max_period=1, spacing=0.1, progress=interrupt, checkpoint=place
            )
        kept = load_branches(place)
        assert len(kept) == len({branch.frequency_hz.tobytes() for branch in kept}) <= 2
    resumed = by_less_damping(harmonic, max_period=1, spacing=0.1, checkpoint=place)
    assert [len(b.nodes) for b in resumed.branches] == [len(b.nodes) for b in found.branches]
    assert np.array_equal(resumed.branches[1].frequency_hz, found.branches[1].frequency_hz)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"factor": 1.0}, "factor must lie between 0 and 1, got 1"),
        ({"factor": float("nan")}, "factor must lie between 0 and 1, got nan"),
        ({"spacing": 0.0}, "spacing must lie between 1e-05 and 1, got 0"),
        ({"max_period": 0}, "max_period must be"),
        ({"known": Diagram((), RANGE_HZ, "tip")}, "known: has no branches to begin with"),
    ],
)
def test_bad_input_is_refused(harmonic, change, message):
    with pytest.raises(SystemModelError, match=message):
        by_less_damping(**{"known": harmonic, **change})


def test_a_system_without_modal_damping_is_refused():
    system = replace(two_modes(), damping=np.zeros((2, 2)))
    branch = continue_branch(solve_orbit(system, 10.99), (10.9, 11.0))
    with pytest.raises(SystemModelError, match="without modal damping"):
        by_less_damping(Diagram((branch,), (10.9, 11.0), "tip"))
