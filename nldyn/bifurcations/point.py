"""Points of a branch: an orbit with the branch's direction, and special points."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from nldyn.base.arrays import Real
from nldyn.base.errors import SystemModelError, shown
from nldyn.orbits.bordered import (
    FREE,
    Condition,
    Corrected,
    Evaluation,
    OrbitFamily,
    Place,
    residual_at,
)
from nldyn.orbits.conditions import Grazing, Phase
from nldyn.orbits.orbit import Orbit, shifted_alike, stroboscopic
from nldyn.orbits.shooting import asymmetry
from nldyn.system.chart import told_value, value_of
from nldyn.system.parameters import Parameter

SAME_HZ, SAME_STATES = 1e-6, 1e-3  # relative, of an orbit at a special point or close beside it


@dataclass(frozen=True, eq=False)
class BranchNode:
    """An orbit on a branch with the branch's direction there.

    Parameters
    ----------
    family : OrbitFamily
        The orbits of the branch and others in the same parameter.
    point : (N + 1,)
        Unknowns of the family.
    orbit : Orbit
        The orbit.
    tangent : (N + 1,)
        Unit tangent in the metric of the family.
    arclength : float
        Relative arclength from the branch's first computed point.
    tests : dict of str to float
        Test functions, filled when first asked for (see `nldyn.bifurcations.sign_changes.tests`).
    condition : Condition
        What the orbits of a curve in two parameters have in common, with borders of this one.
    corner : str
        Kind of the mark where a curve has a corner at a grazing point, else empty.
    """

    family: OrbitFamily
    point: Real
    orbit: Orbit
    tangent: Real
    arclength: float
    tests: dict[str, float] = field(default_factory=dict, repr=False)
    condition: Condition = FREE
    corner: str = ""

    def __repr__(self) -> str:
        """One line: the orbit and where it is along the branch."""
        return f"<BranchNode at arclength {self.arclength:.4g}: {self.orbit!r}>"

    @classmethod
    def of(cls, place: Place, tangent: Real, arclength: float) -> BranchNode:
        """An orbit of a family as a point of a branch."""
        return cls(place.family, place.point, place.orbit, tangent, arclength)

    @classmethod
    def in_frequency(cls, orbit: Orbit, tangent: Real, arclength: float) -> BranchNode:
        """A point of a branch in the frequency."""
        family = OrbitFamily.in_frequency(orbit)
        return cls(family, orbit.point, orbit, tangent, arclength)

    @cached_property
    def at(self) -> Evaluation:
        """The equations of the family at the point."""
        return self.family.at(self.point)

    @cached_property
    def weights(self) -> Real:
        """Metric (N + m,) of the family at the point."""
        return self.family.metric(self.point)

    @cached_property
    def asymmetry(self) -> float:
        """See `nldyn.orbits.shooting.asymmetry`."""
        return asymmetry(self.family.problem, self.point)

    @property
    def values(self) -> Real:
        """Values of the parameters."""
        if self.family.in_frequency_alone:
            return np.array([self.orbit.frequency_hz])
        return self.family.values(self.point)

    @property
    def residual(self) -> float:
        """Largest of the relative error of closing, the condition, and an unfolding number."""
        unfolding = 0.0 if self.family.unfolding is None else abs(float(self.point[-1]))
        return max(residual_at(self.at, self.condition), unfolding)

    @property
    def value(self) -> float:
        """Value of the parameter, of several the first."""
        if self.family.in_frequency_alone:
            return self.orbit.frequency_hz
        return float(self.family.values(self.point)[0])

    @property
    def parameter(self) -> Parameter:
        """What changes along the branch."""
        return self.family.charts[0].parameter

    def reversed(self) -> BranchNode:
        """The same point of the branch run through the other way."""
        return replace(self, tangent=-self.tangent, arclength=-self.arclength, tests={})


def node_of(found: Corrected, towards: Real, arclength: float, corner: str = "") -> BranchNode:
    """Point of a branch or curve from a solution, its tangent on the side of a vector."""
    tangent, condition = found.tangent(towards), found.condition.renewed(found.at)
    family = found.family
    if isinstance(condition, Grazing):  # whose rigid stop is passed where the extreme is now
        family = family.past(condition.passages)
    elif isinstance(condition, Phase):  # fed by what makes it larger
        family = family.unfolded(family.from_origin(found.point))
    return BranchNode(
        family, found.point, found.orbit, tangent, arclength, condition=condition, corner=corner
    )


@dataclass(frozen=True, eq=False)
class SpecialPoint:
    """A located bifurcation, grazing point or event, or a mark on a curve in two parameters.

    Parameters
    ----------
    kind : str
        LP, PD, NS, BP or GR: cyclic fold, flip, Neimark-Sacker, branch point, grazing; CS, GS or
        AS: crossing-, grazing- or adding-sliding, where a motion begins or ceases to stick; on
        curves also CP, GPD, LPPD, R1 to R4 and pairs, see the theory; or that of an `Event`.
    point : BranchNode
        The orbit at which it happens.
    error : float
        Estimated error of the root in the parameter and the last Newton step, relative; of a
        parameter that may be zero or negative, relative to the width of its range. Of a mark on a
        curve that in its arclength.
    """

    kind: str
    point: BranchNode
    error: float

    def __repr__(self) -> str:
        """One line: kind, parameter with its error, the orbit's period and size."""
        orbit, place = self.orbit, self.place(9)
        return (
            f"<{self.kind} at {place} (error {self.error:.1g}): "
            f"period {orbit.period}, {orbit.told_size}>"
        )

    @property
    def orbit(self) -> Orbit:
        """The orbit."""
        return self.point.orbit

    @property
    def frequency_hz(self) -> float:
        """Excitation frequency in Hz."""
        return self.point.orbit.frequency_hz

    @property
    def value(self) -> float:
        """Value of the parameter that changes along the branch."""
        return self.point.value

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """The numbers that were free."""
        return tuple(chart.parameter for chart in self.point.family.charts)

    @property
    def values(self) -> Real:
        """Their values."""
        return self.point.values

    @property
    def residual(self) -> float:
        """Largest of the relative error of closing and the conditions."""
        return self.point.residual

    @property
    def frequency_error(self) -> float:
        """`error` where the frequency changes; else it is exact."""
        return self.error if self.point.family.in_frequency_alone else 0.0

    @property
    def value_error(self) -> float:
        """Estimated error of the value."""
        family = self.point.family
        return self.error * family.charts[0].slope(float(self.point.point[family.n_states]))

    def place(self, digits: int = 6) -> str:
        """The values of the parameters, in words."""
        return place_of(self.point, digits)


def on_branch(special: SpecialPoint) -> SpecialPoint:
    """A special point in a family; in the frequency if it is not one of a branch.

    Then it has no direction.
    """
    if is_of_branch(special):
        return special
    node = BranchNode.in_frequency(special.orbit, np.zeros(special.orbit.point.size), 0.0)
    return SpecialPoint(special.kind, node, float(getattr(special, "error", 0.0)))


def is_of_branch(special: object) -> bool:
    """Whether a special point lies on a branch whose direction it knows."""
    node = getattr(special, "point", None)
    if not isinstance(node, BranchNode):
        return False
    return len(node.family.charts) == 1 and bool(node.tangent.any())


def place_of(node: BranchNode, digits: int = 6) -> str:
    """Where a point of a branch is: the values of its parameters, in words.

    The frequency is told without its name.
    """
    values = [node.value] if len(node.family.charts) == 1 else node.values.tolist()
    pairs = zip(node.family.charts, values, strict=True)
    return ", ".join(told_value(chart.parameter, value, digits=digits) for chart, value in pairs)


def check_special(caller: str, special: object, kind: str = "", *, of_branch: bool = True) -> None:
    """Refuse anything but a special point, of a branch and of a kind where these are wanted.

    Raises
    ------
    SystemModelError
        As said.
    """
    found, orbit = getattr(special, "kind", None), getattr(special, "orbit", None)
    if not (isinstance(found, str) and isinstance(orbit, Orbit)):
        raise SystemModelError(f"{caller} needs a special point, got {shown(special)}")
    if kind and found != kind:
        raise SystemModelError(f"{caller} needs a {kind} point, got {found}")
    if orbit.self_excited:
        raise SystemModelError(
            f"{caller} knows special points of forced motions: the {found} at "
            f"{orbit.frequency_hz:g} Hz is of self-excited ones, whose frequency is found"
        )
    if of_branch and not is_of_branch(special):
        raise SystemModelError(
            f"{caller} needs a special point of a branch, which knows the branch's direction; "
            f"the {found} point at {orbit.frequency_hz:g} Hz was found otherwise"
        )


def is_at(orbit: Orbit, special: SpecialPoint, multiple: int = 1) -> bool:
    """Whether an orbit is that of a special point, run through several times, up to a shift.

    Mirror images are not the same.
    """
    other = special.orbit
    if orbit.period != multiple * other.period:
        return False
    chart = special.point.family.charts[0]
    value = value_of(orbit.system, orbit.frequency_hz, chart.parameter)
    if not abs(chart.coordinate(value) - float(special.point.point[-1])) <= SAME_HZ:
        return False
    states = np.tile(stroboscopic(other), (multiple, 1))
    return shifted_alike(stroboscopic(orbit), states, SAME_STATES * float(np.abs(states).max()))
