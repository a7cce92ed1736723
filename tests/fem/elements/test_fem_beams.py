"""Single beams against closed forms (R.D. Blevins, Formulas for Natural Frequency, chapter 8)."""

import numpy as np
import pytest
import scipy.linalg
from frames import BAR, CLAMP, EA, EI, RHO_A, beam, bending_hz, frequencies_hz
from numpy import cos, cosh, pi, sin, sinh, tan, tanh
from scipy.optimize import brentq
from scipy.sparse.linalg import spsolve

import fem

CLAMPED_LEFT = [fem.Support("left", CLAMP)]
PINNED = [fem.Support("left", ("x", "y")), fem.Support("right", ("x", "y"))]


def roots(equation, brackets):
    return np.array([brentq(equation, *bracket, xtol=1e-14, rtol=1e-15) for bracket in brackets])


CANTILEVER = roots(lambda x: cos(x) + 1 / cosh(x), [(1, 3), (4, 5), (7, 8)])
FREE_FREE = roots(lambda x: cos(x) - 1 / cosh(x), [(4, 5), (7, 8), (10, 11.5)])
CLAMPED_PINNED = roots(lambda x: tan(x) - tanh(x), [(3.5, 4.5), (6.7, 7.5), (9.9, 10.5)])
PINNED_PINNED = pi * np.arange(1, 4)


def hermite_error(root, elements):
    """Relative error of a frequency on elements of length h: (k h)⁴/1440 + higher orders.

    Half of that of its square, which Strang and Fix (An Analysis of the Finite Element Method,
    1973, section 6.3) bound by C h⁴; the constant 1/720 is that of the pinned-pinned beam.
    """
    return (root / elements) ** 4 / 1440


def error(computed_hz, root, elements):
    return (computed_hz / bending_hz(root) - 1) / hermite_error(root, elements)


def assert_above_by_the_error_of_its_elements(found_hz, roots, elements, rounding=1e-9):
    """Each frequency comes from above, and by no more than 1.1 times its own error."""
    excess = found_hz / bending_hz(roots) - 1
    assert (excess > -rounding).all()
    assert (excess < 1.1 * hermite_error(roots, elements) + rounding).all()


@pytest.mark.parametrize(
    ("supports", "roots"),
    [
        (CLAMPED_LEFT, CANTILEVER),
        (PINNED, PINNED_PINNED),
        ([*CLAMPED_LEFT, fem.Support("right", ("x", "y"))], CLAMPED_PINNED),
    ],
    ids=["cantilever", "pinned", "clamped and pinned"],
)
def test_beam_has_the_frequencies_of_its_closed_form(supports, roots):
    found = frequencies_hz(fem.assemble(beam(elements=32, supports=supports)), 3)
    assert_above_by_the_error_of_its_elements(found, roots, 32)


def test_free_beam_has_three_rigid_body_modes_and_then_its_bending_modes():
    component = fem.assemble(beam(elements=32))
    squares = scipy.linalg.eigh(
        component.stiffness.toarray(), component.mass.toarray(), eigvals_only=True
    )
    found = np.sqrt(squares[3:6]) / (2 * pi)
    assert_above_by_the_error_of_its_elements(found, FREE_FREE, 32, rounding=2e-8)
    assert np.abs(squares[:3]).max() < 1e-13 * squares[-1]


def test_free_beam_resists_no_rigid_motion_and_has_its_true_mass_and_inertia():
    component = fem.assemble(beam(length=2.0, elements=5))
    x = component.model.mesh.points[:, 0]
    one, zero = np.ones_like(x), np.zeros_like(x)
    rigid = np.stack(
        [
            np.stack(m, axis=1).ravel()
            for m in ((one, zero, zero), (zero, one, zero), (zero, x, one))
        ],
        axis=1,
    )
    assert np.abs(component.stiffness @ rigid).max() < 1e-14 * component.stiffness.max()
    mass = RHO_A * 2.0
    expected = [[mass, 0, 0], [0, mass, mass * 1.0], [0, mass * 1.0, mass * 4.0 / 3.0]]
    assert rigid.T @ (component.mass @ rigid) == pytest.approx(np.array(expected), abs=1e-13 * mass)


def test_rod_stretches_with_the_frequencies_of_a_clamped_rod():
    supports = [*CLAMPED_LEFT, fem.Support("right", ("y", "rotation"))]
    elements = 40
    found = frequencies_hz(fem.assemble(beam(elements=elements, supports=supports)))
    exact = np.sqrt(EA / RHO_A) / 4.0
    # two-node rod: omega² is too large by (q h)²/12
    expected = exact * (1 + (pi / 2 / elements) ** 2 / 24)
    nearest = found[np.argmin(abs(found - exact))]
    assert nearest == pytest.approx(expected, rel=(pi / 2 / elements) ** 4)


def test_error_of_pinned_beam_falls_with_the_fourth_power_and_the_known_constant():
    counts = np.array([4, 8, 16, 32])
    errors = [
        error(frequencies_hz(fem.assemble(beam(elements=n, supports=PINNED)), 1)[0], pi, n)
        for n in counts
    ]
    assert errors == pytest.approx(np.ones(4), rel=1e-3, abs=4e-2)
    assert abs(errors[2] - 1) < 3e-3


@pytest.mark.parametrize(
    ("supports", "root"),
    [
        (CLAMPED_LEFT, CANTILEVER[1]),
        ([*CLAMPED_LEFT, fem.Support("right", "y")], CLAMPED_PINNED[0]),
    ],
)
def test_order_of_convergence_is_four(supports, root):
    counts = np.array([8, 16, 32])
    errors = [
        abs(
            min(
                frequencies_hz(fem.assemble(beam(elements=n, supports=supports)), 4)
                / bending_hz(root)
                - 1,
                key=abs,
            )
        )
        for n in counts
    ]
    orders = np.diff(np.log(errors)) / -np.log(2)
    assert orders == pytest.approx([4, 4], abs=0.05)


@pytest.mark.parametrize("elements", [1, 2, 7])
@pytest.mark.parametrize("angle", [0.0, 0.7, pi / 2, -2.5])
def test_static_deflection_of_cantilever_is_exact_on_any_mesh(elements, angle):
    length = 1.3
    model = beam(
        length,
        elements,
        angle,
        supports=CLAMPED_LEFT,
        interfaces={name: fem.Interface("right", name) for name in CLAMP},
    )
    component = fem.assemble(model)
    across, along = np.array([-sin(angle), cos(angle)]), np.array([cos(angle), sin(angle)])
    for direction, deflection, rotation in (
        (across, length**3 / (3 * EI), length**2 / (2 * EI)),
        (along, length / EA, 0.0),
    ):
        load = sum(
            f * component.interfaces[name] for f, name in zip(direction, ("x", "y"), strict=True)
        )
        tip = component.shape(spsolve(component.stiffness, load))[model.mesh.node("right")]
        assert tip[:2] == pytest.approx(deflection * direction, abs=1e-11 * length**3 / EI)
        assert tip[5] == pytest.approx(rotation, abs=1e-11 * length**2 / EI)


def end_lump_root(mass, inertia, spring, turning_spring, bracket):
    """Root kL of a cantilever of length 1 with lumps at its tip.

    w = a (cos kx - cosh kx) + b (sin kx - sinh kx);
    EI w'' = (omega² inertia - turning spring) w', EI w''' = (spring - omega² mass) w at the tip.
    """

    def determinant(k):
        square = EI / RHO_A * k**4
        functions = (
            (cos(k) - cosh(k), sin(k) - sinh(k)),
            (k * (-sin(k) - sinh(k)), k * (cos(k) - cosh(k))),
            (k**2 * (-cos(k) - cosh(k)), k**2 * (-sin(k) - sinh(k))),
            (k**3 * (sin(k) - sinh(k)), k**3 * (-cos(k) - cosh(k))),
        )
        w, slope, curvature, shear = (np.array(f) for f in functions)
        moment = EI * curvature - (square * inertia - turning_spring) * slope
        force = EI * shear - (spring - square * mass) * w
        return (moment[0] * force[1] - moment[1] * force[0]) / (EI**2 * cosh(k))

    return brentq(determinant, *bracket, xtol=1e-13, rtol=1e-14)


@pytest.mark.parametrize(
    ("mass", "inertia", "spring", "turning_spring", "bracket"),
    [
        (0.0, 0.0, 0.0, 0.0, (1.5, 2.5)),
        (2.0 * RHO_A, 0.0, 0.0, 0.0, (0.5, 1.8)),
        (0.0, 0.5 * RHO_A, 0.0, 0.0, (0.5, 1.8)),
        (0.7 * RHO_A, 0.1 * RHO_A, 0.0, 0.0, (0.8, 1.8)),
        (0.0, 0.0, 20.0 * EI, 0.0, (2.0, 3.6)),
        (0.0, 0.0, 0.0, 5.0 * EI, (1.9, 3.0)),
        (0.3 * RHO_A, 0.02 * RHO_A, 4.0 * EI, 1.5 * EI, (1.0, 3.0)),
    ],
)
def test_cantilever_with_masses_and_springs_at_its_tip(
    mass, inertia, spring, turning_spring, bracket
):
    root = end_lump_root(mass, inertia, spring, turning_spring, bracket)
    lumps = [fem.PointMass("right", mass, inertia)] if mass or inertia else []
    springs = [fem.PointSpring("right", "y", spring)] if spring else []
    springs += [fem.PointSpring("right", "rotation", turning_spring)] if turning_spring else []
    model = beam(elements=24, supports=CLAMPED_LEFT, point_masses=lumps, springs=springs)
    found = frequencies_hz(fem.assemble(model), 1)[0]
    assert found == pytest.approx(bending_hz(root), rel=5 * hermite_error(root, 24))


def test_pinned_beam_with_a_turning_spring_at_one_end():
    stiffness = 3.0 * EI
    root = brentq(lambda x: 1 / tan(x) - 1 / tanh(x) - 2 * x * EI / stiffness, pi + 0.01, 3.92)
    springs = [fem.PointSpring("left", "rotation", stiffness)]
    found = frequencies_hz(fem.assemble(beam(elements=24, supports=PINNED, springs=springs)), 1)[0]
    assert found == pytest.approx(bending_hz(root), rel=2 * hermite_error(root, 24))


def test_mass_and_spring_along_the_axis():
    # stiff short rod on a soft spring: a single oscillator to first order in stiffness ratio
    spring, lump = 100.0, 3.0
    model = beam(
        length=0.1,
        elements=2,
        supports=[fem.Support("left", ("y", "rotation")), fem.Support("right", ("y", "rotation"))],
        springs=[fem.PointSpring("left", "x", spring)],
        point_masses=[fem.PointMass("right", lump)],
    )
    expected = np.sqrt(spring / (lump + 0.1 * RHO_A)) / (2 * pi)
    found = frequencies_hz(fem.assemble(model), 1)[0]
    assert found == pytest.approx(expected, rel=spring * 0.1 / EA)


def hinged_cantilevers(part_at_hinge, elements=24):
    mesh = fem.frame_mesh(
        {"a": (0, 0), "joint": (1, 0), "b": (2, 0)},
        [("first", "a", "joint", elements), ("second", "joint", "b", elements)],
    )
    return fem.StructureModel(
        mesh,
        {"first": BAR, "second": BAR},
        supports=[fem.Support("a", CLAMP), fem.Support("b", CLAMP)],
        hinges=[fem.Hinge("joint", part_at_hinge)],
        plane=True,
    )


@pytest.mark.parametrize("part", ["first", "second"])
def test_two_cantilevers_joined_by_a_hinge(part):
    """Symmetric modes are those of a cantilever, antisymmetric ones clamped-pinned."""
    found = frequencies_hz(fem.assemble(hinged_cantilevers(part)), 4)
    exact = [CANTILEVER[0], CLAMPED_PINNED[0], CANTILEVER[1], CLAMPED_PINNED[1]]
    expected = bending_hz(np.array(exact))
    assert found == pytest.approx(expected, rel=1.1 * hermite_error(CLAMPED_PINNED[1], 24))


def test_shape_of_elements_shows_the_kink_of_a_hinge():
    model = hinged_cantilevers("second", elements=3)
    component = fem.assemble(model)
    node = model.mesh.node("joint")
    load = (component.free == component.numbering.dofs(np.array([node]))[0, 1]).astype(float)
    u = spsolve(component.stiffness, load)
    at_joint = np.concatenate([
        component.element_shape(u, name)[lines == node] for name, (_, lines) in model.beams.items()
    ])  # fmt: skip
    # each half carries half the load as a cantilever of length 1
    assert at_joint[:, 1] == pytest.approx(np.full(2, 0.5 / (3 * EI)), rel=1e-11)
    assert np.sort(at_joint[:, 5]) == pytest.approx(np.array([-0.25, 0.25]) / EI, rel=1e-11)
    assert component.shape(u)[node, 5] == pytest.approx(0.25 / EI, rel=1e-11)


def test_a_hinge_without_anything_behind_it_is_a_mechanism_that_assembles():
    mesh = fem.frame_mesh(
        {"a": (0, 0), "joint": (1, 0), "b": (2, 0)},
        [("first", "a", "joint", 4), ("second", "joint", "b", 4)],
    )
    model = fem.StructureModel(
        mesh,
        {"first": BAR, "second": BAR},
        supports=[fem.Support("a", CLAMP)],
        hinges=[fem.Hinge("joint", "second")],
        plane=True,
    )
    component = fem.assemble(model)
    squares = scipy.linalg.eigh(
        component.stiffness.toarray(), component.mass.toarray(), eigvals_only=True
    )
    assert abs(squares[0]) < 1e-13 * squares[-1] < squares[1] * 1e-3
