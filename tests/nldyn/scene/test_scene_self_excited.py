"""Scenes without excitation: motions that excite themselves, with the frequency found."""

import csv
import json
import math

import numpy as np
import pytest
from click.testing import CliRunner
from scipy.integrate import solve_ivp

from nldyn import SystemModelError, diagram, explore, load, solve_orbit
from nldyn.app.cli import main
from nldyn.base.errors import ConvergenceError, SceneError
from nldyn.base.resources import example
from nldyn.plot import plot_wear_around
from nldyn.report.answer import answer_lines
from nldyn.report.contact import contact_figure
from nldyn.report.render import orbit_to_draw
from nldyn.report.results import tables_of
from nldyn.scene.basins import basins_of
from nldyn.scene.build import build_system
from nldyn.scene.checks import check_computable
from nldyn.scene.read import load_scene, parse_scene
from nldyn.scene.run import compute
from nldyn.scene.sweep import sweep_of

BLOCK = """
[matrices]
mass = [[1.0]]
stiffness = [[1.0]]
[matrices.interfaces]
block = [1.0]
[damping]
modal_ratio = {ratio}
[[friction]]
at = "block"
coefficient = 0.3
at_rest = 0.4
fading_speed = {fading}
base_speed = 0.1
normal_force = 1.0
{excitation}
[continuation]
parameter = "friction.0.base_speed"
range = [0.09, 0.11]
search_points = {points}
max_step = 0.5
{more}
"""


def block(excitation="", more="", fading=0.05, ratio=0.02, points=1):
    return BLOCK.format(excitation=excitation, more=more, fading=fading, ratio=ratio, points=points)


def scene_with(*args, **changed):
    return parse_scene(block(*args, **changed))


def closed_form(speed):
    """Period of stick-slip in s where friction drops at once: slipping, then sticking."""
    drop, rate = 0.1, 1.0
    return 2.0 * drop / speed + 2.0 / rate * (math.pi - math.atan(drop * rate / speed))


def integrated(speed):
    """Period of stick-slip in s: from where it slips to where it is as fast as the belt again."""

    def rate(_, y):
        friction = 0.3 + 0.1 * math.exp((y[1] - speed) / 0.05)
        return [y[1], friction - y[0] - 0.04 * y[1]]

    def as_fast(t, y):
        return speed - y[1] if t > 1.0 else 1.0

    as_fast.terminal, as_fast.direction = True, -1
    slips_at = 0.4 - 0.04 * speed
    found = solve_ivp(
        rate, (0.0, 30.0), [slips_at, speed], "DOP853", rtol=3e-14, atol=1e-15, events=as_fast
    )
    return found.t[-1] + (slips_at - found.y[0, -1]) / speed


@pytest.mark.parametrize(
    ("excitation", "more"),
    [
        ("", ""),
        ("", "[start]\nvelocities.block = 0.1"),
        ('[[excitation]]\nkind = "constant"\nat = "block"\nforce = 0.5', ""),
    ],
)
def test_a_block_on_a_belt_has_the_period_of_an_integration_at_every_speed(excitation, more):
    found = compute(scene_with(excitation, more))
    (branch,) = found.branches
    assert branch.name == "01 limit cycle"
    assert (branch.values.min(), branch.values.max()) == (0.09, 0.11)
    periods = [integrated(speed) for speed in branch.values]
    assert 1.0 / branch.frequency_hz == pytest.approx(np.array(periods), rel=1e-8)


def test_a_run_writes_tables_pictures_and_a_report_and_is_read_again(tmp_path):
    scene, out = tmp_path / "scene.toml", tmp_path / "out"
    scene.write_text(block())
    told = CliRunner().invoke(main, ["check", str(scene)])
    assert "nothing excites it: motions that excite themselves" in told.output
    told = CliRunner().invoke(main, ["run", str(scene), "--out", str(out)])
    assert told.exit_code == 0, told.output
    assert "frequency, found with the motion: " in told.output
    with (out / "branches.csv").open() as file:
        rows = list(csv.DictReader(file))
    for row in rows:
        period = 1.0 / float(row["frequency_hz"])
        assert period == pytest.approx(integrated(float(row["base_speed"])), rel=1e-8)
    assert json.loads((out / "summary.json").read_text())["parameter"] == "base_speed"
    assert "base speed (m/s)" in (out / "diagram.svg").read_text()
    assert (out / "report.html").stat().st_size > 10_000
    back = load(out / "branches.h5")
    assert back.axis.self_excited
    assert back.branches[0].frequency_hz.tolist() == [float(row["frequency_hz"]) for row in rows]
    again = CliRunner().invoke(main, ["run", str(scene), "--out", str(out)])
    assert "computed before" in again.output


def test_the_example_finds_the_hopf_point_where_friction_falls_as_fast_as_damping_takes():
    """2 ζ ω m = (μ₀ - μ) N/v₀ exp(-v/v₀); the unstable cycle that is born there lies below."""
    scene = load_scene(example("block_on_a_belt.toml"))
    (branch,) = compute(scene).branches
    sliding, hopf = branch.special_points
    assert (sliding.kind, hopf.kind) == ("GS", "Hopf")
    assert hopf.value == pytest.approx(0.05 * math.log(0.1 / 0.05 / 0.04), rel=1e-5)
    assert [orbit.stable for orbit in branch.at(0.4)] == [True, False]


def test_the_limit_cycle_of_the_scene_itself_is_drawn_and_has_its_closed_form():
    scene = scene_with(fading=1e-12, ratio=0.0)
    assert orbit_to_draw(scene, build_system(scene), None).duration == pytest.approx(
        closed_form(0.1), rel=1e-9
    )


def rolling(speed):
    """Radius in m of the rotor that rolls in its ring: m v²/r = k r + s (r - c)."""
    m, k, s, c = 10.0, 4e5, 2e6, 6e-4
    return (s * c + math.sqrt((s * c) ** 2 + 4.0 * (s + k) * m * speed**2)) / (2.0 * (s + k))


def test_the_rotor_of_the_example_whips_backwards_as_in_closed_form():
    """It rolls, so that its frequency is v/r; its ring is pressed alike all the time."""
    found = compute(load_scene(example("dry_whip.toml")))
    (branch,) = found.branches
    assert (branch.values.min(), branch.values.max()) == (0.18, 0.35)
    radii = np.array([rolling(speed) for speed in branch.values])
    np.testing.assert_allclose(branch.frequency_hz, branch.values / radii / 2 / math.pi, rtol=1e-10)
    for orbit, radius in zip(branch.points, radii, strict=True):
        (pressed,) = orbit.impact_list
        assert pressed.force == pytest.approx(2e6 * (radius - 6e-4), rel=1e-9)
        x, y = (orbit.history(4).displacement[name][:2] for name in "xy")
        assert x[0] * y[1] - x[1] * y[0] == pytest.approx(-(radius**2), rel=1e-9)  # from y to x
    force = f"{2e6 * (radii.max() - 6e-4):.4g} N at surface speed 0.35 m/s (stable)"
    told = answer_lines(found, tables_of(found)["special_points"])
    assert f"largest contact force: {force}" in told
    assert not plot_wear_around(branch.points[0], 0).patches[0].get_data().values.any()
    assert contact_figure(found) is None


@pytest.mark.parametrize(
    ("change", "told"),
    [
        ({"more": "frequency_hz = 0.1"}, "continuation.frequency_hz is of no use where nothing"),
        ({"more": "periods = [1]"}, "continuation.periods is of no use where nothing"),
        ({"more": "[[subharmonics]]\nperiod = 2\nnear = 0.1"}, "subharmonics is of no use"),
    ],
)
def test_what_needs_an_excitation_is_refused_in_a_sentence(change, told):
    scene = scene_with(**change)
    with pytest.raises(SceneError, match=told):
        check_computable(scene, scene.file)


def test_an_exploration_is_refused():
    text = block().replace("search_points = 1", "") + "[explore]"
    with pytest.raises(SceneError, match="explore is of no use where nothing excites"):
        compute(parse_scene(text))


def test_a_range_of_frequencies_without_excitation_is_refused_with_what_to_do():
    text = block().split("[continuation]")[0]
    scene = parse_scene(text + "[continuation]\nrange_hz = [0.1, 0.2]")
    with pytest.raises(SceneError, match=r"moves the structure; .* 'friction.0.base_speed'"):
        check_computable(scene, scene.file)


def test_what_searches_for_forced_motions_says_so_at_once():
    carried = build_system(scene_with())
    with pytest.raises(ConvergenceError, match="by limit_cycle"):
        solve_orbit(carried, 0.2)
    with pytest.raises(SystemModelError, match="found, not given"):
        diagram(carried, (0.1, 0.2))
    with pytest.raises(SystemModelError, match="frequencies of their own"):
        explore(carried, (0.1, 0.2), 2, parameter="base_speed")
    with pytest.raises(SystemModelError, match="for excited ones"):
        diagram(carried, (0.1, 0.2), parameter="base_speed", doublings=1)


def test_what_needs_the_frequency_of_an_excitation_says_so():
    scene = scene_with()
    for compute_it in (
        lambda: basins_of(scene, 0.16),
        lambda: basins_of(scene, over=3),
        lambda: sweep_of(scene, points=3),
    ):
        with pytest.raises(SceneError, match="nothing excites the system, whose motions have freq"):
            compute_it()
