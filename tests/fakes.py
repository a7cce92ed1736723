"""Orbits, branches and diagrams that look computed."""

from dataclasses import dataclass, field

import numpy as np
import pytest

from nldyn.bifurcations.normal_form_coefficients import Estimate
from nldyn.bifurcations.normal_forms import NormalForm
from nldyn.branches.endings import StopReason
from nldyn.orbits.multipliers import Stability
from nldyn.report import results
from nldyn.system.chart import THE_FREQUENCY
from nldyn.system.parameters import Parameter

FREQUENCY = Parameter("frequency_hz")
SURE = Stability(0.5 + 0.2j, -0.62, 1e-7)


@dataclass(frozen=True)
class FakeSystem:
    interfaces: tuple[str, ...] = ("middle",)
    stops: tuple[object, ...] = ()
    areas: dict[str, tuple[int, ...]] = field(default_factory=dict)
    sliders: tuple[object, ...] = ()
    rubbing: tuple[object, ...] = ()
    frequencies_hz: tuple[float, ...] = ()

    def unit(self, interface):
        return "m"


@dataclass(frozen=True)
class FakeOrbit:
    frequency_hz: float
    max_abs_displacement: float
    period: int = 1
    stable: bool = True
    impacts: int = 1
    max_penetration: float = 1e-7
    error: float = 1e-14
    liouville_error: float = 1e-12
    largest_multiplier: complex = 0.5 + 0.2j
    stability: Stability = SURE
    observe: str = "middle"
    system: FakeSystem = FakeSystem()

    def deepest_penetration(self, unit):
        return self.max_penetration


@dataclass(frozen=True)
class FakeNode:
    orbit: FakeOrbit
    arclength: float
    parameter: Parameter = FREQUENCY

    @property
    def value(self):
        return self.orbit.frequency_hz


@dataclass(frozen=True)
class FakeSpecialPoint:
    kind: str
    point: FakeNode

    @property
    def orbit(self):
        return self.point.orbit

    @property
    def frequency_hz(self):
        return self.point.orbit.frequency_hz

    @property
    def value(self):
        return self.point.value

    @property
    def form(self):
        if self.kind == "GR":
            return NormalForm("new contact", "A touch, for example.")
        numbers = Estimate(1.25, 1e-3), Estimate(-0.5, 1e-4)
        return NormalForm("supercritical flip", "A flip, for example.", *numbers)


@dataclass(frozen=True)
class FakeBranch:
    name: str
    period: int
    nodes: list
    special_points: list
    stop_reason: str = "end of range"
    stop_reasons: tuple = (StopReason("end of range"),) * 2

    @property
    def points(self):
        return [node.orbit for node in self.nodes]

    @property
    def parameter(self):
        return Parameter("frequency_hz")

    @property
    def frequency_hz(self):
        return np.array([orbit.frequency_hz for orbit in self.points])

    @property
    def max_abs_displacement(self):
        return np.array([orbit.max_abs_displacement for orbit in self.points])

    @property
    def stable(self):
        return np.array([orbit.stable for orbit in self.points])


@dataclass(frozen=True)
class FakeDiagram:
    branches: list
    notes: tuple = ()
    limits: tuple = (5.0, 90.0)
    observe: str = "middle"
    parameter: Parameter = THE_FREQUENCY
    frequency_hz: None = None

    def of_period(self, period):
        return [branch for branch in self.branches if branch.period == period]


def resonance(period=1, low=5.0, high=90.0, count=600, unstable=(30.0, 40.0)):
    peak = 25.3 * period

    def node(hz):
        y = 1e-4 / np.hypot(1 - (hz / peak) ** 2, 0.05 * hz / peak)
        return FakeNode(FakeOrbit(hz, y, period, unstable[0] > hz or hz > unstable[1]), hz)

    places = (("PD", unstable[0]), ("PD", unstable[1]), ("LP", high - 10), ("GR", 60.0))
    special = [FakeSpecialPoint(kind, node(hz)) for kind, hz in places]
    nodes = [node(hz) for hz in np.linspace(low, high, count).tolist()]
    return FakeBranch(f"p{period}", period, nodes, special)


def diagram():
    return FakeDiagram([resonance(1), resonance(2, 30.0, 70.0, 300), resonance(3, 60.0, 90.0, 200)])


@pytest.fixture(autouse=True)
def fakes_know_their_normal_form(monkeypatch):
    """Normal forms of made-up special points, which have no flow map, are made up too."""
    real = results.normal_form

    def either(special, others=()):
        return special.form if isinstance(special, FakeSpecialPoint) else real(special, others)

    monkeypatch.setattr(results, "normal_form", either)


@pytest.fixture(autouse=True)
def fakes_are_saved(monkeypatch):
    """Made-up diagrams have no orbits that a file could hold or a page could show."""
    real, page = results.save, results.write_page

    def shown(found, path, *more, **options):
        made_up = isinstance(found, FakeDiagram)
        return path.write_text("page") if made_up else page(found, path, *more, **options)

    monkeypatch.setattr(results, "write_page", shown)

    def either(found, path):
        made_up = isinstance(found, FakeDiagram)
        return path.write_bytes(b"branches") if made_up else real(found, path)

    monkeypatch.setattr(results, "save", either)
