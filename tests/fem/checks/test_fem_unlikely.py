"""A bar of hexahedra and wedges with a shell on it and a mass at its end; what is hardly meant."""

import warnings
from dataclasses import replace

import meshio
import numpy as np
import pytest
from scipy.optimize import brentq
from structures import lowest_hz

import fem

LENGTH, WIDTH, HEIGHT, SKIN, LUMP = 0.4, 0.04, 0.02, 0.002, 0.5
STEEL = fem.Material(2.1e11, 7800.0, poissons_ratio=0.3)
ALUMINIUM = fem.Material(7e10, 2700.0, poissons_ratio=0.3)
CLAMP = ("x", "y", "z", "rotation_x", "rotation_y", "rotation_z")
TYPES = {"hexahedron20": "C3D20", "wedge15": "C3D15", "quad8": "S8", "triangle6": "S6"}


def bar():
    """Half of hexahedra, half of wedges, with the shell "skin" on top and the node "tip"."""
    halves = [
        fem.box_mesh("body", (LENGTH / 2, WIDTH, HEIGHT), (8, 2, 1), kind=kind, origin=(x, 0, 0))
        for kind, x in (("hexahedron20", 0.0), ("wedge15", LENGTH / 2))
    ]
    solid = fem.joined(halves)
    facets = fem.StructureModel(solid, {"body": fem.SolidPart(STEEL)}).facets
    top = {
        kind: found
        for kind, nodes in facets.items()
        if len(found := nodes[(solid.points[nodes, 2] > HEIGHT - 1e-9).all(axis=1)])
    }
    cells = solid.cells | top
    x, y, z = solid.points.T
    return fem.StructureMesh(
        solid.points,
        cells,
        {
            "body": solid.groups["body"],
            "skin": {kind: np.arange(len(nodes)) for kind, nodes in top.items()},
        },
        {
            "root": np.flatnonzero(x < 1e-9),
            "tip": np.flatnonzero((x > LENGTH - 1e-9) & (y < 1e-9) & (z > HEIGHT - 1e-9)),
        },
        element_types={TYPES[k]: {k: np.arange(len(nodes))} for k, nodes in cells.items()},
    )


def model(mesh, skin, **other):
    parts = {"body": fem.SolidPart(STEEL)}
    if skin:
        parts["skin"] = fem.ShellPart(ALUMINIUM, SKIN)
    return fem.StructureModel(mesh, parts, [fem.Support("root", CLAMP)], **other)


def beam_hz(skin, lump):
    """A cantilever of a composite section by Euler and Bernoulli, with a mass at its end."""
    areas = np.array([WIDTH * HEIGHT, WIDTH * SKIN * skin])
    stretch = areas * [STEEL.youngs_modulus, ALUMINIUM.youngs_modulus]
    middle = np.array([HEIGHT / 2, HEIGHT])
    own = stretch @ [HEIGHT**2 / 12, SKIN**2 / 12]
    bending = own + stretch @ (middle - stretch @ middle / stretch.sum()) ** 2
    line = areas @ [STEEL.density, ALUMINIUM.density]
    share = lump / (line * LENGTH)

    def condition(k):
        free = 1.0 + np.cos(k) * np.cosh(k)
        return free + share * k * (np.cos(k) * np.sinh(k) - np.sin(k) * np.cosh(k))

    k = brentq(condition, 0.5, 2.2)
    return k**2 / LENGTH**2 * np.sqrt(bending / line) / (2 * np.pi)


def test_wedges_a_mass_and_a_shell_are_all_in_the_frequency(tmp_path):
    """Within 1.5 %; the share of each within 0.3 %, where it changes the frequency by 3 to 30 %."""
    mesh, path = bar(), tmp_path / "bar.inp"
    assert {"hexahedron20", "wedge15"} < set(mesh.cells)
    fem.write_mesh(mesh, path)
    node = int(mesh.point_sets["tip"][0]) + 1
    with path.open("a") as file:
        file.write(f"*ELEMENT, TYPE=MASS, ELSET=LUMP\n9999, {node}\n*MASS, ELSET=LUMP\n{LUMP}\n")
    whole = fem.assemble(model(fem.read_mesh(path), skin=True))
    skin_mass = LENGTH * WIDTH * SKIN * ALUMINIUM.density
    body_mass = LENGTH * WIDTH * HEIGHT * STEEL.density
    assert fem.mass_properties(whole).mass == pytest.approx(body_mass + skin_mass + LUMP)
    hz, exact = lowest_hz(whole, 1)[0], beam_hz(True, LUMP)
    assert hz == pytest.approx(exact, rel=0.015)
    bare = replace(mesh, element_types={})  # where "skin" is a face
    for skin, lump in ((True, 0.0), (False, LUMP)):
        masses = [fem.PointMass("tip", lump)] if lump else []
        other = lowest_hz(fem.assemble(model(mesh if skin else bare, skin, point_masses=masses)), 1)
        assert hz / other[0] == pytest.approx(exact / beam_hz(skin, lump), rel=0.003)
        assert abs(hz / other[0] - 1.0) > 0.03


def test_a_mass_that_nothing_carries_is_refused():
    mesh = bar()
    loose = replace(
        mesh,
        points=np.vstack([mesh.points, [0.5, 0.0, 0.0]]),
        point_sets={**mesh.point_sets, "loose": np.array([len(mesh.points)])},
    )
    masses = [fem.PointMass("loose", LUMP)]
    with pytest.raises(fem.ModelError, match=r"'loose', \(0.5, 0, 0\), is at no part of the model"):
        fem.assemble(model(loose, True, point_masses=masses))
    coupled = [fem.Coupling("loose", "tip")]
    fem.assemble(model(loose, True, point_masses=masses, couplings=coupled))


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"point_masses": [fem.PointMass("tip", 0.5)] * 2}, "2 point masses are at 'tip': all"),
        ({"parts": {"skin": fem.ShellPart(ALUMINIUM, 2.0)}}, "'skin' is 2 m thick and as large as"),
    ],
)
def test_what_is_hardly_meant_is_told(change, said):
    usual = model(bar(), True)
    with warnings.catch_warnings():
        warnings.simplefilter("error", fem.UnlikelyWarning)
        fem.assemble(usual)
    change = {**change, "parts": {**usual.parts, **change.get("parts", {})}}
    with pytest.warns(fem.UnlikelyWarning, match=said):
        fem.assemble(replace(usual, **change))


def test_a_beam_that_is_thicker_than_long_is_told():
    frame = fem.frame_mesh({"a": (0, 0), "b": (0.4, 0)}, [("arm", "a", "b", 2)])
    arm = {"arm": fem.BeamPart(STEEL, fem.RectangularSection(40.0, 20.0))}  # in mm
    with pytest.warns(fem.UnlikelyWarning, match=r"'arm' is 28.3 m thick and in all as"):
        fem.assemble(
            fem.StructureModel(frame, arm, [fem.Support("a", ("x", "y", "rotation"))], plane=True)
        )


def test_beams_along_others_are_told_and_those_in_line_are_not():
    members = [("bar", "a", "b", 4), ("bar", "b", "c", 2)]
    points = {"a": (0.0, 0.0), "b": (1.0, 0.0), "c": (2.0, 0.0)}
    part = fem.BeamPart(fem.Material(2.1e11, 7800.0), fem.RectangularSection(0.02, 0.01))
    with warnings.catch_warnings():
        warnings.simplefilter("error", fem.UnlikelyWarning)
        fem.assemble(fem.StructureModel(fem.frame_mesh(points, members), {"bar": part}, plane=True))
    mesh = fem.frame_mesh(points, [*members, ("bar", "a", "b", 1)])
    with pytest.warns(fem.UnlikelyWarning, match=r"beams lie upon others \(2 times; .* at \(0, 0"):
        frame = fem.assemble(fem.StructureModel(mesh, {"bar": part}, plane=True))
    assert fem.mass_properties(frame).mass == pytest.approx(7800.0 * 2e-4 * 3.0)  # 1 m twice


def test_facets_of_shells_upon_others_are_told_and_walls_at_a_fold_are_not():
    corners = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [0, 1, 1]], float)
    wall = fem.ShellPart(fem.Material(2.1e11, 7800.0, 0.3), 0.01)

    def shell(*blocks):
        sets = {"wall": [np.arange(len(cells)) for _, cells in blocks]}
        content = meshio.Mesh(corners, list(blocks), cell_sets=sets)
        return fem.assemble(fem.StructureModel(fem.from_meshio(content), {"wall": wall}))

    walls = ("quad", [[0, 1, 2, 3], [0, 3, 5, 4]])
    with warnings.catch_warnings():
        warnings.simplefilter("error", fem.UnlikelyWarning)
        shell(walls)
    with pytest.warns(fem.UnlikelyWarning, match=r"facets of shells lie upon others \(4 times"):
        shell(walls, ("triangle", [[0, 1, 2], [0, 2, 3]]))
