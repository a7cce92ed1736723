"""What areas of contact do in a motion: forces, pressures, and how much of them is closed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from nldyn.base.arrays import Real
from nldyn.system.stop import Stop


@dataclass(frozen=True, eq=False)
class AreaMeasures:
    """What an area of contact does in a period of an orbit, from samples at equal times.

    Parameters
    ----------
    name : str
        Of the area.
    peak_force, mean_force : float
        Largest and mean force in N of all its points together.
    touched : float
        Share of the area, by the weights of the points, that touches at some time.
    closed : float
        Share of area and time that is closed.
    pressure, mean_pressure : (k,)
        Largest and mean pressure at each point: force by its weight, in N/m² or N/m; N node by
        node.
    points : tuple of str
        Interfaces of the points.

    Examples
    --------
    >>> from nldyn import HarmonicForce, System, contact_area, solve_orbit
    >>> system = System.from_modal([1.0], {"a": [1.0], "b": [0.5]}, modal_damping=0.1,
    ...     stops=contact_area("pads", ["a", "b"], 40.0, gap=[0.1, 9.0]),
    ...     excitation=[HarmonicForce("a", 10.0)])
    >>> (pads,) = solve_orbit(system, 0.7).areas
    >>> pads.touched, bool(pads.pressure[0] > 0.0), float(pads.pressure[1])
    (0.5, True, 0.0)
    """

    name: str
    peak_force: float
    mean_force: float
    touched: float
    closed: float
    pressure: Real
    mean_pressure: Real
    points: tuple[str, ...]

    def __repr__(self) -> str:
        """One line: where, how hard, and how much of it."""
        return (
            f"<AreaMeasures of '{self.name}': {self.peak_force:.4g} N at most, "
            f"{100.0 * self.touched:.3g} % of it touches, {100.0 * self.closed:.3g} % on average>"
        )


def area_measures(name: str, stops: Sequence[Stop], force: Real) -> AreaMeasures:
    """Measures of an area from the forces (m, k) at its points, at m equal steps of a period."""
    weights = np.array([stop.share for stop in stops])
    total = force.sum(axis=1)
    return AreaMeasures(
        name,
        float(total.max()),
        float(total.mean()),
        float(weights @ np.any(force > 0.0, axis=0) / weights.sum()),
        float((np.mean(force > 0.0, axis=0) @ weights) / weights.sum()),
        force.max(axis=0) / weights,
        force.mean(axis=0) / weights,
        tuple(stop.at for stop in stops),
    )
