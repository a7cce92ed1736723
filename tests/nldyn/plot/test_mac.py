"""The map of the modal assurance criterion shows the values of all pairs."""

import numpy as np
import pytest

import cms
from nldyn import SystemModelError
from nldyn.plot import plot_mac


def test_cells_hold_the_values():
    """Sines are orthogonal, and a mixture of two is half like each."""
    x = np.arange(1, 40) / 40
    sines = np.sin(np.pi * np.outer(x, [1, 2, 3]))
    others = np.column_stack([sines[:, 0] + sines[:, 1], sines[:, 2]])
    ax = plot_mac(cms.mac(sines, others), frequencies_hz=[1.0, 4.0, 9.0])
    drawn = np.asarray(ax.images[0].get_array())
    assert drawn == pytest.approx(np.array([[0.5, 0], [0.5, 0], [0, 1]]), abs=1e-12)
    assert [text.get_text() for text in ax.texts][:2] == ["0.50", "0.00"]
    assert [text.get_text() for text in ax.get_yticklabels()] == ["1: 1 Hz", "2: 4 Hz", "3: 9 Hz"]
    assert [text.get_text() for text in ax.get_xticklabels()] == ["1", "2"]


@pytest.mark.parametrize("wrong", [[1.0, 0.5], [[2.0]], [[np.nan]], [[]]])
def test_other_numbers_are_refused(wrong):
    with pytest.raises(SystemModelError, match="a matrix of values from 0 to 1"):
        plot_mac(wrong)
