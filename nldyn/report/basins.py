"""Tables and picture of basins of attraction."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

from nldyn.longterm.basin_shares import BasinsOver
from nldyn.longterm.basins import Basins
from nldyn.longterm.neighbourhoods import UNDECIDED
from nldyn.plot.basin_shares import plot_basins_over
from nldyn.plot.diagram import file_axes, save_figure
from nldyn.plot.longterm import plot_basins
from nldyn.report.results import if_known, write_table

Located = tuple[tuple[float, ...], Basins]  # with the value of a parameter, if one changes
COLUMNS = (
    "attractor", "name", "share", "share_uncertainty", "period", "impacts_per_period", "interface",
    "min_displacement_{unit}", "max_displacement_{unit}", "largest_exponent_per_s", "integrity",
    "distance", "evidence",
)  # fmt: skip


def write_basins(found: Basins | BasinsOver, folder: Path, title: str = "") -> None:
    """Write ``attractors.csv``, ``basins.csv``, ``basins.png`` and ``.svg``.

    Over a parameter the tables begin with its value, and the picture shows the shares.
    """
    first: list[str] = []
    maps: list[Located] = []
    if isinstance(found, BasinsOver):
        first = [found.column]
        maps = [((v,), each) for v, each in zip(found.values, found.maps, strict=True)]
        ax = plot_basins_over(found, file_axes())
    else:
        maps = [((), found)]
        ax = plot_basins(found, file_axes(7.0, 5.5))
    _, one = maps[0]
    names = [*first, *(name.format(unit=one.unit) for name in COLUMNS)]
    write_table(folder / "attractors.csv", names, _rows_at(maps, attractor_rows))
    columns = (*first, one.plane.x_label, one.plane.y_label, "attractor", "phase", "periods")
    write_table(folder / "basins.csv", columns, _rows_at(maps, cell_rows))
    if title:
        ax.set_title(f"{title}\n{ax.get_title()}")
    save_figure(ax, folder / "basins")


def _rows_at(
    maps: Sequence[Located], rows_of: Callable[[Basins], Iterator[tuple[object, ...]]]
) -> Iterator[tuple[object, ...]]:
    """Give the rows of several maps, each with the value of the parameter if there is one."""
    for value, each in maps:
        for row in rows_of(each):
            yield (*value, *row)


def attractor_rows(found: Basins) -> Iterator[tuple[object, ...]]:
    """Give the rows of ``attractors.csv``; the period is empty unless it is periodic."""
    for basin in found.basins:
        attractor = basin.attractor
        values = (
            *attractor.span, float(attractor.largest_exponent[0]),
            basin.integrity, basin.distance,
        )  # fmt: skip
        yield (
            basin.number, attractor.name, basin.share, basin.uncertainty, attractor.period or None,
            if_known(attractor.impact_rate), attractor.interface, *map(if_known, values),
            attractor.evidence,
        )  # fmt: skip


def cell_rows(found: Basins) -> Iterator[tuple[object, ...]]:
    """Give the rows of ``basins.csv``: attractors count from 1, 0 is undecided, -1 impossible."""
    ny, nx = found.labels.shape
    x, y = found.plane.axes((ny, nx))
    for i in range(ny):
        cells = (found.labels[i] - UNDECIDED, found.phases[i], found.periods[i])
        for column, *cell in zip(x.tolist(), *(each.tolist() for each in cells), strict=True):
            yield (column, float(y[i]), *cell)
