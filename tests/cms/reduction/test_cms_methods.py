"""All methods against the full component, with the orders that theory gives."""

from __future__ import annotations

import numpy as np
import pytest
from chains import chain, fixed_free_hz, free_free_hz
from scipy import linalg, sparse

import cms
import cms.solvers.factor

RITZ = ["rubin", "craig-chang", "dual-craig-bampton", "craig-bampton", "truncation"]
ALL = [*RITZ, "macneal"]
STATIC = ["rubin", "craig-chang", "dual-craig-bampton", "craig-bampton", "macneal"]


def full_receptance(component, hz, at, excited):
    K, M = component.stiffness.toarray(), component.mass.toarray()
    dynamic = K - (2 * np.pi * hz) ** 2 * M
    return component.interfaces[at] @ np.linalg.solve(dynamic, component.interfaces[excited])


def order(errors, steps):
    """Slope in a doubly logarithmic plot between the last two."""
    return np.log(errors[-1] / errors[-2]) / np.log(steps[-1] / steps[-2])


@pytest.mark.parametrize("method", ALL)
def test_all_modes_give_the_full_receptance(cantilever, method):
    modes = 28 if method == "craig-bampton" else 30
    reduced = cms.reduce(cantilever, modes=modes, method=method)
    for hz in (0.0, 0.05, 0.3):
        exact = full_receptance(cantilever, hz, "middle", "tip")
        found = reduced.receptance(hz, "middle", "tip")
        assert found == pytest.approx(exact, rel=1e-9)


@pytest.mark.parametrize("method", STATIC)
@pytest.mark.parametrize("modes", [1, 7])
def test_statics_are_exact_at_any_count(cantilever, method, modes):
    reduced = cms.reduce(cantilever, modes=modes, method=method)
    assert reduced.static_flexibility("tip") == pytest.approx(30 / 7, rel=1e-11)
    assert reduced.static_flexibility("tip", "middle") == pytest.approx(15 / 7, rel=1e-11)
    found = cms.check(cantilever, reduced)
    assert max(found.static_recovery.values()) < 1e-10


def test_guyan_is_the_static_condensation(cantilever):
    """Against elimination by hand: boundary dofs 14 and 29, all others follow."""
    reduced = cms.reduce(cantilever, method="guyan")
    K, M = cantilever.stiffness.toarray(), cantilever.mass.toarray()
    boundary, inner = [29, 14], np.setdiff1d(np.arange(30), [14, 29])
    T = np.zeros((30, 2))
    T[boundary] = np.eye(2)
    T[inner] = -np.linalg.solve(K[np.ix_(inner, inner)], K[np.ix_(inner, boundary)])
    squares = linalg.eigvalsh(T.T @ K @ T, T.T @ M @ T)
    np.testing.assert_allclose((2 * np.pi * reduced.frequencies_hz) ** 2, squares, rtol=1e-11)
    assert (reduced.modes, reduced.size) == (0, 2)


def test_craig_bampton_is_that_of_the_textbook(cantilever):
    reduced = cms.reduce(cantilever, modes=4, method="craig-bampton")
    K, M = cantilever.stiffness.toarray(), cantilever.mass.toarray()
    boundary, inner = [29, 14], np.setdiff1d(np.arange(30), [14, 29])
    T = np.zeros((30, 6))
    T[boundary, 4:] = np.eye(2)
    T[inner, 4:] = -np.linalg.solve(K[np.ix_(inner, inner)], K[np.ix_(inner, boundary)])
    T[inner, :4] = linalg.eigh(K[np.ix_(inner, inner)], M[np.ix_(inner, inner)])[1][:, :4]
    squares = linalg.eigvalsh(T.T @ K @ T, T.T @ M @ T)
    np.testing.assert_allclose((2 * np.pi * reduced.frequencies_hz) ** 2, squares, rtol=1e-11)


def test_interfaces_that_are_no_single_dofs():
    """An averaged and a relative displacement: fixed interfaces as in a dense null space."""
    component = chain(40)
    mean, gap = np.zeros(40), np.zeros(40)
    mean[30:38] = 1 / 8
    gap[[5, 12]] = 1.0, -1.0
    component = cms.Matrices(component.stiffness, component.mass, {"mean": mean, "gap": gap})
    reduced = cms.reduce(component, modes=4, method="craig-bampton")
    B = np.column_stack([mean, gap])
    K, M = component.stiffness.toarray(), component.mass.toarray()
    Z = linalg.null_space(B.T)
    fixed = Z @ linalg.eigh(Z.T @ K @ Z, Z.T @ M @ Z)[1][:, :4]
    flexibility = np.linalg.solve(K, B)
    T = np.column_stack([fixed, flexibility @ np.linalg.inv(B.T @ flexibility)])
    squares = linalg.eigvalsh(T.T @ K @ T, T.T @ M @ T)
    np.testing.assert_allclose((2 * np.pi * reduced.frequencies_hz) ** 2, squares, rtol=1e-10)
    assert reduced.static_flexibility("gap") == pytest.approx(B[:, 1] @ flexibility[:, 1])


@pytest.mark.parametrize("method, expected", [("truncation", 0), ("macneal", 2), ("rubin", 4)])
def test_order_of_the_receptance_error_in_frequency(cantilever, method, expected):
    """What is left out is static at first, then its inertia, then the inertia of that."""
    reduced = cms.reduce(cantilever, modes=2, method=method)
    hz = np.array([0.01, 0.02])
    errors = [
        abs(full_receptance(cantilever, f, "tip", "tip") - reduced.receptance(f, "tip", "tip"))
        for f in hz
    ]
    assert order(errors, hz) == pytest.approx(expected, abs=0.35)


@pytest.mark.parametrize("method", ["guyan", "craig-bampton"])
def test_order_of_the_dynamic_stiffness_error_in_frequency(cantilever, method):
    """Constraint modes carry the static stiffness and the mass exactly: the error is Omega^4."""
    asked = {"method": method} if method == "guyan" else {"method": method, "modes": 2}
    reduced = cms.reduce(cantilever, **asked)
    names = list(cantilever.interfaces)
    hz, errors = np.array([0.01, 0.02]), []
    for f in hz:
        exact = np.array([[full_receptance(cantilever, f, a, e) for e in names] for a in names])
        found = np.array([[reduced.receptance(f, a, e).real for e in names] for a in names])
        errors.append(np.abs(np.linalg.inv(exact) - np.linalg.inv(found)).max())
    assert order(errors, hz) == pytest.approx(4, abs=0.35)


@pytest.mark.parametrize(
    "method, expected",
    [("truncation", -1), ("macneal", -3), ("rubin", -5), ("craig-bampton", -3)],
)
def test_order_of_the_receptance_error_in_the_number_of_modes(method, expected):
    """A rod: w_i ~ i, equal participations. The sums over i > k of 1/i^2, 1/i^4 and 1/i^6.

    Craig-Bampton: the inertia coupling of fixed modes falls as 1/i, so that 1/i^2 1/i^2 is left.
    """
    component = chain(600, stiffness=600.0, mass=1 / 600)
    counts, errors = np.array([10, 20, 40]), []
    exact = full_receptance(component, 0.6, "tip", "tip")  # between the second and third mode
    for modes in counts:
        reduced = cms.reduce(component, modes=int(modes), method=method)
        errors.append(abs(reduced.receptance(0.6, "tip", "tip") - exact))
    assert order(errors, counts) == pytest.approx(expected, abs=0.25)


@pytest.mark.parametrize(
    ("method", "size"),
    [("rubin", 40), ("craig-chang", 40), ("macneal", 40), ("rubin", 2500), ("macneal", 2500)],
)
def test_inertia_relief_of_a_floating_chain(size, method):
    """The receptance less its rigid part at frequency zero is the sum over the elastic modes."""
    component = chain(size, left=0.0, interfaces={"tip": size - 1, "start": 0})
    reduced = cms.reduce(component, modes=3, method=method)
    assert reduced.rigid_body_modes == 1
    np.testing.assert_allclose(reduced.frequencies_hz[:3], free_free_hz(size)[:3], rtol=1e-7)
    k = np.arange(1, size)
    squares = (2 * np.pi * free_free_hz(size)[1:]) ** 2
    shape = np.cos(k * np.pi / (2 * size)) * np.sqrt(2 / size)
    here, there = np.sum(shape**2 / squares), np.sum((-1.0) ** k * shape**2 / squares)
    elastic = reduced.frequencies_hz > 0.0
    found = {}
    for at in ("tip", "start"):
        terms = reduced.participation[at] * reduced.participation["tip"]
        found[at] = np.sum(terms[elastic] / (2 * np.pi * reduced.frequencies_hz[elastic]) ** 2)
        if reduced.residual_flexibility is not None:
            found[at] += reduced.residual_flexibility[reduced.interfaces.index(at), 0]
    assert found["tip"] == pytest.approx(here, rel=1e-8)
    assert found["start"] == pytest.approx(there, rel=1e-8)
    assert cms.check(component, reduced).rigid_body_modes == (1, 1)


@pytest.mark.parametrize("modes", [1, 3])
def test_floating_craig_bampton_keeps_the_rigid_body_mode(modes):
    component = chain(60, left=0.0, interfaces={"tip": 59, "start": 0})
    reduced = cms.reduce(component, modes=modes, method="craig-bampton")
    assert reduced.rigid_body_modes == 1
    assert np.ptp(reduced.basis[:, 0]) < 1e-9
    assert reduced.frequencies_hz[1] == pytest.approx(free_free_hz(60)[1], rel=0.2 / modes**3)


def test_a_pinned_rod_whose_interface_does_not_hold_it():
    """Two loose chains, one with an interface: the other is a fixed-interface mode of 0 Hz."""
    one = chain(5, left=0.0).stiffness.toarray()
    loads = {"tip": np.eye(10)[4]}
    component = cms.Matrices(linalg.block_diag(one, one), np.eye(10), loads)
    with pytest.raises(cms.ReductionError, match="its 1 rigid-body mode must be kept"):
        cms.reduce(component, modes=0, method="craig-bampton")
    with pytest.raises(cms.ReductionError, match="'guyan' needs interfaces that hold"):
        cms.reduce(component, method="guyan")
    assert cms.reduce(component, modes=3, method="craig-bampton").rigid_body_modes == 2


@pytest.mark.parametrize("method", ["rubin", "macneal"])
def test_a_load_that_moves_a_body_rigidly_has_no_residual(method):
    """A single free mass, and a rigid pair: nothing elastic is left to attach."""
    single = cms.Matrices([[0.0]], [[2.0]], {"mass": [1.0]})
    reduced = cms.reduce(single, modes=1, method=method)
    assert (reduced.size, reduced.rigid_body_modes) == (1, 1)
    assert not reduced.has_massless_part
    assert reduced.receptance(1.0, "mass", "mass") == pytest.approx(-1 / (2 * (2 * np.pi) ** 2))


def test_truncation_is_the_old_way_without_residual(cantilever):
    old = cms.reduce(cantilever, modes=4, residual=False)
    new = cms.reduce(cantilever, modes=4, method="truncation")
    np.testing.assert_array_equal(old.basis, new.basis)


def test_dependent_interfaces_have_no_constraint_mode_of_their_own():
    component = chain(20)
    tip, first = component.interfaces["tip"], np.eye(20)[0]
    loads = {"tip": tip, "same": -1e6 * tip, "first": first, "sum": tip + 3 * first}
    component = cms.Matrices(component.stiffness, component.mass, loads)
    reduced = cms.reduce(component, modes=2, method="craig-bampton")
    assert (reduced.size, reduced.dropped_residual_modes) == (4, 2)
    assert reduced.residual_modes == 0
    assert reduced.static_flexibility("tip") == pytest.approx(20.0, rel=1e-10)
    assert reduced.static_flexibility("sum") == pytest.approx(20 + 9 + 6, rel=1e-10)


@pytest.mark.parametrize("method", RITZ)
def test_residual_bounds_hold_for_every_method(cantilever, method):
    """Within each band of `frequency_bands_hz` lies a frequency of the chain."""
    reduced = cms.reduce(cantilever, modes=5, method=method)
    exact = fixed_free_hz(30, 7.0, 0.3)
    for low, high in cms.accuracy(cantilever, reduced).frequency_bands_hz:
        assert np.any((exact >= low * (1 - 1e-9)) & (exact <= high * (1 + 1e-9)))


@pytest.mark.parametrize(
    ("method", "modes"),
    [*((method, modes) for method in RITZ[:-1] for modes in (0, 4)),
     ("truncation", 2), ("macneal", 4), ("guyan", 0)],
)  # fmt: skip
def test_true_receptance_error_lies_within_the_stated_band(cantilever, method, modes):
    reduced = cms.reduce(cantilever, modes=modes, method=method)
    known = cms.accuracy(cantilever, reduced)
    told = 0
    for at, excited in (("tip", "tip"), ("middle", "tip")):
        for hz in np.linspace(0.01, 1.2, 24) * known.next_hz:
            low, high = known.receptance_error(hz, at, excited)[0]
            exact = full_receptance(cantilever, hz, at, excited)
            error = exact - reduced.receptance(hz, at, excited).real
            rounding = 1e-10 * abs(exact)
            assert low - rounding <= error <= high + rounding
            told += np.isfinite(high) and high - low < 0.5 * max(abs(low), abs(high))
    assert told >= 8


def test_accuracy_of_a_floating_component():
    component = chain(40, left=0.0)
    known = cms.accuracy(component, cms.reduce(component, modes=3))
    low, high = known.receptance_error(0.4 * known.next_hz, "tip", "tip")[0]
    exact = full_receptance(component, 0.4 * known.next_hz, "tip", "tip")
    found = known.reduced.receptance(0.4 * known.next_hz, "tip", "tip").real
    assert 0 < low <= exact - found <= high < 1.3 * low


def test_damping_matrix_is_projected_exactly():
    """Rayleigh and a local damper, given as a matrix or by name: the same full receptance."""
    plain = chain(30, interfaces={"tip": 29, "middle": 14})
    b = plain.interfaces["middle"]
    C = 0.01 * plain.mass + 0.03 * plain.stiffness + 0.4 * sparse.csc_array(np.outer(b, b))
    given = cms.Matrices(plain.stiffness, plain.mass, plain.interfaces, C)
    by_matrix = cms.reduce(given, modes=4)
    by_name = cms.reduce(plain, modes=4).with_damping(
        rayleigh=(0.01, 0.03), dampers={"middle": 0.4}
    )
    np.testing.assert_allclose(by_matrix.damping, by_name.damping, atol=1e-13)
    whole = cms.reduce(given, modes=30)
    omega = 2 * np.pi * 0.02
    dynamic = plain.stiffness - omega**2 * plain.mass + 1j * omega * C
    exact = np.linalg.solve(dynamic.toarray(), plain.interfaces["tip"])[29]
    assert whole.receptance(0.02, "tip", "tip") == pytest.approx(exact, rel=1e-10)
    assert by_name.receptance(0.02, "tip", "tip") == pytest.approx(exact, rel=1e-4)


def test_modal_damping_is_that_of_the_oscillator(cantilever):
    reduced = cms.reduce(cantilever, modes=3)
    damped = reduced.with_damping(modal=0.02)
    hz = reduced.frequencies_hz[1]
    expected = reduced.receptance(hz, "tip", "tip", modal_damping=0.02)
    assert damped.receptance(hz, "tip", "tip") == pytest.approx(expected, rel=1e-12)


def test_effective_masses_sum_to_the_mass(cantilever):
    whole = cms.reduce(cantilever, modes=30)
    found = cms.check(cantilever, whole, directions={"along": np.ones(30)}, modes=30)
    assert found.direction_mass["along"] == pytest.approx(30 * 0.3)
    assert found.effective_mass["along"].sum() == pytest.approx(30 * 0.3, rel=1e-12)
    k = 2 * np.arange(1, 31) - 1  # fixed-free rod: 8 / (pi k)^2 of the mass in the limit
    share = found.effective_mass["along"][:3] / (30 * 0.3)
    np.testing.assert_allclose(share, 8 / (np.pi * k[:3]) ** 2, rtol=0.06)
    assert found.direction_hz["along"] == pytest.approx(np.sqrt(7 / 9.0) / (2 * np.pi))
    np.testing.assert_allclose(found.mac, 1.0, atol=1e-10)
    assert np.abs(found.frequency_errors).max() < 1e-10
    assert "100.00 % of it in the modes" in found.report()


def test_checks_of_a_coarse_model_show_what_it_lacks(cantilever):
    found = cms.check(cantilever, cms.reduce(cantilever, modes=2, method="truncation"), modes=4)
    assert min(found.static_recovery.values()) > 0.01
    np.testing.assert_allclose(found.mac[:2], 1.0, atol=1e-9)
    assert np.all(found.mac[2:] < 1e-9)
    assert found.mass_orthogonality < 1e-12


@pytest.mark.parametrize("method", ["rubin", "macneal", "craig-bampton"])
def test_files_keep_everything(tmp_path, cantilever, method):
    reduced = cms.reduce(cantilever, modes=3, method=method).with_damping(modal=0.01)
    reduced.save(tmp_path / "model.npz")
    again = cms.ReducedModel.load(tmp_path / "model.npz")
    assert again.method == method
    np.testing.assert_array_equal(again.damping, reduced.damping)
    hz = 0.1
    assert again.receptance(hz, "tip", "tip") == reduced.receptance(hz, "tip", "tip")


@pytest.mark.parametrize(
    "asked, words",
    [
        ({"modes": 2, "method": "rubbin"}, "no method 'rubbin'"),
        ({"modes": 2, "method": "guyan"}, "'guyan' keeps no modes"),
        ({"modes": 0, "method": "macneal"}, "needs at least one mode"),
        ({"modes": 29, "method": "craig-bampton"}, "only 28 degrees of freedom"),
        ({"modes": 2, "method": "macneal", "residual": False}, "residual=False is method"),
    ],
)
def test_faults_in_a_request_are_told(cantilever, asked, words):
    with pytest.raises(cms.ReductionError, match=words):
        cms.reduce(cantilever, **asked)


@pytest.mark.parametrize(
    "damping, words",
    [
        ({"modal": -0.1}, "modal must be finite and not negative"),
        ({"modal": [0.1, 0.1]}, "one damping ratio or one per mode"),
        ({"rayleigh": (0.1,)}, r"two numbers \(alpha, beta\)"),
        ({"dampers": {"nose": 1.0}}, "no interface 'nose'"),
    ],
)
def test_faults_in_damping_are_told(cantilever, damping, words):
    with pytest.raises(cms.ReductionError, match=words):
        cms.reduce(cantilever, modes=3).with_damping(**damping)


@pytest.mark.parametrize("damping", [{"rayleigh": (0.0, 0.1)}, {"dampers": {"tip": 1.0}}])
def test_massless_flexibility_refuses_damping_it_cannot_carry(cantilever, damping):
    with pytest.raises(cms.ReductionError, match="reduce by 'rubin' or 'craig-bampton'"):
        cms.reduce(cantilever, modes=3, method="macneal").with_damping(**damping)


class FakePardisoError(Exception):
    value = -4  # not positive definite


class FakePardiso:
    """Stands in for pypardiso: solves with SuperLU, and spoils what it is told to."""

    spoil = 0.0

    def __init__(self, mtype):
        self.mtype, self.iparm, self.phase = mtype, np.zeros(64, dtype=np.int32), 0

    def set_phase(self, phase):
        self.phase = phase

    def _call_pardiso(self, upper, right):
        if self.phase == 11:
            self.iparm[14:17] = 100, 200, 300
        if self.phase == 22:
            assert self.mtype == 2 and self.iparm[0] == 1
            whole = upper + sparse.triu(upper, k=1).T
            try:
                self.inverse = sparse.linalg.splu(sparse.csc_matrix(whole))
            except RuntimeError:  # exactly singular
                raise FakePardisoError from None
        if self.phase == 33:
            assert right.size  # else the real one fails
            return self.inverse.solve(np.ascontiguousarray(right)) * (1.0 + self.spoil)
        return right


@pytest.fixture
def pardiso(monkeypatch):
    import sys
    import types

    import cms.solvers.factor

    module = types.ModuleType("pypardiso")
    module.PyPardisoSolver = FakePardiso
    module.pardiso_wrapper = types.SimpleNamespace(PyPardisoError=FakePardisoError)
    monkeypatch.setitem(sys.modules, "pypardiso", module)
    monkeypatch.delenv("CMS_SOLVER", raising=False)
    cms.solvers.factor.pardiso_is_there.cache_clear()
    yield FakePardiso
    cms.solvers.factor.pardiso_is_there.cache_clear()


def test_pardiso_is_chosen_where_it_is_installed(pardiso):
    told = []
    reduced = cms.reduce(chain(2500), modes=3, progress=told.append)
    assert "by PARDISO" in told[0] and "GB" in told[0]
    np.testing.assert_allclose(reduced.frequencies_hz[:3], fixed_free_hz(2500)[:3], rtol=1e-8)
    floating = cms.reduce(chain(2500, left=0.0), modes=3)
    assert floating.rigid_body_modes == 1
    without_loads = cms.Matrices(chain(2500).stiffness, chain(2500).mass, {})
    alone = cms.reduce(without_loads, modes=3)
    np.testing.assert_allclose(alone.frequencies_hz, fixed_free_hz(2500)[:3], rtol=1e-8)


@pytest.mark.parametrize("spoil", [1e-3, np.nan])
def test_a_solver_that_returns_garbage_is_found_out(pardiso, monkeypatch, spoil):
    monkeypatch.setattr(pardiso, "spoil", spoil)
    with pytest.raises(cms.ReductionError):
        cms.reduce(chain(2500), modes=3)


def test_pardiso_can_be_left_out(pardiso, monkeypatch):
    monkeypatch.setenv("CMS_SOLVER", "cholesky")
    told = []
    cms.reduce(chain(2500), modes=3, progress=told.append)
    assert any("by sparse Cholesky" in text for text in told)


def test_a_factor_that_needs_more_memory_than_there_is_is_refused(pardiso, monkeypatch):
    """Before the work: PARDISO says after its analysis that it takes 500 kB."""
    monkeypatch.setattr("cms.solvers.factor.available_memory", lambda: 4e5)
    with pytest.raises(cms.ReductionError, match=r"PARDISO needs 0\.000512 GB .* 0\.0004 GB are"):
        cms.reduce(chain(2500), modes=3)
    monkeypatch.setenv("CMS_SOLVER", "cholesky")
    with pytest.raises(cms.ReductionError, match="by sparse Cholesky needs"):
        cms.reduce(chain(2500), modes=3)
    monkeypatch.setenv("CMS_SOLVER", "superlu")
    with pytest.raises(cms.ReductionError, match="by SuperLU needs"):
        cms.reduce(chain(2500), modes=3)


def pardiso_fails(*_):
    raise cms.solvers.factor.SolverError("PARDISO fails with its error code -2")


def test_where_a_solver_fails_the_next_one_is_taken(monkeypatch):
    """PARDISO, then the factor by fronts, then SuperLU; each change is told."""

    def broken(*_):
        raise np.linalg.LinAlgError("broken")

    monkeypatch.delenv("CMS_SOLVER", raising=False)
    monkeypatch.setattr("cms.solvers.factor.pardiso_is_there", lambda: True)
    monkeypatch.setitem(cms.solvers.factor.SOLVERS, "pardiso", pardiso_fails)
    told = []
    cms.reduce(chain(2500), modes=3, progress=told.append)
    assert told[0] == "PARDISO fails with its error code -2: taking another solver"
    assert any("by sparse Cholesky" in text for text in told)
    monkeypatch.setattr("cms.solvers.factor.Cholesky", broken)
    told.clear()
    reduced = cms.reduce(chain(2500), modes=3, progress=told.append)
    assert "sparse Cholesky fails (broken): taking another solver" in told
    assert any("by SuperLU" in text for text in told)
    np.testing.assert_allclose(reduced.frequencies_hz[:3], fixed_free_hz(2500)[:3], rtol=1e-8)
    monkeypatch.setenv("CMS_SOLVER", "cholesky")
    with pytest.raises(cms.ReductionError, match="sparse Cholesky fails"):
        cms.reduce(chain(2500), modes=3)


@pytest.mark.parametrize(
    "name, sentence",
    [("mumps", "there is no solver CMS_SOLVER='mumps'"), ("pardiso", "needs the package")],
)
def test_a_solver_that_is_not_there_is_told(monkeypatch, name, sentence):
    monkeypatch.setenv("CMS_SOLVER", name)
    monkeypatch.setattr("cms.solvers.factor.pardiso_is_there", lambda: False)
    with pytest.raises(cms.ReductionError, match=sentence):
        cms.reduce(chain(2500), modes=3)


def test_pardiso_without_its_library_is_told(monkeypatch):
    monkeypatch.delenv("CMS_SOLVER", raising=False)
    monkeypatch.setattr("cms.solvers.factor.pardiso_is_there", lambda: False)
    monkeypatch.setattr("cms.solvers.factor.find_spec", lambda name: name)
    told = []
    cms.reduce(chain(2500), modes=3, progress=told.append)
    assert told[0].startswith("pypardiso is installed, but MKL's library mkl_rt is not found")
    assert any("by sparse Cholesky" in text for text in told)


def test_fewer_modes_of_a_model_are_the_model_of_fewer_modes(cantilever):
    large = cms.reduce(cantilever, modes=9)
    for numbers in ([1, 2, 3], [1, 3, 4]):
        small = cms.keep_modes(large, numbers)
        static = [small.static_flexibility(n, "tip") for n in ("tip", "middle")]
        np.testing.assert_allclose(static, [30 / 7, 15 / 7], rtol=1e-10)
        np.testing.assert_allclose(
            small.frequencies_hz[:3], large.frequencies_hz[np.array(numbers) - 1], rtol=1e-12
        )
    same = cms.reduce(cantilever, modes=3)
    found = cms.keep_modes(large, [1, 2, 3])
    np.testing.assert_allclose(found.frequencies_hz, same.frequencies_hz, rtol=1e-10)
    with pytest.raises(cms.ReductionError, match="not all between 1 and 9"):
        cms.keep_modes(large, [0, 1])
    with pytest.raises(cms.ReductionError, match="by 'craig-bampton' cannot be left out"):
        cms.keep_modes(cms.reduce(cantilever, modes=3, method="craig-bampton"), [1])


@pytest.mark.parametrize("left, exact", [(1.0, fixed_free_hz), (0.0, free_free_hz)])
def test_half_of_all_modes_of_a_large_component_are_those_of_the_closed_form(left, exact):
    """Held and floating; slow modes from a dense problem that gives the fast ones."""
    reduced = cms.reduce(chain(1520, left=left), modes=760)
    expected = exact(1520)[:760]
    np.testing.assert_allclose(reduced.frequencies_hz[:760], expected, rtol=1e-9, atol=0.0)


@pytest.mark.parametrize("ratio", [1e8, 1e13, 1e16])
@pytest.mark.parametrize(("method", "modes"), [("craig-bampton", 5), ("guyan", None)])
def test_a_soft_chain_beside_a_stiff_one_stays_held(method, modes, ratio):
    """Two separate chains, held at their ends: the soft one's energies are not rounding."""
    n = 6
    chain = 2.0 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1)
    chain[0, 0] = 1.0
    both = np.zeros((2 * n, 2 * n))
    both[:n, :n], both[n:, n:] = chain, ratio * chain
    ends = {"soft": np.eye(2 * n)[0], "stiff": np.eye(2 * n)[n]}
    component = cms.Matrices(both, np.eye(2 * n), ends)
    found = cms.reduce(component, modes=modes, method=method).frequencies_hz[0]
    lowest = 2.0 * np.sin(np.pi / (4 * n + 2)) / (2.0 * np.pi)  # of a chain free at one end
    if method == "guyan":  # all move in a straight line: k/m of it
        shape = 1.0 - np.arange(n) / n
        lowest = np.sqrt(1.0 / n / (shape @ shape)) / (2.0 * np.pi)
    assert found == pytest.approx(lowest, rel=1e-9)


@pytest.mark.parametrize("method", ["guyan", "craig-bampton"])
def test_interfaces_that_leave_nothing_between_them_are_told(method):
    component = cms.Matrices([[2.0]], [[1.0]], {"a": [1.0]})
    with pytest.raises(cms.ReductionError, match="the interfaces take all degrees of freedom"):
        cms.reduce(component, modes=None if method == "guyan" else 1, method=method)
