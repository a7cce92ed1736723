"""Pictures of where contact presses and wears show the measures of the orbit at their places."""

import math

import numpy as np
import pytest

from nldyn import (
    HarmonicForce,
    RoundStop,
    Stop,
    System,
    SystemModelError,
    contact_area,
    solve_orbit,
)
from nldyn.plot import plot_friction_loss, plot_pressure, plot_wear_around
from nldyn.system import DryFriction

NAMES = ("a", "b", "ta", "tb", "c")


@pytest.fixture(scope="module")
def orbit():
    """Two points of an area with friction and weights, and something else that slides."""
    area = contact_area(
        "pad", ["a", "b"], 50.0, weights=[0.5, 2.0], gap=[0.1, 0.2], friction=0.3,
        tangents=["ta", "tb"],
    )  # fmt: skip
    system = System.from_modal(
        [1.0, 1.3, 1.7, 2.1, 2.6], dict(zip(NAMES, np.eye(5) + 0.1, strict=True)),
        modal_damping=0.1, stops=area, dampers=[DryFriction("c", 1.0, 0.5)],
        excitation=[HarmonicForce(name, 30.0) for name in NAMES],
    )  # fmt: skip
    found = solve_orbit(system, 0.7)
    assert all(each.loss > 0.0 for each in found.friction)
    return found


def test_pressures_are_those_of_the_area_in_the_order_of_its_places(orbit):
    (pad,) = orbit.areas
    ax = plot_pressure(orbit, "pad", places=[0.4, 0.1], measure="length")
    largest, mean = ax.lines
    assert ax.get_ylabel() == "pressure (N/m)" and ax.get_xlabel() == "place (m)"
    np.testing.assert_array_equal(largest.get_xdata(), [0.1, 0.4])
    np.testing.assert_allclose(largest.get_ydata(), pad.pressure[::-1])
    np.testing.assert_allclose(mean.get_ydata(), pad.mean_pressure[::-1])
    assert (pad.mean_pressure < pad.pressure).all()
    assert pad.mean_pressure @ [0.5, 2.0] == pytest.approx(pad.mean_force, rel=1e-12)


@pytest.mark.parametrize(
    ("places", "label", "at"),
    [
        (None, "number of the point", [1.0, 2.0]),
        ([[1.0, 5.0, 0.0], [1.0, 2.0, 0.0]], "y (m)", [2.0, 5.0]),
        ([[0.0, 0.0, 0.0], [3.0, 4.0, 0.0]], "distance along it (m)", [0.0, 5.0]),
    ],
)
def test_places_are_told_by_an_axis_of_the_mesh_or_the_distance(orbit, places, label, at):
    ax = plot_friction_loss(orbit, area="pad", places=places, measure="area")
    (curve,) = ax.lines
    assert ax.get_xlabel() == label
    np.testing.assert_allclose(curve.get_xdata(), at, atol=1e-12)
    assert ax.get_ylabel().endswith("J/m²)")


def test_points_in_a_plane_are_coloured():
    names = ["a", "b", "c"]
    system = System.from_modal(
        [1.0], {name: [x] for name, x in zip(names, (1.0, 0.8, 0.5), strict=True)},
        modal_damping=0.1, stops=contact_area("pad", names, 40.0, gap=0.1),
        excitation=[HarmonicForce("a", 10.0)],
    )  # fmt: skip
    orbit = solve_orbit(system, 0.7)
    ax = plot_pressure(orbit, "pad", places=[[0, 0, 1], [0, 1, 1], [0, 0, 3]])
    (marks,) = ax.collections
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("y (m)", "z (m)")
    np.testing.assert_allclose(marks.get_offsets(), [[0, 1], [1, 1], [0, 3]])
    np.testing.assert_allclose(marks.get_array(), orbit.areas[0].pressure)


def test_bars_are_what_each_loses_an_area_together(orbit):
    first, second, other = (each.loss for each in orbit.friction)
    ax = plot_friction_loss(orbit)
    names = [text.get_text() for text in ax.get_yticklabels()]
    shown = dict(zip(names, (bar.get_width() for bar in ax.patches), strict=True))
    assert ax.get_xlabel() == "energy dissipated in a period (J)"
    assert shown == pytest.approx(
        {"'pad', all points": first + second, "friction at 'c'": other}, rel=1e-12
    )


@pytest.mark.parametrize(("count", "then"), [(2, ",\nstop"), (8, ", stop")])
def test_few_bars_have_names_on_two_lines(count, then):
    names = [f"t{number}" for number in range(count)]
    rows = dict(zip([*names, "at"], np.eye(count + 1), strict=True))
    system = System.from_modal(
        np.linspace(1.0, 2.0, count + 1), rows, modal_damping=0.1,
        stops=[Stop("at", 1.0, 1.0, 0.1, tangent=name, friction=0.1) for name in names],
        excitation=[HarmonicForce("at", 10.0)],
    )  # fmt: skip
    ax = plot_friction_loss(solve_orbit(system, 0.7))
    shown = {text.get_text() for text in ax.get_yticklabels()}
    assert shown == {f"friction at '{name}'{then} at 'at'" for name in names}


@pytest.mark.parametrize("rigid", [False, True])
def test_sectors_of_a_ring_lose_together_what_the_ring_does(rigid):
    ring = RoundStop(("x", "y"), 5e4, 1e-3, 1.0, friction=0.2, surface_speed=0.0)
    damping, force, other, phase = 24.0, 3.0, 2.0, -90.0
    if rigid:
        ring = RoundStop.rigid(("x", "y"), 0.6, 1e-3, friction=0.2, surface_speed=0.3)
        damping, force, other, phase = 12.0, 12.0, 4.0, -70.0
    system = System.from_matrices(
        2.0 * np.eye(2), 8e3 * np.eye(2), {"x": [1.0, 0.0], "y": [0.0, 1.0]},
        damping=damping * np.eye(2), stops=[ring],
        excitation=[HarmonicForce("x", force), HarmonicForce("y", other, phase_deg=phase)],
    )  # fmt: skip
    orbit = solve_orbit(system, 9.0)
    ax = plot_wear_around(orbit, 0)
    (sectors,) = ax.patches
    values, edges = sectors.get_data()[:2]
    factor = {"(mJ)": 1e-3, "(µJ)": 1e-6}[ax.get_ylabel().split()[-1]]
    # what rests on a rigid one is let go, or slips, between two instants
    error = 1e-3 if rigid else 1e-6
    assert values.sum() * factor == pytest.approx(orbit.friction[0].loss, rel=error)
    if rigid:
        assert orbit.impacts > 0
        return
    history = orbit.history(720)
    touching = history.force[:, 0] > 0.0
    angles = np.arctan2(history.displacement["y"], history.displacement["x"])[touching]
    at = np.searchsorted(edges, np.degrees(angles)) - 1
    assert (values[at] > 0.0).all() and (values > 0.0).sum() < 60
    assert math.isclose(edges[1] - edges[0], 5.0)


def test_what_cannot_be_drawn_is_told(orbit):
    for fault, told in (
        (lambda: plot_pressure(orbit, "pads"), "area must be one of pad, got 'pads'"),
        (lambda: plot_pressure(orbit, "pad", places=[1.0]), "those of 2 points"),
        (lambda: plot_pressure(orbit, "pad", measure="volume"), "measure"),
        (lambda: plot_wear_around(orbit, 0), r"stops\[0\] is no round clearance"),
    ):
        with pytest.raises(SystemModelError, match=told):
            fault()
    smooth = System.from_modal([1.0], {"a": [1.0]}, modal_damping=0.1,
                               excitation=[HarmonicForce("a", 1.0)])  # fmt: skip
    with pytest.raises(SystemModelError, match="nothing rubs"):
        plot_friction_loss(solve_orbit(smooth, 0.5))
