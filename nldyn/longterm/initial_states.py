"""From displacements and velocities at interfaces to the modal state of a system."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from nldyn.base.arrays import Real
from nldyn.base.errors import SystemModelError, check_types, is_finite, shown
from nldyn.system.equilibrium import rest_positions
from nldyn.system.system import System

SAME = 1e-9  # relative difference of values that are met


def state_with(
    system: System,
    displacements: Mapping[str, float] | None = None,
    velocities: Mapping[str, float] | None = None,
    *,
    at_rest: bool = False,
) -> Real:
    """The modal state of a system whose interfaces have given displacements and velocities.

    Of all such states it is the one of least energy: displacements as by static forces at these
    interfaces, velocities as by impulses there. Where every coordinate of a model is an interface
    with given values it is that state itself.

    Parameters
    ----------
    system : System
        Its mode shapes and stiffness count, without its stops.
    displacements, velocities : mapping of str to float, optional
        By interface, in m and m/s (rad and rad/s of rotations), from the undeformed structure.
        All else follows.
    at_rest : bool
        Begin where the structure rests under its constant loads, its stops closed or not: what is
        given is added to that. It has one place to rest then.

    Returns
    -------
    (2n,) array
        Modal displacements and velocities, for ``start`` of `nldyn.simulate` and others.

    Raises
    ------
    SystemModelError
        For an unknown interface, a value that is no finite number, values that no motion of the
        modes has, or several places to rest.

    Examples
    --------
    >>> from nldyn import System
    >>> system = System.from_matrices([[2.0]], [[8.0]], {"tip": [1.0]})
    >>> state = state_with(system, {"tip": 0.3})
    >>> round(float(state[:1] @ system.participation["tip"]), 12)
    0.3
    """
    check_types(system=(system, System))
    stiffness = np.diag(system.natural_frequencies**2) + system.spring_stiffness
    q = _least(system, "displacements", displacements, stiffness)
    v = _least(system, "velocities", velocities, np.eye(system.size))
    if at_rest:
        places = rest_positions(system)
        if len(places) > 1:
            raise SystemModelError(f"at_rest: the structure has {len(places)} places to rest")
        q = q + places[0]
    return np.concatenate([q, v])


def _least(system: System, called: str, given: Mapping[str, float] | None, weight: Real) -> Real:
    """The vector x (n,) of least x W x with given values at interfaces, by its multipliers."""
    given = {} if given is None else given
    check_types(**{called: (given, Mapping)})
    for name, value in given.items():
        if name not in system.participation:
            known = ", ".join(system.participation)
            raise SystemModelError(f"{called}: unknown interface '{name}'; there are: {known}")
        if not is_finite(value):
            fault = f"that of '{name}' must be a number, got {shown(value)}"
            raise SystemModelError(f"{called}: {fault}")
    n = system.size
    if not given:
        return np.zeros(n)
    rows = np.array([system.participation[name] for name in given])
    wanted = np.array(list(given.values()), dtype=float)
    scale = float(np.abs(weight).max()) or 1.0
    size = np.linalg.norm(rows, axis=1)
    if not size.all():
        still = list(given)[int(np.argmin(size))]
        raise SystemModelError(f"{called}: no mode moves interface '{still}'")
    unit = rows / size[:, None]
    system_of = np.block([[weight / scale, unit.T], [unit, np.zeros((len(given),) * 2)]])
    x = np.linalg.lstsq(system_of, np.concatenate([np.zeros(n), wanted / size]), rcond=None)[0][:n]
    if np.abs(rows @ x - wanted).max() > SAME * np.abs(wanted).max(initial=0.0):
        names = ", ".join(f"'{name}'" for name in given)
        raise SystemModelError(f"{called}: no motion of {n} modes has these values at {names}")
    return np.asarray(x)
