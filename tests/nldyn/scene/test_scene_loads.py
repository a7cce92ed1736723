"""Constant forces, weight, motions of the base and measured forces in scenes."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import eigh

from nldyn import SceneError, solve_orbit
from nldyn.scene.build import build_reduced, build_system
from nldyn.scene.checks import check_computable, remarks
from nldyn.scene.component import build_component
from nldyn.scene.read import load_scene, parse_scene
from nldyn.scene.run import compute
from nldyn.system.equilibrium import rest
from nldyn.system.measured import measured_force

E, RHO, B, H, L = 2.1e11, 7800.0, 0.03, 0.01, 1.5
MESH = """$MeshFormat
2.2 0 8
$EndMeshFormat
$PhysicalNames
2
0 1 "root"
1 2 "arm"
$EndPhysicalNames
$Nodes
3
1 0 0 0
2 0.75 0 0
3 1.5 0 0
$EndNodes
$Elements
3
1 15 2 1 1 1
2 1 2 2 1 1 2
3 1 2 2 1 2 3
$EndElements
"""
BEAM = f"""
[mesh]
file = "arm.msh"
model = "{{model}}"
[places]
tip.at = [1.5, 0.0, 0.0]
[parts.arm]
youngs_modulus = {E}
density = {RHO}
poissons_ratio = 0.3
width = {B}
height = {H}
{{orientation}}
[[supports]]
at = "root"
fixed = {{fixed}}
[interfaces.tip]
at = "tip"
direction = "{{across}}"
[reduction]
modes = {{modes}}
[damping]
modal_ratio = 0.02
[continuation]
range_hz = [3.0, 8.0]
"""
FRAME = {"model": "frame", "orientation": "", "fixed": '["x", "y", "rotation"]', "across": "y"}
STRUCTURE = {
    "model": "structure",
    "orientation": "orientation = [0.0, 0.0, 1.0]",
    "fixed": '["x", "y", "z", "rotation_x", "rotation_y", "rotation_z"]',
    "across": "z",
}


def beam(tmp_path, kind: dict[str, str], modes: int, more: str):
    (tmp_path / "arm.msh").write_text(MESH)
    (tmp_path / "beam.toml").write_text(BEAM.format(**kind, modes=modes) + more)
    return load_scene(tmp_path / "beam.toml")


@pytest.mark.parametrize("modes", [1, 2])
@pytest.mark.parametrize("kind", [FRAME, STRUCTURE], ids=["frame", "structure"])
def test_a_cantilever_sags_as_beam_theory_says_with_any_number_of_modes(tmp_path, kind, modes):
    """ρ A g L⁴/8 E I at the tip."""
    down = "[0.0, -9.81]" if kind is FRAME else "[0.0, 0.0, -9.81]"
    more = f'[[excitation]]\nkind = "weight"\nacceleration = {down}\n'
    more += '[[excitation]]\nkind = "harmonic"\nat = "tip"\namplitude = 1.0\n'
    system = build_system(beam(tmp_path, kind, modes, more))
    exact = -RHO * B * H * 9.81 * L**4 / (8 * E * B * H**3 / 12)
    assert system.participation["tip"] @ rest(system) == pytest.approx(exact, rel=1e-9)
    assert system.interfaces == ("tip",)


HELD = '[[springs]]\nat = "tip"\ndirection = "y"\nstiffness = 1e3\n'


@pytest.mark.parametrize("held", ["", HELD])
def test_a_shaken_cantilever_moves_as_with_its_supports_moved(tmp_path, held):
    """Relative motion of all degrees of freedom, solved without any reduction."""
    more = held + '[[excitation]]\nkind = "base"\ndirection = "y"\namplitude = 1e-3\n'
    scene = beam(tmp_path, FRAME, 3, more)
    reduced = build_reduced(scene)
    system = build_system(scene, reduced)
    orbit = solve_orbit(system, 5.0)
    omega = 2 * np.pi * 5.0
    component = build_component(scene)
    force = omega**2 * 1e-3 * component.interfaces["base y"]
    squares, modes = eigh(component.stiffness.toarray(), component.mass.toarray())
    rates = np.sqrt(squares)
    q = (modes.T @ force) / (squares - omega**2 + 2j * 0.02 * rates * omega)
    exact = abs(component.interfaces["tip"] @ modes @ q)
    assert orbit.max_abs_displacement == pytest.approx(exact, rel=2e-4)  # three of six modes


GEAR = """
[matrices]
mass = [[1.0]]
stiffness = [[0.0]]
damping = [[0.1]]
interfaces.x = [1.0]
loads.table = [1.0]
[continuation]
range_hz = [0.05, 0.2]
[[stops]]
at = "x"
law = "linear"
stiffness = 1.0
gap = 1.0
"""


def test_every_kind_of_excitation_becomes_what_it_says(tmp_path):
    t = np.arange(40) / 40.0
    samples = 3.0 + 2.0 * np.cos(2 * np.pi * t) + 0.5 * np.sin(4 * np.pi * t)
    text = "# force in N\n" + "\n".join(f"{value:.15g}," for value in samples)
    (tmp_path / "force.csv").write_text(text)
    (tmp_path / "gear.toml").write_text(
        GEAR
        + '[[excitation]]\nkind = "constant"\nat = "x"\nforce = -0.1\n'
        + '[[excitation]]\nkind = "unbalance"\nat = "x"\nmass_times_radius = 2.0\nharmonic = 3\n'
        + '[[excitation]]\nkind = "base"\nat = "table"\namplitude = 0.1\nquantity = "velocity"\n'
        + '[[excitation]]\nkind = "measured"\nat = "x"\nfile = "force.csv"\nharmonics = 5\n'
    )
    system = build_system(load_scene(tmp_path / "gear.toml"))
    orders = [source.harmonic for source in system.excitation]
    assert orders == [0, 3, 1, 0, 1, 2]
    measured = system.excitation[3:]
    assert [source.phasor for source in measured] == pytest.approx([3.0, 2.0, -0.5j], abs=1e-13)


def test_what_is_left_out_of_a_measured_force_is_told():
    t = np.arange(64) / 64.0
    force = measured_force("tip", np.cos(2 * np.pi * t) + 0.25 * np.cos(2 * np.pi * 9 * t), 4)
    assert force.truncation_error == pytest.approx(0.25, rel=1e-12)
    assert len(force.sources) == 1


@pytest.mark.parametrize(
    ("excitation", "words"),
    [
        ('kind = "constant"\nat = "x"', "force is missing: kind 'constant' needs it"),
        ('kind = "constant"\nat = "x"\nforce = 1.0', "is constant: there is no branch"),
        ('kind = "constant"\nat = "y"\nforce = 1.0', "interface or load vector"),
        ('kind = "harmonic"\nat = "x"\namplitude = 1.0\nharmonic = 0', "harmonic"),
        ('kind = "harmonic"\nat = "x"\namplitude = 1.0\nharmonic = 1.5', "1.5: all .* whole cycle"),
        ('kind = "harmonic"\nat = "x"\namplitude = 1.0\nfrequency_hz = 2.0', "be multiples 'harm"),
        (
            'kind = "harmonic"\nat = "x"\namplitude = 1.0\nfrequency_hz = 2.0\nharmonic = 2',
            "has both 'harmonic' and 'frequency_hz'",
        ),
        ('kind = "base"\nat = "table"\namplitude = 1.0\nfrequency_hz = 2.0', "not a key of kind"),
        ('kind = "harmonic"\nat = "x"\namplitude = 1.0\nforce = 2.0', "not a key of kind"),
        ('kind = "base"\nat = "x"\namplitude = 1.0', "'x' is an interface, .* load vector M r"),
        ('kind = "weight"\nacceleration = [0.0, -9.81]', "needs a .mesh.; give 'loads'"),
        ('kind = "weight"\nacceleration = [0.0]', "must be a list of at least 2 values"),
        ('kind = "base"\namplitude = 1.0', "needs 'direction'.* or 'at' naming a load vector"),
        ('kind = "base"\ndirection = "x"\namplitude = 1.0', "needs a .mesh."),
        ('kind = "measured"\nat = "x"\nfile = "none.csv"', "none.csv, which does not exist"),
        ('kind = "friction"\nat = "x"', "'unbalance'"),
    ],
)
def test_excitations_that_make_no_sense(excitation, words):
    with pytest.raises(SceneError, match=words):
        scene = parse_scene(GEAR + f"[[excitation]]\n{excitation}\n")
        build_system(scene)
        check_computable(scene, scene.file)


def test_weight_out_of_a_plane_frame_is_refused(tmp_path):
    more = '[[excitation]]\nkind = "weight"\nacceleration = [0.0, 0.0, -9.81]\n'
    with pytest.raises(SceneError, match="out of its plane"):
        build_system(beam(tmp_path, FRAME, 1, more))


def test_a_sample_left_out_of_a_measured_force_is_told(tmp_path):
    """A hole would move all that follows: the mean of a cosine would no longer be zero."""
    measured = '[[excitation]]\nkind = "measured"\nat = "x"\nfile = "force.csv"\nharmonics = 5\n'
    (tmp_path / "gear.toml").write_text(GEAR + measured)
    lines = [f"{value:.15g}" for value in np.cos(2 * np.pi * np.arange(32) / 32.0)]

    def sources(lines: list[str]):
        (tmp_path / "force.csv").write_text("# force in N\n\n" + "\n".join(lines) + "\n\n")
        return build_system(load_scene(tmp_path / "gear.toml")).excitation

    (cosine,) = sources([*lines[:7], "# a quarter", *lines[7:]])
    assert (cosine.harmonic, cosine.phasor) == (1, pytest.approx(1.0, abs=1e-13))
    with pytest.raises(SceneError, match="line 10: is blank between samples"):
        sources([*lines[:7], "", *lines[8:]])
    with pytest.raises(SceneError, match="line 10: must be one number"):
        sources([*lines[:7], ",", *lines[8:]])


def test_a_last_sample_that_repeats_the_first_is_asked_about(tmp_path):
    """Left in, it would give the cosine a mean of 1/33."""
    measured = '[[excitation]]\nkind = "measured"\nat = "x"\nfile = "force.csv"\nharmonics = 5\n'
    cosine = np.cos(2 * np.pi * np.arange(33) / 32.0)
    (tmp_path / "force.csv").write_text("\n".join(f"{value:.6f}" for value in cosine))

    def sources(more: str = ""):
        (tmp_path / "gear.toml").write_text(GEAR + measured + more)
        return build_system(load_scene(tmp_path / "gear.toml")).excitation

    with pytest.raises(SceneError, match=r"last of 33 samples .* equals the first: say closed"):
        sources()
    one, *_ = sources("closed = true")
    assert one.harmonic == 1 and one.phasor == pytest.approx(1.0, abs=1e-6)
    mean, *_ = sources("closed = false")
    assert mean.force == pytest.approx(1 / 33, abs=1e-6)
    with pytest.raises(SceneError, match="closed is not a key of kind 'constant', but of"):
        build_system(parse_scene(GEAR + '[[excitation]]\nkind = "constant"\nat = "x"\n'
                                 "force = 1.0\nclosed = true\n"))  # fmt: skip


def test_a_body_that_nothing_holds_ends_with_the_reason():
    shaken = '[[excitation]]\nkind = "base"\nat = "table"\namplitude = 1e-3\n'
    free = parse_scene(GEAR.split("[[stops]]")[0] + shaken)
    with pytest.raises(SceneError, match=r"free to move .* nothing tells its place: hold it by"):
        compute(free)
    held = GEAR.replace("gap = 1.0", "gap = 0.2").replace("damping = [[0.1]]", "")
    once = "range_hz = [0.05, 0.2]\nperiods = [1]\nsearch_points = 1"
    between = parse_scene(held.replace("range_hz = [0.05, 0.2]", once) + shaken)
    notes = compute(between).notes
    assert any("where the motion touches no stop, nothing" in note for note in notes)


RIDES = """
[matrices]
mass = [[1.0, 0.0], [0.0, 1.0]]
stiffness = [[394784.0, 0.0], [0.0, 394784.0]]
interfaces.a = [1.0, 0.0]
interfaces.b = [0.0, 1.0]
loads.A = {load}
[damping]
modal_ratio = 0.02
{element}
[[excitation]]
at = "A"
kind = "base"
amplitude = 1e-3
"""
TIES = {
    "stops": '[[stops]]\nat = "a"\nagainst = "b"\nlaw = "linear"\nstiffness = 1e6\ngap = 5e-4',
    "springs": '[[springs]]\nat = "a"\nagainst = "b"\nstiffness = 10.0',
    "dampers": '[[dampers]]\nat = "a"\nagainst = "b"\ncoefficient = 1.0',
    "friction": '[[friction]]\nat = "a"\nagainst = "b"\ncoefficient = 0.1\nnormal_force = 1.0',
}


@pytest.mark.parametrize("table", TIES)
def test_what_ties_a_place_that_rides_to_one_that_does_not_is_refused(table):
    """Displacements are relative to the base: a base that moves both ends is no matter."""
    name = {"friction": "friction at 'a'"}.get(table, rf"{table}\[0\]")
    with pytest.raises(SceneError, match=rf"{name}: a base carries 'a' otherwise than 'b'"):
        build_system(parse_scene(RIDES.format(load=[1.0, 0.0], element=TIES[table])))
    build_system(parse_scene(RIDES.format(load=[1.0, 1.0], element=TIES[table])))
    build_system(parse_scene(RIDES.format(load=[1.0, 0.0], element="")))


@pytest.mark.parametrize("table", TIES)
def test_modes_do_not_tell_what_a_base_carries(table):
    modal = """
    [modal]
    frequencies_hz = [100.0, 100.0]
    participation.a = [1.0, 0.0]
    participation.b = [0.0, 1.0]
    loads.A = [1.0, 0.0]
    [damping]
    modal_ratio = 0.02
    """
    shaken = RIDES.format(load=[1.0, 0.0], element=TIES[table])
    scene = parse_scene(modal + shaken[shaken.index(f"[[{table}]]") :])
    (said,) = remarks(scene, build_system(scene))
    assert said.startswith(f"{table}[0]: displacements are relative to the base")
