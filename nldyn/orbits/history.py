"""A motion sampled in time, and what other programs make of it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from nldyn.base.arrays import Real
from nldyn.base.optional import optional
from nldyn.base.version import software_version
from nldyn.system.naming import moment_unit

if TYPE_CHECKING:
    import pandas
    import xarray


def told(units: Iterable[str]) -> str:
    """The units of columns that stand in one array, in their order; one if they are alike.

    Examples
    --------
    >>> told(["m", "m"]), told(["m", "rad"]), told([])
    ('m', 'm, rad', '')
    """
    given = list(units)
    return given[0] if len(set(given)) == 1 else ", ".join(given)


@dataclass(frozen=True, eq=False)
class History:
    """A motion sampled in time, from `Orbit.history` or `Motion.history`.

    `nldyn.io.write_history` writes it to a CSV, MAT or UFF file.

    Parameters
    ----------
    time : (k,)
        Time in s from forcing phase zero.
    modal : (k, n)
        Modal displacements q.
    modal_velocity : (k, n)
        Modal velocities.
    displacement : dict of str to (k,)
        Displacement of each interface in m, of a rotation in rad.
    penetration, force : (k, n_stops)
        Penetration (m, negative when open) and contact force (N) of each stop; of a rotation in
        rad and N m.
    units : dict of str to str
        Of the displacements: m, or rad of a rotation.
    stop_units : tuple of str
        Of the penetrations.

    Examples
    --------
    >>> from nldyn import System, Unbalance, solve_orbit
    >>> system = System.from_modal([13.1], {"middle": [0.635]}, modal_damping=0.0142,
    ...     excitation=[Unbalance("middle", 4.92e-6)])
    >>> history = solve_orbit(system, frequency_hz=10.0).history(samples=4)
    >>> list(history.table())
    ['time_s', 'displacement_m[middle]', 'modal[0]', 'modal_velocity[0]']
    """

    time: Real
    modal: Real
    modal_velocity: Real
    displacement: dict[str, Real]
    penetration: Real
    force: Real
    units: Mapping[str, str]
    stop_units: tuple[str, ...]

    def __repr__(self) -> str:
        """One line: samples, duration, interfaces."""
        names = ", ".join(map(repr, self.displacement)) or "no interface"
        return f"<History: {self.time.size} samples up to {self.time[-1]:.4g} s of {names}>"

    @property
    def displacements(self) -> Real:
        """Displacements (k, n_interfaces), in the order of `displacement`."""
        return np.reshape([*self.displacement.values()], (-1, self.time.size)).T

    def table(self) -> dict[str, Real]:
        """Columns of numbers (k,), one row per sample; their units stand in the names.

        Stops and modes are counted from 0.
        """
        columns = {"time_s": self.time}
        columns |= {
            f"displacement_{self.units[name]}[{name}]": u for name, u in self.displacement.items()
        }
        forces = ["n_m" if unit == "rad" else "n" for unit in self.stop_units]
        for name, units, values in (
            ("penetration", self.stop_units, self.penetration),
            ("force", forces, self.force),
        ):
            columns |= {
                f"{name}_{unit}[{i}]": column
                for i, (unit, column) in enumerate(zip(units, values.T, strict=True))
            }
        for name, values in (("modal", self.modal), ("modal_velocity", self.modal_velocity)):
            columns |= {f"{name}[{i}]": column for i, column in enumerate(values.T)}
        return columns

    def to_pandas(self) -> pandas.DataFrame:
        """As `table`, as a DataFrame over ``time_s`` (needs pandas)."""
        return optional("pandas", "to_pandas").DataFrame(self.table()).set_index("time_s")

    def to_xarray(self) -> xarray.Dataset:
        """A Dataset over ``time``, ``interface``, ``stop`` and ``mode`` (needs xarray)."""
        data = {
            "displacement": (
                ("time", "interface"),
                self.displacements,
                {"units": told(self.units.values())},
            ),
            "penetration": (("time", "stop"), self.penetration, {"units": told(self.stop_units)}),
            "force": (
                ("time", "stop"),
                self.force,
                {"units": told(map(moment_unit, self.stop_units))},
            ),
            "modal": (("time", "mode"), self.modal, {"units": "m kg^0.5"}),
            "modal_velocity": (("time", "mode"), self.modal_velocity, {"units": "m kg^0.5/s"}),
        }
        coords = {
            "time": ("time", self.time, {"units": "s"}),
            "interface": [*self.displacement],
        }
        about = {"software": f"nldyn {software_version()}"}
        made: xarray.Dataset = optional("xarray", "to_xarray").Dataset(data, coords, about)
        return made
