"""Matrices of other codes: few digits, massless directions, mixed units."""

import re

import numpy as np
import pytest
from scipy import linalg, sparse
from superelements import exact_hz, free_beam, joined, rounded, superelement

import cms
from cms.reduction.coupling import check_coupled

METHODS = ("rubin", "craig-bampton", "macneal", "truncation")


def ends(K, M, **other):
    """The component with both ends, displacement and turn, as interfaces."""
    unit = np.eye(K.shape[0])
    named = {"left": unit[0], "left turn": unit[1], "right": unit[-2], "right turn": unit[-1]}
    return cms.Matrices(K, M, named, **other)


@pytest.mark.parametrize("method", ["rubin", "craig-bampton"])
@pytest.mark.parametrize(
    ("elements", "digits"), [(3, 17), (3, 7), (10, 14), (40, 9), (100, 16), (100, 12), (100, 7)]
)
def test_free_beam_of_few_digits(elements, digits, method):
    """Rigid-body modes are zero, elastic ones those of the rounded matrices."""
    K, M = (rounded(A, digits) for A in free_beam(elements))
    tip = cms.Matrices(K, M, {"tip": np.eye(K.shape[0])[0]})
    modes = 4 if method == "rubin" else K.shape[0] - 1
    found = cms.reduce(tip, modes=modes, method=method)
    exact = linalg.eigh(K, M, eigvals_only=True, subset_by_index=[2, 3])
    assert found.rigid_body_modes == 2
    floor = 1e-13 * elements**4  # of the direct solution in double precision
    np.testing.assert_allclose(
        found.frequencies_hz[2:4], np.sqrt(exact) / (2 * np.pi), rtol=max(1e-9, floor)
    )


def test_the_bound_of_rigid_modes_is_told_and_kept():
    K, M = (rounded(A, 7) for A in free_beam(100))
    said = []
    found = cms.reduce(cms.Matrices(K, M, {"tip": np.eye(202)[0]}), modes=4, progress=said.append)
    lowest = linalg.eigh(K, M, eigvals_only=True, subset_by_index=[0, 1])
    assert np.sqrt(np.abs(lowest).max()) / (2 * np.pi) < found.rigid_bound_hz < 300.0
    assert any("2 rigid-body modes: zero within the 7 digits" in text for text in said)


def test_digits_that_leave_the_modes_open_are_refused():
    K, M = (rounded(A, 6) for A in free_beam(200))
    with pytest.raises(cms.ReductionError, match="the 6 digits of the stiffness leave open which"):
        cms.reduce(cms.Matrices(K, M, {"tip": np.eye(402)[0]}), modes=4)


def test_an_unstable_structure_of_few_digits_is_told_as_such():
    K, M = free_beam(10)
    K[0, 0] -= 1e5
    K, M = rounded(K, 7), rounded(M, 7)
    with pytest.raises(cms.ReductionError, match="beyond its buckling load"):
        cms.reduce(ends(K, M), modes=4)


def test_a_softly_held_beam_of_exact_entries_is_held():
    """The spring is far below what 7 digits would leave; entries of double precision have it."""
    K, M = free_beam(10)
    K[0, 0] += 100.0
    K[-2, -2] += 100.0
    found = cms.reduce(ends(K, M), modes=4)
    assert found.rigid_body_modes == 0
    np.testing.assert_allclose(found.frequencies_hz[:4], exact_hz(K, M, 4), rtol=1e-6)


def test_stated_digits_hold_in_other_units():
    """Converted to other units the entries look like those of double precision."""
    K, M = (rounded(A, 8) for A in free_beam(8))
    inch = np.tile([1.0, 0.0254], 9) / 0.3048
    K, M = K * np.outer(inch, inch), M * np.outer(inch, inch)
    found = cms.reduce(ends(K, M, digits=8), modes=4)
    assert found.rigid_body_modes == 2
    np.testing.assert_allclose(found.frequencies_hz[2:4], exact_hz(K, M, 4)[2:], rtol=1e-8)
    with pytest.raises(cms.ReductionError, match="digits = 2 must be a whole number from 3 to 17"):
        cms.reduce(ends(K, M, digits=2), modes=4)


@pytest.mark.parametrize(("units", "noise"), [(1.0, 0.0), (1.0, 1e-11), (1e12, 1e-12)])
def test_superelement_whose_mass_is_semidefinite_but_for_rounding(noise, units):
    K, M, _ = superelement(kept=9, heavy=14, noise=noise, units=units)
    exact = exact_hz(K, M, 8)
    for method in METHODS:
        model = cms.reduce(ends(K, M), cutoff_hz=1e9, method=method)
        found = np.sort(model.frequencies_hz)
        assert model.rigid_body_modes == 2
        assert np.count_nonzero(model.frequencies_hz < 1e12) == model.size
        np.testing.assert_allclose(found[2:8], exact[2:], rtol=1e-8)


@pytest.mark.parametrize(
    ("noise", "methods"),
    [(0.0, ("craig-bampton", "rubin")), (6e-12, ("craig-bampton", "craig-bampton"))],
)
def test_coupled_superelements_are_those_of_the_joined_matrices(noise, methods):
    parts = [superelement(kept=9, heavy=14, noise=noise, seed=seed)[:2] for seed in (1, 8)]
    K, M = (joined(a, b, [16, 17], [0, 1]) for a, b in zip(*parts, strict=True))
    models = [
        cms.reduce(ends(*part), cutoff_hz=1e12, method=method)
        for part, method in zip(parts, methods, strict=True)
    ]
    joints = [cms.Joint(("a", f"right{x}"), ("b", f"left{x}")) for x in ("", " turn")]
    whole = cms.couple(dict(zip("ab", models, strict=True)), joints)
    assert whole.rigid_body_modes == 2
    np.testing.assert_allclose(whole.frequencies_hz[2:6], exact_hz(K, M, 6)[2:], rtol=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("units", [1.0, 1e12])
@pytest.mark.parametrize("seed", range(3))
def test_superelements_of_46_degrees_of_freedom(seed, units):
    K, M, _ = superelement(seed=seed, units=units, noise=2e-11)
    exact = exact_hz(K, M, 8)
    for method in METHODS:
        model = cms.reduce(ends(K, M), cutoff_hz=1e9, method=method)
        assert model.rigid_body_modes == 2
        np.testing.assert_allclose(np.sort(model.frequencies_hz)[2:8], exact[2:], rtol=1e-8)


def spring_network(nodes, massless, seed):
    """K and M of a floating body of springs between random points, the last of which have no mass.

    With them are the w^2 and modes of the points that have it, by static condensation.
    """
    chance = np.random.default_rng(seed)
    points = chance.uniform(0.0, 1.0, (nodes, 3))
    K = np.zeros((3 * nodes, 3 * nodes))
    for i in range(nodes):
        for j in range(i):
            along = (points[i] - points[j]) / np.linalg.norm(points[i] - points[j])
            pull = np.zeros((nodes, 3))
            pull[i], pull[j] = along, -along
            K += chance.uniform(1e4, 1e5) * np.outer(pull, pull)
    masses = chance.uniform(0.5, 2.0, nodes)
    masses[nodes - massless :] = 0.0
    heavy = 3 * (nodes - massless)
    follow = -linalg.solve(K[heavy:, heavy:], K[heavy:, :heavy])
    expand = np.vstack([np.eye(heavy), follow])
    M = np.diag(np.repeat(masses, 3))
    squares, modes = linalg.eigh(expand.T @ K @ expand, M[:heavy, :heavy])
    return K, M, squares, expand @ modes


@pytest.mark.parametrize(("noise", "first"), [(1e-17, 0), (1e-14, 21), (1e-11, 0), (1e-11, 21)])
def test_noise_on_the_diagonal_of_massless_rows_is_no_mass(noise, first):
    K, M, squares, _ = spring_network(8, 3, seed=1)
    error = np.random.default_rng(3).standard_normal(M.shape)
    noisy = M + noise * (error + error.T)
    assert np.diag(noisy).min() < 0.0
    named = {axis: np.eye(24)[first + i] for i, axis in enumerate("xyz")}
    found = cms.reduce(cms.Matrices(K, noisy, named), modes=10)
    assert found.rigid_body_modes == 6
    exact = np.sqrt(squares[6:10]) / (2 * np.pi)
    np.testing.assert_allclose(found.frequencies_hz[6:10], exact, rtol=max(1e-12, 10 * noise))


def test_a_negative_mass_beyond_noise_is_refused():
    K, M, _, _ = spring_network(8, 3, seed=1)
    M[16, 16] = -1e-8
    with pytest.raises(cms.ReductionError, match="its diagonal has -1e-08 in row 16"):
        cms.reduce(cms.Matrices(K, M, {"x": np.eye(24)[0]}), modes=4)


def skew_network(seed, digits, first):
    """A network whose massless directions are skew to its coordinates: K, M, w^2 and modes.

    With them the same with few digits, with the three directions of a point as interfaces.
    """
    K, M, squares, modes = spring_network(10, 4, seed)
    chance = np.random.default_rng(seed + 100)
    mixed = np.triu(chance.standard_normal(K.shape), 1) * (chance.uniform(size=K.shape) < 0.15)
    T = np.eye(30) + 0.3 * mixed
    K, M = ((A + A.T) / 2 for A in (T.T @ K @ T, T.T @ M @ T))
    named = {axis: T[first + i] for i, axis in enumerate("xyz")}
    few = cms.Matrices(rounded(K, digits), rounded(M, digits), named)
    return K, M, squares, linalg.solve(T, modes), few


@pytest.mark.parametrize(
    ("seed", "digits", "first"),
    [(1, 7, 0), (1, 12, 27), (2, 7, 27), (2, 8, 0), (3, 8, 27), (3, 6, 27), (4, 6, 27)],
)
def test_skew_massless_directions_of_few_digits(seed, digits, first):
    """The w^2 lie within the change that rounding of all entries may cause, in the first order."""
    K, M, squares, modes, few = skew_network(seed, digits, first)
    found = cms.reduce(few, modes=10)
    assert found.rigid_body_modes == 6
    shapes = np.abs(modes[:, 6:10])
    sizes = [np.sum(shapes * (np.abs(A) @ shapes), axis=0) for A in (K, M)]
    change = 0.5 * 10.0 ** (1 - digits) * (sizes[0] + squares[6:10] * sizes[1])
    assert np.all(change < 10.0 ** (3 - digits) * squares[6:10])
    moved = (2 * np.pi * found.frequencies_hz[6:10]) ** 2 - squares[6:10]
    assert np.all(np.abs(moved) < change)


@pytest.mark.parametrize("seed", [3, 4])
def test_answers_of_a_massless_interface_of_six_digits(seed):
    """With all modes the reduced model answers as K and M do, but for what rounding may cause."""
    K, M, squares, _, few = skew_network(seed, 6, 27)
    found = cms.reduce(few, modes=18)
    load = np.array(list(few.interfaces.values())).T
    squared = squares[6] / 2
    answer = linalg.solve(K - squared * M, load)
    sizes = np.abs(answer)
    change = 0.5e-5 * sizes.T @ (np.abs(K) + squared * np.abs(M)) @ sizes
    exact = load.T @ answer
    assert np.all(change < 0.01 * np.abs(exact).max())
    rows = np.array(list(found.participation.values()))
    stiffness = (2 * np.pi * found.frequencies_hz) ** 2 - squared
    answered = rows / stiffness @ rows.T
    if found.residual_flexibility is not None:
        answered = answered + found.residual_flexibility
    assert np.all(np.abs(answered - exact) < change)


def test_more_modes_than_have_mass_are_refused_with_their_number():
    K, M, _ = superelement(kept=9, heavy=14)
    with pytest.raises(cms.ReductionError, match="only 10 degrees of freedom that have mass"):
        cms.reduce(ends(K, M), modes=14, method="craig-bampton")
    with pytest.raises(cms.ReductionError, match="only 14 have mass"):
        cms.reduce(ends(K, M), modes=15)


def test_an_indefinite_mass_is_refused():
    K, M, _ = superelement(kept=9, heavy=14)
    values, vectors = linalg.eigh(M)
    M -= 1e-6 * values[-1] * np.outer(vectors[:, 0], vectors[:, 0])
    with pytest.raises(
        cms.ReductionError, match=r"mass matrix is not positive: (scaled to|its diagonal)"
    ):
        cms.reduce(ends(K, M), modes=4)


def test_statics_of_a_massless_interface_are_exact():
    """Springs of 3, 4 and 5 N/m in series, the last one to a point without mass."""
    K = np.array([[7.0, -4.0, 0.0], [-4.0, 9.0, -5.0], [0.0, -5.0, 5.0]])
    M = np.diag([2.0, 1.0, 0.0])
    exact = np.sqrt(linalg.eigvalsh(K[:2, :2] - np.diag([0.0, 5.0]), M[:2, :2])) / (2 * np.pi)
    for method, modes in (("rubin", 2), ("craig-bampton", 1)):
        model = cms.reduce(cms.Matrices(K, M, {"end": np.eye(3)[2]}), modes=modes, method=method)
        known = 1 / 3 + 1 / 4 + 1 / 5
        assert model.static_flexibility("end") == pytest.approx(known, rel=1e-12)
        np.testing.assert_allclose(model.frequencies_hz, exact, rtol=1e-12)
        assert model.has_massless_part


def test_rigid_modes_are_compared_as_a_space():
    K, M = free_beam(12)
    model = cms.reduce(ends(K, M), modes=6)
    turned = cms.Matrices(K, M, dict(reversed(ends(K, M).interfaces.items())))
    other = cms.reduce(turned, modes=6, method="craig-bampton")
    for component, reduced in ((ends(K, M), model), (turned, other)):
        found = cms.check(component, reduced, modes=2)
        np.testing.assert_allclose(found.mac, 1.0, atol=1e-9)
    angle = 0.7
    turn = np.eye(model.size)
    turn[:2, :2] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
    rows = {name: row @ turn for name, row in model.participation.items()}
    rotated = cms.ReducedModel(
        model.frequencies_hz, rows, model.basis @ turn, model.residuals, model.modes
    )
    np.testing.assert_allclose(cms.check(ends(K, M), rotated, modes=2).mac, 1.0, atol=1e-9)


def test_rigid_modes_of_coupled_models_are_counted():
    """A hinge leaves two free beams three rigid-body modes, a hinge and an equal turn two."""
    model = cms.reduce(ends(*free_beam(8)), modes=6)
    hinge = cms.Joint(("a", "right"), ("b", "left"))
    weld = cms.Joint(("a", "right turn"), ("b", "left turn"))
    parts = {"a": model, "b": model}
    assert cms.couple(parts, [hinge]).rigid_body_modes == 3
    assert cms.couple(parts, [hinge, weld]).rigid_body_modes == 2


def test_rigid_modes_that_do_not_fit_at_the_joints_are_told():
    """Rigid-body modes that rounding has given 0.5 Hz leave the other part's at a spring."""
    omega, vectors = np.array([0.0, 3.0, 100.0]), np.eye(3)
    with pytest.raises(cms.ReductionError, match="leave 2 rigid-body modes, but mode 2 of the"):
        check_coupled(omega, 2, vectors, np.zeros((0, 3)), np.diag(omega))
    with pytest.raises(cms.ReductionError, match="the energy of the coupled model differs"):
        check_coupled(omega, 1, vectors, np.zeros((0, 3)), 1.001 * np.diag(omega))
    with pytest.raises(cms.ReductionError, match="the mass of the coupled model differs"):
        check_coupled(omega, 1, 1.001 * vectors, np.zeros((0, 3)), np.diag(omega))
    with pytest.raises(cms.ReductionError, match="the displacement at a joint of the coupled"):
        check_coupled(omega, 1, vectors, np.array([[0.0, 1.0, 0.0]]), np.diag(omega))


def test_a_mode_that_no_interface_sees_and_is_kept_is_told():
    K = linalg.block_diag([[2.0, -1.0], [-1.0, 2.0]], [[9.0]])
    said = []
    component = cms.Matrices(K, np.eye(3), {"one": [1.0, 0.0, 0.0]})
    found = cms.reduce(component, modes=3, unseen=True, progress=said.append)
    assert found.unseen_modes == (3,)
    assert "kept modes that move no interface: 3" in said
    assert "kept modes that move no interface: 3" in cms.check(component, found).report()


@pytest.mark.parametrize("kind", [sparse.csr_array, sparse.coo_matrix, sparse.dia_array])
def test_sparse_matrices_and_vectors(kind):
    K, M = free_beam(6)
    tip = np.eye(14)[:1]
    dense = cms.Matrices(K, M, {"tip": tip[0]}, damping=1e-3 * M)
    given = cms.Matrices(kind(K), kind(M), {"tip": sparse.csr_array(tip)}, damping=kind(1e-3 * M))
    for method in METHODS[:2]:
        a, b = (cms.reduce(c, modes=4, method=method) for c in (dense, given))
        np.testing.assert_allclose(b.frequencies_hz, a.frequencies_hz)
        np.testing.assert_allclose(b.damping, 1e-3 * np.eye(b.size), atol=1e-9)
    assert cms.check(given, b, modes=3).mac.shape == (3,)


TOO_FEW = "the (mass|stiffness) leave open (whether the component floats|which (modes|directions))"


@pytest.mark.parametrize("stated", [False, True])
@pytest.mark.parametrize("elements", [1, 2, 3, 10, 40, 100])
@pytest.mark.parametrize("digits", [4, 5, 6, 9, 13, 15])
def test_a_floating_beam_is_right_or_refused_for_its_digits(digits, elements, stated):
    K, M = (rounded(A, digits) for A in free_beam(elements))
    tip = cms.Matrices(K, M, {"tip": np.eye(len(K))[0]}, digits=digits if stated else None)
    try:
        found = cms.reduce(tip, modes=4)
    except cms.ReductionError as error:
        assert digits < 14 and re.search(TOO_FEW, str(error)), error
        return
    first, second, *elastic = linalg.eigh(K, M, eigvals_only=True, subset_by_index=[0, 3])
    assert found.rigid_body_modes == 2
    if found.rigid_bound_hz:
        assert max(abs(first), abs(second)) <= (2 * np.pi * found.rigid_bound_hz) ** 2
    floor = 1e-13 * elements**4
    np.testing.assert_allclose(
        found.frequencies_hz[2:4], np.sqrt(elastic) / (2 * np.pi), rtol=max(1e-9, floor)
    )


def test_a_mass_of_few_digits_is_refused_for_them():
    """Condensed masses have fewer of them than degrees of freedom; rounding gives the rest some."""
    K, M, _ = superelement(kept=9, heavy=14, noise=0.0, held=True)
    with pytest.raises(cms.ReductionError, match="5 digits of the mass leave open which direc"):
        cms.reduce(ends(K, rounded(M, 5)), modes=2)
    assert cms.reduce(ends(K, M), modes=2).rigid_body_modes == 0


def test_exact_entries_of_few_digits_are_no_rounding():
    """Springs of whole numbers between masses: what floats floats, what is held is held."""
    springs = np.array([1234.0, 5678.0, 9012.0, 3456.0, 7891.0])
    for ground in (0.0, 321.0):
        across = np.diff(np.eye(6), axis=0)
        K = across.T @ (springs[:, None] * across) + ground * np.outer(np.eye(6)[0], np.eye(6)[0])
        found = cms.reduce(cms.Matrices(K, np.eye(6), {"end": np.eye(6)[5]}), modes=3)
        exact = np.sqrt(np.maximum(linalg.eigvalsh(K)[:3], 0.0)) / (2 * np.pi)
        assert found.rigid_body_modes == (0 if ground else 1)
        np.testing.assert_allclose(found.frequencies_hz[:3], exact, rtol=1e-9, atol=1e-6)
