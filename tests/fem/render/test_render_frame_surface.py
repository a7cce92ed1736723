"""The swept surface against polynomials and plain geometry."""

from __future__ import annotations

import numpy as np
import pytest

import fem
from fem.elements.straight_beams import hermite
from fem.render.structure_surface import local_deflection, reflected, structure_surface
from fem.render.swept import outline


@pytest.mark.parametrize("coefficients", [*np.eye(4).tolist(), [0.3, -1.0, 2.0, 5.0]])
def test_hermite_reproduces_cubics(coefficients):
    cubic = np.polynomial.Polynomial(coefficients)
    slope = cubic.deriv()
    values = np.array([cubic(0.0), slope(0.0), cubic(1.0), slope(1.0)])
    s = np.linspace(0, 1, 11)
    cubics, slopes = hermite(s)
    np.testing.assert_allclose(values @ cubics, cubic(s), atol=1e-14)
    np.testing.assert_allclose(values @ slopes, slope(s), atol=1e-14)


def test_deflection_of_an_element_is_its_cubic():
    """Cubics across and a linear stretch along an element of length 3."""
    length, s = 3.0, np.linspace(0, 1, 7)
    along = np.polynomial.Polynomial([0.4, -0.1])
    up, across = (np.polynomial.Polynomial(c) for c in ([0.1, 0.2, -0.3, 0.05], [0.3, 0, 0.1, -1]))
    ends = [
        [along(x), up(x), across(x), 0.0, -across.deriv()(x), up.deriv()(x)] for x in (0.0, length)
    ]
    moved, slope, _ = local_deflection(np.array([ends]).reshape(1, 12), np.array([length]), s)
    curves, x = (along, up, across), s * length
    np.testing.assert_allclose(moved[0], np.stack([c(x) for c in curves], -1), atol=1e-14)
    np.testing.assert_allclose(slope[0], np.stack([c.deriv()(x) for c in curves], -1), atol=1e-13)


def centres(surface, u, scale=1.0):
    """Axis of the drawn frame: the means of the outlines, in order of parts, elements, places."""
    points, _ = surface.place(u, scale)
    found, start = [], 0
    for _, part in surface.beams:
        count = int(np.prod(part.shape))
        found.append(points[start : start + count].reshape(*part.shape, 3).mean(axis=2))
        start += count
    return found


def test_sweep_passes_through_the_nodes(half_beam):
    u = np.random.default_rng(1).standard_normal(len(half_beam.free)) * 0.01
    mesh, shape = half_beam.model.mesh, half_beam.shape(u)
    surface = structure_surface(half_beam)
    for (name, _), axis in zip(surface.beams, centres(surface, u, scale=3.0), strict=True):
        for end, place in ((0, 0), (1, -1)):
            nodes = half_beam.model.beams[name][1][:, end]
            expected = mesh.points[nodes, :2] + 3.0 * shape[nodes, :2]
            np.testing.assert_allclose(axis[:, place, :2], expected, atol=1e-13)


def test_one_element_draws_the_exact_static_deflection():
    """Cantilever under a tip load F: w = F x^2 (3 L - x) / (6 E I), a cubic."""
    mesh = fem.frame_mesh({"root": (0, 0), "tip": (2, 0)}, [("arm", "root", "tip", 1)])
    section = fem.RectangularSection(width=0.05, height=0.02)
    component = fem.assemble(
        fem.StructureModel(
            mesh,
            parts={"arm": fem.BeamPart(fem.Material(2e11, 7800.0), section)},
            supports=[fem.Support("root", ("x", "y", "rotation"))],
            interfaces={"tip": fem.Interface("tip", "y")},
            plane=True,
        )
    )
    load = 40.0 * component.interfaces["tip"]
    u = np.linalg.solve(component.stiffness.toarray(), load)
    surface = structure_surface(component, places=9)
    x = np.linspace(0, 2, 9)
    exact = 40.0 * x**2 * (6 - x) / (6 * 2e11 * section.second_moment)
    np.testing.assert_allclose(centres(surface, u)[0][0, :, 1], exact, rtol=1e-10, atol=1e-15)
    _, size = surface.place(u, scale=7.0)
    np.testing.assert_allclose(size.reshape(9, 4)[:, 0], exact, rtol=1e-10, atol=1e-15)


def test_sections_keep_their_size_and_stand_across_the_drawn_axis(half_beam):
    u = np.random.default_rng(2).standard_normal(len(half_beam.free)) * 0.01
    surface = structure_surface(half_beam)
    points, _ = surface.place(u, scale=5.0)
    part = surface.beams[0][1]
    rings = points[: np.prod(part.shape)].reshape(*part.shape, 3)
    edges = np.linalg.norm(np.roll(rings, -1, axis=2) - rings, axis=-1)
    np.testing.assert_allclose(np.sort(edges, axis=-1)[..., 0], 0.01, rtol=1e-12)
    np.testing.assert_allclose(np.sort(edges, axis=-1)[..., -1], 0.09, rtol=1e-12)
    fine = structure_surface(half_beam, places=2001)
    chord = np.diff(centres(fine, u, 5.0)[0], axis=1)[..., :2]
    tall = fine.place(u, 5.0)[0][: np.prod(fine.beams[0][1].shape)].reshape(
        *fine.beams[0][1].shape, 3
    )
    height = (tall[:, :, 2] - tall[:, :, 1])[:, :-1, :2]
    cosine = np.sum(height * chord, axis=-1) / np.linalg.norm(chord, axis=-1) / 0.01
    assert np.max(np.abs(cosine)) < 5e-3


def test_hinged_part_keeps_its_own_slope(portal):
    """Turning only the hinge's own rotation bends the girder and leaves the columns straight."""
    u = np.zeros(len(portal.free))
    u[-1] = 0.01
    surface = structure_surface(portal)
    column, girder = centres(surface, u)
    rest_column, rest_girder = centres(surface, 0 * u)
    np.testing.assert_array_equal(column, rest_column)
    assert np.abs(girder - rest_girder).max() > 1e-3


def test_outlines_have_the_sections_area_and_second_moment():
    for section in (fem.RectangularSection(0.09, 0.01), fem.Section(2.85e-3, 1.94e-5)):
        corners = outline(section)
        height, width = np.ptp(corners, axis=0)
        assert height * width == pytest.approx(section.area, rel=1e-12)
        assert width * height**3 / 12 == pytest.approx(section.second_moment, rel=1e-12)
    np.testing.assert_allclose(np.linalg.norm(outline(fem.CircularSection(0.2)), axis=1), 0.1)


def test_mirror_makes_the_whole_beam(half_beam):
    u = np.random.default_rng(3).standard_normal(len(half_beam.free)) * 0.01
    half, _ = structure_surface(half_beam).place(u)
    whole = structure_surface(half_beam, mirror="middle")
    points, size = whole.place(u)
    assert len(points) == 2 * len(half) == len(size)
    np.testing.assert_allclose(points[len(half) :, 0], 1.32 - half[:, 0])
    np.testing.assert_array_equal(points[len(half) :, 1:], half[:, 1:])
    for cells in whole.faces() + whole.edges():
        assert cells.max(initial=0) < len(points)


def test_reflection_in_a_slanted_plane_is_its_own_inverse():
    points = np.random.default_rng(4).standard_normal((5, 3))
    origin, normal = np.array([0.3, -0.2, 0.1]), np.array([0.6, 0.8, 0.0])
    once = reflected(points, origin, normal)
    np.testing.assert_allclose(reflected(once, origin, normal), points)
    np.testing.assert_allclose(reflected(np.zeros((1, 3)), normal, normal)[0], [1.2, 1.6, 0])


def euler_characteristic(surface):
    """Vertices - edges + faces of the polygons, after dropping coinciding points."""
    points, _ = surface.place(np.zeros(len(surface.component.free)))
    _, merged = np.unique(np.round(points, 9), axis=0, return_inverse=True)
    merged = merged.ravel()
    faces = [tuple(merged[face]) for array in surface.faces() for face in array]
    edges = {frozenset(pair) for f in faces for pair in zip(f, f[1:] + f[:1], strict=True)}
    return len({v for f in faces for v in f}) - len(edges) + len(faces)


def test_surface_is_closed(half_beam):
    """Each part is a topological sphere: Euler characteristic 2 each."""
    assert euler_characteristic(structure_surface(half_beam)) == 4


def test_mirror_needs_a_plane_of_symmetry(half_beam):
    with pytest.raises(fem.ModelError, match="'foot' is not on a plane of symmetry"):
        structure_surface(half_beam, mirror="foot")
    with pytest.raises(fem.ModelError, match="there is no point or face 'centre'"):
        structure_surface(half_beam, mirror="centre")
