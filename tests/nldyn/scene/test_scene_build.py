"""Scenes become components, reduced models and systems."""

import math
import tomllib
from types import SimpleNamespace

import numpy as np
import pytest

import nldyn.scene.run
from nldyn.base.errors import SceneError
from nldyn.base.resources import example, examples, mesh
from nldyn.scene.build import build_candidates, build_reduced, build_selection, build_system
from nldyn.scene.component import build_component
from nldyn.scene.load_case import load_case_of
from nldyn.scene.read import load_scene, parse_scene
from nldyn.scene.run import compute
from nldyn.system.rigid_stop import RigidStop

MODAL = """
[modal]
frequencies_hz = [13.1, 125.1]
participation.a = [0.6, 0.5]
participation.b = [0.4, -0.2]
"""


def test_rayleighs_damping_of_a_mesh_is_that_of_its_matrices():
    scene = load_scene(example("two_dof_xi_0.01.toml"))
    keys = "[damping]\nrayleigh_mass = 2.0\nrayleigh_stiffness = 1e-5"
    damped = parse_scene(scene.text.replace("[damping]", keys), scene.file)
    squares = build_system(scene).natural_frequencies ** 2
    added = build_system(damped).total_damping - build_system(scene).total_damping
    np.testing.assert_allclose(added, np.diag(2.0 + 1e-5 * squares), rtol=1e-10, atol=1e-9)
    asked = load_case_of(damped).system(build_reduced(scene)).total_damping
    np.testing.assert_allclose(asked, build_system(damped).total_damping, rtol=1e-12)
    with pytest.raises(SceneError, match=r"Rayleigh's damping, which needs a \[reduction\]"):
        build_system(parse_scene(MODAL + "[damping]\nrayleigh_mass = 1.0"))


def test_one_dof_is_equation_3_1():
    system = build_system(load_scene(example("one_dof.toml")))
    assert system.natural_frequencies[0] ** 2 == pytest.approx(16877 / 2.48, rel=1e-14)
    assert 1 / system.participation["middle"][0] ** 2 == pytest.approx(2.48, rel=1e-14)
    damping = system.total_damping[0, 0] * 2.48
    assert damping == pytest.approx(2 * 0.0142 * math.sqrt(2.48 * 16877), rel=1e-14)
    (stop,) = system.stops
    assert (stop.stiffness, stop.exponent, stop.gap, stop.direction) == (5.17e9, 1.5, 0.0, 1)
    assert system.excitation[0].mass_times_radius == 4.92e-6


@pytest.mark.parametrize(
    ("name", "published"),
    [
        ("two_dof_xi_0.01.toml", [13.1, 125.1]),
        ("four_dof_xi_0.001.toml", [13.1, 117.5, 326.5, 749.5]),
    ],
)
def test_beam_scenes_meet_the_published_frequencies(name, published):
    """Within 0.2 %, as the documentation of the calibration says."""
    system = build_system(load_scene(example(name)))
    np.testing.assert_allclose(system.frequencies_hz, published, rtol=2e-3)
    assert 1 / system.participation["middle"][0] ** 2 == pytest.approx(2.48, rel=2e-3)


def test_beam_scenes_share_one_structure():
    systems = [build_system(load_scene(example(n))) for n in examples() if "two_dof" in n]
    assert len(systems) == 2
    np.testing.assert_array_equal(systems[0].frequencies_hz, systems[1].frequencies_hz)
    assert systems[0].damping[0, 0] != systems[1].damping[0, 0]


def test_damper_of_beam_scenes_is_that_of_equation_3_1():
    for name in examples():
        if "_xi_" in name:
            (damper,) = load_scene(example(name)).dampers
            assert damper.coefficient == pytest.approx(
                2 * 0.0142 * math.sqrt(2.48 * 16877), abs=1e-5
            )


def test_mass_of_beam_scenes_is_half_of_the_calibrated_one():
    calibrated = tomllib.loads(mesh("half_beam.toml").read_text())["middle_mass"]
    for name in examples():
        if "_xi_" in name:
            (mass,) = load_scene(example(name)).point_masses
            assert mass.mass == pytest.approx(calibrated / 2, rel=1e-12)


def test_component_can_be_handed_on():
    scene = load_scene(example("two_dof_xi_0.01.toml"))
    component = build_component(scene)
    reduced = build_reduced(scene, component)
    system = build_system(scene, reduced)
    np.testing.assert_array_equal(system.frequencies_hz, reduced.frequencies_hz)


def test_cutoff_gives_the_same_model_as_the_mode_count():
    scene = load_scene(example("four_dof_xi_0.01.toml"))
    other = parse_scene(scene.text.replace("modes = 3", "cutoff_hz = 400.0"), scene.file)
    np.testing.assert_allclose(
        build_reduced(other).frequencies_hz, build_reduced(scene).frequencies_hz, rtol=1e-8
    )


def with_tolerance(*changes):
    """The beam with its modes chosen by a tolerance."""
    scene = load_scene(example("four_dof_xi_0.01.toml"))
    text = scene.text
    for old, new in (("modes = 3", "tolerance = 0.3"), *changes):
        assert old in text
        text = text.replace(old, new)
    return parse_scene(text, scene.file)


def test_a_tolerance_asks_for_a_selection_in_the_scenes_setting(monkeypatch, caplog):
    asked = {}

    def select_modes(component, setting, *, tolerance, progress):
        assert set(component.interfaces) == {"middle"}
        asked.update(range=setting.range_hz, tolerance=tolerance)
        return SimpleNamespace(reduced="the model", report=lambda: "modes kept: 1")

    monkeypatch.setattr("nldyn.reduction.selection.select_modes", select_modes)
    with caplog.at_level("INFO", logger="nldyn"):
        assert build_reduced(with_tolerance()) == "the model"
    assert asked == {"range": (15.0, 90.0), "tolerance": 0.3}
    assert "modes kept: 1" in caplog.text


@pytest.mark.parametrize(
    "old, new, sentence",
    [
        ("modal_ratio = 0.01", "modal_ratio = [0.01, 0.01]", "must be one number where the number"),
        ("tolerance = 0.3", "tolerance = 0.01", "may matter, more than 3; reduce by hand"),
    ],
)
@pytest.mark.parametrize("build", [build_selection, build_candidates])
def test_a_tolerance_that_cannot_be_met_is_told(old, new, sentence, build, monkeypatch):
    monkeypatch.setattr("nldyn.reduction.candidates.MOST_MODES", 3)
    with pytest.raises(SceneError, match=sentence):
        build(with_tolerance((old, new)))


def test_sections_of_every_kind(tmp_path):
    scene = load_scene(example("two_dof_xi_0.01.toml"))
    rectangle = "width = 0.09               # m, out of the plane\nheight = 0.01 "
    assert rectangle in scene.text
    general = scene.text.replace(rectangle, "area = 0.0009\nsecond_moment = 7.5e-9")
    np.testing.assert_allclose(
        build_reduced(parse_scene(general, scene.file)).frequencies_hz,
        build_reduced(scene).frequencies_hz,
        rtol=1e-8,
    )
    tube = scene.text.replace(rectangle, "diameter = 0.03\nbore = 0.02")
    assert build_reduced(parse_scene(tube, scene.file)).frequencies_hz[0] > 0


def test_mesh_is_sought_beside_the_scene(tmp_path):
    scene = load_scene(example("two_dof_xi_0.01.toml"))
    (tmp_path / "half_beam.msh").write_bytes(mesh("half_beam.msh").read_bytes())
    moved = tmp_path / "moved.toml"
    moved.write_text(scene.text.replace("../../meshes/", ""))
    assert build_component(load_scene(moved)).stiffness.shape[0] > 0


def test_hertz_stop_from_a_sphere():
    scene = parse_scene(
        MODAL + "[[stops]]\nat='a'\nradius=0.005\nyoungs_modulus=2.1e11\npoissons_ratio=0.25\n"
    )
    (stop,) = build_system(scene).stops
    effective = 2.1e11 / (2 * (1 - 0.25**2))
    assert stop.stiffness == pytest.approx(4 / 3 * effective * math.sqrt(0.005), rel=1e-12)
    assert stop.exponent == 1.5


def test_stop_gap_direction_law_and_other_side():
    text = "[[stops]]\nat='a'\nlaw='linear'\nstiffness=1e7\ngap=-1e-5\ndirection=-1\nagainst='b'\n"
    (stop,) = build_system(parse_scene(MODAL + text)).stops
    assert (stop.exponent, stop.gap, stop.direction, stop.against) == (1.0, -1e-5, -1, "b")


def test_observed_interface_comes_first():
    assert build_system(parse_scene(MODAL)).interfaces == ("a", "b")
    assert build_system(parse_scene(MODAL + "[observe]\nat='b'")).interfaces == ("b", "a")


def test_harmonic_force():
    text = "[[excitation]]\nat='b'\nkind='harmonic'\namplitude=2.0\nphase_deg=90.0\n"
    (force,) = build_system(parse_scene(MODAL + text)).excitation
    assert (force.at, force.amplitude, force.phase_deg) == ("b", 2.0, 90.0)


def test_damping_of_each_mode():
    system = build_system(parse_scene(MODAL + "[damping]\nmodal_ratio=[0.01, 0.02]"))
    ratios = np.diag(system.damping) / (2 * system.natural_frequencies)
    np.testing.assert_allclose(ratios, [0.01, 0.02])


def test_matrices_with_damping_matrix():
    text = "[matrices]\nmass=[[2.0]]\nstiffness=[[8e4]]\ndamping=[[6.0]]\ninterfaces.a=[1.0]\n"
    system = build_system(parse_scene(text))
    assert system.natural_frequencies[0] == pytest.approx(200.0)
    assert system.damping[0, 0] == pytest.approx(3.0)


def test_dissipation_of_a_stop_is_given_or_follows_from_restitution():
    stop = "[[stops]]\nat='a'\nstiffness=1e9\n"
    given = parse_scene(MODAL + stop + "dissipation=2.5\n")
    assert build_system(given).stops[0].dissipation == 2.5
    asked = parse_scene(MODAL + stop + "restitution=0.9\nimpact_speed=0.05\n")
    x = 0.05 * build_system(asked).stops[0].dissipation
    # docs/explanation/theory.md
    assert 1.9 * x == pytest.approx(math.log((1 + x) / (1 - 0.9 * x)), rel=1e-12)
    for wrong, words in (
        ("restitution=0.9\n", "impact_speed"),
        ("restitution=0.9\nimpact_speed=0.1\ndissipation=1.0\n", "dissipation"),
        ("dissipation=-1.0\n", "dissipation"),
        ("restitution=1.2\nimpact_speed=0.1\n", "restitution"),
    ):
        with pytest.raises(SceneError, match=words):
            parse_scene(MODAL + stop + wrong)


def test_a_rigid_stop_has_a_restitution_and_nothing_elastic():
    stop = "[[stops]]\nat='a'\nlaw='rigid'\n"
    (built,) = build_system(parse_scene(MODAL + stop + "restitution=0.8\ngap=1e-3\n")).stops
    assert built == RigidStop("a", 0.8, 1e-3)
    for wrong, words in (
        ("", "restitution is missing"),
        ("restitution=0.8\nstiffness=1e9\n", "stiffness is not a key of law 'rigid'"),
        ("restitution=0.8\ndashpot=1.0\n", "dashpot is not a key of law 'rigid'"),
        ("restitution=0.8\ngap=-1e-3\n", "a preload needs a stop with a stiffness"),
    ):
        with pytest.raises(SceneError, match=words):
            parse_scene(MODAL + stop + wrong)


def test_tolerance_of_a_scene_is_that_of_its_flow_map(monkeypatch):
    scene = load_scene(example("one_dof.toml"))
    text = scene.text.replace("[continuation]", "[continuation]\nrtol = 1e-6")
    taken = []
    monkeypatch.setattr(nldyn.scene.run, "diagram", lambda flow, *_, **__: taken.append(flow))
    compute(parse_scene(text, scene.file))
    assert taken[0].options.rtol == 1e-6


def test_the_beam_of_solids_moves_as_the_frame():
    """Same scene, other mesh: orbits with contact agree as the reduced models do.

    At 20 Hz, where both settle from rest to the motion with one impact a period; at 25 Hz there are
    several stable ones, and last digits decide which is found.
    """
    from nldyn import solve_orbit

    heights = []
    for name in ("four_dof_xi_0.01.toml", "solid_beam.toml"):
        orbit = solve_orbit(build_system(load_scene(example(name))), frequency_hz=20.0)
        heights.append((orbit.max_abs_displacement, orbit.max_penetration))
    np.testing.assert_allclose(heights[1], heights[0], rtol=1e-2)


SOLID = (
    example("solid_beam.toml")
    .read_text()
    .replace("../../meshes/half_beam_solid.vtu", mesh("half_beam_solid.vtu").as_posix())
)


@pytest.mark.parametrize(
    ("old", "new", "sentence"),
    [
        ('model = "structure"', "", r"parts\.beam\.kind 'solid' needs \[mesh\] with model = 's"),
        ("[parts.leaf]", "[parts.leave]", r"parts\.leave.*is not a part of the mesh.*'leaf'"),
        (
            'face = "leaf_top"',
            'face = "leaf_tip"',
            r"couplings\[1\]\.face.*'leaf_tip' is not a poi",
        ),
        ('at = "foot"', 'at = "feet"', r"supports\[1\]\.at.*'feet' is not a point or face"),
        ("poissons_ratio = 0.3", "", r"parts\.beam\.poissons_ratio is missing: kind 'solid'"),
        (
            'kind = "solid"',
            'kind = "solid"\nwidth = 0.1',
            "width is not a key of kind 'solid'",
        ),
        ('kind = "solid"', 'kind = "solid"\nthickness = 0.1', "needs both 'plane' and 'thickness'"),
        (
            'model = "structure"',
            'model = "structure"\nmirror = "middle"',
            "'middle' is not on a plane",
        ),
        (
            'at = "corner"\nfixed = ["z"]',
            'at = "beam_end"\nfixed = ["y"]',
            "a support holds a direction of its face",
        ),
    ],
)
def test_a_fault_in_a_scene_of_solids_is_told(old, new, sentence):
    text = SOLID.replace(old, new, 1)
    assert text != SOLID
    with pytest.raises(SceneError, match=sentence) as caught:
        build_component(parse_scene(text))
    assert "\n" not in str(caught.value)


def test_a_scene_of_beams_in_space(tmp_path):
    import fem

    frame = fem.frame_mesh(
        {"a": (0, 0, 0), "b": (0, 0, 1), "c": (0.5, 0, 1)},
        [("mast", "a", "b", 6), ("arm", "b", "c", 4)],
    )
    fem.write_mesh(frame, tmp_path / "mast.vtu")
    text = """
    [mesh]
    file = "mast.vtu"
    model = "structure"
    [parts.mast]
    youngs_modulus = 2.1e11
    density = 7800.0
    poissons_ratio = 0.3
    diameter = 0.05
    orientation = [1.0, 0.0, 0.0]
    theory = "timoshenko"
    axial_force = -1000.0
    [parts.arm]
    youngs_modulus = 2.1e11
    density = 7800.0
    poissons_ratio = 0.3
    area = 1e-3
    second_moment = 1e-7
    second_moment_across = 2e-7
    torsion_constant = 1.5e-7
    offset = [0.01, 0.0]
    [[supports]]
    at = "a"
    fixed = ["x", "y", "z", "rotation_x", "rotation_y", "rotation_z"]
    [[point_masses]]
    at = "c"
    mass = 1.0
    rotary_inertia = [0.01, 0.02, 0.03]
    offset = [0.0, 0.1, 0.0]
    [[foundations]]
    at = "arm"
    stiffness = [0.0, 0.0, 1e4]
    [interfaces.tip]
    at = "c"
    direction = "z"
    [reduction]
    modes = 4
    """
    with pytest.raises(SceneError, match="rotary_inertia must be one number or three"):
        parse_scene(text.replace("0.02, 0.03]", "0.02]"), tmp_path / "mast.toml")
    scene = parse_scene(text, tmp_path / "mast.toml")
    section = fem.Section(1e-3, 1e-7, 2e-7, 1.5e-7)
    steel = fem.Material(2.1e11, 7800.0, 0.3)
    direct = fem.assemble(
        fem.StructureModel(
            frame,
            {
                "mast": fem.BeamPart(
                    steel, fem.CircularSection(0.05), "timoshenko", -1000.0, (1.0, 0.0, 0.0)
                ),
                "arm": fem.BeamPart(steel, section, offset=(0.01, 0.0)),
            },
            [fem.Support("a", ("x", "y", "z", "rotation_x", "rotation_y", "rotation_z"))],
            [fem.PointMass("c", 1.0, (0.01, 0.02, 0.03), (0.0, 0.1, 0.0))],
            foundations=[fem.Foundation("arm", (0.0, 0.0, 1e4))],
            interfaces={"tip": fem.Interface("c", "z")},
        )
    )
    component = build_component(scene)
    assert abs(component.stiffness - direct.stiffness).max() == 0.0
    assert abs(component.mass - direct.mass).max() == 0.0
    assert len(build_reduced(scene, component).frequencies_hz) == 5


SHELL = """
[mesh]
file = "plate.vtu"
model = "structure"
[parts.plate]
kind = "shell"
youngs_modulus = 2.1e11
density = 7800.0
poissons_ratio = 0.3
thickness = 0.002
offset = 0.001
[[supports]]
at = "x0"
fixed = ["x", "y", "z", "rotation_x", "rotation_y", "rotation_z"]
[interfaces.tip]
at = "tip"
direction = "z"
[[couplings]]
at = "tip"
face = "x1"
[reduction]
modes = 4
"""


def test_a_scene_of_shells(tmp_path):
    import fem

    plate = fem.box_mesh("plate", (0.3, 0.1), (6, 2), kind="quad")
    fem.write_mesh(plate, tmp_path / "plate.vtu")
    scene = parse_scene(SHELL, tmp_path / "plate.toml")
    component = build_component(scene)
    part = fem.ShellPart(fem.Material(2.1e11, 7800.0, 0.3), 0.002, 0.001)
    assert component.model.parts == {"plate": part}
    assert len(build_reduced(scene, component).frequencies_hz) == 5


@pytest.mark.parametrize(
    ("old", "new", "sentence"),
    [
        ("thickness = 0.002", "", r"parts\.plate\.thickness is missing: kind 'shell'"),
        ("poissons_ratio = 0.3", "", "poissons_ratio is missing: kind 'shell' needs it"),
        ("offset = 0.001", "offset = [0.1, 0.0]", "offset must be a number"),
        ("offset = 0.001", "offset = [0.1]", "offset must be a number"),
        ("offset = 0.001", "width = 0.1", "width is not a key of kind 'shell', but of kind 'beam'"),
        ('model = "structure"', "", r"parts\.plate\.kind 'shell' needs \[mesh\] with model = 's"),
    ],
)
def test_a_fault_in_a_scene_of_shells_is_told(old, new, sentence):
    with pytest.raises(SceneError, match=sentence) as caught:
        parse_scene(SHELL.replace(old, new))
    assert "\n" not in str(caught.value)


def test_a_scene_of_trusses(tmp_path):
    import fem

    ends = {"a": (0, 1), "b": (0, -1), "tip": (1, 0)}
    frame = fem.frame_mesh(ends, [("bars", "a", "tip", 1), ("bars", "b", "tip", 1)])
    fem.write_mesh(frame, tmp_path / "bars.msh")
    text = """
    [mesh]
    file = "bars.msh"
    [parts.bars]
    kind = "truss"
    youngs_modulus = 2.1e11
    density = 7800.0
    area = 1e-4
    [[supports]]
    at = "a"
    fixed = ["x", "y"]
    [[supports]]
    at = "b"
    fixed = ["x", "y"]
    [interfaces.tip]
    at = "tip"
    direction = "y"
    [reduction]
    modes = 2
    """
    component = build_component(parse_scene(text, tmp_path / "bars.toml"))
    assert component.model.parts == {"bars": fem.TrussPart(fem.Material(2.1e11, 7800.0), 1e-4)}
    assert component.stiffness.shape == (2, 2)
    for old, new, sentence in (
        ("area = 1e-4", "", "area is missing: kind 'truss' needs it"),
        ("area = 1e-4", "area = 1e-4\nwidth = 0.1", "width is not a key of kind 'truss', but of"),
    ):
        with pytest.raises(SceneError, match=sentence):
            parse_scene(text.replace(old, new), tmp_path / "bars.toml")


TAPER = """
[mesh]
file = "arm.msh"
[parts.arm]
youngs_modulus = 2.1e11
density = 7800.0
width = 0.03
height = 0.04
taper = ["root", "tip"]
height_end = 0.02
[[supports]]
at = "root"
fixed = ["x", "y", "rotation"]
[interfaces.tip]
at = "tip"
direction = "y"
[reduction]
modes = 2
"""


@pytest.fixture
def arm_file(tmp_path):
    import fem

    frame = fem.frame_mesh({"root": (0, 0), "tip": (1, 0)}, [("arm", "root", "tip", 4)])
    fem.write_mesh(frame, tmp_path / "arm.msh")
    return tmp_path / "arm.toml"


def test_a_scene_of_a_tapered_beam(arm_file):
    import fem

    component = build_component(parse_scene(TAPER, arm_file))
    ends = fem.RectangularSection(0.03, 0.04), fem.RectangularSection(0.03, 0.02)
    assert component.model.parts["arm"].section == fem.TaperedSection(*ends, "root", "tip")
    tube = TAPER.replace("width = 0.03", "diameter = 0.04").replace("height = 0.04", "bore = 0.02")
    tube = tube.replace("height_end = 0.02", "bore_end = 0.0")
    section = build_component(parse_scene(tube, arm_file)).model.parts["arm"].section
    assert section.end == fem.CircularSection(0.04)


@pytest.mark.parametrize(
    ("old", "new", "sentence"),
    [
        ('taper = ["root", "tip"]', "", "needs 'taper' .* together with one of 'width_end'"),
        ("height_end = 0.02", "", "needs 'taper' .* together with one of 'width_end'"),
        ("height_end = 0.02", "bore_end = 0.02", "has 'bore_end' without 'bore'"),
        ('["root", "tip"]', '["root", "top"]', r"parts.arm.taper.*'top' is not a point"),
        ('["root", "tip"]', '["root", "root"]', "it starts and ends at 'root'"),
        ('["root", "tip"]', '["root"]', r"parts\.arm\.taper"),
    ],
)
def test_a_fault_in_a_taper_is_told(arm_file, old, new, sentence):
    with pytest.raises(SceneError, match=sentence) as caught:
        build_component(parse_scene(TAPER.replace(old, new), arm_file))
    assert "\n" not in str(caught.value)
