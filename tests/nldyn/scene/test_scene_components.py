"""Scenes of several components against the whole that they make, solved as one."""

from __future__ import annotations

import json

import numpy as np
import pytest
from click.testing import CliRunner
from scipy import io, sparse
from scipy.linalg import eigh

import fem
import fem.render
from fem.render.pictures import surface_of
from fem.render.stop_scenery import penetration
from nldyn import SceneError, solve_orbit
from nldyn.app.cli import main
from nldyn.base.resources import example, mesh
from nldyn.report.again import drawn_of
from nldyn.report.stop_spheres import not_drawn, stops_to_draw
from nldyn.scene.backbone import undamped
from nldyn.scene.build import build_parts, build_reduced, build_structure, build_system
from nldyn.scene.case_fingerprints import case_fingerprints
from nldyn.scene.read import load_scene, parse_scene
from nldyn.system.equilibrium import rest

E, RHO, B, H, L = 2.1e11, 7800.0, 0.03, 0.01, 0.75
STEEL = fem.BeamPart(fem.Material(E, RHO), fem.RectangularSection(B, H))
CLAMP = fem.Support("left", ("x", "y", "rotation"))
PART = f"{{youngs_modulus = {E}, density = {RHO}, width = {B}, height = {H}}}"
HALVES = f"""
[components.inner.mesh]
file = "inner.vtu"
[components.inner.parts]
arm = {PART}
[[components.inner.supports]]
at = "left"
fixed = ["x", "y", "rotation"]
[components.inner.interfaces]
x = {{at = "right", direction = "x"}}
y = {{at = "right", direction = "y"}}
turn = {{at = "right", direction = "rotation"}}
[components.inner.reduction]
modes = INNER

[components.outer.mesh]
file = "outer.vtu"
[components.outer.parts]
arm = {PART}
[components.outer.interfaces]
x = {{at = "left", direction = "x"}}
y = {{at = "left", direction = "y"}}
turn = {{at = "left", direction = "rotation"}}
tip = {{at = "right", direction = "y"}}
[components.outer.reduction]
modes = OUTER
"""
JOINTS = "".join(
    f'\n[[joints]]\nat = "inner.{name}"\nagainst = "outer.{name}"\n' for name in ("x", "y", "turn")
)
FORCE = """
[[excitation]]
kind = "harmonic"
at = "outer.tip"
amplitude = 2.0
"""
RANGE = "[continuation]\nrange_hz = [3.0, 8.0]\n"


def arm(start: float, end: float, lines: int) -> fem.StructureMesh:
    return fem.frame_mesh(
        {"left": (start, 0), "right": (end, 0)}, [("arm", "left", "right", lines)]
    )


def halves(tmp_path, more: str, inner: int = 6, outer: int = 6):
    """A cantilever of 2 L in two meshes of two lines each."""
    fem.write_mesh(arm(0.0, L, 2), tmp_path / "inner.vtu")
    fem.write_mesh(arm(L, 2 * L, 2), tmp_path / "outer.vtu")
    text = HALVES.replace("INNER", str(inner)).replace("OUTER", str(outer)) + more
    (tmp_path / "halves.toml").write_text(text)
    return load_scene(tmp_path / "halves.toml")


def cantilever() -> fem.Component:
    """The same in one mesh of four lines."""
    tip = {"tip": fem.Interface("right", "y")}
    return fem.assemble(
        fem.StructureModel(arm(0.0, 2 * L, 4), {"arm": STEEL}, [CLAMP], interfaces=tip, plane=True)
    )


def test_two_meshes_with_all_modes_are_the_mesh_of_the_whole(tmp_path):
    scene = halves(tmp_path, JOINTS + FORCE, inner=6, outer=9)
    reduced = build_reduced(scene)
    whole = cantilever()
    squares = eigh(whole.stiffness.toarray(), whole.mass.toarray(), eigvals_only=True)
    assert 2 * np.pi * reduced.frequencies_hz == pytest.approx(np.sqrt(squares), rel=1e-9)
    flexibility = np.linalg.solve(whole.stiffness.toarray(), whole.interfaces["tip"])
    static = flexibility @ whole.interfaces["tip"]
    assert reduced.static_flexibility("outer.tip") == pytest.approx(static, rel=1e-9)
    assert static == pytest.approx((2 * L) ** 3 / (3 * E * B * H**3 / 12), rel=1e-9)


def test_a_mirror_of_one_of_several_components_is_refused(tmp_path):
    scene = halves(tmp_path, JOINTS + FORCE)
    text = scene.text.replace('file = "outer.vtu"', 'file = "outer.vtu"\nmirror = "right"')
    (tmp_path / "mirrored.toml").write_text(text)
    with pytest.raises(SceneError, match=r"outer\.mesh\.mirror is for a single component"):
        load_scene(tmp_path / "mirrored.toml")


def test_weight_and_base_act_on_every_component(tmp_path):
    """The tip sags by rho A g (2 L)^4 / 8 E I whatever the modes; r^T M r is the mass."""
    loads = '[[excitation]]\nkind = "weight"\nacceleration = [0.0, -9.81]\n'
    loads += '[[excitation]]\nkind = "base"\ndirection = "y"\namplitude = 1e-3\n'
    scene = halves(tmp_path, JOINTS + FORCE + loads + '[observe]\nat = "outer.tip"\n', 1, 4)
    system = build_system(scene)
    assert system.interfaces[0] == "outer.tip"
    exact = -RHO * B * H * 9.81 * (2 * L) ** 4 / (8 * E * B * H**3 / 12)
    assert system.participation["outer.tip"] @ rest(system) == pytest.approx(exact, rel=1e-9)
    orbit = solve_orbit(build_system(halves(tmp_path, JOINTS + loads + DAMPED, 6, 9)), 5.0)
    whole = cantilever().with_load("base", (0.0, 1.0, 0.0))
    K, M, b = whole.stiffness.toarray(), whole.mass.toarray(), whole.interfaces["base"]
    squares, modes = eigh(K, M)
    omega = 2 * np.pi * 5.0
    shaken = modes.T @ b * omega**2 * 1e-3
    q = shaken / (squares - omega**2 + 0.04j * np.sqrt(squares) * omega)
    tip = modes.T @ whole.interfaces["tip"]
    assert orbit.max_abs_displacement == pytest.approx(abs(tip @ q) - exact, rel=1e-7)


DAMPED = '[damping]\nmodal_ratio = 0.02\n[observe]\nat = "outer.tip"\n'
CHAIN = """
[components.wall.matrices]
mass = "M.mtx"
stiffness = "K.npz"
interfaces.end = {row = 30}
loads.weight = {rows = {1 = 1.0, 30 = 0.5}}

[components.rest.matrices]
mass = [[0.5, 0.0], [0.0, 1.0]]
stiffness = [[1.0, -1.0], [-1.0, 1.0]]
damping = [[0.1, -0.1], [-0.1, 0.1]]
gyroscopic = [[0.0, 0.3], [-0.3, 0.0]]
interfaces.end = [1.0, 0.0]
interfaces.tip = [0.0, 1.0]

[[joints]]
at = "wall.end"
against = "rest.end"

[[excitation]]
kind = "harmonic"
at = "rest.tip"
amplitude = 1.0
[[excitation]]
kind = "constant"
at = "wall.weight"
force = 2.0
"""


def chain(tmp_path, text: str = CHAIN):
    """30 springs and masses from a wall on, the last of them halved at the joint."""
    bands = sparse.diags_array([-1.0, 2.0, -1.0], offsets=[-1, 0, 1], shape=(30, 30)).tolil()
    bands[29, 29] = 1.0
    masses = np.ones(30)
    masses[29] = 0.5
    io.mmwrite(tmp_path / "M.mtx", sparse.diags_array(masses))
    sparse.save_npz(tmp_path / "K.npz", bands.tocsc())
    (tmp_path / "chain.toml").write_text(text + RANGE)
    return load_scene(tmp_path / "chain.toml")


def test_matrices_join_to_the_closed_form_of_a_chain(tmp_path):
    """31 masses from a wall to a free end: 2 sin((2k - 1) pi / 2 (2 n + 1)) in rad/s."""
    system = build_system(chain(tmp_path))
    k = np.arange(1, 32)
    exact = 2.0 * np.sin((2 * k - 1) * np.pi / 126)
    assert np.sort(system.natural_frequencies) == pytest.approx(exact, rel=1e-9)
    both = np.array([system.participation["rest.end"], system.participation["rest.tip"]])
    damper = 0.1 * np.outer(both[1] - both[0], both[1] - both[0])
    whirl = 0.3 * (np.outer(both[0], both[1]) - np.outer(both[1], both[0]))
    assert system.damping == pytest.approx(damper + whirl, abs=1e-9)
    # 2 N in row 1 and 1 N in row 30 stretch the first spring by 3 and 29 more by 1 each
    assert system.participation["rest.tip"] @ rest(system) == pytest.approx(32.0, rel=1e-9)


def test_a_backbone_leaves_out_the_damping_of_components(tmp_path):
    free = build_system(undamped(chain(tmp_path, CHAIN.replace("gyroscopic", "#"))))
    assert not np.any(free.damping)


def test_files_of_components_count_in_studies(tmp_path):
    chain(tmp_path)
    import tomllib

    tables = [tomllib.loads((tmp_path / "chain.toml").read_text())]
    before = case_fingerprints(tables, tmp_path, len, "n")
    io.mmwrite(tmp_path / "M.mtx", sparse.eye_array(30))
    assert case_fingerprints(tables, tmp_path, len, "n") != before


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('against = "rest.end"', 'against = "test.end"', "joints[0].against 'test' is not a comp"),
        ('against = "rest.end"', 'against = "rest.root"', "'rest.root' is not an interface"),
        ('at = "wall.end"', 'at = "wall.weight"', "'wall.weight' is not an interface"),
        ('against = "rest.end"', 'against = "wall.end"', "needs another interface than its own"),
        (
            "[[excitation]]\nkind = \"harm",
            '[[joints]]\nat = "rest.end"\nagainst = "wall.end"\n[[excitation]]\nkind = "harm',
            "joints[1] joins what joints[0] joins already",
        ),
        (
            "[[joints]]",
            '[components."a.b".matrices]\nmass=[[1.0]]\nstiffness=[[1.0]]\ninterfaces.x=[1.0]\n'
            "[[joints]]",
            'components."a.b" must be a name without a dot',
        ),
        ("[[joints]]", "[components.third]\n[[joints]]", "third gives no structure; it needs a"),
        ("[[joints]]", "[reduction]\nmodes = 2\n[[joints]]", "reduction must be in a component"),
        ("[components.rest.matrices]", "[matrices]", "components cannot stand beside [matrices]"),
        ("mass = [[0.5, 0.0]", "mass = [[0.5, 1.0]", "components.rest.matrices.mass must be sym"),
        ('"M.mtx"', '"N.mtx"', "components.wall: matrices.mass names"),
        ("{row = 30}", "{row = 31}", "components.wall: matrices.interfaces.end"),
        ("[[joints]]", '[[components.wall.springs]]\nat = "end"\nstiffness = 1.0\n[[joints]]',
         "components.wall.springs[0] acts at an interface: give it in [[springs]] of the scene"),
        (
            "[[joints]]",
            "[components.wall.reduction]\ntolerance = 0.1\n[[joints]]",
            "components.wall.reduction.tolerance is for a single component",
        ),
        (
            "[[joints]]",
            '[[excitation]]\nkind = "weight"\nacceleration = [0.0, -9.81]\n[[joints]]',
            "acts on meshes only, but component 'wall' is given by matrices",
        ),
    ],
)  # fmt: skip
def test_what_cannot_be_joined_is_told(tmp_path, old, new, words):
    with pytest.raises(SceneError) as caught:
        build_system(chain(tmp_path, CHAIN.replace(old, new, 1)))
    assert words in str(caught.value) and "\n" not in str(caught.value)


def test_a_rotation_is_not_joined_to_a_displacement(tmp_path):
    wrong = '[[joints]]\nat = "inner.turn"\nagainst = "outer.y"\n'
    with pytest.raises(SceneError, match=r"a rotation, to 'outer\.y', a displacement"):
        halves(tmp_path, wrong)


def test_a_joint_of_displacements_along_different_axes_is_told(tmp_path):
    crossed = '[[joints]]\nat = "inner.y"\nagainst = "outer.x"\n'
    turn = "[[joints]]" + JOINTS.rsplit("[[joints]]", 1)[1]
    held = '[[stops]]\nat = "outer.tip"\nlaw = "linear"\nstiffness = 1.0\n'
    scene = halves(tmp_path, crossed + turn + held)
    with pytest.warns(UserWarning, match=r"'inner.y', along y, with 'outer.x', along x: they move"):
        build_reduced(scene)


def test_a_list_of_components_and_joints_of_nothing_are_told():
    with pytest.raises(SceneError, match=r"with a name: \[components.NAME\]"):
        parse_scene('[[components]]\nname = "a"\n')
    alone = '[modal]\nfrequencies_hz = [1.0]\nparticipation.a = [1.0]\n[[joints]]\nat = "a"\n'
    with pytest.raises(SceneError, match=r"joints needs \[components.NAME\]"):
        parse_scene(alone)


def test_a_whole_that_floats_is_told(tmp_path):
    """Of the outer half nothing is joined: it has three rigid-body modes."""
    floating = halves(tmp_path, FORCE + DAMPED + RANGE)
    told = CliRunner().invoke(main, ["check", str(floating.file)])
    assert told.exit_code == 2 and "components float: 3 rigid-body motions" in told.output
    spring = '[[springs]]\nat = "outer.y"\nagainst = "inner.y"\nstiffness = 1.0\n'
    with pytest.raises(SceneError, match="components float: 2 rigid-body motions"):
        build_system(halves(tmp_path, FORCE + DAMPED + spring))


def test_a_whole_free_along_its_axis_is_told_although_rounding_moves_its_interfaces(tmp_path):
    """Joined across and in rotation only, the outer half is free along the beam."""
    across = '[[joints]]\nat = "inner.y"\nagainst = "outer.y"\n'
    stop = '[[stops]]\nat = "outer.tip"\nlaw = "linear"\nstiffness = 1.0e5\ngap = 0.01\n'
    joints = across + across.replace("y", "turn") + stop
    with pytest.raises(SceneError, match="components float: 1 rigid-body motion of the whole"):
        build_system(halves(tmp_path, FORCE + DAMPED + joints))


def test_the_example_has_the_modes_of_its_whole():
    """All degrees of freedom of the frame beside those of the absorber, as one eigenproblem."""
    scene = load_scene(example("portal_with_absorber.toml"))
    parts = build_parts(scene)
    frame, absorber = parts["frame"], parts["absorber"]
    K = sparse.block_diag([frame.stiffness, absorber.stiffness]).toarray()
    M = sparse.block_diag([frame.mass, absorber.mass]).toarray()
    apart = np.concatenate([frame.interfaces["corner"], -absorber.interfaces["housing"]])
    held = np.linalg.svd(apart[None])[2][1:].T
    squares = eigh(held.T @ K @ held, held.T @ M @ held, eigvals_only=True)[:3]
    found = build_reduced(scene).frequencies_hz[:3]
    assert found == pytest.approx(np.sqrt(squares) / (2 * np.pi), rel=1e-7)


def test_joined_components_are_drawn_as_the_whole(tmp_path):
    """The tip of a cantilever of the mass m moves by 2/√m in its first mode of unit modal mass."""
    scene = halves(tmp_path, FORCE + JOINTS)
    drawn = drawn_of(scene, build_structure(scene))
    drawing = surface_of(drawn.component)
    points, _ = drawing.place(np.zeros(len(drawn.component.free)))
    _, size = drawing.place(drawn.reduced.basis[:, 0])
    assert np.ptp(points, axis=0) == pytest.approx([2 * L, H, B])
    assert size.max() == pytest.approx(2.0 / np.sqrt(RHO * B * H * 2 * L), rel=1e-4)
    assert points[size.argmax(), 0] == pytest.approx(2 * L)
    joint = np.abs(points[:, 0] - L) < 1e-9  # the last of one half and the first of the other
    assert joint.sum() >= 8 and np.ptp(size[joint]) < 1e-9 * size.max()
    corners = np.concatenate([faces.ravel() for faces in drawing.faces()])
    assert np.array_equal(np.unique(corners), np.arange(len(points)))


def test_of_a_mesh_and_matrices_the_mesh_is_drawn(tmp_path, monkeypatch):
    monkeypatch.setattr(fem.render, "gl_available", lambda: (False, "install libegl1"))
    scene, out = str(example("portal_with_absorber.toml")), tmp_path / "r"
    told = CliRunner().invoke(main, ["render", scene, "--out", str(out), "--frequency-hz", "12"])
    assert told.exit_code == 3 and told.stderr.endswith("nldyn: install libegl1\n")
    assert {"mode_shapes.html", "deepest_contact.html", "orbit.png"} < {
        path.name for path in out.iterdir()
    }
    (stop,) = stops_to_draw(load_scene(scene))
    assert (stop.point, stop.direction, stop.gap) == ("frame.CORNER-R", (1.0, 0.0), 2e-3)


def test_stops_between_two_meshes_are_drawn_and_the_reason_is_told_for_others(tmp_path):
    """Of the halves of a beam the lower of two sides moves as the model says it does."""
    pairs = ("tip", "y"), ("turn", "turn"), ("tip", "x")
    stops = "".join(
        f'[[stops]]\nat = "outer.{one}"\nagainst = "inner.{other}"\nlaw = "linear"\n'
        "stiffness = 1e3\ngap = 1e-3\ndirection = -1\n"
        for one, other in pairs
    )
    scene = halves(tmp_path, FORCE + JOINTS + stops)
    structure = build_structure(scene)
    drawn = drawn_of(scene, structure)
    (stop,) = drawn.stops
    assert (stop.point, stop.against, stop.gap) == ("outer.right", "inner.right", 1e-3)
    q = np.arange(1.0, structure.reduced.size + 1.0)
    system = build_system(scene, structure.reduced)
    sunk = penetration(surface_of(drawn.component), drawn.reduced.expand(q), stop)
    assert sunk == pytest.approx(system.stop_vector(system.stops[0]) @ q - 1e-3, rel=1e-9)
    assert not_drawn(scene) == [
        "stop at 'outer.turn' against 'inner.turn', which acts on a rotation",
        "stop at 'outer.tip' against 'inner.x', which acts along two axes",
    ]


def test_a_stop_against_what_has_no_mesh_is_told(tmp_path):
    text = example("portal_with_absorber.toml").read_text()
    text = text.replace("../../meshes/", f"{mesh('portal.inp').parent.as_posix()}/")
    text = text.replace(
        'at = "frame.corner"\nlaw', 'at = "frame.corner"\nagainst = "absorber.mass"\nlaw'
    )
    scene = parse_scene(text, tmp_path / "s.toml")
    assert stops_to_draw(scene) == []
    (told,) = not_drawn(scene)
    assert told == "stop at 'frame.corner' against 'absorber.mass', which has no mesh at one side"


def test_check_tells_of_every_component():
    told = CliRunner().invoke(main, ["check", str(example("portal_with_absorber.toml"))])
    assert told.exit_code == 0, told.output
    assert "component 'frame':" in told.output and "matrices of 2 degrees" in told.output
    told = CliRunner().invoke(main, ["check", "--json", str(example("portal_with_absorber.toml"))])
    assert json.loads(told.output)["degrees_of_freedom"] == 59
