"""Tables of what to compute."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, ValidationInfo, field_validator, model_validator

from nldyn.scene.messages import show
from nldyn.scene.schema.table import Frequency, Number, Period, Table


class ObserveTable(Table):
    """``[observe]``: the interface whose displacement is reported and drawn."""

    at: str
    """Interface whose displacement is tabulated and drawn. Without the table it is the first
    interface."""
    absolute: bool = False
    """With a moving base: its absolute displacement, not that relative to the base."""


class StartTable(Table):
    """``[start]``: where ``nldyn simulate`` begins; undeformed and without speed unless given.

    Where nothing excites the structure, ``nldyn run`` begins its simulations there, too.

    What is not given follows: of all states with these values it is the one of least energy.
    """

    at_rest: bool = False
    """Begin where the structure rests under its constant loads; what is given is added to that."""
    displacements: dict[str, Number] = {}
    """[m or rad] By interface, such as tip = 1e-3."""
    velocities: dict[str, Number] = {}
    """[m/s or rad/s] By interface."""


class ContinuationTable(Table):
    """``[continuation]``: which branches of periodic orbits are followed, and how far.

    They are followed over the excitation frequency, or over another number of the scene. Where
    nothing excites the structure, motions that excite themselves are simulated from `[start]`, or
    from rest and carried along by what moves beneath friction, until they settle, and followed over
    a `parameter`; their frequency is found.
    """

    range_hz: list[Frequency] | None = None
    """[Hz] Lowest and highest excitation frequency; needed unless there is a `parameter`."""
    parameter: str | None = None
    """What changes in place of the frequency: a key such as `"stops.0.gap"` (tables in a list
    count from 0), `"stops.0.stiffness"`, `"stops.0.restitution"`, `"excitation.0.amplitude"`,
    `"dampers.0.coefficient"`, `"springs.0.stiffness"`, `"friction.0.base_speed"`,
    `"damping.modal_ratio"` or `"matrices.spin.hz"`; or in short `"gap"`, `"stiffness"`,
    `"restitution"` and so on of the first stop, `"force"`, the strength of the only load that moves
    the structure, `"damping"`, the ratio of all modes, and `"speed"` of a shaft that turns as fast
    as its load."""
    range: list[Number] | None = None
    """[unit of the parameter] Lowest and highest value of the parameter, in the unit of its key."""
    frequency_hz: Frequency | None = None
    """[Hz] Excitation frequency, held while the parameter changes; none without excitation."""
    periods: Annotated[list[Period], Field(min_length=1)] = [1, 2, 3]
    """Periods of the orbits to look for, in periods of the excitation: 1 is the harmonic
    branch, 3 the 1/3 subharmonics."""
    follow_doublings: Annotated[int, Field(ge=0, le=10)] = 0
    """How many more (up to 10) doublings to follow at the flips of branches whose doubled
    period is beyond `periods`: with 1 also the 1/4 subharmonics born from the 1/2 ones, with 2
    the 1/8 ones, and so on."""
    search_points: Annotated[int, Field(ge=1, le=1000)] = 12
    """Number of frequencies, or values of the parameter (up to 1000), spread over the range, at
    which time simulations look for orbits."""
    max_step: Annotated[float, Field(ge=0.01, le=1.0)] = 0.05
    """Longest step along a branch, relative: at 0.05 orbit or frequency change by 5 %, or a
    parameter whose range is not positive by 5 % of the range's width. Shorter
    steps (down to 0.01) give smoother curves and take longer."""
    rtol: Annotated[float, Field(ge=1e-13, le=1e-2)] = 1e-9
    """Relative error to aim at in the motion over a period, 1e-13 to 1e-2; multipliers are
    about ten times less exact."""
    events: list[Literal["amplitude resonance", "amplitude antiresonance", "phase resonance"]] = []
    """Further special points to mark: where the largest displacement is extremal along a branch,
    or where the displacement lags a quarter of a turn behind the only source that swings."""

    @field_validator("range_hz", "range")
    @classmethod
    def _ordered(cls, value: list[float] | None, about: ValidationInfo) -> list[float] | None:
        if value is None:
            return value
        one, several = ("frequency", "frequencies")
        if about.field_name == "range":
            one, several = ("value", "values")
        if len(value) != 2:
            raise ValueError(f"must be two {several}, [lowest, highest], not {show(value)}")
        if value[1] <= value[0]:
            raise ValueError(f"must run from the lower to the higher {one}, not {show(value)}")
        if value[1] - value[0] <= 1e-9 * max(abs(value[0]), abs(value[1])):
            raise ValueError(f"must be wider than 1e-9 of its {several}, not {show(value)}")
        return value

    @model_validator(mode="after")
    def _one_range(self) -> ContinuationTable:
        given = [key for key in ("range", "frequency_hz") if getattr(self, key) is not None]
        if self.parameter is None:
            if self.range_hz is None:
                raise ValueError("needs 'range_hz' (Hz)")
            if given:
                raise ValueError(f"has '{given[0]}', which goes with a 'parameter'")
        elif self.range_hz is not None:
            raise ValueError("has both 'range_hz' and 'parameter'; keep one")
        elif self.range is None:
            raise ValueError("needs 'range', the lowest and highest value of its 'parameter'")
        return self

    @property
    def limits(self) -> tuple[float, float]:
        """Lowest and highest frequency in Hz, or value of the parameter."""
        given = self.range_hz or self.range
        assert given is not None
        return given[0], given[1]

    @property
    def frequencies_hz(self) -> tuple[float, float]:
        """Lowest and highest excitation frequency in Hz."""
        if self.frequency_hz is not None:
            return self.frequency_hz, self.frequency_hz
        return self.limits

    @field_validator("periods")
    @classmethod
    def _different(cls, value: list[int]) -> list[int]:
        if len(set(value)) < len(value):
            raise ValueError(f"must name each period once, not {show(value)}")
        return value


class SeedTable(Table):
    """``[[subharmonics]]``: where to look for the start of a branch by time simulation."""

    period: Period
    """Period of the orbits, in periods of the excitation."""
    near_hz: Frequency | None = None
    """[Hz] Excitation frequency to look at; needed where `continuation` has a `range_hz`."""
    near: Number | None = None
    """[unit of the parameter] Value to look at where `continuation` has a `parameter`."""

    @property
    def place(self) -> float:
        """The frequency in Hz, or the value."""
        near = self.near if self.near_hz is None else self.near_hz
        assert near is not None  # checked with the continuation
        return near


class ExploreTable(Table):
    """``[explore]``: find all branches without naming places to look at."""

    max_period: Period = 8
    """Longest orbits wanted, in periods of the excitation."""
    spacing: Annotated[float, Field(ge=1e-6, le=0.5)] = 0.005
    """Largest relative distance of the frequencies, or of values of a parameter, at which motions
    are simulated, up to 0.5; where their range is not positive, the share of its width.
    What is stable in a narrower window only may be missed."""
    starts: Annotated[int, Field(ge=1, le=1000)] = 12
    """Random initial states at each of them (up to 1000), beside the motions carried over from
    the frequency before."""
    rounds: Annotated[int, Field(ge=1, le=1000)] = 1
    """Most searches through the range, each from other random states at frequencies between
    those before; one that finds no new branch is the last. With two or more the report
    estimates how many branches are missing."""
    settling: Annotated[int, Field(ge=1, le=10_000_000)] = 50000
    """Most periods of the excitation that a motion gets to settle. It gets four decay times of
    the slowest mode, and where this key cuts that, a line says so."""
    unstable_period: Annotated[int, Field(ge=0, le=100)] = 3
    """Longest unstable orbits looked for by near returns and deflation; 0 for none."""
    doubled_period: Period = 1
    """Longest orbits followed from flips, where that is longer than `max_period`."""
    doubled_points: Annotated[int, Field(ge=2, le=1_000_000)] | None = None
    """Most points in one direction of branches longer in period than `max_period`; those that
    are broken off are noted."""
    pseudo_orbits: Annotated[int, Field(ge=0, le=1_000_000)] = 10
    """Most closed sequences (up to 1 000 000) of pieces of known orbits, of each length up to
    `unstable_period`, beside which [orbits are looked for](../how-to/exploring.md) at each
    frequency on the way down."""
    mixtures: Annotated[int, Field(ge=0, le=1_000_000)] = 10
    """Mixtures (up to 1 000 000) of two known orbits, of each length up to `unstable_period`,
    beside which [orbits are looked for](../how-to/exploring.md) at each frequency on the way
    down."""
    walks: Annotated[int, Field(ge=0, le=1_000_000)] = 10
    """Most closed walks (up to 1 000 000) among random states, of each length up to
    `unstable_period`, beside which [orbits are looked for](../how-to/exploring.md) at each
    frequency on the way down."""
    walk_states: Annotated[int, Field(ge=1, le=100_000)] = 500
    """How many random states (up to 100 000) these walks are among."""
    seed: Annotated[int, Field(ge=0, le=2**32)] = 20
    """Seed of the random initial states."""
