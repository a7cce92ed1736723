"""Tapered beams: Kirchhoff's wedge, integrals of statics, one part against many."""

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import brentq
from scipy.sparse.linalg import spsolve
from scipy.special import iv, jv, kv, yv
from structures import CLAMP, flexibility, lowest_hz

import fem
from fem.render.colouring import surface_values
from fem.render.structure_surface import structure_surface

E, RHO, NU = 2.0e11, 8000.0, 0.3
STEEL = fem.Material(E, RHO, NU)
WEDGE = fem.TaperedSection(
    fem.RectangularSection(0.03, 0.04), fem.RectangularSection(0.03, 0.02), "root", "tip"
)
BOTH = fem.TaperedSection(
    fem.RectangularSection(0.03, 0.04), fem.RectangularSection(0.05, 0.02), "root", "tip"
)
TUBE = fem.TaperedSection(
    fem.CircularSection(0.04, 0.02), fem.CircularSection(0.03, 0.018), "root", "tip"
)


def mesh(elements, end=(1.0, 0.0, 0.0)):
    return fem.frame_mesh({"root": (0, 0, 0), "tip": end}, [("arm", "root", "tip", elements)])


def in_plane(section, elements, **options):
    return fem.assemble(
        fem.StructureModel(
            mesh(elements),
            {"arm": fem.BeamPart(STEEL, section, **options)},
            supports=[fem.Support("root", ("x", "y", "rotation"))],
            interfaces={d: fem.Interface("tip", d) for d in ("x", "y", "rotation")},
            plane=True,
        )
    )


def in_space(section, elements, end=(1.0, 0.0, 0.0), **options):
    return fem.assemble(
        fem.StructureModel(
            mesh(elements, end),
            {"arm": fem.BeamPart(STEEL, section, **options)},
            supports=[fem.Support("root", CLAMP)],
            interfaces={d: fem.Interface("tip", d) for d in ("x", "y", "z", "rotation_x")},
        )
    )


def truncated_wedge(ratio, count):
    """Omega of a wedge of length 1 whose height falls from 1 to `ratio`, for sqrt(12 rho/E) = 1.

    With x from the apex the height is x and the length 1 - ratio; Kirchhoff's solution is
    x^(-1/2) Z1(2 sqrt(p x)) with Z out of J, Y, I and K.
    """
    rises = ((jv, 1, 1), (yv, 1, 1), (iv, 1, 1), (kv, 1, -1))

    def determinant(p):
        def z(order, x):
            return np.array([f(order, 2 * np.sqrt(p * x)) for f, _, _ in rises])

        falls = np.array([-1, -1, 1, -1])
        moment = np.array([1, 1, 1, 1])
        shear = moment * np.array([1, 1, 1, -1])
        rows = [z(1, 1.0), falls * z(2, 1.0), moment * z(3, ratio), shear * z(2, ratio)]
        rows = np.array(rows)
        return np.linalg.det(rows / np.abs(rows).max(axis=0))

    grid = np.linspace(1.0, 400.0, 8000)
    values = [determinant(p) for p in grid]
    found = [
        brentq(determinant, a, b)
        for a, b, u, v in zip(grid, grid[1:], values, values[1:], strict=False)
        if u * v < 0
    ]
    # p belongs to the length 1 - ratio; heights scale with it
    return np.array(found[:count]) * (1 - ratio)


def wedge_hz(count):
    """The wedge from 0.04 m to 0.02 m over 1 m: height 0.04 x/(1 m) with x from 2 m to 1 m."""
    # height = c X with c = 0.02, X from 1 to 2; p = omega sqrt(12 rho / (E c²)) in 1/m,
    # in x = X/2 it is twice that
    p = truncated_wedge(0.5, count) / 0.5
    return p / 2 * np.sqrt(E * 0.02**2 / (12 * RHO)) / (2 * np.pi)


def bending_only(n):
    frame = mesh(n)
    frame = fem.StructureMesh(
        frame.points,
        frame.cells,
        frame.groups,
        {**frame.point_sets, "all": np.arange(len(frame.points))},
    )
    return fem.StructureModel(
        frame,
        {"arm": fem.BeamPart(STEEL, WEDGE)},
        supports=[fem.Support("root", ("y", "rotation")), fem.Support("all", "x")],
        plane=True,
    )


def test_the_closed_form_of_the_wedge_has_the_published_limit():
    """A sharp wedge: 5.315, 15.21, 30.02 times sqrt(E I/(rho A))/L² (Kirchhoff, 1879; Blevins)."""
    sharp = truncated_wedge(1e-6, 3)
    np.testing.assert_allclose(sharp, [5.315, 15.21, 30.02], rtol=1e-3)


def test_a_truncated_wedge_has_the_frequencies_of_bessel_functions():
    wanted = wedge_hz(3)
    errors = [lowest_hz(fem.assemble(bending_only(n)), 3) / wanted - 1 for n in (8, 16)]
    assert (errors[1] > 0).all() and (errors[0] < [5e-6, 1e-4, 7e-4]).all()
    np.testing.assert_allclose(np.log2(errors[0] / errors[1]), 4.0, atol=0.3)


def integral(function):
    return quad(function, 0.0, 1.0, epsabs=0, epsrel=1e-12)[0]


@pytest.mark.parametrize("theory", ["euler-bernoulli", "timoshenko"])
@pytest.mark.parametrize("section", [BOTH, TUBE], ids=["rectangle", "tube"])
def test_statics_are_those_of_the_integrals(section, theory):
    component = in_space(section, 16, theory=theory)
    G = E / (2 * (1 + NU))

    def bent(name, which):
        flexible = integral(lambda x: (1 - x) ** 2 / (E * getattr(section.at(x), name)))
        if theory == "timoshenko":
            flexible += integral(lambda x: 1 / (G * section.at(x).shear_areas(NU)[which]))
        return flexible

    found = {d: flexibility(component, d) for d in ("x", "y", "z", "rotation_x")}
    assert found["y"] == pytest.approx(bent("second_moment", 0), rel=1e-4)
    assert found["z"] == pytest.approx(bent("second_moment_across", 1), rel=1e-4)
    stretched = integral(lambda x: 1 / (E * section.at(x).area))
    assert found["x"] == pytest.approx(stretched, rel=1e-3)
    twisted = integral(lambda x: 1 / (G * section.at(x).torsion_constant))
    assert found["rotation_x"] == pytest.approx(twisted, rel=2e-3)


def test_the_mass_and_its_centre_are_exact():
    component = in_space(BOTH, 2)
    free = fem.assemble(fem.StructureModel(mesh(2), {"arm": fem.BeamPart(STEEL, BOTH)}))
    assert component.mass.shape[0] == free.mass.shape[0] - 6
    dofs = free.numbering.dofs(np.arange(3))
    along, across = np.zeros((2, len(free.free)))
    along[dofs[:, 1]] = 1.0
    across[dofs[:, 1]], across[dofs[:, 5]] = free.model.mesh.points[:, 0], 1.0
    mass = RHO * integral(lambda x: BOTH.at(x).area)
    moment = RHO * integral(lambda x: x * BOTH.at(x).area)
    assert along @ free.mass @ along == pytest.approx(mass, rel=1e-13)
    assert along @ free.mass @ across == pytest.approx(moment, rel=1e-13)


@pytest.mark.parametrize("theory", ["euler-bernoulli", "timoshenko"])
def test_one_tapered_part_is_the_limit_of_many_steps(theory):
    """Steps with the section of their middle converge to it with the second power."""
    fine = lowest_hz(in_space(BOTH, 12, theory=theory), 6)
    errors = []
    for steps in (12, 24):
        points = {"root": (0, 0, 0)} | {f"p{i}": (i / steps, 0, 0) for i in range(1, steps + 1)}
        names = list(points)
        members = [(f"s{i}", names[i], names[i + 1], 1) for i in range(steps)]
        parts = {
            f"s{i}": fem.BeamPart(STEEL, BOTH.at((i + 0.5) / steps), theory=theory)
            for i in range(steps)
        }
        model = fem.StructureModel(
            fem.frame_mesh(points, members), parts, supports=[fem.Support("root", CLAMP)]
        )
        errors.append(lowest_hz(fem.assemble(model), 4) / fine[:4] - 1)
    assert np.abs(errors[1]).max() < 2e-3
    assert (np.abs(errors[1]) < 0.35 * np.abs(errors[0])).all()


def test_a_taper_without_change_is_none():
    same = fem.RectangularSection(0.03, 0.04)
    taper = fem.TaperedSection(same, same, "root", "tip")
    for theory, force in (("euler-bernoulli", 0.0), ("timoshenko", 1e4)):
        options = {"theory": theory, "axial_force": force}
        for build in (in_plane, in_space):
            one, other = (build(section, 3, **options) for section in (same, taper))
            for matrix in ("stiffness", "mass"):
                wanted = getattr(one, matrix).toarray()
                found = getattr(other, matrix).toarray()
                np.testing.assert_allclose(found, wanted, atol=1e-12 * np.abs(wanted).max())


@pytest.mark.parametrize("build", [in_plane, in_space])
@pytest.mark.parametrize("section", [BOTH, TUBE], ids=["rectangle", "tube"])
def test_the_natural_form_is_the_stiffness(build, section):
    component = build(section, 3, theory="timoshenko", axial_force=1e5)
    form, K = component.natural_form, component.stiffness.toarray()
    A, d = form.deformations, form.stiffness
    found = A.T @ (d[:, None] * (A @ np.eye(len(K))))
    scale = np.sqrt(np.outer(np.diag(K), np.diag(K)))
    assert (np.abs(found - K) / scale).max() < 1e-12


def test_a_taper_follows_the_way_between_its_points_whichever_way_the_lines_run():
    turned = fem.TaperedSection(WEDGE.end, WEDGE.start, "tip", "root")
    one, other = (in_space(section, 4) for section in (WEDGE, turned))
    np.testing.assert_allclose(
        other.stiffness.toarray(), one.stiffness.toarray(), rtol=1e-12, atol=1e-3
    )


def test_a_round_taper_stands_upright_without_an_orientation():
    assert in_space(TUBE, 2, end=(0, 0, 1.0)).stiffness.shape == (12, 12)


@pytest.mark.parametrize(
    ("make", "sentence"),
    [
        (
            lambda: fem.TaperedSection(WEDGE.start, TUBE.start, "a", "b"),
            "tapered section: start and end must be two RectangularSection or two Circular",
        ),
        (lambda: fem.TaperedSection(TUBE.start, TUBE.end, "a", "a"), "it starts and ends at 'a'"),
        (
            lambda: in_plane(fem.TaperedSection(TUBE.start, TUBE.end, "root", "top"), 2),
            "there is no point or face 'top'",
        ),
        (
            lambda: fem.assemble(
                fem.StructureModel(
                    fem.frame_mesh(
                        {"root": (0, 0), "tip": (1, 0), "more": (2, 0)},
                        [("arm", "root", "tip", 1), ("arm", "tip", "more", 1)],
                    ),
                    {"arm": fem.BeamPart(STEEL, WEDGE)},
                    plane=True,
                )
            ),
            "part 'arm': node 2 lies beyond the way from 'root' to 'tip'",
        ),
    ],
)
def test_a_bad_taper_is_one_sentence(make, sentence):
    with pytest.raises(fem.ModelError, match=sentence) as caught:
        make()
    assert "\n" not in str(caught.value)


def test_a_saved_taper_is_the_same(tmp_path):
    for build in (in_plane, in_space):
        component = build(TUBE, 2)
        component.save(tmp_path / "arm.npz")
        assert fem.Component.load(tmp_path / "arm.npz").model.parts == component.model.parts


@pytest.mark.parametrize("build", [in_plane, in_space])
def test_a_taper_is_drawn_and_coloured_as_it_is(build):
    component = build(WEDGE, 8)
    drawing = structure_surface(component)
    points, _ = drawing.place(np.zeros(len(component.free)))
    height = 0.04 - 0.02 * points[:, 0]
    np.testing.assert_allclose(np.abs(points[:, 1]), height / 2, atol=1e-12)
    u = spsolve(component.stiffness.tocsc(), 100.0 * component.interfaces["y"])
    found = surface_values(drawing, u, "stress")
    wanted = 100.0 * (1 - points[:, 0]) * 6 / (0.03 * height**2)
    assert np.abs(found - wanted).max() < 0.01 * wanted.max()
