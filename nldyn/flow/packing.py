"""A system's numbers as the compiled flow takes them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from nldyn.base.arrays import Complex
from nldyn.base.errors import check_types
from nldyn.flow.kernels.layout import FIRST_POWER, StopRow
from nldyn.system.parameters import OF_SPRINGS, OF_STOPS, Parameter, check_exact
from nldyn.system.system import System

_COLUMNS = {name: StopRow._fields.index(name) for name in OF_STOPS}
_EXCITATION = -1


def parameter_tables(
    system: System, parameters: Sequence[Parameter]
) -> tuple[NDArray[np.int64], Complex]:
    """What the kernels need to know of parameters: see `kernels.segments.shoot`.

    Raises
    ------
    SystemModelError
        For a parameter that the system does not have.
    """
    check_types(parameters=(parameters, Sequence))
    for parameter in parameters:
        check_types(**{"parameters: entry": (parameter, Parameter)})
    table = np.zeros((len(parameters), 2), dtype=np.int64)
    drive_by = np.zeros((len(parameters), *system.drive.shape), dtype=complex)
    for row, parameter in enumerate(parameters):
        check_exact(system, parameter)
        name, index = parameter.name, parameter.index
        if name in _COLUMNS:
            table[row] = _COLUMNS[name], index
        elif name in OF_SPRINGS:
            spring = system.springs[index]
            place = [(bond.at, bond.against) for bond in system.bonds]
            bond = len(system.stops) + place.index((spring.at, spring.against))
            table[row] = FIRST_POWER + OF_SPRINGS.index(name), bond
        else:
            table[row] = _EXCITATION, index
            size: dict[str, Any] = {name: 1.0}
            unit = replace(system.excitation[index], **size)
            drive_by[row] = system.drive_of([unit])
    return table, drive_by
