"""Sparse matrices of a system, and frequencies of models with few modes."""

import numpy as np
import pytest
from scipy import sparse

from nldyn import System, SystemModelError
from nldyn.reduction.model_errors import frequency_error


def test_sparse_matrices_of_a_system():
    found = System.from_matrices(sparse.eye(3), 100.0 * sparse.eye(3), {"x": [1.0, 0.0, 0.0]})
    np.testing.assert_allclose(found.frequencies_hz, 10.0 / (2 * np.pi))


def test_large_sparse_matrices_are_to_be_reduced_first():
    large = sparse.eye_array(501)
    with pytest.raises(SystemModelError, match=r"sparse matrix of 501 rows, .* reduce the comp"):
        System.from_matrices(large, large, {"x": np.eye(501)[0]})


def test_frequencies_of_fewer_modes_than_three():
    exact = np.array([0.0, 10.0, 20.0])
    assert frequency_error(np.array([0.0, 10.0]), exact) == 0.0
    assert frequency_error(np.array([0.0, 11.0]), exact) == pytest.approx(0.1)
    assert frequency_error(np.array([1.0]), exact) == pytest.approx(0.1)
    assert np.isnan(frequency_error(np.zeros(0), exact))
