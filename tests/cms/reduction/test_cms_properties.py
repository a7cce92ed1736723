"""What must hold for any component."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from scipy import linalg

import cms


def random_component(seed, size, interfaces):
    """Symmetric positive definite K and M with spread spectra, and random interface vectors."""
    rng = np.random.default_rng(seed)
    K = rng.standard_normal((size, size))
    M = rng.standard_normal((size, size))
    K = K @ K.T + np.diag(10.0 ** rng.uniform(-1, 3, size))
    M = M @ M.T / size + np.eye(size)
    vectors = {f"i{j}": rng.standard_normal(size) for j in range(interfaces)}
    return cms.Matrices(K, M, vectors)


cases = st.tuples(st.integers(0, 10**6), st.integers(2, 25), st.integers(1, 4)).flatmap(
    lambda case: st.tuples(st.just(random_component(*case)), st.integers(0, case[1]))
)


@given(cases)
def test_projection_is_diagonal_and_above_the_full_frequencies(case):
    component, modes = case
    reduced = cms.reduce(component, modes=modes)
    squares = (2 * np.pi * reduced.frequencies_hz) ** 2
    exact = linalg.eigvalsh(component.stiffness, component.mass)
    scale = exact[-1]
    gram = reduced.basis.T @ component.mass @ reduced.basis
    stiffness = reduced.basis.T @ component.stiffness @ reduced.basis
    np.testing.assert_allclose(gram, np.eye(reduced.size), atol=1e-10)
    np.testing.assert_allclose(stiffness, np.diag(squares), atol=1e-10 * scale)
    assert np.all(squares >= exact[: reduced.size] * (1 - 1e-9))
    np.testing.assert_allclose(squares[:modes], exact[:modes], rtol=1e-9)


@given(cases)
def test_statics_between_all_interfaces_are_exact(case):
    component, modes = case
    reduced = cms.reduce(component, modes=modes)
    for name, load in component.interfaces.items():
        solution = np.linalg.solve(component.stiffness, load)
        for at, vector in component.interfaces.items():
            scale = np.sqrt(
                (load @ solution) * (vector @ np.linalg.solve(component.stiffness, vector))
            )
            error = reduced.static_flexibility(at, name) - vector @ solution
            assert abs(error) <= 1e-10 * scale


@given(cases, st.lists(st.floats(-6, 6), min_size=4, max_size=4), st.floats(-6, 6))
def test_units_of_interfaces_and_of_mass_do_not_matter(case, exponents, mass_exponent):
    component, modes = case
    factors = 10.0 ** np.array(exponents)
    scaled = {
        name: vector * factor
        for (name, vector), factor in zip(component.interfaces.items(), factors, strict=False)
    }
    unit = 10.0**mass_exponent
    reduced = cms.reduce(component, modes=modes)
    other = cms.reduce(
        cms.Matrices(component.stiffness * unit, component.mass * unit, scaled), modes=modes
    )
    np.testing.assert_allclose(other.frequencies_hz, reduced.frequencies_hz, rtol=1e-8)
    for name, factor in zip(component.interfaces, factors, strict=False):
        np.testing.assert_allclose(
            other.static_flexibility(name) * unit,
            factor**2 * reduced.static_flexibility(name),
            rtol=1e-9,
        )


@given(cases)
def test_the_same_component_gives_the_same_model(case):
    component, modes = case
    one, two = (cms.reduce(component, modes=modes) for _ in range(2))
    np.testing.assert_array_equal(one.basis, two.basis)
    first = one.participation["i0"]
    seen = np.abs(first) > 1e-6 * np.abs(first).max()
    assert np.all(first[seen] > 0)
