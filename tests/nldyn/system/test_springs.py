"""Springs and dampers between interfaces: closed forms, and the same structure by its matrices."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from click.testing import CliRunner
from independent import Motion

import nldyn
from nldyn import Damper, FlowMap, HarmonicForce, Parameter, PolynomialSpring, Spring, Stop, System
from nldyn.app.cli import main
from nldyn.base.errors import SceneError, SystemModelError
from nldyn.base.resources import example
from nldyn.scene.build import build_system
from nldyn.scene.read import load_scene, parse_scene
from nldyn.system import CubicDamper
from nldyn.system.equilibrium import rest, rest_positions

UNITS = {f"m{i}": np.eye(6)[i].tolist() for i in range(6)}


def chain(ends=(), count=6, mass=2.0, k=18.0, **more):
    """Free masses in a row that springs join, and further springs."""
    names = list(UNITS)[:count]
    springs = [Spring(a, k, b) for a, b in pairwise(names)]
    return System.from_matrices(
        mass * np.eye(count),
        np.zeros((count, count)),
        {name: UNITS[name][:count] for name in names},
        springs=[*springs, *ends],
        **more,
    )


def test_a_chain_has_the_frequencies_of_the_closed_form():
    """2 sqrt(k/m) sin(j pi/(2n + 2)) between walls, 2 sqrt(k/m) sin(j pi/(2n)) free."""
    held = chain([Spring("m0", 18.0), Spring("m5", 18.0)])
    j = np.arange(1, 7)
    exact = 6.0 * np.sin(j * np.pi / 14.0) / (2.0 * np.pi)
    assert held.linear.frequencies_hz == pytest.approx(exact, rel=1e-14)
    assert held.free_modes == 0
    free = chain()
    exact = 6.0 * np.sin((j - 1) * np.pi / 12.0) / (2.0 * np.pi)
    assert free.linear.frequencies_hz == pytest.approx(exact, rel=1e-14, abs=0.0)
    assert free.free_modes == 1
    assert free.left_free


def test_a_soft_mode_keeps_its_digits_beside_a_stiff_one():
    """Modes at 1 rad/s and 1e7 rad/s with a spring k = 1: a quadratic equation."""
    soft, stiff = 1.0, 1e14
    system = System.from_modal(
        np.sqrt([soft, stiff]) / (2.0 * np.pi), {"a": [1.0, 1.0]}, springs=[Spring("a", 1.0)]
    )
    trace, determinant = soft + stiff + 2.0, (soft + 1.0) * (stiff + 1.0) - 1.0
    lower = 2.0 * determinant / (trace + np.sqrt(trace * trace - 4.0 * determinant))
    assert (2.0 * np.pi * system.linear.frequencies_hz[0]) ** 2 == pytest.approx(lower, rel=1e-14)


def pair(matrices):
    """Two masses with a spring and a damper between them, as elements or as matrices."""
    between = np.array([[1.0, -1.0], [-1.0, 1.0]])
    grounded = np.diag([1.0, 0.0])
    damping = np.array([[0.06, -0.01], [-0.01, 0.08]])
    common = {
        "stops": [Stop("b", 5e3, gap=0.2, direction=-1), Stop("a", 40.0, 1.0, 0.3, 1, "b")],
        "excitation": [HarmonicForce("a", 1.0)],
    }
    interfaces = {"a": [1.0, 0.0], "b": [0.0, 1.0]}
    K = np.diag([3.0, 4.0])
    if matrices:
        K = K + 5.0 * between - 1.5 * grounded
        C = damping + 0.3 * between
        return System.from_matrices(np.diag([1.0, 2.0]), K, interfaces, damping=C, **common)
    return System.from_matrices(
        np.diag([1.0, 2.0]), K, interfaces, damping=damping,
        springs=[Spring("a", 5.0, "b"), Spring("a", -1.5)], dampers=[Damper("b", 0.3, "a")],
        **common,
    )  # fmt: skip


def test_orbits_with_springs_are_those_of_the_matrices():
    found, same = (nldyn.solve_orbit(pair(matrices), 0.2) for matrices in (False, True))
    assert found.impacts == same.impacts > 0
    assert found.max_abs_displacement == pytest.approx(same.max_abs_displacement, rel=1e-9)
    order = np.lexsort((found.multipliers.imag, found.multipliers.real))
    other = np.lexsort((same.multipliers.imag, same.multipliers.real))
    assert found.multipliers[order] == pytest.approx(same.multipliers[other], rel=1e-7)
    assert found.liouville_error < 1e-8


def test_springs_and_dampers_go_through_files(tmp_path):
    orbit = nldyn.solve_orbit(pair(False), 0.2)
    branch = nldyn.continue_branch(orbit, (0.1998, 0.2002))
    nldyn.save(branch, tmp_path / "b.h5")
    (back,) = nldyn.load(tmp_path / "b.h5")
    assert back.points[0].system.springs == orbit.system.springs
    assert back.points[0].system.dampers == orbit.system.dampers
    assert np.array_equal(back.max_abs_displacement, branch.max_abs_displacement)


def test_a_spring_is_a_parameter():
    """|u| of one mass on k is 1/sqrt((k - ω²)² + (cω)²)."""
    system = System.from_matrices(
        [[1.0]], [[0.0]], {"a": [1.0]}, damping=[[0.2]], springs=[Spring("a", 2.0)],
        excitation=[HarmonicForce("a", 1.0)],
    )  # fmt: skip
    orbit = nldyn.solve_orbit(system, 1.0 / (2.0 * np.pi))
    family = nldyn.continue_branch(orbit, (1.5, 2.5), parameter=Parameter("spring_stiffness"))
    k = np.array([point.system.springs[0].stiffness for point in family.points])
    size = np.array([point.max_abs_displacement for point in family.points])
    assert k.min() == pytest.approx(1.5) and k.max() == pytest.approx(2.5)
    assert size == pytest.approx(1.0 / np.hypot(k - 1.0, 0.2), rel=1e-8)


def test_rest_on_springs():
    """A load of 1 N on the first of two free masses, of which the second is held."""
    system = chain([Spring("m1", 4.0)], count=2, excitation=[nldyn.ConstantForce("m0", 1.0)])
    q = rest(system)
    places = [float(phi @ q) for phi in system.participation.values()]
    assert places == pytest.approx([1.0 / 4.0 + 1.0 / 18.0, 1.0 / 4.0], rel=1e-12)


def test_what_makes_no_sense_is_refused():
    with pytest.raises(SystemModelError, match="spring at 'a': against must be another interface"):
        Spring("a", 1.0, "a")
    with pytest.raises(SystemModelError, match="spring at 'a': stiffness must be a finite number"):
        Spring("a", np.nan)
    with pytest.raises(SystemModelError, match="damper at 'a': against must be another interface"):
        Damper("a", 1.0, "a")
    with pytest.raises(SystemModelError, match="spring against unknown interface 'z'"):
        System.from_modal([1.0], {"a": [1.0]}, springs=[Spring("a", 1.0, against="z")])
    with pytest.raises(SystemModelError, match="spring at unknown interface 'z'"):
        replace(pair(True), springs=(Spring("z", 1.0),))
    with pytest.raises(SystemModelError, match="negative in a direction"):
        replace(pair(True), springs=(Spring("a", -20.0),))


SCENE = """
[matrices]
mass = [[1.0, 0.0], [0.0, 2.0]]
stiffness = [[3.0, 0.0], [0.0, 4.0]]
damping = [[0.06, -0.01], [-0.01, 0.08]]
interfaces.a = [1.0, 0.0]
interfaces.b = [0.0, 1.0]

[[springs]]
at = "a"
against = "b"
stiffness = 5.0

[[springs]]
at = "a"
stiffness = -1.5

[[dampers]]
at = "b"
against = "a"
coefficient = 0.3
"""


def test_springs_in_a_scene():
    system = build_system(parse_scene(SCENE))
    same = pair(True)
    assert system.linear.frequencies_hz == pytest.approx(same.linear.frequencies_hz, rel=1e-12)
    assert np.trace(system.total_damping) == pytest.approx(np.trace(same.total_damping), rel=1e-12)
    with pytest.raises(SceneError, match=r"springs\[0\].against 'c' is not an interface"):
        parse_scene(SCENE.replace('against = "b"', 'against = "c"'))
    with pytest.raises(SceneError, match="needs another interface than its own in 'against'"):
        parse_scene(SCENE.replace('against = "b"', 'against = "a"'))


WELLS = """
[[springs]]
at = "b"
against = "a"
coefficients = [-8.0, 0.0, 2.0]

[[dampers]]
at = "a"
law = "cubic"
coefficient = 0.2

[[dampers]]
at = "b"
law = "displacement"
coefficient = 0.1

[[excitation]]
at = "a"
kind = "harmonic"
amplitude = 1.0

[continuation]
range_hz = [0.1, 1.0]
"""


def test_nonlinear_springs_and_dampers_in_a_scene(tmp_path):
    """Two bodies, held by nothing else than springs, with two rest positions: told by check."""
    system = build_system(parse_scene(SCENE + WELLS))
    assert system.springs[2] == PolynomialSpring("b", (-8.0, 0.0, 2.0), "a")
    assert system.dampers[1:] == (
        CubicDamper("a", 0.2),
        CubicDamper("b", 0.1, by="displacement"),
    )
    (tmp_path / "wells.toml").write_text(SCENE + WELLS)
    told = CliRunner().invoke(main, ["check", str(tmp_path / "wells.toml")])
    assert told.exit_code == 0
    assert "spring at 'b' against 'a': -8 N/m, 2 N/m^3" in told.stdout
    # with u = b - a: 1.5 a = 4 b·(-1), so that (1.5 · 4 / 5.5 + 5 - 8) u + 2 u³ = 0
    u = np.sqrt((3.0 - 6.0 / 5.5) / 2.0)
    first, second = (line for line in told.stdout.splitlines() if "at rest" in line)
    assert first.startswith("at rest: ") and second.startswith("or at rest: ")
    assert f"{4.0 / 5.5 * u:.6g} m at 'a'" in first + second
    for q in rest_positions(system):
        a, b = (float(phi @ q) for phi in system.participation.values())
        assert abs(b - a) == pytest.approx(u, rel=1e-12)
        assert 1.5 * a == pytest.approx(-4.0 * b, rel=1e-12)


def test_a_tilted_double_well_has_two_rest_positions_of_which_the_lower_comes_first():
    """x³ - x = 0.1."""
    system = System.from_matrices(
        [[1.0]], [[0.0]], {"a": [1.0]}, springs=[PolynomialSpring("a", [-1.0, 0.0, 1.0])],
        excitation=[nldyn.ConstantForce("a", 0.1)],
    )  # fmt: skip
    lowest, middle, other = sorted(np.roots([1.0, 0.0, -1.0, -0.1]).real, key=lambda x: -x)
    found = [float(system.participation["a"] @ q) for q in rest_positions(system)]
    assert found == pytest.approx([lowest, other], rel=1e-12)
    assert middle == pytest.approx(-0.1, rel=0.02)  # the saddle, which is none


def test_rest_positions_that_there_are_not():
    softening = System.from_matrices(
        [[1.0]], [[1.0]], {"a": [1.0]}, springs=[PolynomialSpring("a", [0.0, 0.0, -1.0])],
        excitation=[nldyn.ConstantForce("a", 5.0)],
    )  # fmt: skip
    with pytest.raises(SystemModelError, match="springs at 'a' let it run away"):
        rest(softening)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("coefficients = [-8.0, 0.0, 2.0]", "coefficients = [0.0]", "not all zero"),
        ("coefficients = [-8.0, 0.0, 2.0]", "", "needs one of 'stiffness' and 'coefficients'"),
        ('law = "cubic"\ncoefficient = 0.2', 'law = "cubic"\ncoefficient = 0.0', "above 0"),
        (
            'against = "a"\ncoefficients',
            'direction = "x"\ncoefficients',
            "is not a key of a spring with a 'direction'",
        ),
    ],
)
def test_springs_that_make_no_sense_in_a_scene(old, new, words):
    with pytest.raises(SceneError, match=words):
        parse_scene(SCENE + WELLS.replace(old, new))


def test_the_beam_with_two_wells_rests_where_beam_theory_says():
    """u = sqrt((9 - 3EI/L³)/4e4), and a motion between the wells is that of Runge and Kutta."""
    system = build_system(load_scene(example("two_well_beam.toml")))
    held = 3.0 * 2.1e11 * 0.02 * 5e-4**3 / 12.0 / 0.3**3
    tip = np.sqrt((9.0 - held) / 4e4)
    found = sorted(float(system.participation["tip"] @ q) for q in rest_positions(system))
    assert found == pytest.approx([-tip, tip], rel=1e-7)
    assert tip == pytest.approx(0.0101721, abs=5e-8)
    flow, start = FlowMap(system), np.array([1e-3, 0.0, 0.0, 0.0, 0.02, 0.0, 0.0, 0.0])
    end, *_ = Motion(system).run(start, (0.0, 2.0 * np.pi), 25.0, tangent=False)
    here = flow.to_state(start)[None]
    end_found = flow.shoot(here, np.array([0.0, 2.0 * np.pi]), 25.0).ends[0]
    row = system.participation["tip"]
    assert row @ flow.to_modal(end_found)[:4] == pytest.approx(row @ end[:4], rel=1e-8)


def test_the_line_of_a_system_knows_its_linear_springs():
    """One mass of 1 kg on 1 N/m and a spring of 3 N/m: 2 rad/s, not 1."""
    sprung = System.from_matrices([[1.0]], [[1.0]], {"a": [1.0]}, springs=[Spring("a", 3.0)])
    assert "0.31831 Hz with the springs" in repr(sprung)
