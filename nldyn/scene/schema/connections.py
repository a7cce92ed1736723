"""Tables of what acts between interfaces: springs, dampers and friction."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Discriminator, Field, Tag, field_validator, model_validator

from nldyn.scene.messages import show
from nldyn.scene.schema.table import (
    Direction,
    NotNegative,
    Number,
    Positive,
    Table,
    TwoEnds,
    exactly_one,
    value_of,
)
from nldyn.system.friction import DryFriction, Friction
from nldyn.system.springs_dampers import (
    LARGEST_DEGREE,
    CubicDamper,
    Damper,
    PolynomialSpring,
    Spring,
)
from nldyn.system.system import AnyDamper, AnySpring


class SpringTable(TwoEnds):
    """``[[springs]]`` at an interface."""

    stiffness: Number | None = None
    """[N/m, N m/rad] Stiffness; a negative one must leave the structure stable."""
    coefficients: Annotated[list[Number], Field(min_length=1, max_length=LARGEST_DEGREE)] | None = (
        None
    )
    """[N/m^j] Of a nonlinear spring, instead of `stiffness`: F = k₁u + k₂u² + ..., up to nine, of
    either sign."""

    @model_validator(mode="after")
    def _one_law(self) -> SpringTable:
        exactly_one(self, "stiffness", "coefficients")
        if self.coefficients is not None and not any(self.coefficients):
            raise ValueError("must have 'coefficients' that are not all zero")
        return self

    def made(self) -> AnySpring:
        """The spring."""
        if self.coefficients is not None:
            return PolynomialSpring(self.at, self.coefficients, self.against)
        assert self.stiffness is not None
        return Spring(self.at, self.stiffness, self.against)


class MeshSpringTable(Table):
    """``[[springs]]`` with a ``direction``: from a point of the mesh to the ground."""

    at: str
    """Point of the mesh."""
    direction: Direction
    """A direction."""
    stiffness: Positive
    """[N/m, N m/rad] Stiffness."""

    @property
    def ends(self) -> list[tuple[str, str | None]]:
        """None: no interface is at an end."""
        return []


_MESH, _INTERFACE = "a spring with a 'direction'", "a spring at an interface"
AnySpringTable = Annotated[
    Annotated[SpringTable, Tag(_INTERFACE)] | Annotated[MeshSpringTable, Tag(_MESH)],
    Discriminator(lambda given: _INTERFACE if value_of(given, "direction") is None else _MESH),
]


class DampingTable(Table):
    """``[damping]``: the damping ratio of the modes, one number or one per mode; Rayleigh's."""

    modal_ratio: float | list[float] = 0.0
    """Damping ratio of the modes, from 0 to below 1: one number for all, or a list with one per
    mode of the reduced model (residual modes are modes of it)."""
    rayleigh_mass: NotNegative = 0.0
    """[1/s] With a `[reduction]`: Rayleigh's damping, this times the mass matrix. It adds to
    that of the modes."""
    rayleigh_stiffness: NotNegative = 0.0
    """[s] The same with the stiffness matrix."""

    @field_validator("modal_ratio", mode="before")
    @classmethod
    def _ratios(cls, value: Any) -> float | list[float]:
        numbers = value if isinstance(value, list) else [value]
        for number in numbers:
            plain = isinstance(number, int | float) and not isinstance(number, bool)
            if not plain or not 0 <= number < 1:
                raise ValueError(
                    f"must be a number from 0 to below 1, or one per mode, not {show(number)}"
                )
        return [float(n) for n in numbers] if isinstance(value, list) else float(value)

    @property
    def rayleigh(self) -> tuple[float, float]:
        """Factors (1/s, s) of the mass and of the stiffness in the damping of a mesh."""
        return self.rayleigh_mass, self.rayleigh_stiffness


class DamperTable(TwoEnds):
    """``[[dampers]]``: a damper between an interface and the ground or another one."""

    coefficient: NotNegative
    """[N s/m] Coefficient c, 0 or more; above 0 in N s³/m³ or N s/m³ for the other laws."""
    law: Literal["linear", "cubic", "displacement"] = "linear"
    """`"linear"`, `"cubic"` for the force c u'³, or `"displacement"` for c u² u'."""

    @model_validator(mode="after")
    def _some(self) -> DamperTable:
        if self.law != "linear" and self.coefficient == 0.0:
            raise ValueError(f"needs a 'coefficient' above 0 for law '{self.law}'")
        return self

    def made(self) -> AnyDamper:
        """The damper."""
        if self.law == "linear":
            return Damper(self.at, self.coefficient, self.against)
        by = "speed" if self.law == "cubic" else self.law
        return CubicDamper(self.at, self.coefficient, self.against, by)


class FrictionTable(TwoEnds):
    """``[[friction]]``: [dry friction](../how-to/friction.md) along an interface."""

    at: str
    """Interface whose displacement lies along the surface."""
    coefficient: NotNegative
    """Coefficient μ of Coulomb's friction while it slides."""
    normal_force: Positive | None = None
    """[N] Constant force that presses it on. This, or `stop`."""
    stop: Annotated[int, Field(ge=0)] | None = None
    """Number of the stop whose force presses it on, counted from 0: friction acts while it is
    closed."""
    at_rest: NotNegative | None = None
    """Coefficient at rest, at least `coefficient`; the same unless given."""
    fading_speed: Positive | None = None
    """[m/s] Speed in which the coefficient falls from that at rest by 1 − 1/e of the difference.
    Unless given, it drops at once where sliding begins."""
    base_speed: Number | Annotated[list[Number], Field(min_length=2, max_length=2)] = 0.0
    """[m/s] Speed along the surface of what it slides on: of a belt or a rotor; over a plane a list
    of those along both tangents, or that along the first one."""
    against: str | None = None
    """Interface at the other side; the ground unless given."""
    tangential_stiffness: Positive | None = None
    """[N/m] Stiffness of a spring along the surface before what slides, above 0: Jenkins' element.
    Several tables at one interface are an Iwan chain. Without it nothing gives way."""
    second_tangent: str | None = None
    """Interface at the same place along the surface, perpendicular to `at`: it slides over the
    plane of both. A `tangential_stiffness` is the same in all directions."""
    second_tangent_against: str | None = None
    """The same interface at the other side; the ground unless given."""

    @model_validator(mode="after")
    def _one_pressure(self) -> FrictionTable:
        exactly_one(self, "normal_force", "stop")
        if self.at_rest is not None and self.at_rest < self.coefficient:
            raise ValueError("needs an 'at_rest' of at least 'coefficient'")
        if self.at_rest is None and self.fading_speed is not None:
            raise ValueError("has a 'fading_speed', which needs the 'at_rest' that fades")
        if (self.at_rest or 0.0) > self.coefficient and self.tangential_stiffness is not None:
            raise ValueError("has a 'tangential_stiffness', before which 'at_rest' is no other one")
        if self.second_tangent is None and isinstance(self.base_speed, list):
            raise ValueError("has a 'base_speed' of two, which needs a 'second_tangent'")
        if self.second_tangent is None and self.second_tangent_against is not None:
            raise ValueError("has a 'second_tangent_against', which needs a 'second_tangent'")
        if self.second_tangent is not None and (self.at_rest or 0.0) > self.coefficient:
            raise ValueError("has a 'second_tangent', over which 'at_rest' is no other one")
        if self.second_tangent is not None and self.second_tangent in (
            self.at,
            self.against,
            self.second_tangent_against,
        ):
            raise ValueError("needs another interface as 'second_tangent'")
        return self

    @property
    def ends(self) -> list[tuple[str, str | None]]:
        """The interfaces at both ends, along each tangent."""
        if self.second_tangent is None:
            return super().ends
        return [*super().ends, (self.second_tangent, self.second_tangent_against)]

    @property
    def of_coulomb(self) -> Friction:
        """The law of the friction."""
        speed = self.base_speed
        both = (speed[0], speed[1]) if isinstance(speed, list) else speed
        return Friction(self.coefficient, self.at_rest, self.fading_speed, both)

    def made(self) -> DryFriction:
        """The friction of what a constant force presses on."""
        assert self.normal_force is not None
        spring, across = self.tangential_stiffness, self.second_tangent
        return DryFriction(
            self.at, self.normal_force, self.of_coulomb, self.against, spring, across,
            self.second_tangent_against,
        )  # fmt: skip
