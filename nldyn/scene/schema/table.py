"""What all tables of a scene have in common: kinds of numbers, and refusals."""

from __future__ import annotations

from typing import Annotated, Literal, Self

from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Discriminator,
    Field,
    model_validator,
)

from nldyn.base.errors import LARGEST_FREQUENCY
from nldyn.scene.messages import NONE_CHOSEN, quoted

SMALLEST, LARGEST = 1e-50, 1e50


def _plausible(value: float) -> float:
    """Refuse what no unit explains, before its powers leave the range of floating-point numbers."""
    if value != 0.0 and not SMALLEST <= abs(value) <= LARGEST:
        raise ValueError(f"must be 0 or from {SMALLEST:g} to {LARGEST:g} in size, not {value:g}")
    return value


def _no_truth_value(value: object) -> object:
    if isinstance(value, bool):
        raise ValueError("must be 1 or -1")
    return value


Number = Annotated[float, AfterValidator(_plausible)]
Positive = Annotated[Number, Field(gt=0)]
NotNegative = Annotated[Number, Field(ge=0)]
Frequency = Annotated[float, Field(ge=1e-6, le=LARGEST_FREQUENCY)]
ModeFrequency = Annotated[NotNegative, Field(le=1e12)]
Period = Annotated[int, Field(ge=1, le=100)]
Matrix = list[list[Number]]
Triple = Annotated[list[Number], Field(min_length=3, max_length=3)]
Sign = Annotated[Literal[1, -1], BeforeValidator(_no_truth_value)]
Axis = Literal["x", "y", "z", "-x", "-y", "-z"]
Direction = Literal["x", "y", "rotation", "z", "rotation_x", "rotation_y", "rotation_z"]


class Table(BaseModel):
    """A TOML table: no unknown keys, no conversions between types, finite numbers only."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, allow_inf_nan=False)


class TwoEnds(Table):
    """What lies between an interface and the ground or another one."""

    at: str
    """Interface."""
    against: str | None = None
    """Interface at the other end; the ground unless given."""

    @model_validator(mode="after")
    def _two_ends(self) -> Self:
        if self.against == self.at:
            raise ValueError("needs another interface than its own in 'against'")
        return self

    @property
    def ends(self) -> list[tuple[str, str | None]]:
        """The interfaces at both ends."""
        return [(self.at, self.against)]


def value_of(given: object, key: str) -> object:
    """What a table that is still to be read, or was read, has under a key."""
    return given.get(key) if isinstance(given, dict) else getattr(given, key, None)


def by_key(key: str, *values: str, default: str | None = None) -> Discriminator:
    """Choose among tables that are tagged ``key 'value'`` by the value of a key."""

    def tag(given: object) -> str:
        absent = default if isinstance(given, dict) else values[0]
        return f"{key} '{absent if (value := value_of(given, key)) is None else value}'"

    told: dict[str, str | int | float] = {
        "key": key,
        "expected": f"{quoted(values[:-1])} or '{values[-1]}'",
    }
    return Discriminator(tag, NONE_CHOSEN, "must be {expected}", told)


def exactly_one(table: BaseModel, *names: str) -> None:
    given = [name for name in names if getattr(table, name) is not None]
    if len(given) != 1:
        chosen = given or names
        fault = ("has both" if len(given) == 2 else "has") if given else "needs one of"
        listed = ", ".join(f"'{name}'" for name in chosen[:-1]) + f" and '{chosen[-1]}'"
        raise ValueError(f"{fault} {listed}" + ("; keep one" if given else ""))


def refuse(table: BaseModel, names: tuple[str, ...], of: str) -> None:
    for name in names:
        if name in table.model_fields_set and getattr(table, name) is not None:
            raise ValueError(f"has '{name}', which is not a key of {of}")
