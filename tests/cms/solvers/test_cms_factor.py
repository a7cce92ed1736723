"""Orders of elimination, and the sparse Cholesky factor, against SuperLU and LAPACK."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import sparse
from scipy.sparse.linalg import splu

from cms.solvers.cholesky import Cholesky, NotPositiveDefiniteError
from cms.solvers.dissection import dissected, quotient_graph, separator, vertices
from cms.solvers.factor import SOLVERS, factorise, pardiso_is_there

THERE = [name for name in SOLVERS if name != "pardiso" or pardiso_is_there()]


def grid(*counts: int, dofs: int = 1, shift: float = 1e-3) -> sparse.csc_array:
    """Laplacian of a grid of nodes with coupled degrees of freedom, positive definite."""
    whole = sparse.csc_array((1, 1))
    for n in counts:
        line = sparse.diags_array([-1.0, 2.0, -1.0], offsets=[-1, 0, 1], shape=(n, n))
        whole = sparse.kron(whole, sparse.eye_array(n)) + sparse.kron(
            sparse.eye_array(whole.shape[0]), line
        )
    block = np.eye(dofs) + 0.3
    return sparse.csc_array(
        sparse.kron(whole, block) + shift * sparse.eye_array(whole.shape[0] * dofs)
    )


def random_matrix(size: int, entries: int, seed: int) -> sparse.csc_array:
    """A diagonally dominant matrix of random pattern, in pieces where entries are few."""
    rng = np.random.default_rng(seed)
    i, j = rng.integers(size, size=(2, entries))
    part = sparse.coo_array((rng.standard_normal(entries), (i, j)), shape=(size, size)).tocsc()
    whole = part + part.T
    return sparse.csc_array(whole + sparse.diags_array(abs(whole).sum(axis=1) + 1.0))


@pytest.mark.parametrize("counts, dofs", [((2000,), 1), ((40, 50), 2), ((14, 12, 10), 3)])
def test_solutions_are_those_of_superlu(counts, dofs):
    A = grid(*counts, dofs=dofs)
    right = np.random.default_rng(0).standard_normal((A.shape[0], 3))
    factor = Cholesky(A, dissected(A))
    exact = splu(A).solve(right)
    np.testing.assert_allclose(factor.solve(right), exact, rtol=0, atol=1e-9 * abs(exact).max())
    assert factor.solve(right[:, 0]).shape == (A.shape[0],)


@given(st.integers(1, 600), st.integers(0, 1500), st.integers(0, 1000))
def test_any_pattern_is_ordered_and_solved(size, entries, seed):
    """Pieces, lonely rows and full rows among them."""
    A = random_matrix(size, entries, seed)
    plan = dissected(A)
    np.testing.assert_array_equal(np.sort(plan.order), np.arange(size))
    right = np.random.default_rng(seed).standard_normal(size)
    residual = A @ Cholesky(A, plan).solve(right) - right
    assert np.max(np.abs(residual)) < 1e-11 * abs(A).max() * (1 + np.max(np.abs(right)))


def test_the_smallest_pivot_is_that_of_the_dense_factor_in_the_same_order():
    A = grid(12, 11, 10, dofs=2)
    plan = dissected(A)
    dense = np.linalg.cholesky(A.toarray()[np.ix_(plan.order, plan.order)])
    assert Cholesky(A, plan).smallest_pivot == pytest.approx(np.min(np.diag(dense)) ** 2, rel=1e-10)


def test_the_plan_counts_what_the_factor_keeps():
    A = grid(20, 18, 16, dofs=2)
    plan = dissected(A)
    factor = Cholesky(A, plan)
    kept = sum(block.size for block in (*factor.diagonals, *factor.panels))
    assert kept == plan.entries < plan.most_numbers
    assert sorted(c for f in plan.fronts for c in f.children) == list(range(len(plan.fronts) - 1))


def test_an_indefinite_matrix_is_told():
    A = grid(15, 15, 15, shift=-1.0)
    with pytest.raises(NotPositiveDefiniteError):
        Cholesky(A, dissected(A))


@pytest.mark.parametrize("name", THERE)
def test_all_solvers_that_are_there_agree(monkeypatch, name):
    """On the solution of a scaled grid, and on which matrices are not positive definite."""
    monkeypatch.setenv("CMS_SOLVER", name)
    scale = sparse.diags_array(np.geomspace(1.0, 1e3, 2700))
    A = sparse.csc_array(scale @ grid(15, 12, 5, dofs=3) @ scale)
    right = np.random.default_rng(0).standard_normal((2700, 2))
    exact = np.linalg.solve(A.toarray(), right)
    factor = factorise(A)
    for b, x in ((right, exact), (right[:, 0], exact[:, 0])):
        found = factor.solve(b)
        assert found.shape == b.shape
        np.testing.assert_allclose(found, x, rtol=0, atol=1e-9 * abs(exact).max())
    assert not factor.suspect
    assert factorise(grid(15, 12, 10, shift=-1.0)) is None
    ends = np.zeros(2000)
    ends[[0, -1]] = 1.0
    floating = factorise(grid(2000, shift=0.0) - 1.3 * sparse.diags_array(ends))
    assert floating is None or floating.suspect


def test_degrees_of_freedom_of_a_node_are_one_vertex():
    A = grid(7, 6, 5, dofs=3)
    vertex = vertices(A)
    assert np.array_equal(np.bincount(vertex), np.full(210, 3))
    assert quotient_graph(A, vertex).nnz == 2 * (6 * 6 * 5 + 7 * 5 * 5 + 7 * 6 * 4)


@pytest.mark.parametrize("side", [40, 80])
def test_the_fill_of_a_plane_is_that_of_nested_dissection(monkeypatch, side):
    """George (1973): 31/4 n^2 log2(n) entries for n x n nodes, less terms of lower order."""
    monkeypatch.setattr("cms.solvers.dissection.LEAF", 4)
    plan = dissected(grid(side, side))
    fill = sum(f.rows * ((f.rows + 1) / 2 + f.border.size) for f in plan.fronts)
    assert fill < 31 / 4 * side**2 * np.log2(side)


def test_the_separator_of_a_dumbbell_is_its_neck():
    """Two squares of 9 x 9 vertices, joined by a bar of two: no lighter set parts them."""
    bar = {(i, j) for i in range(9, 13) for j in (3, 4)}
    square = {(i, j) for i in range(9) for j in range(9)}
    spots = np.array(sorted(square | bar | {(i + 13, j) for i, j in square}))
    near = np.abs(spots[:, None] - spots[None, :]).sum(axis=2) == 1
    edges = tuple(np.nonzero(near))
    low, between = separator(edges, np.ones(len(spots), dtype=int), spots.astype(float))
    high = ~low & ~between
    assert between.sum() == 2 and min(low.sum(), high.sum()) >= 81 - 2
    assert not near[np.ix_(low, high)].any()


def test_the_separator_of_a_cube_is_no_larger_than_a_plane():
    A = grid(11, 11, 11)
    plan = dissected(A)
    assert plan.fronts[-1].rows <= 11**2
