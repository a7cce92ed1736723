"""Pictures are written whole, have their size and show something; faults get one sentence."""

from __future__ import annotations

import importlib.util
import subprocess

import imageio.v3 as iio
import numpy as np
import pytest
import pyvista

import fem
from fem.render import (
    RenderError,
    StopSphere,
    animate,
    gl,
    pictures,
    render_comparison,
    render_modes,
    render_shape,
)
from fem.render.pictures import automatic_scale
from fem.render.scenery import mass_blocks
from fem.render.several import Several
from fem.render.stop_scenery import largest_scale, penetration, stop_bodies
from fem.render.structure_surface import structure_surface

STEEL = fem.Material(2.1e11, 7800.0)


@pytest.fixture
def with_gl():
    available, advice = gl.gl_available()
    if not available:
        pytest.skip(advice)


@pytest.fixture
def without_gl(monkeypatch):
    monkeypatch.setattr(gl, "renders", lambda window: False)
    gl.working_window.cache_clear()
    yield
    gl.working_window.cache_clear()


@pytest.fixture
def sagging(half_beam):
    return -1e-3 * np.linalg.solve(
        half_beam.stiffness.toarray(), 1e4 * half_beam.interfaces["middle"]
    )


def colours(image):
    """Number of well-coloured pixels: neither white nor grey."""
    return int(np.count_nonzero(np.ptp(image[..., :3].astype(int), axis=-1) > 40))


def test_shape(with_gl, half_beam, sagging, tmp_path):
    path = tmp_path / "shape.png"
    stop = StopSphere("middle", 0.005)
    factor = render_shape(half_beam, sagging, path, title="Sagging", stops=[stop], size=(800, 450))
    image = iio.imread(path)
    assert image.shape[:2] == (450, 800)
    assert colours(image) > 10_000
    assert [file.name for file in tmp_path.iterdir()] == ["shape.png"]
    assert 0.02 < factor * np.abs(half_beam.shape(sagging)).max() < 0.1
    frame = np.concatenate([image[0], image[-1], image[:, 0], image[:, -1]])
    assert np.all(frame == 255), "something reaches the edge of the picture"


def test_stop_and_mirror_show(with_gl, half_beam, sagging, tmp_path):
    path = tmp_path / "a.png"
    red = []
    for stops in ((), [StopSphere("middle", 0.02)]):
        render_shape(half_beam, sagging, path, stops=stops, mirror="middle", size=(600, 300))
        pixels = iio.imread(path).astype(int)
        red.append(np.count_nonzero((pixels[..., 0] > 120) & (pixels[..., 1:3].max(-1) < 60)))
    assert red[0] == 0
    assert red[1] > 50


def test_frame_at_rest_with_other_marks_and_a_long_title(with_gl, portal, tmp_path):
    """A frame with every kind of support, a hinge, and no displacement at all."""
    assert render_shape(portal, np.zeros(len(portal.free)), tmp_path / "rest.png", title="x" * 300)
    assert colours(iio.imread(tmp_path / "rest.png")) > 1000


@pytest.mark.parametrize("count", [1, 2, 4])
def test_modes(with_gl, half_beam, tmp_path, count):
    shapes = np.eye(len(half_beam.free))[:, 4 : 4 + count]
    titles = [f"mode {i + 1}" for i in range(count)]
    path = tmp_path / "modes.png"
    render_modes(half_beam, shapes, titles, path, size=(800, 600))
    image = iio.imread(path)
    assert image.shape[:2] == (600, 800)
    columns = 1 if count < 4 else 2
    rows = -(-count // columns)
    for index in range(count):
        row, column = divmod(index, columns)
        height, width = (600 - pictures.BAR_ROW) // rows, 800 // columns
        field = image[row * height : (row + 1) * height, column * width : (column + 1) * width]
        assert colours(field) > 500
    assert colours(image[600 - pictures.BAR_ROW :]) > 3000


def unit(ways):
    return ways / np.linalg.norm(ways)


@pytest.mark.parametrize(
    "draw, texts",
    [
        (lambda c, u, *to: render_shape(c, u, *to, title="Sag"), {"title", "note", "unit"}),
        (lambda c, u, *to: render_comparison(c, u, 0.9 * u, *to), {"title", "note", "unit"}),
        (lambda c, u, *to: render_modes(c, u[:, None], ["Sag"], *to), {"title"}),
    ],
)
def test_without_a_path_a_plotter_shows_what_a_file_has(
    with_gl, half_beam, sagging, tmp_path, monkeypatch, draw, texts
):
    monkeypatch.setattr(pyvista, "OFF_SCREEN", True)
    draw(half_beam, sagging, tmp_path / "a.png")
    plotter = draw(half_beam, sagging)
    actors = plotter.renderers[0].actors
    assert texts <= set(actors)
    at_rest, _ = structure_surface(half_beam).place(0.0 * sagging)
    way = unit(structure_surface(half_beam).place(sagging)[0] - at_rest)
    bodies = [a.mapper.dataset.points for a in actors.values() if isinstance(a, pyvista.Actor)]
    ways = [unit(points - at_rest) for points in bodies if len(points) == len(at_rest)]
    assert max(np.vdot(w, way) for w in ways) == pytest.approx(1.0, abs=1e-6), "not deflected"
    shown = plotter.show(screenshot=True, return_img=True)
    np.testing.assert_array_equal(shown, iio.imread(tmp_path / "a.png"))


def states_of_one_period(u, count):
    times = np.arange(count) / count / 25.0
    return np.sin(2 * np.pi * 25.0 * times)[:, None] * u, times


def test_gif(with_gl, half_beam, sagging, tmp_path):
    states, times = states_of_one_period(sagging, 4)
    path = tmp_path / "period.gif"
    animate(half_beam, states, path, times=times, fps=10, size=(320, 200), mirror="middle")
    images = iio.imread(path)
    assert images.shape[:3] == (4, 200, 320)
    assert np.any(images[1] != images[3])
    meta = iio.immeta(path)
    assert (meta["duration"], meta["loop"]) == (100, 0)
    assert [file.name for file in tmp_path.iterdir()] == ["period.gif"]


@pytest.mark.skipif(
    importlib.util.find_spec("imageio_ffmpeg") is None, reason="imageio-ffmpeg is not installed"
)
def test_mp4(with_gl, half_beam, sagging, tmp_path):
    states, times = states_of_one_period(sagging, 6)
    path = tmp_path / "period.mp4"
    animate(half_beam, states, path, times=times, scale=20.0, size=(320, 200))
    assert iio.imread(path).shape == (6, 200, 320, 3)


def test_mp4_without_ffmpeg_says_what_to_install(half_beam, sagging, tmp_path, monkeypatch):
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    with pytest.raises(RenderError, match=r"pip install imageio-ffmpeg.* \.gif"):
        animate(half_beam, sagging[None], tmp_path / "a.mp4", times=[0.0])


def test_without_gl_one_sentence_says_what_to_install(without_gl, half_beam, sagging, tmp_path):
    available, advice = gl.gl_available()
    assert not available
    with pytest.raises(RenderError) as caught:
        render_shape(half_beam, sagging, tmp_path / "a.png")
    assert str(caught.value) == advice
    assert "apt-get install libegl1 libgl1-mesa-dri" in advice
    assert "\n" not in advice
    assert list(tmp_path.iterdir()) == []
    with pytest.raises(RenderError):
        render_modes(half_beam, sagging[:, None], ["one"])
    with pytest.raises(RenderError):
        animate(half_beam, sagging[None], tmp_path / "a.gif", times=[0.0])


def test_probe_survives_a_crash(monkeypatch):
    monkeypatch.setattr(gl, "PROBE", "import os, signal; os.kill(os.getpid(), signal.SIGSEGV)")
    assert gl.renders("") is False


def test_probe_survives_a_hang(monkeypatch):
    def hangs(*args, **kwargs):
        raise subprocess.TimeoutExpired("python", 1.0)

    monkeypatch.setattr(subprocess, "run", hangs)
    assert gl.renders("") is False


def test_probe_is_made_once(monkeypatch):
    calls = []
    monkeypatch.setattr(gl, "renders", lambda window: calls.append(window) or False)
    gl.working_window.cache_clear()
    try:
        assert gl.gl_available() == gl.gl_available() == (False, gl.ADVICE)
        assert len(calls) == len(gl.candidate_windows())
    finally:
        gl.working_window.cache_clear()


def test_egl_is_tried_where_there_is_no_display(monkeypatch):
    monkeypatch.setattr(gl.sys, "platform", "linux")
    monkeypatch.delenv(gl.EGL_VARIABLE, raising=False)
    monkeypatch.delenv("DISPLAY", raising=False)
    assert gl.candidate_windows() == ["vtkEGLRenderWindow"]
    monkeypatch.setenv("DISPLAY", ":0")
    assert gl.candidate_windows() == ["", "vtkEGLRenderWindow"]
    monkeypatch.setenv(gl.EGL_VARIABLE, "vtkOSOpenGLRenderWindow")
    assert gl.candidate_windows() == ["vtkOSOpenGLRenderWindow"]
    assert not gl.on_screen()
    monkeypatch.delenv(gl.EGL_VARIABLE)
    assert gl.on_screen()


def test_failed_write_leaves_the_old_picture(tmp_path, monkeypatch):
    path = tmp_path / "a.png"
    path.write_bytes(b"old")

    def fails(*args, **kwargs):
        raise OSError("disk full")

    monkeypatch.setattr(iio, "imwrite", fails)
    with pytest.raises(OSError, match="disk full"):
        pictures.write_image(path, np.zeros((4, 4, 3), dtype=np.uint8))
    assert path.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [path]


def test_bad_requests(half_beam, sagging, tmp_path):
    png = tmp_path / "a.png"
    with pytest.raises(RenderError, match=r"must end in \.png"):
        render_shape(half_beam, sagging, tmp_path / "a.jpeg")
    with pytest.raises(RenderError, match="there is no folder"):
        render_shape(half_beam, sagging, tmp_path / "no" / "a.png")
    with pytest.raises(fem.ModelError, match=r"have shape \(3,\), but the component has 25"):
        render_shape(half_beam, sagging[:3], png)
    with pytest.raises(fem.ModelError, match="not all finite"):
        render_shape(half_beam, sagging * np.nan, png)
    with pytest.raises(fem.ModelError, match="scale must be a finite number"):
        render_shape(half_beam, sagging, png, scale=np.inf)
    with pytest.raises(fem.ModelError, match="1 modes to draw, but 2 titles"):
        render_modes(half_beam, sagging[:, None], ["a", "b"], png)
    with pytest.raises(fem.ModelError, match="2 states to draw, but times has shape"):
        animate(half_beam, np.array([sagging, sagging]), tmp_path / "a.gif", times=[0.0])
    with pytest.raises(fem.ModelError, match="fps must be positive"):
        animate(half_beam, sagging[None], tmp_path / "a.gif", times=[0.0], fps=0.0)


def test_unknown_stop(half_beam, sagging, tmp_path):
    with pytest.raises(fem.ModelError, match="there is no point or face 'centre'"):
        render_shape(half_beam, sagging, tmp_path / "a.png", stops=[StopSphere("centre", 0.01)])


@pytest.mark.parametrize(
    "fields, sentence",
    [
        ({"radius": 0.0}, "stop at 'm': radius must be positive"),
        ({"radius": 1.0, "gap": np.nan}, "stop at 'm': gap must be finite"),
        ({"radius": 1.0, "direction": (0.0, 0.0)}, "is no direction"),
    ],
)
def test_bad_stops(fields, sentence):
    with pytest.raises(fem.ModelError, match=sentence):
        StopSphere("m", **fields)


def test_stop_touches_the_beam_at_rest(half_beam):
    """The sphere's lowest point is the beam's upper surface, or above it by the scaled gap."""
    drawing = structure_surface(half_beam)
    for gap, scale in ((0.0, 1.0), (2e-4, 50.0)):
        sphere = stop_bodies(drawing, StopSphere("middle", 0.005, gap=gap), scale)[0].solid
        assert sphere.bounds[2] == pytest.approx(0.005 + gap * scale, abs=1e-5)
        assert np.mean(sphere.bounds[:2]) == pytest.approx(0.66, abs=1e-5)
    below = stop_bodies(drawing, StopSphere("middle", 0.005, direction=(0.0, -2.0)), 1.0)[0].solid
    assert below.bounds[3] == pytest.approx(-0.005, abs=1e-5)


def test_mass_is_a_block_of_steel_away_from_the_stop(half_beam):
    stop = StopSphere("middle", 0.005)
    (block,) = mass_blocks(structure_surface(half_beam, mirror="middle"), [stop])
    assert block.solid.volume * 7800.0 == pytest.approx(2 * 0.19, rel=1e-4)
    assert block.solid.bounds[3] == pytest.approx(-0.005, abs=1e-6)
    (half,) = mass_blocks(structure_surface(half_beam), [stop])
    assert half.solid.volume * 7800.0 == pytest.approx(0.19, rel=1e-4)
    assert half.solid.bounds[1] == pytest.approx(0.66, abs=1e-6)
    shape = np.zeros((10, 3))
    shape[half.node] = [0.0, 0.01, 0.0]
    half.move(shape, 3.0)
    assert half.solid.bounds[3] == pytest.approx(-0.005 + 0.03, abs=1e-6)


def test_scales_are_round_and_units_readable():
    assert [pictures.round_number(x) for x in (1.0, 0.199, 4.99, 5.0, 9.9e4)] == [
        1.0, 0.1, 2.0, 5.0, 5e4,
    ]  # fmt: skip
    for largest in (5.05, 1.54e-3, 1.0, 999.0, 12.0):
        top, parts = pictures.round_range(largest)
        assert largest <= top <= 1.51 * largest
        assert float(f"{top / parts:.1g}") == pytest.approx(top / parts), "ticks are not round"
    assert pictures.length_unit(4e-6) == ("µm", 1e6)
    assert pictures.length_unit(0.9e-3) == ("mm", 1e3)
    assert pictures.length_unit(0.7) == ("m", 1.0)
    assert pictures.length_unit(3e-9) == ("nm", 1e9)


@pytest.fixture
def tongs():
    """Two cantilevers beside each other, 20 mm apart, with a stop between their ends."""
    arm = fem.BeamPart(STEEL, fem.RectangularSection(0.01, 0.01))
    parts = {}
    for name, y in (("lower", 0.0), ("upper", 0.03)):
        mesh = fem.frame_mesh({"root": (0, y), "tip": (0.5, y)}, [("arm", "root", "tip", 4)])
        supports = [fem.Support("root", ("x", "y", "rotation"))]
        ends = {"tip": fem.Interface("tip", "y")}
        parts[name] = fem.assemble(
            fem.StructureModel(mesh, {"arm": arm}, supports, interfaces=ends, plane=True)
        )
    return Several(parts)


def bent(tongs, lower, upper):
    """Displacements of which the tips have those along y."""
    found = []
    for part, size in zip(tongs.parts.values(), (lower, upper), strict=True):
        pushed = np.linalg.solve(part.stiffness.toarray(), part.interfaces["tip"])
        found.append(size * pushed / (part.interfaces["tip"] @ pushed))
    return np.concatenate(found)


def test_a_stop_between_two_points_is_carried_by_one_and_marked_at_the_other(tongs):
    """The sphere keeps off the surface by gap and relative motion; its rod leads to the carrier."""
    drawing = pictures.surface_of(tongs)
    stop = StopSphere("lower.tip", 0.004, (0.0, 1.0), gap=2e-3, against="upper.tip")
    u, scale = bent(tongs, 1e-3, -5e-4), 3.0
    ball, rod, disc = stop_bodies(drawing, stop, scale)
    assert (ball.carrier, rod.carrier, disc.carrier) == ("upper.tip", "upper.tip", "lower.tip")
    bottom = ball.solid.bounds[2] + ball.moved(drawing, u, scale)[1]
    touched = 0.005 + scale * 1e-3  # the upper side of the lower arm
    assert bottom - touched == pytest.approx(scale * (2e-3 - 1.5e-3), abs=1e-5)
    assert rod.solid.bounds[3] == pytest.approx(0.03, abs=1e-6)
    assert np.mean(disc.solid.bounds[2:4]) == pytest.approx(0.005, abs=1e-6)


def test_no_stop_sinks_in_by_more_than_half_its_radius(tongs):
    """In one state or several, by relative motion, and without contact not limited."""
    drawing = pictures.surface_of(tongs)
    stop = StopSphere("lower.tip", 0.004, (0.0, 1.0), gap=1e-3, against="upper.tip")
    deep = bent(tongs, 1e-3, -5e-4)
    assert penetration(drawing, deep, stop) == pytest.approx(5e-4)
    assert largest_scale(drawing, np.array([deep, -deep]), [stop]) == pytest.approx(4.0)
    assert automatic_scale(drawing, np.array([deep, -deep]), [stop]) == 2.0
    assert automatic_scale(drawing, np.array([-deep]), [stop]) > 10.0


def test_a_stop_of_a_component_that_is_not_there(tongs):
    with pytest.raises(fem.ModelError, match="there is no component 'middle'"):
        stop_bodies(pictures.surface_of(tongs), StopSphere("middle.tip"), 1.0)


def test_pictures_move_what_is_carried(with_gl, tongs, tmp_path):
    stop = StopSphere("lower.tip", 0.004, (0.0, 1.0), gap=2e-3, against="upper.tip")
    times = np.arange(3) / 3
    states = np.array([bent(tongs, size, -size) for size in (0.0, 5e-3, -5e-3)])
    animate(tongs, states, tmp_path / "tongs.gif", times=times, stops=[stop], scale=1.0)
    rows = []
    for image in iio.imread(tmp_path / "tongs.gif"):
        red = image[..., :3].astype(int)
        seen = (red[..., 0] > 120) & (red[..., 1] < 100) & (red[..., 2] < 100)
        rows.append(np.nonzero(seen[80:440])[0].mean())
    assert rows[1] > rows[0] + 2 and rows[2] < rows[0] - 2
