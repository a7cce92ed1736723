"""Tables of contacts: stops, round clearances and areas."""

from __future__ import annotations

import math
from typing import Annotated, ClassVar, Literal, Self

from pydantic import Discriminator, Field, Tag, field_validator, model_validator

from nldyn.scene.schema.table import (
    Axis,
    NotNegative,
    Number,
    Positive,
    Sign,
    Table,
    Triple,
    TwoEnds,
    by_key,
    refuse,
    value_of,
)
from nldyn.system.rigid_stop import RigidStop
from nldyn.system.round_stop import RoundStop, fault_of_rubbing
from nldyn.system.stop import LARGEST_EXPONENT, Stop, dashpot_for, dissipation_for, hertz_stiffness


class StopTable(TwoEnds):
    """``[[stops]]``: a stop that an interface hits."""

    at: str
    """Interface that hits the stop."""
    law: Literal["hertz", "linear", "rigid"] = "hertz"
    """`"hertz"`, `"linear"` for a one-sided spring, or `"rigid"` for
    [impacts](../how-to/rigid_stops.md) that take no time."""
    gap: Number = 0.0
    """[m] Clearance at rest. A negative gap is a preload: the stop presses on the structure at
    rest; a rigid one has none."""
    direction: Sign = 1
    """`1` if positive displacements close the gap, `-1` if negative ones do."""
    against: str | None = None
    """Another interface that carries the stop, so that the relative displacement counts; the
    ground unless given."""


class RigidStopTable(StopTable):
    """``[[stops]]`` with ``law = "rigid"``."""

    restitution: Annotated[float, Field(ge=0, le=1)]
    """Coefficient of restitution from 0 to 1."""

    @model_validator(mode="after")
    def _no_preload(self) -> RigidStopTable:
        if self.gap < 0.0:
            raise ValueError("needs a 'gap' of at least 0: a preload needs a stop with a stiffness")
        return self

    def made(self) -> RigidStop:
        """The stop."""
        return RigidStop(self.at, self.restitution, self.gap, self.direction, self.against)


class ElasticStopTable(StopTable):
    """What stops have that give way."""

    _beside: ClassVar[tuple[str, ...]] = ("impact_speed",)  # `restitution`
    dashpot: NotNegative = 0.0
    """[N s/m] Dashpot parallel to the spring (Kelvin and Voigt): the force jumps at the
    contact, and pulls at its end."""
    dissipation: NotNegative | None = None
    """[s/m] Loss of the contact (Hunt and Crossley): it grows with the penetration, 0 or more;
    none unless given."""
    restitution: Annotated[float, Field(ge=0, le=1)] | None = None
    """Coefficient of restitution, above 0, of a free body that hits the stop, instead of
    `dissipation`."""
    impact_speed: Positive | None = None
    """[m/s] Speed at which `restitution` holds; slower impacts lose less."""

    @model_validator(mode="after")
    def _one_loss(self) -> ElasticStopTable:
        if self.restitution == 0.0:
            raise ValueError("needs a 'restitution' above 0, or the law 'rigid'")
        given = [key for key in self._beside if getattr(self, key) is not None]
        if (self.restitution is not None) != bool(given):
            other = " or ".join(f"'{key}'" for key in self._beside)
            raise ValueError(f"needs both 'restitution' and {other}, or neither")
        if len(given) > 1:
            raise ValueError("has both 'impact_speed' and 'mass'; keep one")
        if self.restitution is not None:
            refuse(self, ("dissipation",), "a stop whose 'restitution' is given")
        return self

    @property
    def loss(self) -> float:
        """Its dissipation in s/m."""
        if self.restitution is not None and self.impact_speed is not None:
            return dissipation_for(self.restitution, self.impact_speed)
        return self.dissipation or 0.0


class HertzStopTable(ElasticStopTable):
    """``[[stops]]`` with ``law = "hertz"``."""

    stiffness: Positive | None = None
    """[N/m^exponent] Stiffness, above 0. Needed unless `radius` is given."""
    exponent: Annotated[float, Field(ge=1, le=LARGEST_EXPONENT)] | None = None
    """Exponent, from 1 to 4; 1.5 unless given."""
    radius: Positive | None = None
    """[m] Radius of a sphere against a plane of the same material, instead of `stiffness`."""
    youngs_modulus: Positive | None = None
    """[N/m²] Young's modulus that goes with `radius`."""
    poissons_ratio: Annotated[float, Field(gt=-1, le=0.5)] | None = None
    """Poisson's ratio that goes with `radius`; 0.3 unless given."""

    @model_validator(mode="after")
    def _one_stiffness(self) -> HertzStopTable:
        if self.stiffness is not None:
            sphere = ("radius", "youngs_modulus", "poissons_ratio")
            refuse(self, sphere, "a stop whose 'stiffness' is given")
        elif self.radius is None or self.youngs_modulus is None:
            raise ValueError(
                "needs 'stiffness' (N/m^exponent), or 'radius' and 'youngs_modulus' of a sphere"
            )
        else:
            refuse(self, ("exponent",), "a stop given by its radius (it is 1.5)")
        return self

    def made(self) -> Stop:
        """The stop."""
        stiffness = self.stiffness
        if stiffness is None:
            assert self.radius is not None and self.youngs_modulus is not None
            ratio = 0.3 if self.poissons_ratio is None else self.poissons_ratio
            stiffness = hertz_stiffness(self.radius, self.youngs_modulus, ratio)
        law = stiffness, self.exponent or 1.5, self.gap, self.direction, self.against, self.loss
        return Stop(self.at, *law, dashpot=self.dashpot)


class LinearStopTable(ElasticStopTable):
    """``[[stops]]`` with ``law = "linear"``."""

    _beside = ("impact_speed", "mass")
    stiffness: Positive
    """[N/m] Stiffness, above 0."""
    pulls: bool = True
    """`false`: the force of a stop with a dashpot is never negative; it lets go where it would
    pull."""
    mass: Positive | None = None
    """[kg] Mass of a free body whose `restitution` the stop has at every speed; its dashpot
    follows from that. Instead of `impact_speed`."""

    @model_validator(mode="after")
    def _one_dashpot(self) -> LinearStopTable:
        if self.mass is not None and self.dashpot:
            raise ValueError("has both 'mass' and 'dashpot'; keep one")
        if not self.pulls and self.mass is None:
            if not self.dashpot:
                raise ValueError("has 'pulls = false', which needs a 'dashpot' above 0")
            if self.dissipation or self.restitution is not None:
                raise ValueError(
                    "has 'pulls = false' beside 'dissipation' or 'restitution'; keep one"
                )
        return self

    def made(self) -> Stop:
        """The stop."""
        dashpot = self.dashpot
        if self.restitution is not None and self.mass is not None:
            dashpot = dashpot_for(self.restitution, self.stiffness, self.mass, pulls=self.pulls)
        return Stop.linear(
            self.at, self.stiffness, gap=self.gap, direction=self.direction, against=self.against,
            dissipation=self.loss, dashpot=dashpot, pulls=self.pulls or not dashpot,
        )  # fmt: skip


AnyStopTable = Annotated[
    Annotated[HertzStopTable, Tag("law 'hertz'")]
    | Annotated[LinearStopTable, Tag("law 'linear'")]
    | Annotated[RigidStopTable, Tag("law 'rigid'")],
    by_key("law", "hertz", "linear", "rigid", default="hertz"),
]


class RoundClearanceTable(Table):
    """``[[round_clearances]]``: [ring or pin](../how-to/round_clearances.md), touched anywhere."""

    plane: Annotated[list[str], Field(min_length=2, max_length=2)]
    """Two interfaces: the displacements of one place along two perpendicular directions."""
    clearance: Positive
    """[m] Radial clearance, above 0: how far the place may move from the centre of a ring, or how
    near it may come to that of a pin."""
    stiffness: Positive | None = None
    """[N/m^exponent] Stiffness of the contact, above 0; none of the law `"rigid"`."""
    law: Literal["hertz", "linear", "rigid"] = "hertz"
    """`"hertz"`, `"linear"` for a spring, or `"rigid"` for impacts that take no time."""
    restitution: Annotated[float, Field(ge=0, le=1)] | None = None
    """Coefficient of restitution from 0 to 1 of the law `"rigid"`, which needs it."""
    exponent: Annotated[float, Field(ge=1, le=LARGEST_EXPONENT)] | None = None
    """Exponent of the law `"hertz"`, from 1 to 4; 1.5 unless given."""
    eccentricity: Annotated[list[Number], Field(min_length=2, max_length=2)] = [0.0, 0.0]
    """[m] Where the centre lies beside the place at rest, along both directions."""
    inside: bool = True
    """`true` for a ring, in which the place is; `false` for a pin, from which it stays away."""
    against: Annotated[list[str], Field(min_length=2, max_length=2)] | None = None
    """Two interfaces of what is on the other side; the ground unless given."""
    dissipation: NotNegative = 0.0
    """[s/m] Loss of the contact (Hunt and Crossley): it grows with the penetration, 0 or more."""
    friction: NotNegative | None = None
    """Coefficient of the friction along the circle, sliding and sticking."""
    surface_speed: Number | None = None
    """[m/s] Speed of the surface that turns, ΩR of a rotor, above 0 if it turns from the first
    direction to the second; 0 of what does not turn. Needed where there is `friction`."""

    @model_validator(mode="after")
    def _makes_sense(self) -> RoundClearanceTable:
        if self.plane[0] == self.plane[1]:
            raise ValueError("needs two different interfaces in 'plane'")
        if self.against is not None and set(self.against) & set(self.plane):
            raise ValueError("needs other interfaces than its own in 'against'")
        if self.law == "rigid":
            refuse(self, ("stiffness", "exponent", "dissipation"), "law 'rigid'")
            if self.restitution is None:
                raise ValueError("needs a 'restitution' for law 'rigid'")
        elif self.restitution is not None:
            raise ValueError("has 'restitution', which is for law 'rigid'")
        elif self.stiffness is None:
            raise ValueError("needs a 'stiffness', or the law 'rigid'")
        if self.law == "linear":
            refuse(self, ("exponent",), "law 'linear'")
        if fault := fault_of_rubbing(self.friction, self.surface_speed):
            raise ValueError(fault)
        return self

    @property
    def ends(self) -> list[tuple[str, str | None]]:
        """Both directions: the interface, and that on the other side."""
        return list(zip(self.plane, self.against or (None, None), strict=True))

    def made(self) -> RoundStop:
        """The round stop."""
        against = None if self.against is None else (self.against[0], self.against[1])
        rigid, stiffness = self.stiffness is None, self.stiffness or math.inf
        return RoundStop(
            (self.plane[0], self.plane[1]), stiffness, self.clearance,
            1.5 if rigid else exponent_of(self), (self.eccentricity[0], self.eccentricity[1]),
            self.inside, against, self.dissipation, friction=self.friction or 0.0,
            surface_speed=self.surface_speed, restitution=self.restitution,
        )  # fmt: skip


ONLY_ELASTIC = (
    *("stiffness", "dissipation", "dashpot", "pulls", "tangential_stiffness"),
    *("second_along", "second_along_against"),
)


class ContactAreaTable(Table):
    """``[[contact_areas]]``: [a face or an edge that touches](../how-to/contact_areas.md)."""

    at: str | list[str]
    """Face of solids or shells, edge of plane solids, part of beams or set of points of the mesh;
    or a list of interfaces."""
    name: str = ""
    """What reports call it; `at` unless given."""
    stiffness: Positive | None = None
    """[N/m^exponent per m², m or point] Stiffness of the contact, needed unless it is rigid: per
    area of a face, per length of an edge or of beams; at each point node by node, or of a list
    without `weights`."""
    law: Literal["linear", "hertz", "rigid"] = "linear"
    """`"linear"` for a foundation that lifts off, `"hertz"` for a power of the penetration, or
    `"rigid"` where `massless` names the area."""
    exponent: Annotated[float, Field(ge=1, le=LARGEST_EXPONENT)] | None = None
    """Exponent of the law `"hertz"`, from 1 to 4; 1.5 unless given."""
    gap: Number | Annotated[list[Number], Field(min_length=1)] = 0.0
    """[m] Clearance at rest, one or at each point; a negative one is a preload. Where `against` is
    of a mesh, it adds to the distance of both surfaces in the mesh."""
    against: str | Annotated[list[str], Field(min_length=1)] | None = None
    """What moves on the other side: a face, edge or beams of the mesh, whose own mesh need not
    match, nodes that lie opposite to nodes, or a list of interfaces; the ground unless given. With
    components both are `"component.set"`, of one or of two that have the same coordinates."""
    dissipation: NotNegative = 0.0
    """[s/m] Loss of the contact (Hunt and Crossley): it grows with the penetration, 0 or more."""
    dashpot: NotNegative = 0.0
    """[N s/m per m², m or point] Dashpot parallel to the springs."""
    pulls: bool = True
    """`false`: the pressure of a linear law with a dashpot is never negative."""
    friction: NotNegative | None = None
    """Coefficient of Coulomb's friction at each point; needs `along`."""
    along: Axis | Triple | Annotated[list[str], Field(min_length=1)] | None = None
    """Axis or vector along the surface, in which it slides; of a list, interfaces."""
    tangential_stiffness: Positive | None = None
    """[N/m per m², m or point] Stiffness of a spring along the surface before what slides."""
    second_along: Axis | Triple | Annotated[list[str], Field(min_length=1)] | None = None
    """The same as `along` perpendicular to it, of points that slide over the plane of both."""

    @model_validator(mode="after")
    def _one_law(self) -> Self:
        if self.law != "hertz":
            refuse(self, ("exponent",), f"law '{self.law}'")
        if self.law == "rigid":
            refuse(self, ONLY_ELASTIC, "law 'rigid'")
        elif self.stiffness is None:
            raise ValueError("needs a 'stiffness', or the law 'rigid'")
        if (self.friction is None) != (self.along is None):
            raise ValueError("needs both 'friction' and 'along', or neither")
        if self.along is None and self.tangential_stiffness is not None:
            raise ValueError("has a 'tangential_stiffness', which needs 'friction' and 'along'")
        if self.along is None and self.second_along is not None:
            raise ValueError("has 'second_along', which needs 'friction' and 'along'")
        if not self.pulls and not self.dashpot:
            raise ValueError("has 'pulls = false', which needs a 'dashpot' above 0")
        return self

    @property
    def called(self) -> str:
        """Its name."""
        return self.name or (self.at if isinstance(self.at, str) else "contact area")


class MeshAreaTable(ContactAreaTable):
    """``[[contact_areas]]`` of a mesh."""

    at: str
    against: str | None = None
    along: Axis | Triple | None = None
    second_along: Axis | Triple | None = None
    direction: Axis | Triple
    """Axis or vector of the normal, along which the structure moves to close the gap: `"y"`,
    `"-y"`, ..."""
    points: Annotated[int, Field(ge=1, le=12)] | Literal["nodes"] = 1
    """Points of contact in each direction of a facet or beam, at Gauss's places, from 1
    to 12; or `"nodes"`: node by node."""
    slope: Triple | None = None
    """Change of the gap along x, y and z, where what it hits is a plane that is
    inclined; at `centre` it is `gap`."""
    radius: Number | None = None
    """[m] What it hits is a cylinder of this radius with its axis along `axis`, nearest
    at `centre`, where the gap is `gap`; below 0 a hollow one."""
    axis: Axis | Triple | None = None
    """Axis of the cylinder; a ball unless given. In a plane frame `"z"`."""
    centre: Triple | None = None
    """[m] Place [x, y, z] of the mesh where the gap is `gap`; the middle of the points unless
    given."""
    surface: NotNegative = 0.0
    """[m] Of beams or shells: distance of the surface from their axis or middle."""
    surface_against: NotNegative = 0.0
    """[m] The same of the other side."""
    attachment_modes: Annotated[int, Field(ge=0)] | None = None
    """How many attachment modes the reduction gives to the area; chosen by `static_error` unless
    given. `nldyn check` tells both."""
    static_error: Annotated[float, Field(gt=0, lt=1)] = 1e-2
    """Share of the static deflection of structure and contact together, under any load at the
    points, that the attachment modes may miss."""

    @model_validator(mode="after")
    def _one_shape(self) -> MeshAreaTable:
        if self.axis is not None and self.radius is None:
            raise ValueError("has 'axis', which needs the 'radius' of a cylinder")
        if self.radius == 0.0:
            raise ValueError("needs a 'radius' other than 0")
        if self.centre is not None and self.slope is None and self.radius is None:
            raise ValueError("has 'centre', which needs a 'slope' or a 'radius'")
        if self.surface_against and self.against is None:
            raise ValueError("has 'surface_against', which needs 'against'")
        if self.attachment_modes is not None and "static_error" in self.model_fields_set:
            raise ValueError("has both 'attachment_modes' and 'static_error'; keep one")
        return self


class ListedAreaTable(ContactAreaTable):
    """``[[contact_areas]]`` of a list of interfaces."""

    at: list[str]
    against: Annotated[list[str], Field(min_length=1)] | None = None
    along: Annotated[list[str], Field(min_length=1)] | None = None
    second_along: Annotated[list[str], Field(min_length=1)] | None = None
    closes: Sign = 1
    """`1` if positive displacements close the gap, `-1` if negative ones
    do."""
    weights: Annotated[list[Positive], Field(min_length=1)] | None = None
    """[m², m] Areas or lengths that the interfaces stand for."""
    along_against: Annotated[list[str], Field(min_length=1)] | None = None
    """The interfaces of the other side in that direction, where there is `against`."""
    second_along_against: Annotated[list[str], Field(min_length=1)] | None = None
    """The same in the direction of `second_along`."""

    @field_validator("at")
    @classmethod
    def _different(cls, value: list[str]) -> list[str]:
        if len(set(value)) < len(value):
            raise ValueError("must name each interface once")
        return value


ALONG = ("along", "along_against", "second_along", "second_along_against")  # keys of lists
_MESH, _LIST = "an area of a mesh", "a list of interfaces"
AnyAreaTable = Annotated[
    Annotated[MeshAreaTable, Tag(_MESH)] | Annotated[ListedAreaTable, Tag(_LIST)],
    Discriminator(lambda given: _LIST if isinstance(value_of(given, "at"), list) else _MESH),
]


def exponent_of(table: RoundClearanceTable | ContactAreaTable) -> float:
    """Exponent of the law of a contact."""
    return table.exponent or 1.5 if table.law == "hertz" else 1.0
