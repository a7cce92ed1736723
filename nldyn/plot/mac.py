"""The modal assurance criterion as a map."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes

from nldyn.base.arrays import Real
from nldyn.base.errors import SystemModelError, check_types
from nldyn.plot.diagram import new_axes

MOST_NUMBERS = 12  # modes on a side up to which the values are written into the cells


def plot_mac(
    mac: Real,
    ax: Axes | None = None,
    *,
    frequencies_hz: Sequence[float] | Real = (),
    other_hz: Sequence[float] | Real = (),
) -> Axes:
    """Draw how much alike modes are: a cell for each pair, white for 0 and dark for 1.

    Parameters
    ----------
    mac : (k, l) array
        Modal assurance criterion, from 0 to 1, as `cms.mac` gives it.
    ax : matplotlib.axes.Axes, optional
        Where to draw; a new figure unless given, which pyplot shows where it is in use.
    frequencies_hz, other_hz : (k,), (l,) array, optional
        Frequencies in Hz to be written beside the modes of the rows and of the columns.

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    SystemModelError
        If the numbers are no matrix of values from 0 to 1.

    Examples
    --------
    >>> import cms
    >>> shapes = [[1.0, 1.0], [1.0, -1.0]]
    >>> ax = plot_mac(cms.mac(shapes, shapes), frequencies_hz=[10.0, 20.0])
    >>> [label.get_text() for label in ax.get_yticklabels()]
    ['1: 10 Hz', '2: 20 Hz']
    """
    check_types(**{"plot_mac: ax": (ax, Axes, None)})
    values = np.asarray(mac, dtype=float)
    if values.ndim != 2 or not values.size or not (values >= -1e-9).all() or (values > 1.001).any():
        raise SystemModelError("plot_mac: mac must be a matrix of values from 0 to 1")
    if ax is None:
        ax = new_axes(6.5, 5.0)
        figure = ax.get_figure(root=True)
        assert figure is not None
        figure.set_layout_engine("compressed")  # the cells are squares
    image = ax.imshow(values, cmap="Blues", vmin=0.0, vmax=1.0)
    rows, columns = values.shape
    ax.set_yticks(range(rows), _labels(rows, frequencies_hz))
    ax.set_xticks(range(columns), _labels(columns, other_hz), rotation=45, ha="right")
    if max(rows, columns) <= MOST_NUMBERS:
        for (i, j), value in np.ndenumerate(values):
            colour = "white" if value > 0.6 else "black"
            ax.text(j, i, f"{value:.2f}", ha="center", va="center", color=colour, fontsize=8)
    ax.set_ylabel("mode")
    ax.set_xlabel("mode of the other")
    assert ax.figure is not None
    ax.figure.colorbar(image, ax=ax, label="MAC")
    return ax


def _labels(count: int, frequencies_hz: Sequence[float] | Real) -> list[str]:
    """Numbers of modes from 1, with their frequencies if these are given."""
    if len(frequencies_hz) != count:
        return [f"{number}" for number in range(1, count + 1)]
    return [f"{number}: {hz:.4g} Hz" for number, hz in enumerate(frequencies_hz, 1)]
