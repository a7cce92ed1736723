"""Orbits as tables: columns of numbers with their units in their names."""

from __future__ import annotations

import cmath
import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray

from nldyn.base.optional import optional
from nldyn.base.version import software_version
from nldyn.bifurcations.point import BranchNode, SpecialPoint
from nldyn.orbits.orbit import Orbit
from nldyn.system.chart import parameter_name
from nldyn.system.parameters import Parameter
from nldyn.system.system import System

if TYPE_CHECKING:
    import pandas
    import xarray

Part = Literal["points", "special_points", "requested"]

UNITS = {
    "period": "1",
    "frequency_hz": "Hz",
    "max_abs_displacement_m": "m",
    "max_abs_displacement_rad": "rad",
    "max_penetration_m": "m",
    "max_penetration_rad": "rad",
    "impacts": "1",
    "friction_loss_j": "J",
    "stuck_share": "1",
    "stable": "1",
    "largest_multiplier": "1",
    "multiplier_angle_deg": "deg",
    "relative_uncertainty": "1",
    "liouville_error": "1",
    "error": "1",
    "arclength": "1",
    "frequency_error": "1",
}
LAST_DIGIT = 1e-14  # relative difference of two frequencies that were meant to be one


def orbit_columns(
    orbits: Sequence[Orbit], known_hz: Sequence[float] = ()
) -> dict[str, NDArray[Any]]:
    """Give what is reported of orbits as columns.

    Parameters
    ----------
    orbits : sequence of Orbit
        One for each row.
    known_hz : sequence of float
        Frequencies that orbits may meet exactly, see `at_known`.

    Returns
    -------
    dict of str to (n,) array
        Their units are in `UNITS`: displacements of rotations are in rad, and so are penetrations
        of stops there, in a column of their own. Where there is dry friction, there are the energy
        that all sliders dissipate in a period, and the mean of their shares of it that they stick.
    """
    columns: dict[str, list[Any]] = {
        "period": [orbit.period for orbit in orbits],
        "frequency_hz": [at_known(orbit.frequency_hz, known_hz) for orbit in orbits],
        **_sizes(orbits),
        "impacts": [orbit.impacts for orbit in orbits],
        **_friction(orbits),
        "stable": [orbit.stable for orbit in orbits],
        "largest_multiplier": [abs(orbit.largest_multiplier) for orbit in orbits],
        "multiplier_angle_deg": [
            math.degrees(cmath.phase(orbit.largest_multiplier)) for orbit in orbits
        ],
        "relative_uncertainty": [orbit.stability.uncertainty for orbit in orbits],
        "liouville_error": [orbit.liouville_error for orbit in orbits],
        "error": [orbit.error for orbit in orbits],
    }
    kinds: dict[str, type] = {"period": int, "impacts": int, "stable": bool}
    return {name: np.array(list_, dtype=kinds.get(name, float)) for name, list_ in columns.items()}


def _sizes(orbits: Sequence[Orbit]) -> dict[str, list[float]]:
    """The columns of displacements and penetrations."""
    names = size_names(orbits[0].system, orbits[0].observe) if orbits else size_names()
    displacement, *penetrations = names
    deepest = {name: name.rsplit("_", 1)[1] for name in penetrations}
    return {
        displacement: [orbit.max_abs_displacement for orbit in orbits],
        **{
            name: [orbit.deepest_penetration(unit) for orbit in orbits]
            for name, unit in deepest.items()
        },
    }


def _friction(orbits: Sequence[Orbit]) -> dict[str, list[float]]:
    """The columns of dry friction, if there is any."""
    names = friction_names(orbits[0].system) if orbits else ()
    if not names:
        return {}
    measures = [orbit.friction for orbit in orbits]
    losses = [math.fsum(each.loss for each in found) for found in measures]
    shares = [math.fsum(each.stuck for each in found) / len(found) for found in measures]
    return dict(zip(names, (losses, shares), strict=True))


def friction_names(system: System | None) -> tuple[str, ...]:
    """Names of the columns of dry friction of a system, if it has any."""
    return ("friction_loss_j", "stuck_share") if system and system.rubbing else ()


def size_names(system: System | None = None, observe: str = "") -> tuple[str, ...]:
    """Names of the columns of displacements and penetrations of a system, with their units.

    Examples
    --------
    >>> size_names()
    ('max_abs_displacement_m', 'max_penetration_m')
    """
    units = {system.unit(stop.at) for stop in system.stops} if system else set()
    return (
        displacement_name(system, observe),
        *(f"max_penetration_{unit}" for unit in sorted(units or {"m"})),
    )


def displacement_name(system: System | None, observe: str) -> str:
    """Name of the column of the largest displacements of an interface."""
    return f"max_abs_displacement_{system.unit(observe) if system else 'm'}"


def at_known(frequency_hz: float, known_hz: Sequence[float]) -> float:
    """Give the known frequency that a frequency meets, else the frequency itself.

    Orbits keep the logarithm of their frequency, so that 90 Hz come back as 89.99999999999999.

    Examples
    --------
    >>> at_known(89.99999999999999, (5.0, 90.0)), at_known(89.999, (5.0, 90.0))
    (90.0, 89.999)
    """
    met = (known for known in known_hz if math.isclose(frequency_hz, known, rel_tol=LAST_DIGIT))
    return float(next(met, frequency_hz))


def point_columns(
    points: Sequence[BranchNode], known_hz: Sequence[float] = ()
) -> dict[str, NDArray[Any]]:
    """Give the columns of `orbit_columns` and the arclength of points of a branch."""
    columns = orbit_columns([point.orbit for point in points], known_hz)
    columns["arclength"] = np.array([point.arclength for point in points], dtype=float)
    return columns


def special_columns(
    special: Sequence[SpecialPoint], columns: dict[str, NDArray[Any]], parameter: Parameter
) -> dict[str, NDArray[Any]]:
    """Give the columns of special points: their type first, and the error of their parameter."""
    name = parameter_name(parameter).removesuffix("_hz")
    errors = np.array([point.error for point in special], dtype=float)
    return {
        "type": np.array([point.kind for point in special], dtype=str),
        **columns,
        f"{name}_error": errors,
    }


def to_pandas(columns: Mapping[str, NDArray[Any]], about: Mapping[str, Any]) -> pandas.DataFrame:
    """Give columns as a DataFrame, with what they are about as its attributes."""
    frame = optional("pandas", "to_pandas").DataFrame(columns)
    frame.index.name = "point"
    frame.attrs = {**about, "software": f"nldyn {software_version()}"}
    return frame


def to_xarray(
    columns: Mapping[str, NDArray[Any]],
    multipliers: NDArray[np.complex128],
    about: Mapping[str, Any],
) -> xarray.Dataset:
    """Give columns and multipliers (n, 2n_modes) as a Dataset over ``point``."""
    data = {
        name: ("point", column, {"units": UNITS[name]} if name in UNITS else {})
        for name, column in columns.items()
    }
    made: xarray.Dataset = optional("xarray", "to_xarray").Dataset(
        {**data, "multipliers": (("point", "multiplier"), multipliers, {"units": "1"})},
        coords={"point": np.arange(len(multipliers))},
        attrs={**about, "software": f"nldyn {software_version()}"},
    )
    return made
