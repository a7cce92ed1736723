"""The modes of a component that may matter in a setting, by its linear response alone."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

import cms
from nldyn.base.arrays import Real
from nldyn.base.errors import SystemModelError
from nldyn.reduction.load_case import LoadCase
from nldyn.system.chart import Chart, checked_parameter, with_value
from nldyn.system.contact_law import duration_factor
from nldyn.system.round_stop import RoundStop
from nldyn.system.stop import Stop
from nldyn.system.system import AnyDamper, AnySpring, System, ends_of

INVISIBLE = 1e-6
MOST_MODES = 60
PULSE = 1.5  # a half sine of duration T has its first spectral zero at 1.5 / T
BEYOND = 2.0
ENOUGH = 1.1  # times the cutoff: modes up to there need not be computed anew


@dataclass(frozen=True, eq=False)
class Candidates:
    """A component reduced to the modes that may matter in a setting, and to more.

    Parameters
    ----------
    whole : cms.ReducedModel
        All modes up to twice the cut-off.
    seen : list of int
        Numbers, from 1, of those that an interface in use sees.
    cutoff_hz : float
        Up to where modes may matter: the larger of the excitation's highest frequency and 1.5
        over the shortest contact.
    contact_s : float
        Shortest contact expected, in s; infinite without a stop.
    """

    whole: cms.ReducedModel
    seen: list[int]
    cutoff_hz: float
    contact_s: float

    def __repr__(self) -> str:
        return f"<Candidates: {len(self.numbers)} modes up to {self.cutoff_hz:.4g} Hz>"

    @property
    def numbers(self) -> list[int]:
        """Numbers of the modes seen up to the cut-off."""
        return [n for n in self.seen if self.whole.frequencies_hz[n - 1] <= self.cutoff_hz]

    def reduced(self) -> cms.ReducedModel:
        """The model with these modes."""
        return cms.keep_modes(self.whole, self.numbers or self.seen)


def candidate_modes(component: cms.ComponentLike, setting: LoadCase) -> Candidates:
    """The modes that may matter in a setting, see the notes of `nldyn.select_modes`.

    Raises
    ------
    SystemModelError
        If they are too many, or if the component has no interface for something.
    cms.ReductionError
        As `cms.reduce`.
    """
    first = cms.reduce(component, cutoff_hz=BEYOND * setting.range_hz[1])
    contact = shortest_contact(setting, first)
    cutoff = max(setting.range_hz[1], PULSE / contact)
    whole = first
    for _ in range(8):
        whole = cms.reduce(component, cutoff_hz=BEYOND * cutoff)
        contact = shortest_contact(setting, cms.keep_modes(whole, below(whole, cutoff)))
        longer = max(setting.range_hz[1], PULSE / contact)
        if longer <= ENOUGH * cutoff or whole.modes > MOST_MODES:
            break
        cutoff = longer
    seen = visible(whole, setting)
    if len(seen) > MOST_MODES:
        raise SystemModelError(
            f"{len(seen)} modes up to {BEYOND * cutoff:.4g} Hz may matter, more than {MOST_MODES}; "
            "reduce by hand"
        )
    return Candidates(whole, seen, cutoff, contact)


def contact_duration(stop: Stop | RoundStop, mass: float, speed: float) -> float:
    r"""Duration in s of the impact of a free mass on a stop without loss.

    .. math:: T = \frac{2\delta}{v}\int_0^1\frac{dx}{\sqrt{1 - x^{p+1}}}, \qquad
              \delta = \left(\frac{(p + 1) m v^2}{2k}\right)^{1/(p+1)}

    Parameters
    ----------
    stop : Stop
        With stiffness k and exponent p.
    mass, speed : float
        In kg and m/s.

    References
    ----------
    K. L. Johnson (1985), *Contact Mechanics*, eq. 11.24: :math:`T = 2.94\,\delta/v` for p = 1.5.

    Examples
    --------
    >>> t = contact_duration(Stop("middle", 5.17e9), 2.48, 0.05)
    >>> depth = (1.25 * 2.48 * 0.05**2 / 5.17e9) ** 0.4
    >>> round(t * 0.05 / depth, 3)
    2.943
    """
    power = stop.exponent + 1.0
    depth = (power * mass * speed**2 / (2.0 * stop.stiffness)) ** (1.0 / power)
    return duration_factor(stop.exponent) * float(depth) / speed


def in_use(model: cms.ReducedModel, setting: LoadCase) -> Real:
    """Participations (m, r) of the interfaces where something acts or is observed."""
    pairs: tuple[Stop | RoundStop | AnyDamper | AnySpring, ...] = (
        *setting.stops,
        *setting.dampers,
        *setting.springs,
    )
    names = {name for each in (*pairs, *setting.excitation) for _, name in ends_of(each)}
    names.add(setting.observe or model.interfaces[0])
    return np.array([model.participation[name] for name in model.interfaces if name in names])


def visible(model: cms.ReducedModel, setting: LoadCase) -> list[int]:
    """Numbers of the modes that an interface in use sees, and of all rigid-body modes."""
    rows = np.abs(in_use(model, setting))
    seen = np.any(rows > INVISIBLE * rows.max(axis=1, keepdims=True), axis=0)
    seen |= model.frequencies_hz == 0.0
    return [int(i) + 1 for i in np.flatnonzero(seen[: model.modes])]


def below(model: cms.ReducedModel, cutoff_hz: float) -> list[int]:
    """Numbers of the modes up to a frequency."""
    return [i + 1 for i in range(model.modes) if model.frequencies_hz[i] <= cutoff_hz]


def share(model: cms.ReducedModel, setting: LoadCase, number: int) -> float:
    """How much an interface in use sees a mode, relative to the one it sees best."""
    rows = np.abs(in_use(model, setting)[:, : model.modes])
    return float(np.max(rows[:, number - 1] / rows.max(axis=1)))


def shortest_contact(setting: LoadCase, model: cms.ReducedModel) -> float:
    """Duration in s of the shortest contact to be expected; infinite without a stop.

    Where a parameter changes, it is looked for at both of its limits and halfway.
    """
    systems = [setting.system(model)]
    if setting.parameter is not None:
        chosen = checked_parameter(systems[0], setting.parameter)
        values = Chart.of(chosen, setting.limits).spread(3)
        systems = [with_value(systems[0], chosen, value) for value in values]
    return min(_shortest_in(system, setting.range_hz) for system in systems)


def _shortest_in(system: System, range_hz: tuple[float, float]) -> float:
    """The same of a system, over a range of excitation frequencies."""
    omegas = 2.0 * np.pi * np.linspace(*range_hz, 200 if range_hz[0] < range_hz[1] else 1)
    shortest = math.inf
    for stop in system.elastic_stops.values():
        for c in system.stop_vectors(stop):
            row = system.displacement_row(c)
            speed = max(_fastest(system, row, float(w)) for w in omegas)
            if speed > 0.0:
                shortest = min(shortest, contact_duration(stop, 1.0 / float(c @ c), speed))
    return shortest


def _fastest(system: System, row: Real, omega: float) -> float:
    """Bound of the speed of a displacement ``row @ z`` in the linear response at ω (rad/s)."""
    orders, amplitudes = system.response(omega).harmonics(omega)
    return float(omega * orders @ np.abs(amplitudes @ row))
