"""Pictures and pages of structures: right surfaces, right colours, drawn in a real browser."""

from __future__ import annotations

import html
import itertools
import json
import re
import shutil
import subprocess
from dataclasses import replace

import imageio.v3 as iio
import numpy as np
import pytest
from scipy.sparse.linalg import spsolve

import fem
from fem.render import (
    RenderError,
    StopSphere,
    gl_available,
    render_comparison,
    render_modes,
    render_shape,
    write_motion,
    write_page,
)
from fem.render.colouring import surface_values
from fem.render.page import shapes_of
from fem.render.scenery import reach_along, support_marks
from fem.render.structure_surface import structure_surface
from fem.render.views import view_of_motion

STEEL = fem.Material(2.0e11, 8000.0, 0.3)
CLAMP = ("x", "y", "z", "rotation_x", "rotation_y", "rotation_z")
BROWSER = next(
    (found for name in ("chromium", "google-chrome") if (found := shutil.which(name))), ""
)


@pytest.fixture
def with_gl():
    available, advice = gl_available()
    if not available:
        pytest.skip(advice)


@pytest.fixture
def bar():
    """A bar of solids with a mass at its tip, bent by 100 N along y."""
    component = fem.assemble(
        fem.StructureModel(
            fem.box_mesh("bar", (0.5, 0.02, 0.03), (10, 1, 1), origin=(0.0, -0.01, -0.015)),
            {"bar": fem.SolidPart(fem.Material(2.0e11, 8000.0, 0.0))},
            supports=[fem.Support("x0", ("x", "y", "z"))],
            couplings=[fem.Coupling("tip", "x1", "averaging")],
            point_masses=[fem.PointMass("tip", 0.1, offset=(0.02, 0.0, 0.0))],
            interfaces={"tip": fem.Interface("tip", "y")},
        )
    )
    return component, spsolve(component.stiffness.tocsc(), 100.0 * component.interfaces["tip"])


def beam(direction, **options):
    end = tuple(0.5 * np.array(direction) / np.linalg.norm(direction))
    mesh = fem.frame_mesh({"root": (0, 0, 0), "tip": end}, [("arm", "root", "tip", 5)])
    section = fem.RectangularSection(width=0.03, height=0.02)
    return fem.assemble(
        fem.StructureModel(
            mesh,
            {"arm": fem.BeamPart(STEEL, section, **options)},
            [fem.Support("root", CLAMP)],
            interfaces={name: fem.Interface("tip", name) for name in CLAMP},
        )
    )


def test_the_stress_of_a_bent_bar_is_that_of_beam_theory(bar):
    component, u = bar
    drawing = structure_surface(component)
    points, _ = drawing.place(np.zeros_like(u))
    found = surface_values(drawing, u, "stress")
    middle = np.abs(points[:, 0] - 0.25) < 1e-9
    second = 0.03 * 0.02**3 / 12
    wanted = 100.0 * 0.25 * np.abs(points[middle, 1]) / second
    outer = wanted > 0.0
    np.testing.assert_allclose(found[middle][outer], wanted[outer], rtol=0.01)
    assert found[middle][~outer].max() < 0.1 * wanted.max()


@pytest.mark.parametrize("direction", [(1, 0, 0), (1, 2, 0.5), (0, 0, 1)])
def test_moment_and_stress_of_a_beam_in_space_are_those_of_statics(direction):
    component = beam(direction, orientation=(0.3, 0.9, 0.1))
    drawing = structure_surface(component)
    x = np.array(direction) / np.linalg.norm(direction)
    z = np.cross(x, (0.3, 0.9, 0.1))
    z /= np.linalg.norm(z)
    y = np.cross(z, x)
    for axis, depth, second in ((y, 0.01, 0.03 * 0.02**3 / 12), (z, 0.015, 0.02 * 0.03**3 / 12)):
        load = 100.0 * sum(axis[i] * component.interfaces[name] for i, name in enumerate("xyz"))
        u = spsolve(component.stiffness.tocsc(), load)
        moment = surface_values(drawing, u, "moment")
        points, _ = drawing.place(np.zeros_like(u))
        np.testing.assert_allclose(moment, 100.0 * (0.5 - points @ x), atol=1e-6)
        stress = surface_values(drawing, u, "stress")
        np.testing.assert_allclose(stress, moment * depth / second, atol=1.0)


def test_the_moment_of_a_frame_is_that_of_statics(half_beam):
    u = np.linalg.solve(half_beam.stiffness.toarray(), 100.0 * half_beam.interfaces["middle"])
    drawing = structure_surface(half_beam)
    moment = surface_values(drawing, u, "moment")
    points, _ = drawing.place(np.zeros_like(u))
    along = points[np.abs(points[:, 1]) < 0.006]
    values = moment[np.abs(points[:, 1]) < 0.006]
    # the shear force of 100 N all along the beam: the moment changes by 100 N times the length
    ends = [values[np.argmin(np.abs(along[:, 0] - x))] for x in (0.66, 0.33)]
    assert ends[0] - ends[1] == pytest.approx(33.0, rel=1e-6)


def test_a_twisted_beam_turns_its_section():
    component = beam((1, 0, 0))
    turning = component.interfaces["rotation_x"]
    u = spsolve(component.stiffness.tocsc(), turning)
    u = u / (turning @ u)
    drawing = structure_surface(component)
    rest, _ = drawing.place(np.zeros_like(u))
    moved, _ = drawing.place(u, 0.01)
    tip = np.abs(rest[:, 0] - 0.5) < 1e-9
    turn = 0.01 * np.stack([0 * rest[tip, 0], -rest[tip, 2], rest[tip, 1]], axis=1)
    np.testing.assert_allclose(moved[tip] - rest[tip], turn, atol=2e-6)


@pytest.mark.parametrize("held", [fem.symmetry("x0", "x"), fem.Support("x0", "x")])
def test_a_mirror_makes_a_whole_of_half_a_block(held):
    """The cut through the middle is not drawn: the surface of the whole is one sphere."""
    half = fem.assemble(
        fem.StructureModel(
            fem.box_mesh("bar", (1.0, 0.1, 0.1), (3, 1, 1)),
            {"bar": fem.SolidPart(fem.Material(2e11, 7800.0, 0.3))},
            supports=[held],
        )
    )
    whole = structure_surface(half, mirror="x0")
    points, size = whole.place(np.ones(len(half.free)))
    assert points[:, 0].min() == pytest.approx(-points[:, 0].max(), rel=1e-12)
    assert len(size) == len(points)
    at_rest, _ = whole.place(np.zeros(len(half.free)))
    _, merged = np.unique(np.round(at_rest, 9), axis=0, return_inverse=True)
    faces = [tuple(merged.ravel()[face]) for array in whole.faces() for face in array]
    edges = {frozenset(pair) for f in faces for pair in zip(f, f[1:] + f[:1], strict=True)}
    assert len({v for f in faces for v in f}) - len(edges) + len(faces) == 2


def test_every_point_of_a_beam_in_space_has_its_displacement():
    mesh = fem.frame_mesh({"a": (0, 0, 0), "b": (0, 0, 1)}, [("bar", "a", "b", 3)])
    bar = fem.BeamPart(fem.Material(2e11, 7800.0, 0.3), fem.CircularSection(0.05))
    component = fem.assemble(fem.StructureModel(mesh, {"bar": bar}))
    aside = np.append(np.tile([3.0, 4.0, 0.0], 4), np.zeros(12))
    points, size = structure_surface(component).place(aside)
    assert len(points) == len(size)
    np.testing.assert_allclose(size, 5.0)


def test_the_surface_of_a_block_is_closed(bar):
    drawing = structure_surface(bar[0])
    points, _ = drawing.place(np.zeros_like(bar[1]))
    faces = [face for array in drawing.faces() for face in array]
    edges = {frozenset(pair) for f in faces for pair in zip(f, np.roll(f, -1), strict=True)}
    assert len(points) - len(edges) + len(faces) == 2
    low, high = points.min(axis=0), points.max(axis=0)
    sharp = np.concatenate(drawing.edges())
    for a, b in sharp:
        on_side = np.isclose(points[[a, b]], low) | np.isclose(points[[a, b]], high)
        assert (on_side.all(axis=0)).sum() >= 2


def colours(image):
    return int(np.count_nonzero(np.ptp(image[..., :3].astype(int), axis=-1) > 40))


def test_pictures_of_solids_and_sheets(with_gl, bar, tmp_path):
    component, u = bar
    stop = StopSphere("tip", 0.005, (0.0, 1.0, 0.0))
    for colour in ("displacement", "stress"):
        path = tmp_path / f"{colour}.png"
        render_shape(component, u, path, stops=[stop], colour=colour, size=(640, 360))
        assert colours(iio.imread(path)) > 3_000
    render_modes(component, np.stack([u, -u], axis=1), ["one", "other"], tmp_path / "modes.png")
    sheet = fem.assemble(
        fem.StructureModel(
            fem.box_mesh("sheet", (1.0, 0.4), (4, 2)),
            {"sheet": fem.SolidPart(STEEL, "stress", 0.01)},
            [fem.Support("x0", ("x", "y"))],
        )
    )
    shape = np.sin(np.arange(len(sheet.free)))
    render_shape(sheet, shape, tmp_path / "sheet.png", size=(640, 360))
    assert colours(iio.imread(tmp_path / "sheet.png")) > 10_000


def test_what_does_not_move_hides_the_structure_at_rest(with_gl, bar, tmp_path, monkeypatch):
    """Where both lie at one place, the colour of that at rest does not show through."""
    component, u = bar
    images = []
    for colour in ("#ff0000", "#00ff00"):
        monkeypatch.setattr("fem.render.pictures.GHOST", colour)
        render_shape(component, 0.0 * u, tmp_path / "rest.png", size=(640, 360))
        images.append(iio.imread(tmp_path / "rest.png")[..., :3].astype(int))
    drawn = np.ptp(images[0], axis=-1) > 40
    differ = np.abs(images[0] - images[1]).max(axis=-1) > 10
    assert np.count_nonzero(differ) < 0.2 * np.count_nonzero(drawn)  # edges


def test_a_comparison_says_how_far_the_two_are_apart(with_gl, bar, tmp_path):
    component, u = bar
    share = render_comparison(component, u, 0.9 * u, tmp_path / "two.png", size=(640, 360))
    assert share == pytest.approx(0.1, rel=1e-6)
    assert colours(iio.imread(tmp_path / "two.png")) > 3_000


def test_what_cannot_be_drawn_is_one_sentence(bar, half_beam, tmp_path):
    component, u = bar
    with pytest.raises(fem.ModelError, match="'tip' is not on a plane of symmetry"):
        render_shape(component, u, tmp_path / "a.png", mirror="tip")
    with pytest.raises(fem.ModelError, match="no colouring 'heat'; there are 'displacement'"):
        surface_values(structure_surface(component), u, "heat")
    with pytest.raises(fem.ModelError, match=r"a\.htm: the name must end in \.html"):
        write_page(component, u[:, None], ["one"], tmp_path / "a.htm")
    with pytest.raises(fem.ModelError, match="there are 1 shapes to draw, but 2 titles"):
        write_page(component, u[:, None], ["one", "two"], tmp_path / "a.html")
    with pytest.raises(RenderError, match="must end in"):
        render_comparison(component, u, u, tmp_path / "a.gif")
    assert not list(tmp_path.iterdir())


def test_a_page_holds_its_text_and_nothing_from_elsewhere(bar, tmp_path):
    component, u = bar
    path = tmp_path / "bar.html"
    title = "</script><b>one</b> & more"
    write_page(component, u[:, None], [title], path, heading="A <bar>")
    text = path.read_text(encoding="utf-8")
    assert not re.search(r"""(src|href)=["'](?!data:)|https?://""", text)
    assert text.count("</script>") == 2
    assert "<title>A &lt;bar&gt;</title>" in text


TURNING = """
<script>
const page = { x: 100, y: 200, pointerId: 1 };
viewer.canvas.setPointerCapture = () => {};
function pixels() {
  viewer.drawNow();
  const { gl, canvas } = viewer, found = new Uint8Array(4 * canvas.width * canvas.height);
  gl.readPixels(0, 0, canvas.width, canvas.height, gl.RGBA, gl.UNSIGNED_BYTE, found);
  return found;
}
function where(is) { // mean height of the pixels of a colour, and their number
  const all = pixels(), width = viewer.canvas.width;
  let count = 0, sum = 0;
  for (let i = 0; i < all.length; i += 4)
    if (is(all[i], all[i + 1], all[i + 2])) { count += 1; sum += Math.floor(i / 4 / width); }
  return [count, sum / count];
}
const coloured = (r, g, b) => Math.max(r, g, b) - Math.min(r, g, b) > 40;
const red = (r, g, b) => r > 90 && g < 60 && b < 60;
const told = [0, 0.25, 0.5, 0.75].map((part) => {
  viewer.setPhase(part);
  return { surface: where((...c) => coloured(...c) && !red(...c)), stop: where(red) };
});
const before = String(pixels());
for (const [kind, x] of [["pointerdown", 200], ["pointermove", 300], ["pointerup", 300]])
  viewer.canvas.dispatchEvent(new PointerEvent(kind, { clientX: x, clientY: 200, pointerId: 1 }));
document.body.dataset.turned = String(pixels()) !== before;
document.body.dataset.told = JSON.stringify(told);
document.body.dataset.state = viewer.root.dataset.state;
</script>
"""


def in_browser(path, tmp_path):
    """What a page tells of its picture at four instants, and whether it can be turned."""
    text = path.read_text(encoding="utf-8")
    path.write_text(text.replace("</body>", TURNING + "</body>"), encoding="utf-8")
    run = subprocess.run(
        [BROWSER, "--headless=new", "--no-sandbox", "--use-angle=swiftshader",
         "--enable-unsafe-swiftshader", f"--user-data-dir={tmp_path / 'profile'}",
         "--window-size=700,500", "--virtual-time-budget=5000", "--dump-dom", path.as_uri()],
        capture_output=True, text=True, timeout=120, check=False,
    )  # fmt: skip
    body = re.search(r"<body[^>]*>", run.stdout)[0]
    if 'data-state="no WebGL 2"' in run.stdout:
        pytest.skip("this Chromium has no WebGL 2")
    assert 'data-state="drawn"' in body
    assert 'data-turned="true"' in body
    return json.loads(html.unescape(re.search(r'data-told="([^"]*)"', body)[1]))


@pytest.mark.skipif(not BROWSER, reason="no Chromium on this machine")
def test_a_browser_swings_a_mode_to_both_sides(bar, tmp_path):
    component, u = bar
    path = tmp_path / "bar.html"
    write_page(component, u[:, None], ["bent"], path)
    high, middle, low, again = (each["surface"] for each in in_browser(path, tmp_path))
    assert min(high[0], low[0]) > 2_000
    assert high[1] > low[1] + 5  # rows of the picture, from below
    assert middle[0] == again[0] == 0  # without displacement nothing is coloured


@pytest.mark.skipif(not BROWSER, reason="no Chromium on this machine")
def test_a_browser_plays_a_motion_that_stays_on_its_side_of_the_stop(bar, tmp_path):
    """It goes down and back, never up, as the states that were given; the stop stands still."""
    component, u = bar
    path = tmp_path / "bar.html"
    times = np.arange(8) / 8
    states = -np.outer(0.5 * (1.0 - np.cos(2.0 * np.pi * times)), u)
    stop = StopSphere("tip", 0.01, (0.0, 1.0, 0.0), gap=0.5 * np.abs(u).max())
    write_motion(
        component, states, path, times=times, period=1.0, title="down and back", stops=[stop],
        colour="stress",
    )  # fmt: skip
    rest, quarter, lowest, back = in_browser(path, tmp_path)
    assert min(each["surface"][0] for each in (rest, quarter, lowest, back)) > 2_000
    # the number of coloured pixels differs from run to run by some per cent, their height hardly
    heights = [each["surface"][1] for each in (rest, quarter, lowest)]
    assert heights[0] > heights[1] > heights[2]
    assert abs(back["surface"][1] - heights[1]) < 0.1 * (heights[0] - heights[2])
    assert len({tuple(each["stop"]) for each in (rest, lowest)}) == 1 and rest["stop"][0] > 20


def test_shapes_of_a_motion_give_its_states_back(bar):
    _, u = bar
    states = np.array([u, -0.5 * u, u + 1e-3 * np.abs(u).max() * np.cos(np.arange(len(u)))])
    shapes, coordinates = shapes_of(states)
    assert shapes.shape[1] == 2
    np.testing.assert_allclose(coordinates @ shapes.T, states, atol=1e-9 * np.abs(u).max())


def test_held_faces_and_edges_of_solids_are_marked_where_they_are():
    """A face by a patch on it, the nodes of an edge by cubes around them."""
    mesh = fem.box_mesh("bar", (0.5, 0.02, 0.03), (10, 1, 1))
    edge = np.flatnonzero((mesh.points[:, 0] > 0.499) & (mesh.points[:, 1] < 1e-9))
    mesh = replace(mesh, point_sets={**mesh.point_sets, "edge": edge})
    supports = [fem.Support("x0", ("x", "y", "z")), fem.Support("edge", "y")]
    component = fem.assemble(fem.StructureModel(mesh, {"bar": fem.SolidPart(STEEL)}, supports))
    (face, *cubes), planes = zip(*support_marks(structure_surface(component)), strict=True)
    assert planes == (False, *[True] * len(cubes))
    assert np.allclose(np.asarray(face.points)[:, 0], 0.0, atol=2e-3)
    assert face.area == pytest.approx(0.02 * 0.03, rel=0.1)
    centres = np.array([cube.center for cube in cubes])
    np.testing.assert_allclose(centres, mesh.points[edge], atol=1e-12)


def test_a_view_shows_what_moves():
    """Of a plate in x-y, of one in x-z and of a rod along z, most of each motion is seen."""
    sides = {"x-y": (1.0, 0.6, 0.01), "x-z": (1.0, 0.01, 0.6), "rod": (0.05, 0.05, 1.0)}
    for name, way in itertools.product(sides, np.eye(3)):
        corners = np.array(list(itertools.product((0.0, 1.0), repeat=3))) * sides[name]
        axes = view_of_motion(corners, np.tile(way, (8, 1)))
        np.testing.assert_allclose(axes @ axes.T, np.eye(3), atol=1e-12)
        assert np.linalg.det(axes) == pytest.approx(1.0)
        assert np.linalg.norm(axes[:2] @ way) > 0.9
        assert np.linalg.norm(axes[:2] @ sides[name]) > 0.75 * np.linalg.norm(sides[name])


def test_a_stop_touches_its_own_arm_of_a_fork():
    """From a corner along an edge, from inside the arm, and from a face through the thickness."""
    arms = [
        fem.box_mesh("fork", (0.5, 0.02, 0.02), (5, 2, 1), origin=(0.0, y, 0.0)) for y in (0.0, 0.1)
    ]
    foot = fem.box_mesh("fork", (0.1, 0.08, 0.02), (1, 4, 1), origin=(0.0, 0.02, 0.0))
    mesh = fem.joined([*arms, foot])
    component = fem.assemble(
        fem.StructureModel(
            fem.StructureMesh(mesh.points, mesh.cells, mesh.groups, {}),
            {"fork": fem.SolidPart(STEEL)},
        )
    )
    drawing = structure_surface(component)
    up = np.array([0.0, 1.0, 0.0])
    for y in (0.0, 0.01, 0.02):
        for x, z in ((0.5, 0.02), (0.5, 0.01), (0.4, 0.0)):
            found = reach_along(drawing, np.array([x, y, z]), up)
            assert found == pytest.approx(0.02 - y, abs=1e-9)
    assert reach_along(drawing, np.array([0.0, 0.0, 0.0]), up) == pytest.approx(0.12)
