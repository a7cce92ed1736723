"""Areas of contact: many stops with one law, and their numbers as parameters."""

import numpy as np
import pytest

import nldyn
from nldyn import (
    FlowMap,
    HarmonicForce,
    Parameter,
    Stop,
    System,
    SystemModelError,
    contact_area,
    continue_branch,
    solve_orbit,
)
from nldyn.system import Friction
from nldyn.system.chart import Chart, label_of, value_of, with_value
from nldyn.system.naming import stop_name

TURN = np.array([0.0, 2.0 * np.pi])
UNIFORM = {"tip": [1.0, 0.3], "along": [0.2, -0.7]}


def body(stops, points=0):
    places = {f"p{i}": UNIFORM["tip"] for i in range(points)}
    slid = {f"t{i}": UNIFORM["along"] for i in range(points)}
    return System.from_modal(
        [1.0, 3.1],
        UNIFORM | places | slid,
        modal_damping=0.02,
        stops=stops,
        excitation=[HarmonicForce("tip", 10.0)],
    )


def _at_zero(orbit):
    return orbit.states(np.zeros(1))


def area(points=4, stiffness=50.0, **more):
    weights = np.arange(1, points + 1) / 10.0
    return contact_area(
        "edge", [f"p{i}" for i in range(points)], stiffness, weights=weights, gap=0.2, **more
    )


def wedge():
    """An area whose points close one after the other."""
    rng = np.random.default_rng(3)
    places = {f"p{i}": [1.0, x] for i, x in enumerate(np.linspace(-1.5, 1.5, 5))}
    stops = contact_area(
        "edge", list(places), 40.0, weights=rng.uniform(0.5, 1.5, 5), gap=0.1 * rng.uniform(0, 1, 5)
    )
    return System.from_modal(
        [1.0, 3.1], UNIFORM | places, modal_damping=0.02, stops=stops,
        excitation=[HarmonicForce("tip", 10.0)],
    )  # fmt: skip


@pytest.mark.parametrize("exponent", [1.0, 1.5])
@pytest.mark.parametrize("dissipation", [0.0, 0.3])
def test_an_area_under_a_uniform_field_is_one_stop_of_the_sum(exponent, dissipation):
    law = {"exponent": exponent, "dissipation": dissipation}
    many = solve_orbit(body(area(**law), 4), 1.3)
    one = solve_orbit(body([Stop("tip", 50.0, gap=0.2, **law)]), 1.3)
    assert np.allclose(
        _at_zero(many), _at_zero(one), rtol=0.0, atol=1e-12 * np.abs(_at_zero(one)).max()
    )
    assert np.allclose(many.multipliers, one.multipliers, rtol=0.0, atol=1e-12)


def test_derivatives_by_the_numbers_of_an_area_are_those_of_differences():
    system, state = wedge(), np.array([[0.1, 0.2, 0.3, 0.4]])
    for name in ("area_gap", "area_stiffness"):
        parameter = Parameter(name)
        exact = FlowMap(system).shoot(state, TURN, 8.0, parameters=[parameter]).d_parameters
        value = value_of(system, 1.0, parameter)
        step = 1e-5 * value
        ends = [
            FlowMap(with_value(system, parameter, value + sign * step)).shoot(state, TURN, 8.0).ends
            for sign in (1.0, -1.0)
        ]
        differences = (ends[0] - ends[1]) / (2.0 * step)
        scale = np.abs(differences).max()
        assert np.allclose(exact[0, :, 0], differences[0], rtol=0.0, atol=1e-6 * scale)


def test_derivatives_by_the_friction_of_an_area_are_those_of_one_slider():
    rough = {"friction": 0.2, "tangents": ["t0", "t1"]}
    with pytest.raises(SystemModelError, match="not independent"):  # what each holds is not told
        body(area(2, **rough), 2)
    one = body(area(1, friction=Friction(0.2), tangents=["t0"]), 1)
    single = body([Stop("tip", 5.0, 1.0, 0.2, tangent="along", friction=0.2)])
    state = np.array([[0.1, 0.2, 3.0, 0.4]])
    by_area = FlowMap(one).shoot(state, TURN, 8.0, parameters=[Parameter("area_friction")])
    by_slider = FlowMap(single).shoot(state, TURN, 8.0, parameters=[Parameter("friction")])
    assert np.abs(by_slider.d_parameters).max() > 0.0
    assert np.allclose(by_area.d_parameters, by_slider.d_parameters, rtol=1e-12)


def test_an_area_is_followed_in_its_gap_and_stiffness_and_kept_in_files(tmp_path):
    system = wedge()
    orbit = solve_orbit(system, 1.3)
    for name, limits in (("area_gap", (0.0, 0.1)), ("area_stiffness", (20.0, 60.0))):
        branch = continue_branch(orbit, limits, parameter=Parameter(name))
        last = branch.points[-1]
        again = solve_orbit(
            with_value(system, Parameter(name), limits[1]), 1.3, guess=_at_zero(last)
        )
        assert np.allclose(_at_zero(last), _at_zero(again), rtol=0.0, atol=1e-8)
        nldyn.save(branch, tmp_path / f"{name}.h5")
        loaded = nldyn.load(tmp_path / f"{name}.h5")[0]
        assert loaded.points[-1].system.stops == last.system.stops
    assert label_of(Parameter("area_gap")) == "area gap (m)"
    assert stop_name(system, 1) == "'edge', point 2 of 5"


def test_measures_of_an_area_are_those_of_one_stop_of_the_sum():
    (found,) = solve_orbit(body(area(), 4), 1.3).areas
    one = solve_orbit(body([Stop("tip", 50.0, 1.0, 0.2)]), 1.3)
    force = one.history(1000).force[:-1, 0]
    assert np.isclose(found.peak_force, force.max(), rtol=1e-10)
    assert np.isclose(found.mean_force, force.mean(), rtol=1e-10)
    assert found.touched == 1.0 and np.isclose(found.closed, np.mean(force > 0.0), atol=2e-3)
    assert np.allclose(found.pressure, force.max(), rtol=1e-10)  # the weights sum to 1 m²


def test_the_gap_of_an_area_is_that_of_its_nearest_point():
    system = wedge()
    gaps = np.array([stop.gap for stop in system.stops])
    parameter = Parameter("area_gap")
    assert value_of(system, 1.0, parameter) == gaps.min()
    moved = with_value(system, parameter, 0.5)
    assert np.allclose([stop.gap for stop in moved.stops], gaps + 0.5 - gaps.min())
    stiffer = with_value(system, Parameter("area_stiffness"), 80.0)
    assert np.allclose(
        [s.stiffness for s in stiffer.stops], [2.0 * s.stiffness for s in system.stops]
    )


def test_what_makes_no_area_is_refused_in_a_sentence():
    for arguments, said in (
        ({"points": []}, "there are no points"),
        ({"points": ["a", "a"]}, "must name each interface once, not 'a'"),
        ({"stiffness": -1.0}, "stiffness must be positive"),
        ({"weights": [1.0]}, "one number or one for each of 2 points"),
        ({"weights": [1.0, 0.0]}, "weights must be positive"),
        ({"gap": [1.0, 2.0, 3.0]}, "one number or one for each of 2 points"),
        ({"against": ["c"]}, "against must name 2 interfaces"),
        ({"friction": 0.3}, "friction needs both friction and tangent"),
        ({"exponent": 0.5}, "exponent must lie"),
    ):
        given = {"name": "edge", "points": ["a", "b"], "stiffness": 1.0} | arguments
        with pytest.raises(SystemModelError, match=said):
            contact_area(given.pop("name"), given.pop("points"), given.pop("stiffness"), **given)
    plain = body([Stop("tip", 5.0)])
    for name, said in (
        ("area_gap", "the system has none"),
        ("area_friction", "the system has none"),
    ):
        with pytest.raises(SystemModelError, match=said):
            FlowMap(plain).shoot(np.zeros((1, 4)), TURN, 8.0, parameters=[Parameter(name)])
    with pytest.raises(SystemModelError, match="has no friction"):
        FlowMap(wedge()).shoot(np.zeros((1, 4)), TURN, 8.0, parameters=[Parameter("area_friction")])
    with pytest.raises(SystemModelError, match="must be 0 at least"):
        Chart.of(Parameter("area_stiffness"), (-1.0, 2.0))


def test_points_that_slide_over_a_plane_do_as_stops_with_their_shares():
    modes = {"tip": [1.0, 0.3, 0.2], "along": [0.2, -0.7, 0.4], "across": [0.1, 0.5, 0.8]}
    names = {f"{name}{i}": modes[name] for name in modes for i in range(2)}
    law = {"exponent": 1.0, "gap": 0.1, "friction": 0.3}
    edge = contact_area(
        "edge", ["tip0", "tip1"], 50.0, weights=[0.5, 1.5], tangents=["along0", "along1"],
        tangential_stiffness=20.0, second_tangents=["across0", "across1"], **law,
    )  # fmt: skip
    alone = [
        Stop(
            f"tip{i}", 50.0 * share, tangent=f"along{i}", second_tangent=f"across{i}",
            tangential_stiffness=20.0 * share, **law,
        )
        for i, share in enumerate((0.5, 1.5))
    ]  # fmt: skip
    ends = []
    for stops in (edge, alone):
        system = System.from_modal(
            [1.0, 2.1, 3.3], names, modal_damping=0.02, stops=stops,
            excitation=[HarmonicForce("tip0", 10.0)],
        )  # fmt: skip
        flow = FlowMap(system)
        start = flow.to_state(np.array([0.2, 0.1, 0.0, 1.0, 0.5, 1.0]))[None]
        ends.append(flow.to_modal(flow.shoot(start, TURN, 8.0).ends[0]))
    np.testing.assert_allclose(ends[0], ends[1], atol=1e-13)
