"""Tables of what moves a structure."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, Tag, model_validator

from nldyn.scene.schema.table import Frequency, Number, Positive, Table, by_key
from nldyn.system.loads import (
    LARGEST_PHASE,
    MOST_HARMONIC,
    BaseMotion,
    ConstantForce,
    HarmonicForce,
    Unbalance,
)


class ExcitationTable(Table):
    """``[[excitation]]``: what moves the structure, by its kind."""

    kind: Literal["unbalance", "harmonic", "constant", "measured", "weight", "base"]
    """One of those below."""

    @property
    def load(self) -> str | None:
        """Name of the load vector that a mesh must have for it; None if it needs none."""
        return None

    @property
    def periodic(self) -> bool:
        """Whether it has the period of the excitation."""
        return True


class PlacedTable(ExcitationTable):
    """What acts at one place."""

    at: str
    """Interface, or a name in `loads` of `[matrices]` or `[modal]`."""


class SwingingTable(ExcitationTable):
    """What swings."""

    phase_deg: Annotated[Number, Field(ge=-LARGEST_PHASE, le=LARGEST_PHASE)] = 0.0
    """[degrees] Phase, up to 1e6 either way."""
    harmonic: Annotated[int, Field(ge=1, le=MOST_HARMONIC)] = 1
    """Multiple m of the frequency, a whole number up to 1000. Where half orders act, the frequency
    is that of the whole cycle."""


class UnbalanceTable(SwingingTable, PlacedTable):
    """``[[excitation]]`` with ``kind = "unbalance"``."""

    mass_times_radius: Positive
    """[kg m] Unbalanced mass times its radius."""

    def made(self, at: str) -> Unbalance:
        """The load."""
        return Unbalance(at, self.mass_times_radius, self.phase_deg, self.harmonic)


class HarmonicTable(SwingingTable, PlacedTable):
    """``[[excitation]]`` with ``kind = "harmonic"``."""

    amplitude: Positive
    """[N] Amplitude."""
    frequency_hz: Frequency | None = None
    """[Hz] A frequency of its own, instead of `harmonic`: the scene is then for
    [`nldyn simulate`](../how-to/simulation.md#two-frequencies), as no motion has a period."""

    @model_validator(mode="after")
    def _one_frequency(self) -> HarmonicTable:
        if self.frequency_hz is not None and "harmonic" in self.model_fields_set:
            raise ValueError("has both 'harmonic' and 'frequency_hz'; keep one")
        return self

    @property
    def periodic(self) -> bool:
        """Whether it has no frequency of its own."""
        return self.frequency_hz is None

    def made(self, at: str) -> HarmonicForce:
        """The load."""
        swings = self.phase_deg, self.harmonic, self.frequency_hz
        return HarmonicForce(at, self.amplitude, *swings)


class ConstantTable(PlacedTable):
    """``[[excitation]]`` with ``kind = "constant"``."""

    force: Number
    """[N] Constant force."""

    def made(self, at: str) -> ConstantForce:
        """The load."""
        return ConstantForce(at, self.force)


class MeasuredTable(PlacedTable):
    """``[[excitation]]`` with ``kind = "measured"``."""

    file: str
    """Samples at 0, T/n, ..., (n − 1) T/n, beside the scene; `#` begins a remark. What the
    harmonics leave out is told."""
    harmonics: Annotated[int, Field(ge=1, le=MOST_HARMONIC)] = 20
    """How many harmonics are taken."""
    closed: bool | None = None
    """Whether the last sample is the first one again, at T. Needed where the two are equal."""


class WeightTable(ExcitationTable):
    """``[[excitation]]`` with ``kind = "weight"``."""

    acceleration: Annotated[list[Number], Field(min_length=2, max_length=3)]
    """[m/s²] `[0.0, -9.81]` in a plane frame, three components else."""

    @property
    def load(self) -> str:
        """Name of the load vector."""
        return "weight"

    def made(self, at: str) -> ConstantForce:
        """The load; its vector holds the acceleration."""
        return ConstantForce(at, 1.0)


class BaseTable(SwingingTable):
    """``[[excitation]]`` with ``kind = "base"``."""

    amplitude: Positive
    """[m, m/s or m/s²] Amplitude of `quantity`."""
    at: str | None = None
    """Of modes and matrices: a name in `loads`."""
    direction: Literal["x", "y", "z"] | None = None
    """Of meshes: `"x"`, `"y"` or `"z"`."""
    quantity: Literal["displacement", "velocity", "acceleration"] = "displacement"
    """What keeps its amplitude at every frequency: `"displacement"`, `"velocity"` or
    `"acceleration"`."""

    @model_validator(mode="after")
    def _one_way(self) -> BaseTable:
        if (self.at is None) == (self.direction is None):
            raise ValueError(
                "needs 'direction' for kind 'base' of a mesh, or 'at' naming a load vector"
            )
        return self

    @property
    def load(self) -> str | None:
        """Name of the load vector of a mesh."""
        return f"base {self.direction}" if self.direction is not None else None

    def made(self, at: str) -> BaseMotion:
        """The motion."""
        return BaseMotion(at, self.amplitude, self.quantity, self.phase_deg, self.harmonic)


AnyExcitationTable = Annotated[
    Annotated[UnbalanceTable, Tag("kind 'unbalance'")]
    | Annotated[HarmonicTable, Tag("kind 'harmonic'")]
    | Annotated[ConstantTable, Tag("kind 'constant'")]
    | Annotated[MeasuredTable, Tag("kind 'measured'")]
    | Annotated[WeightTable, Tag("kind 'weight'")]
    | Annotated[BaseTable, Tag("kind 'base'")],
    by_key("kind", "unbalance", "harmonic", "constant", "measured", "weight", "base"),
]
