"""A motion sampled in time, and what other programs make of it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from nldyn.base.arrays import Real
from nldyn.base.optional import optional
from nldyn.base.version import software_version

if TYPE_CHECKING:
    import pandas
    import xarray


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
        Displacement of each interface in m.
    penetration, force : (k, n_stops)
        Penetration (m, negative when open) and contact force (N) of each stop.

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

    def __repr__(self) -> str:
        """One line: samples, duration, interfaces."""
        names = ", ".join(map(repr, self.displacement)) or "no interface"
        return f"<History: {self.time.size} samples up to {self.time[-1]:.4g} s of {names}>"

    @property
    def displacements(self) -> Real:
        """Displacements (k, n_interfaces) in m, in the order of `displacement`."""
        return np.reshape([*self.displacement.values()], (-1, self.time.size)).T

    def table(self) -> dict[str, Real]:
        """Columns of numbers (k,), one row per sample; their units stand in the names.

        Stops and modes are counted from 0.
        """
        columns = {"time_s": self.time}
        columns |= {f"displacement_m[{name}]": u for name, u in self.displacement.items()}
        for name, values in {
            "penetration_m": self.penetration,
            "force_n": self.force,
            "modal": self.modal,
            "modal_velocity": self.modal_velocity,
        }.items():
            columns |= {f"{name}[{i}]": column for i, column in enumerate(values.T)}
        return columns

    def to_pandas(self) -> pandas.DataFrame:
        """As `table`, as a DataFrame over ``time_s`` (needs pandas)."""
        return optional("pandas", "to_pandas").DataFrame(self.table()).set_index("time_s")

    def to_xarray(self) -> xarray.Dataset:
        """A Dataset over ``time``, ``interface``, ``stop`` and ``mode`` (needs xarray)."""
        data = {
            "displacement": (("time", "interface"), self.displacements, {"units": "m"}),
            "penetration": (("time", "stop"), self.penetration, {"units": "m"}),
            "force": (("time", "stop"), self.force, {"units": "N"}),
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
