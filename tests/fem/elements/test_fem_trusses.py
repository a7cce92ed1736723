"""Trusses in frames and structures, against statics and rods."""

import meshio
import numpy as np
import pytest
from structures import CLAMP, STEEL, flexibility, lowest_hz

import fem
from fem.render.colouring import surface_values
from fem.render.structure_surface import structure_surface

E, RHO, AREA = 2.0e11, 8000.0, 1e-4
BAR = fem.TrussPart(fem.Material(E, RHO), AREA)


def bracket(**attached):
    """Two bars of sqrt(2) m from a wall to a joint, at 45 degrees up and down."""
    mesh = fem.frame_mesh(
        {"top": (0, 1), "low": (0, -1), "joint": (1, 0)},
        [("bars", "top", "joint", 1), ("bars", "low", "joint", 1)],
    )
    return fem.StructureModel(
        mesh,
        {"bars": BAR},
        supports=[fem.Support(end, ("x", "y")) for end in ("top", "low")],
        interfaces={d: fem.Interface("joint", d) for d in ("x", "y")},
        **attached,
        plane=True,
    )


def test_two_bars_carry_a_load_as_statics_say():
    component = fem.assemble(bracket())
    assert component.stiffness.shape == (2, 2)  # no rotations
    for direction in ("x", "y"):
        moved = flexibility(component, direction)
        assert moved == pytest.approx(np.sqrt(2) / (E * AREA), rel=1e-12)


def test_a_mass_on_two_bars_swings_as_one_oscillator():
    component = fem.assemble(bracket(point_masses=[fem.PointMass("joint", 10.0)]))
    mass = 10.0 + 2 * RHO * AREA * np.sqrt(2) / 3  # the joint's share of the bars
    wanted = np.sqrt(E * AREA / np.sqrt(2) / mass) / (2 * np.pi)
    np.testing.assert_allclose(lowest_hz(component, 2), [wanted] * 2, rtol=1e-12)


def test_the_same_truss_in_a_structure():
    frame = bracket()
    held = [fem.Support("top", "z"), fem.Support("low", "z"), fem.Support("joint", "z")]
    model = fem.StructureModel(
        frame.mesh,
        {"bars": BAR},
        supports=[*frame.supports, *held],
        interfaces=frame.interfaces,
    )
    for matrix in ("stiffness", "mass"):
        one, other = (getattr(fem.assemble(m), matrix).toarray() for m in (frame, model))
        np.testing.assert_allclose(other, one, rtol=1e-13, atol=1e-13 * np.abs(one).max())


def test_a_tripod_stands_on_three_bars():
    """Statics: the vertical stiffness is EA/L times the sum of squared cosines."""
    angles = 2 * np.pi / 3 * np.arange(3)
    feet = {f"foot{i}": (np.cos(a), np.sin(a), 0) for i, a in enumerate(angles)}
    mesh = fem.frame_mesh({"top": (0, 0, 2), **feet}, [("legs", "top", foot, 1) for foot in feet])
    model = fem.StructureModel(
        mesh,
        {"legs": BAR},
        supports=[fem.Support(foot, ("x", "y", "z")) for foot in feet],
        interfaces={d: fem.Interface("top", d) for d in ("x", "z")},
    )
    component = fem.assemble(model)
    L = np.sqrt(5)
    assert flexibility(component, "z") == pytest.approx(L / (E * AREA * 3 * 4 / 5), rel=1e-12)
    assert flexibility(component, "x") == pytest.approx(L / (E * AREA * 1.5 / 5), rel=1e-12)


def rod(kind, elements):
    """A rod of 1 m, clamped at one end, that moves along itself only."""
    step = 1 if kind == "line" else 2
    ends = {"root": (0, 0, 0), "tip": (1, 0, 0)}
    mesh = fem.frame_mesh(ends, [("rod", "root", "tip", step * elements)])
    if kind == "line3":
        order = np.argsort(mesh.points[:, 0])
        cells = np.stack([order[:-2:2], order[2::2], order[1::2]], axis=1)
        mesh = fem.StructureMesh(
            mesh.points, {kind: cells}, {"rod": {kind: np.arange(elements)}}, mesh.point_sets
        )
    return fem.assemble(
        fem.StructureModel(
            mesh,
            {"rod": BAR},
            supports=[fem.Support("root", "x"), fem.Support("rod", ("y", "z"))],
        )
    )


@pytest.mark.parametrize(("kind", "order"), [("line", 2), ("line3", 4)])
def test_a_rod_of_trusses_converges_to_the_wave_equation(kind, order):
    wanted = np.sqrt(E / RHO) / 4
    errors = [lowest_hz(rod(kind, n), 1)[0] / wanted - 1 for n in (4, 8)]
    assert 0 < errors[1] < 2e-3
    assert np.log2(errors[0] / errors[1]) == pytest.approx(order, abs=0.1)


def curved(middle):
    points = [[0, 0, 0], [1, 0, 0], middle]
    return fem.StructureMesh(points, {"line3": [[0, 1, 2]]}, {"rod": {"line3": [0]}}, {}, "m")


def test_a_middle_node_off_the_middle_keeps_strain_and_mass():
    component = fem.assemble(
        fem.StructureModel(
            curved([0.6, 0, 0]), {"rod": BAR}, supports=[fem.Support("rod", ("y", "z"))]
        )
    )
    pulled = np.array([0.0, 1.0, 0.6])
    force = component.stiffness @ pulled
    np.testing.assert_allclose(force, [-E * AREA, E * AREA, 0.0], atol=1e-9 * E * AREA)
    assert np.ones(3) @ component.mass @ np.ones(3) == pytest.approx(RHO * AREA, rel=1e-12)


def test_a_curved_line_of_three_nodes_keeps_its_rigid_motions():
    model = fem.StructureModel(curved([0.5, 0.2, 0.1]), {"rod": BAR})
    with pytest.warns(fem.JointWarning, match="3 nodes of trusses"):
        component = fem.assemble(model)
    K = component.stiffness.toarray()
    points = model.mesh.points
    for axis in np.eye(3):
        assert np.abs(K @ np.tile(axis, 3)).max() < 1e-12 * np.abs(K).max()
        assert np.abs(K @ np.cross(axis, points).ravel()).max() < 1e-12 * np.abs(K).max()


def test_nodes_that_nothing_holds_across_are_told():
    mesh = fem.frame_mesh(
        {"a": (0, 0), "b": (1, 0), "m": (0.5, 0)}, [("rod", "a", "m", 1), ("rod", "m", "b", 1)]
    )
    held = [fem.Support(end, ("x", "y")) for end in "ab"]
    told = r"frame_mesh: 1 nodes of trusses \(of 'm'\) are not held in all directions: 2; hold"
    with pytest.warns(fem.JointWarning, match=told):
        fem.assemble(fem.StructureModel(mesh, {"rod": BAR}, supports=held, plane=True))
    with pytest.warns(fem.JointWarning, match=r"are not held"):
        plane = [*held, fem.Support("m", "y")]
        fem.assemble(fem.StructureModel(mesh, {"rod": BAR}, supports=plane))


def test_trusses_brace_beams(recwarn):
    """A mast of beams with a tie: the tie's stiffness adds to that of the mast's tip."""
    mesh = fem.frame_mesh(
        {"foot": (0, 0), "tip": (0, 1), "anchor": (1, 0)},
        [("mast", "foot", "tip", 4), ("tie", "tip", "anchor", 1)],
    )
    section = fem.RectangularSection(0.02, 0.02)
    mast = fem.BeamPart(fem.Material(E, RHO, 0.3), section, orientation=(1, 0, 0))
    parts = {"mast": mast, "tie": fem.TrussPart(fem.Material(E, RHO), 1e-9)}
    plain = {"mast": fem.BeamPart(fem.Material(E, RHO), section), "tie": parts["tie"]}
    held = [fem.Support("foot", CLAMP), fem.Support("anchor", ("x", "y", "z"))]
    flat = [fem.Support("foot", ("x", "y", "rotation")), fem.Support("anchor", ("x", "y"))]
    interfaces = {"tip": fem.Interface("tip", "x")}
    second = 0.02**4 / 12
    # the mast's tip is all but rigid along y
    stiffness = 3 * E * second + E * 1e-9 / np.sqrt(2) / 2
    for model in (
        fem.StructureModel(mesh, plain, supports=flat, interfaces=interfaces, plane=True),
        fem.StructureModel(mesh, parts, supports=held, interfaces=interfaces),
    ):
        assert flexibility(fem.assemble(model), "tip") == pytest.approx(1 / stiffness, rel=1e-5)
    assert not [w for w in recwarn if issubclass(w.category, fem.JointWarning)]


@pytest.mark.parametrize(
    ("make", "sentence"),
    [
        (lambda: fem.TrussPart(STEEL, -1.0), "truss part: area must be positive"),
        (
            lambda: fem.assemble(bracket(point_masses=[fem.PointMass("joint", 1.0, 0.1)])),
            "'joint' has no direction 'rotation_z': it does not turn, since only solids or trusses",
        ),
        (
            lambda: fem.assemble(bracket(springs=[fem.PointSpring("joint", "rotation", 1.0)])),
            "'joint' has no direction 'rotation': it does not turn",
        ),
        (
            lambda: bracket(hinges=[fem.Hinge("joint", "bars")]),
            "hinge at 'joint': 'bars' is no beam part",
        ),
        (
            lambda: fem.assemble(fem.StructureModel(curved([1.3, 0, 0.0]), {"rod": BAR})),
            "not near the middle|doubles back",
        ),
    ],
)
def test_a_bad_truss_is_one_sentence(make, sentence):
    with pytest.raises(fem.ModelError, match=sentence) as caught:
        make()
    assert "\n" not in str(caught.value)


def test_saved_trusses_are_the_same(tmp_path):
    frame = fem.assemble(bracket())
    frame.save(tmp_path / "frame.npz")
    assert fem.Component.load(tmp_path / "frame.npz").model.parts == frame.model.parts
    whole = rod("line3", 2)
    whole.save(tmp_path / "rod.npz")
    again = fem.Component.load(tmp_path / "rod.npz")
    assert np.array_equal(again.stiffness.toarray(), whole.stiffness.toarray())


@pytest.mark.parametrize("in_space", [False, True])
def test_trusses_are_drawn_straight_and_coloured_by_their_stress(in_space):
    model = bracket()
    if in_space:
        flat = fem.Support("bars", "z")
        model = fem.StructureModel(
            model.mesh, model.parts, supports=[*model.supports, flat], interfaces=model.interfaces
        )
    component = fem.assemble(model)
    drawing = structure_surface(component)
    u = 1e-3 * component.interfaces["y"]
    points, _ = drawing.place(u)
    ends = np.array([[0, 1, 0], [0, -1, 0]]), np.array([1, 1e-3, 0])
    radius = np.sqrt(AREA / np.pi)
    for start in ends[0]:
        way = ends[1] - start
        side = np.sign(points[:, 1] - points[:, 0] * 1e-3) == np.sign(start[1])
        arm = points[side & (points[:, 0] < 0.9)] - start
        along = arm @ way / (way @ way)
        assert np.linalg.norm(arm - along[:, None] * way, axis=1).max() < 1.001 * radius
    strain = 1e-3 / np.sqrt(2) / np.sqrt(2)
    np.testing.assert_allclose(surface_values(drawing, u, "stress"), E * strain, rtol=1e-9)
    assert not surface_values(drawing, u, "moment").any()


def second_order(middle):
    return meshio.Mesh(
        [[0.0, 0, 0], [2.0, 0, 0], middle, [3.0, 1.0, 0]],
        [("line3", [[0, 1, 2]]), ("line", [[1, 3]])],
        cell_data={"set:arm": [[1], [0]], "set:end": [[0], [1]]},
        point_data={"set:middle": [0, 0, 1, 0]},
    )


@pytest.mark.parametrize("middle", [[0.8, 0.0, 0.0], [1.0, 0.01, 0.0]])
def test_lines_of_three_nodes_are_two_beams(middle):
    mesh = fem.from_meshio(second_order(middle), "beam.vtu")
    beam = fem.BeamPart(STEEL, fem.CircularSection(0.1))
    model = fem.StructureModel(mesh, {"arm": beam, "end": beam}, plane=True)
    assert {name: lines.tolist() for name, (_, lines) in model.beams.items()} == {
        "arm": [[0, 2], [2, 1]],
        "end": [[1, 3]],
    }
    assert mesh.node("middle") == 2
