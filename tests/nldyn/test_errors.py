"""Input that makes no sense gets one clear sentence that names it."""

from __future__ import annotations

import math
from functools import partial

import numpy as np
import pytest
from hard.modes import nearly_defective
from hypothesis import given
from hypothesis import strategies as st

from nldyn import (
    ContinuationOptions,
    Damper,
    FlowOptions,
    HarmonicForce,
    Stop,
    System,
    SystemModelError,
    Unbalance,
    continue_branch,
    diagram,
    find_orbits,
    hertz_stiffness,
    solve_orbit,
)
from nldyn.orbits import OrbitSearchOptions
from nldyn.search import SubharmonicSeed

NOT_FINITE = st.sampled_from([math.nan, math.inf, -math.inf])
NEGATIVE = st.floats(-1e100, -1e-100)
BAD = NOT_FINITE | NEGATIVE
NOT_A_NUMBER = st.sampled_from(["a", "1.0", None, True, [1.0], 1j, 10**400])


def sentence(call, *words: str) -> None:
    """The call is refused with one line that contains the words."""
    with pytest.raises(SystemModelError) as caught:
        call()
    text = str(caught.value)
    assert "\n" not in text and 10 < len(text) < 250
    for word in words:
        assert word in text, text


# --- elements ------------------------------------------------------------------------------------


@given(BAD | st.just(0.0))
def test_stop_stiffness(value):
    sentence(lambda: Stop("middle", stiffness=value), "stop at 'middle'", "stiffness")
    sentence(lambda: Stop.linear("middle", value), "stop at 'middle'", "stiffness")


@given(BAD | st.floats(0.0, 1.0, exclude_max=True))
def test_stop_exponent(value):
    sentence(lambda: Stop("middle", 1e9, exponent=value), "stop at 'middle'", "exponent")


@given(NOT_FINITE)
def test_stop_gap(value):
    sentence(lambda: Stop("middle", 1e9, gap=value), "stop at 'middle'", "gap")
    assert Stop("middle", 1e9, gap=-1e-3).gap == -1e-3


@given(NOT_A_NUMBER)
def test_what_is_no_number(value):
    sentence(lambda: Stop("middle", value), "stop at 'middle'", "stiffness must be a finite number")
    sentence(lambda: Stop("middle", 1e9, exponent=value), "exponent must be a finite number")
    sentence(lambda: Stop("middle", 1e9, gap=value), "gap must be a finite number")
    sentence(lambda: Damper("middle", value), "damper at 'middle'", "coefficient must be a finite")
    sentence(lambda: Unbalance("middle", value), "mass_times_radius must be a finite number")
    sentence(lambda: HarmonicForce("middle", 1.0, value), "phase_deg must be a finite number")
    sentence(lambda: hertz_stiffness(value, 2.1e11), "radius must be a finite number")


def test_exponent_has_the_limit_that_it_has_in_a_scene():
    assert Stop("middle", 1e9, exponent=4.0).exponent == 4.0
    sentence(lambda: Stop("middle", 1e9, exponent=4.01), "exponent must lie in [1, 4]", "4.01")


@pytest.mark.parametrize("direction", [0, 2, -2, math.nan, True, np.True_])
def test_stop_direction(direction):
    sentence(lambda: Stop("middle", 1e9, direction=direction), "direction must be +1 or -1")


def test_stop_against_itself():
    sentence(
        lambda: Stop("middle", 1e9, against="middle"), "stop at 'middle'", "against", "another"
    )


@given(BAD | st.just(0.0))
def test_hertz_stiffness(value):
    sentence(lambda: hertz_stiffness(value, 2.1e11), "radius")
    sentence(lambda: hertz_stiffness(0.005, value), "youngs_modulus")
    sentence(lambda: hertz_stiffness(0.005, 2.1e11, other_youngs_modulus=value), "youngs_modulus")
    sentence(lambda: Stop.hertz("m", radius=value, youngs_modulus=2.1e11), "radius")


@pytest.mark.parametrize("ratio", [-1.0, 0.51, math.nan, 3.0])
def test_poissons_ratio(ratio):
    sentence(lambda: hertz_stiffness(0.005, 2.1e11, ratio), "poissons_ratio")


def test_hertz_stiffness_is_that_of_johnson():
    """4/3 E* sqrt(R) with 1/E* = Σ (1 - ν²)/E."""
    effective = 1 / ((1 - 0.3**2) / 2.1e11 + (1 - 0.2**2) / 7e10)
    exact = 4 / 3 * effective * math.sqrt(0.005)
    found = hertz_stiffness(0.005, 2.1e11, other_youngs_modulus=7e10, other_poissons_ratio=0.2)
    assert found == pytest.approx(exact, rel=1e-14)


@given(BAD)
def test_dampers_and_excitation(value):
    sentence(lambda: Damper("middle", value), "damper at 'middle'", "coefficient")
    sentence(lambda: Unbalance("middle", value), "excitation at 'middle'", "mass_times_radius")
    sentence(lambda: HarmonicForce("middle", value), "excitation at 'middle'", "amplitude")


@given(NOT_FINITE)
def test_phase_of_the_excitation(value):
    sentence(lambda: Unbalance("middle", 1.0, value), "excitation at 'middle'", "phase_deg")


def test_a_phase_of_many_turns_is_refused():
    """Beyond 1e6 degrees its digits are used up by whole turns."""
    for phase in (1e50, -1000000.5):
        with pytest.raises(SystemModelError, match="phase_deg must lie between -1e\\+06 and 1e"):
            HarmonicForce("a", 1.0, phase)
    assert HarmonicForce("a", 1.0, -1e6).phase_deg == -1e6


# --- systems -------------------------------------------------------------------------------------


def modal(**changes):
    data = {"frequencies_hz": [10.0, 20.0], "participation": {"m": [1.0, 2.0]}, **changes}
    return lambda: System.from_modal(**data)


@given(BAD)
def test_modal_frequency(value):
    sentence(modal(frequencies_hz=[10.0, value]), "frequencies_hz")


@given(BAD)
def test_modal_damping(value):
    sentence(modal(modal_damping=value), "modal_damping")
    sentence(modal(modal_damping=[0.1, value]), "modal_damping")


@given(NOT_FINITE)
def test_participation(value):
    sentence(modal(participation={"m": [1.0, value]}), "m", "not finite")


def test_shapes_of_modal_data():
    sentence(modal(participation={"m": [1.0]}), "participation of 'm'", "1 entries", "2 modes")
    sentence(modal(participation={"m": [1.0, 1e200]}), "participation of 'm'", "at most 1e+50")
    sentence(modal(modal_damping=[0.1, 0.1, 0.1]), "modal_damping", "3")
    sentence(modal(frequencies_hz=[]), "at least one mode")
    sentence(modal(frequencies_hz=[[10.0, 20.0]]), "frequencies_hz", "shape (1, 2)")
    sentence(modal(participation={"m": [[1.0, 2.0]]}), "participation of 'm'", "shape (1, 2)")
    sentence(modal(frequencies_hz=["ten", 20.0]), "frequencies_hz", "numbers")


@pytest.mark.parametrize(
    "elements",
    [
        {"stops": [Stop("left", 1e9)]},
        {"stops": [Stop("m", 1e9, against="left")]},
        {"dampers": [Damper("left", 1.0)]},
        {"excitation": [Unbalance("left", 1.0)]},
    ],
    ids=["stop", "against", "damper", "excitation"],
)
def test_unknown_interface(elements):
    sentence(modal(modal_damping=0.1, **elements), "unknown interface 'left'", "m")


def test_elements_of_another_kind():
    sentence(modal(stops=Stop("m", 1e9)), "stops must be a list", "Stop(at='m'")
    sentence(modal(stops=[Damper("m", 1.0)]), "stop cannot be Damper(at='m'")
    sentence(modal(dampers=[1.0]), "damper cannot be 1.0")
    sentence(modal(excitation=[Stop("m", 1e9)]), "excitation cannot be Stop(at='m'")


def test_vectors_that_belong_to_no_interface():
    sentence(modal(participation=[1.0, 2.0]), "participation must be a dictionary", "[1.0, 2.0]")
    sentence(lambda: System.from_matrices([[1.0]], [[1.0]], [1.0]), "interfaces must be a dict")


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"mass": [[1.0, 0.0]]}, ("mass", "square")),
        ({"mass": [[1.0, 0.5], [0.0, 1.0]]}, ("mass", "symmetric")),
        ({"mass": [[1.0, 0.0], [0.0, -1.0]]}, ("mass", "positive definite")),
        ({"mass": [[1.0, 0.0], [0.0, 0.0]]}, ("mass", "positive definite")),
        ({"mass": [[math.nan, 0.0], [0.0, 1.0]]}, ("mass", "not finite")),
        ({"stiffness": [[1.0]]}, ("stiffness", "(1, 1)")),
        ({"stiffness": [[1.0, 0.0], [0.0, -1.0]]}, ("stiffness", "negative")),
        ({"stiffness": [[math.inf, 0.0], [0.0, 1.0]]}, ("stiffness", "not finite")),
        ({"interfaces": {"tip": [1.0]}}, ("interface 'tip'", "1 entries", "2 rows")),
        ({"interfaces": {"tip": [1.0, math.nan]}}, ("interface 'tip'", "not finite")),
        ({"damping": [[1.0]]}, ("damping", "(1, 1)")),
        ({"damping": [[-1.0, 0.0], [0.0, 1.0]]}, ("damping", "energy")),
    ],
)
def test_matrices(changes, words):
    data = {
        "mass": np.eye(2), "stiffness": [[2e3, -1e3], [-1e3, 1e3]],
        "interfaces": {"tip": [0.0, 1.0]}, "modal_damping": 0.01, **changes,
    }  # fmt: skip
    sentence(lambda: System.from_matrices(**data), *words)


def test_modes_that_damping_makes_inseparable():
    """Two free bodies on one damper: a triple eigenvalue at zero with one chain."""
    free = modal(
        frequencies_hz=[0.0, 0.0], participation={"m": [1.0, 2.0]}, dampers=[Damper("m", 1.0)]
    )
    sentence(free, "coinciding modes", "damping")


def test_two_modes_that_a_damper_makes_coincide_are_told_apart_with_a_warning():
    """One of their frequencies is moved by at most 1e-10; the eigenvalues then by its root."""
    with pytest.warns(UserWarning, match="the mode at 9.53463 Hz is moved by 1e-1"):
        system = nearly_defective(0.0)
    omega, n = system.natural_frequencies, system.size
    state = np.block([[np.zeros((n, n)), np.eye(n)], [-np.diag(omega**2), -system.total_damping]])
    exact = np.linalg.eigvals(state)
    for block in system.linear.blocks:
        for value in np.linalg.eigvals(block):
            assert np.abs(exact - value).min() < 2e-5 * abs(value)


def test_undamped_mode_at_its_own_frequency():
    system = System.from_modal([10.0], {"m": [1.0]}, excitation=[HarmonicForce("m", 1.0)])
    sentence(lambda: solve_orbit(system, 10.0), "10 Hz", "undamped mode")


# --- orbits, branches, searches ------------------------------------------------------------------


@pytest.fixture(scope="module")
def orbit(one_dof):
    return solve_orbit(one_dof, 26.0)


@given(BAD | NOT_A_NUMBER | st.sampled_from([0.0, 1.1e12, 1e300]))
def test_frequency(one_dof, value):
    sentence(lambda: solve_orbit(one_dof, value), "frequency_hz must be positive")
    sentence(lambda: find_orbits(one_dof, value, 1), "frequency_hz must be positive")
    seeded = partial(diagram, one_dof, (5.0, 90.0))
    sentence(lambda: seeded(seeds=[SubharmonicSeed(2, value)]), "near")


@pytest.mark.parametrize("period", [0, -1, 1.5, math.nan])
def test_period(one_dof, period):
    sentence(lambda: solve_orbit(one_dof, 26.0, period), "period must be", "from 1 to 10000")
    sentence(lambda: find_orbits(one_dof, 26.0, period), "period must be", "from 1 to 10000")
    sentence(lambda: diagram(one_dof, (20.0, 30.0), periods=[period]), "periods", "at least 1")
    sentence(lambda: SubharmonicSeed(period, 50.0), "SubharmonicSeed: period", "at least 1")


def test_observed_interface(one_dof):
    sentence(lambda: solve_orbit(one_dof, 26.0, observe="tip"), "'tip'", "middle")
    sentence(lambda: find_orbits(one_dof, 26.0, 1, observe="tip"), "'tip'", "middle")
    nowhere = System.from_modal([10.0], {}, modal_damping=0.1)
    sentence(lambda: solve_orbit(nowhere, 26.0), "no interface")


@pytest.mark.parametrize("segments", [0, -1, 3, 2.0])
def test_segments(one_dof, segments):
    sentence(lambda: solve_orbit(one_dof, 26.0, 2, segments=segments), "segments must be")


def test_guess(one_dof):
    sentence(lambda: solve_orbit(one_dof, 26.0, guess=np.zeros(3)), "guess", "2 entries")
    sentence(lambda: solve_orbit(one_dof, 26.0, guess=np.array([math.nan, 0.0])), "guess", "finite")
    sentence(lambda: solve_orbit(one_dof, 26.0, guess=["a", "b"]), "guess must hold numbers only")


@given(BAD | st.just(0.0))
def test_range(one_dof, orbit, value):
    sentence(lambda: continue_branch(orbit, (value, 90.0)), "the range of")
    sentence(lambda: continue_branch(orbit, (20.0, value)), "the range of")
    sentence(lambda: diagram(one_dof, (value, 90.0)), "the range of")


@pytest.mark.parametrize("range_hz", ["ab", None, ("a", 90.0), [[5.0], [90.0, 95.0]]])
def test_range_that_is_not_two_numbers(one_dof, orbit, range_hz):
    sentence(lambda: continue_branch(orbit, range_hz), "range")
    sentence(lambda: diagram(one_dof, range_hz), "the range of")


def test_range_that_is_empty_or_elsewhere(orbit):
    sentence(lambda: continue_branch(orbit, (90.0, 5.0)), "the range of", "ascending")
    sentence(lambda: continue_branch(orbit, (5.0,)), "the range of", "two numbers", "got (5.0,)")
    sentence(lambda: continue_branch(orbit, 30.0), "the range of", "two numbers", "got 30.0")
    sentence(lambda: continue_branch(orbit, (30.0, 90.0)), "orbit at 26 Hz", "outside")


@pytest.mark.parametrize(
    "options",
    [
        {"first_step": 0.0}, {"min_step": -1.0}, {"max_step": 1e-3}, {"max_step": math.nan},
        {"first_step": math.nan}, {"max_angle": 0.0}, {"max_angle": math.nan}, {"max_points": 1},
        {"max_points": math.nan}, {"max_step": math.inf}, {"max_miss": 0.0},
        {"max_miss": math.nan}, {"grazing_step": math.nan}, {"grazing_step": -1.0},
        {"grazing_step": 1e-11}, {"max_step": "a"}, {"max_miss": None}, {"max_angle": 1.5},
    ],
)  # fmt: skip
def test_continuation_options(options):
    sentence(lambda: ContinuationOptions(**options), "continuation:")


@pytest.mark.parametrize(
    "options",
    [
        {"starts": 0}, {"recorded": 0}, {"candidates": -1}, {"transient": -1},
        {"starts": math.nan}, {"seed": -1},
    ],
)  # fmt: skip
def test_search_options(options):
    sentence(lambda: OrbitSearchOptions(**options), "search:", next(iter(options)))


@pytest.mark.parametrize(
    "options",
    [
        {"nodes": 3}, {"nodes": 41}, {"nodes": 12.5},
        {"tail": 0.0}, {"tail": 1.0}, {"tail": math.nan},
    ],
)  # fmt: skip
def test_flow_options(options):
    sentence(lambda: FlowOptions(**options), f"FlowOptions: {next(iter(options))} must")


def test_diagram(one_dof):
    sentence(lambda: diagram(one_dof, (20.0, 30.0), periods=[]), "periods")
    sentence(lambda: diagram(one_dof, (20.0, 30.0), search_points=0), "search_points")
    sentence(lambda: diagram(one_dof, (20.0, 30.0), doublings=-1), "doublings")
    sentence(
        lambda: diagram(one_dof, (20.0, 30.0), seeds=[SubharmonicSeed(2, 40.0)]),
        "near = 40",
        "outside",
    )


@pytest.mark.parametrize("samples", [0, -4, 2.5, True, "many"])
def test_history_needs_a_whole_number_of_samples(orbit, samples):
    sentence(lambda: orbit.history(samples), "history: samples must be a whole number of at least")


@pytest.mark.parametrize("frequency", [0.0, -1.0, math.nan, "a"])
def test_frequency_at_which_a_branch_is_asked_for(one_dof, frequency):
    branch = continue_branch(solve_orbit(one_dof, 60.0), (59.0, 61.0))
    sentence(lambda: branch.at(frequency), "frequency_hz")
