"""Wedges and pyramids, alone and among hexahedra and tetrahedra."""

import warnings
from itertools import product

import numpy as np
import pytest
import skfem
from mixed import FAMILIES, STRETCH, jiggled, mixed_block, patch_error
from scipy.linalg import null_space
from structures import CLAMP, STEEL, lowest_hz

import fem
from fem.assembly.constraints import facet_products
from fem.mesh.cells import KINDS
from fem.render.colouring import von_mises
from fem.render.structure_surface import structure_surface

NEW = ("wedge", "wedge15", "wedge18", "pyramid", "pyramid13", "pyramid14")
STRAIGHT = fem.Material(2.0e11, 8000.0, 0.0)


def body(mesh, material=STEEL, **options):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", fem.LockingWarning)
        return fem.assemble(
            fem.StructureModel(mesh, {name: fem.SolidPart(material) for name in mesh.groups},
                               **options)
        )  # fmt: skip


def inside(kind, count):
    """Places in the reference cell, random but the same each time."""
    corners = KINDS[kind].corners
    shares = np.random.default_rng(7).dirichlet(np.ones(len(corners)), count)
    return shares @ corners


@pytest.mark.parametrize("kind", NEW)
def test_shape_functions_are_one_at_their_node_and_give_back_what_they_span(kind):
    cell = KINDS[kind]
    values, _ = cell.basis(cell.nodes)
    assert np.abs(values - np.eye(cell.node_count)).max() < 1e-13
    at = inside(kind, 20)
    values, gradients = cell.basis(at)
    for powers in product(range(cell.order + 1), repeat=3):
        if sum(powers) <= cell.order:
            exact, at_nodes = (np.prod(x ** np.array(powers), axis=1) for x in (at, cell.nodes))
            assert np.abs(values @ at_nodes - exact).max() < 1e-13
    step = 1e-6
    for axis in range(3):
        shift = step * np.eye(3)[axis]
        slope = (cell.basis(at + shift)[0] - cell.basis(at - shift)[0]) / (2 * step)
        assert np.abs(slope - gradients[..., axis]).max() < 1e-8


def test_the_wedge_of_six_nodes_is_that_of_scikit_fem():
    at = inside("wedge", 10)
    values, gradients = KINDS["wedge"].basis(at)
    for node in range(6):
        value, gradient = skfem.ElementWedge1().lbasis(at.T, node)
        assert np.abs(values[:, node] - value).max() < 1e-14
        assert np.abs(gradients[:, node].T - np.array(gradient)).max() < 1e-14


def zienkiewicz(x, y, z):
    """The wedge of fifteen nodes in area coordinates and ζ from -1 to 1."""
    areas, height = np.array([1 - x - y, x, y]), 2 * z - 1
    ends = [(a * (2 * a - 1) * (1 + s * height) - a * (1 - height**2)) / 2
            for s in (-1, 1) for a in areas]  # fmt: skip
    flat = [2 * areas[i] * areas[(i + 1) % 3] * (1 + s * height) for s in (-1, 1) for i in range(3)]
    return np.array([*ends, *flat, *(a * (1 - height**2) for a in areas)]).T


def bedrosian(x, y, z):
    """The pyramid of thirteen nodes as in Bedrosian's paper of 1992."""
    signs = ((-1, -1), (1, -1), (1, 1), (-1, 1))
    corners = [(a * x + b * y - 1) * ((1 + a * x) * (1 + b * y) - z + a * b * x * y * z / (1 - z))
               / 4 for a, b in signs]  # fmt: skip
    along_x, along_y = (1 + x - z) * (1 - x - z), (1 + y - z) * (1 - y - z)
    base = [along_x * (1 - y - z), along_y * (1 + x - z), along_x * (1 + y - z),
            along_y * (1 - x - z)]  # fmt: skip
    up = [z * (1 + a * x - z) * (1 + b * y - z) / (1 - z) for a, b in signs]
    return np.array([*corners, z * (2 * z - 1), *(b / (2 * (1 - z)) for b in base), *up]).T


@pytest.mark.parametrize(("kind", "known"), [("wedge15", zienkiewicz), ("pyramid13", bedrosian)])
def test_shape_functions_are_those_of_the_literature(kind, known):
    at = inside(kind, 20)
    assert np.abs(KINDS[kind].basis(at)[0] - known(*at.T)).max() < 1e-13


@pytest.mark.parametrize("kind", NEW)
def test_neighbours_see_the_same_on_a_face(kind):
    """On each face only its own nodes count, with a triangle's or a quadrilateral's functions."""
    cell = KINDS[kind]
    for name, faces in cell.facets.items():
        facet = KINDS[name]
        at = inside(name, 10)
        for local in faces:
            own, _ = facet.basis(at)
            values, _ = cell.basis(own @ cell.nodes[local])
            assert np.abs(values[:, local] - own).max() < 1e-13
            assert np.abs(np.delete(values, local, axis=1)).max() < 1e-13


@pytest.mark.parametrize("kind", NEW)
def test_the_quadrature_is_exact_for_products_of_shape_functions(kind):
    """Against a rule of much higher order, for the reference cell and for its affine images."""
    cell = KINDS[kind]
    values, gradients = cell.basis(cell.quadrature[0])
    places, weights = cell.element.rule(16)
    finer, slopes = cell.basis(places)
    own = cell.quadrature[1]
    for f, g, h, k in ((values, finer, values, finer), (gradients, slopes, gradients, slopes)):
        products = np.einsum("q,qa...,qb...->ab...", own, f, h)
        exact = np.einsum("q,qa...,qb...->ab...", weights, g, k)
        assert np.abs(products - exact).max() < 1e-13


def sheared(corners):
    return corners @ np.array([[1.0, 0.2, 0.1], [0.3, 0.9, 0.0], [-0.1, 0.25, 1.2]])


def harmless_quadratic():
    """Coefficients (3, 3, 3) of a displacement of second degree without a force in the body."""
    nu = STEEL.poissons_ratio
    ratio = 1.0 / (1.0 - 2.0 * nu)  # (lambda + mu)/mu
    rows = np.zeros((3, 3, 3, 3))
    for k, i in product(range(3), repeat=2):
        rows[k, i, i, k] += ratio / 2.0
        rows[k, i, k, i] += ratio / 2.0
        rows[k, k, i, i] += 1.0
    asymmetric = [np.eye(27)[9 * i + 3 * j + k] - np.eye(27)[9 * i + 3 * k + j]
                  for i, j, k in product(range(3), repeat=3) if j < k]  # fmt: skip
    space = null_space(np.vstack([rows.reshape(3, 27), *asymmetric]))
    assert space.shape[1] == 15
    mixed = space @ np.random.default_rng(5).standard_normal(15)
    return mixed.reshape(3, 3, 3)


CASES = [(f, jiggled, 1) for f in FAMILIES] + [
    ("complete", jiggled, 2), ("serendipity", sheared, 2)
]  # fmt: skip


@pytest.mark.parametrize(("family", "move", "degree"), CASES)
def test_patches_of_all_shapes_pass(family, move, degree):
    """With exact displacements outside, the nodes inside find theirs.

    Quadratics on distorted cells are beyond serendipity, on sheared ones they are not.
    """
    component = body(mixed_block(family, move))
    points = component.model.mesh.points
    exact = points @ STRETCH
    if degree == 2:
        exact = exact + np.einsum("ijk,nj,nk->ni", harmless_quadratic(), points, points)
    assert patch_error(component, exact) < 1e-12


@pytest.mark.parametrize("family", FAMILIES)
def test_a_mixed_body_has_its_mass_its_energy_and_six_rigid_motions(family):
    component = body(mixed_block(family, jiggled))
    mesh = component.model.mesh
    points = mesh.points
    corners = {name: cells[:, : len(KINDS[name].corners)] for name, cells in mesh.cells.items()}
    volume = sum(signed_volume(points, KINDS[name], cells) for name, cells in corners.items())
    one = np.tile(np.eye(3)[0], len(points))
    assert one @ component.mass @ one == pytest.approx(8000.0 * volume, rel=1e-12)
    strain = np.array([[2.0, 0.5, 0.0], [0.5, -1.0, 0.3], [0.0, 0.3, 0.4]])
    first, mu = fem.SolidPart(STEEL).lame
    energy = first * np.trace(strain) ** 2 + 2 * mu * (strain**2).sum()
    u = (points @ strain).ravel()
    assert u @ component.stiffness @ u == pytest.approx(volume * energy, rel=1e-12)
    squares = np.linalg.eigvalsh(component.stiffness.toarray())
    assert (np.abs(squares[:6]) < 1e-13 * squares[-1]).all()
    assert squares[6] > 1e-6 * squares[-1]
    assert np.linalg.eigvalsh(component.mass.toarray())[0] > 0.0


def signed_volume(points, kind, cells):
    """Volume by Gauss's theorem over the faces; bilinear ones by their two triangulations' mean."""
    total = 0.0
    for face in kind.shape.faces:
        corners = points[cells[:, list(face)]]
        cuts = [(0, 1, 2)] if len(face) == 3 else [(0, 1, 2), (0, 2, 3), (0, 1, 3), (1, 2, 3)]
        share = sum(np.linalg.det(corners[:, list(cut)]) for cut in cuts) / 6.0
        share = share / (1 if len(face) == 3 else 2)
        outward = corners.mean(axis=1) - points[cells].mean(axis=1)
        normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        total += (np.sign((outward * normal).sum(axis=1)) * share).sum()
    return total


@pytest.mark.parametrize("kind", ["wedge15", "wedge18", "pyramid13", "pyramid14"])
def test_a_rod_rings_as_the_wave_equation_says(kind):
    """Axial frequencies (2 n - 1) c/(4 L) without contraction.

    To leading order quadratics of length h are too high by less than (k h)⁴/1440.
    """
    mesh = fem.box_mesh("rod", (1.0, 0.1, 0.1), (6, 1, 1), kind=kind)
    held = [fem.Support("x0", ("x", "y", "z")), fem.Support("y0", "y"), fem.Support("z0", "z")]
    hz = lowest_hz(body(mesh, STRAIGHT, supports=held), 12)
    speed = np.sqrt(STRAIGHT.youngs_modulus / STRAIGHT.density)
    for n in (1, 2):
        exact = (2 * n - 1) * speed / 4.0
        excess = hz[np.argmin(np.abs(hz - exact))] / exact - 1.0
        assert 0.0 < excess < ((2 * n - 1) * np.pi / 2 / 6) ** 4 / 1440


@pytest.fixture(scope="module")
def converged_bar():
    mesh = fem.box_mesh("bar", LENGTHS, (20, 4, 4), kind="hexahedron27")
    return lowest_hz(body(mesh, supports=[fem.Support("x0", CLAMP)]), 4)


LENGTHS = (1.0, 0.12, 0.1)


@pytest.mark.parametrize("kind", ["wedge15", "wedge18", "pyramid13", "pyramid14"])
def test_a_cantilever_bends_as_one_of_many_hexahedra(kind, converged_bar):
    mesh = fem.box_mesh("bar", LENGTHS, (16, 2, 2), kind=kind)
    excess = lowest_hz(body(mesh, supports=[fem.Support("x0", CLAMP)]), 4) / converged_bar - 1.0
    assert (excess > 0.0).all() and excess.max() < 0.003


@pytest.mark.parametrize("family", FAMILIES)
def test_a_surface_of_all_shapes_is_closed_and_drawn(family):
    component = body(mixed_block(family))
    facets = component.model.facets
    area = sum(facet_products(kind, component.model.mesh.points[nodes]).sum()
               for kind, nodes in facets.items())  # fmt: skip
    assert area == pytest.approx(2 * (2 * 2 + 2 * 2 + 2 * 2), rel=1e-12)
    surface = structure_surface(component)
    moved, size = surface.place(np.zeros(len(component.free)))
    assert np.ptp(moved, axis=0) == pytest.approx([2.0, 2.0, 2.0]) and not size.any()
    u = (component.model.mesh.points * [1e-3, 0, 0]).ravel()
    _, mu = fem.SolidPart(STEEL).lame
    assert von_mises(component, u) == pytest.approx(2e-3 * mu, rel=1e-10)
