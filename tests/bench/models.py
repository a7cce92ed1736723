"""The orbits of the benchmark: a system, a state and a frequency, with what is known of them.

They are read from ``data/reference.json``, which `bench.reference` computes.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from functools import cached_property
from importlib import resources
from typing import Any

import numpy as np

from nldyn.base.arrays import Real
from nldyn.system.loads import Unbalance
from nldyn.system.stop import Stop
from nldyn.system.system import System

MODELS = ("one_dof", "two_dof", "four_dof", "sixteen_dof")


@dataclass(frozen=True)
class Sensitivities:
    """Where a state goes in one period, and how that depends on the start and on ω.

    Parameters
    ----------
    state : (2n,)
        Modal displacements and velocities at the end.
    monodromy : (2n, 2n)
        Derivative of the end with respect to the start.
    d_omega : (2n,)
        Derivative of the end with respect to ω, from phase 0 to phase 2π.
    """

    state: Real
    monodromy: Real
    d_omega: Real


@dataclass(frozen=True)
class Case:
    """One period of a system from a given state, and what it gives.

    Parameters
    ----------
    name : str
        Name in tables.
    system : System
        One Hertz stop, one rotating unbalance, all damping in `System.damping`.
    omega : float
        Excitation frequency in rad/s.
    start : (2n,)
        Modal displacements and velocities at phase zero.
    exact : Sensitivities
        The reference, rounded to double precision.
    digits : float
        Digits to which two computations of the reference agree.
    """

    name: str
    system: System
    omega: float
    start: Real
    exact: Sensitivities
    digits: float

    @property
    def size(self) -> int:
        """Number of degrees of freedom n."""
        return self.system.size

    @cached_property
    def scale(self) -> Real:
        """Units of the state (2n,): with them its length is the square root of the energy."""
        return np.concatenate([1.0 / self.system.natural_frequencies, np.ones(self.size)])


@dataclass(frozen=True)
class Flip:
    """A flip on the branch of a case.

    Parameters
    ----------
    case : Case
        The orbit next to it, good to rounding.
    omega : float
        Its exact frequency in rad/s.
    inverse : (2n + 1, 2n + 1)
        Approximate inverse Jacobian of ``(end - start, det(Φ + 1))`` with respect to (start, ω).
    """

    case: Case
    omega: float
    inverse: Real


def stored() -> dict[str, Any]:
    """The file of reference values."""
    text = resources.files("bench").joinpath("data/reference.json").read_text("utf-8")
    return dict(json.loads(text))


def to_system(table: dict[str, Any]) -> System:
    """The system of a stored case."""
    return System(
        np.array(table["natural_frequencies"]),
        np.array(table["damping"]),
        {"middle": np.array(table["participation"])},
        (Stop("middle", table["stop_stiffness"], gap=table["gap"]),),
        (),
        (Unbalance("middle", table["mass_times_radius"]),),
    )


def to_table(system: System) -> dict[str, Any]:
    """What `to_system` needs to make a system again, to the last bit."""
    (stop,), (source,) = system.elastic_stops.values(), system.excitation
    assert isinstance(source, Unbalance)
    return {
        "natural_frequencies": system.natural_frequencies.tolist(),
        "damping": system.total_damping.tolist(),
        "participation": system.participation["middle"].tolist(),
        "stop_stiffness": stop.stiffness,
        "gap": stop.gap,
        "mass_times_radius": source.mass_times_radius,
    }


def to_case(name: str, table: dict[str, Any]) -> Case:
    """A stored case."""
    exact = Sensitivities(*(_numbers(table[k]) for k in ("state", "monodromy", "d_omega")))
    start = np.array(table["start"])
    system = to_system(table["system"])
    return Case(name, system, table["omega"], start, exact, table["digits"])


def load_case(name: str) -> Case:
    """One of `MODELS` with its orbit next to a flip."""
    return to_case(name, stored()["models"][name])


def load_flip(name: str) -> Flip:
    """The flip of one of `MODELS`."""
    table = stored()["models"][name]
    return Flip(to_case(name, table), float(table["flip_omega"]), np.array(table["flip_inverse"]))


def load_orbit_start(name: str) -> Real:
    """State at phase zero of the periodic orbit at the frequency of a case."""
    return _numbers(stored()["models"][name]["orbit_start"])


def load_grazing() -> dict[float, Case]:
    """Cases of the 1-DOF model that touch the stop, by relative depth."""
    tables = stored()["grazing"]
    return {float(depth): to_case(f"depth {depth}", table) for depth, table in tables.items()}


def _numbers(text: Any) -> Real:
    return np.array(text, dtype=str).astype(float)
