"""Contact at points without mass: stops in series with the flexibility that gives way at once."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from nldyn.base.arrays import TINY, Real
from nldyn.base.errors import SystemModelError
from nldyn.system.friction import DryFriction
from nldyn.system.rigid_stop import AnyStop, RigidStop
from nldyn.system.round_stop import RoundStop
from nldyn.system.stop import Stop

NEGATIVE = 1e-9  # of the largest eigenvalue of a flexibility: one that is not rounding
# of flexibilities between contacts: the rounding of these moves forces by up to 4e-17 of it, as
# measured on strips of 12 to 90 points, here by 4e-10, within the 1e-9 of the flow map
WORST_CONDITION = 1e7
MOST_COMMON = 0.05  # share of massless flexibility that friction and others may have in common

Ends = tuple[str | None, str | None]


@dataclass(frozen=True)
class MasslessBoundary:
    r"""Flexibility G of interfaces that follows their forces at once, :math:`u = p\,q + G F`.

    A rigid stop of gap g there holds :math:`p\,q - G F = g` while it is closed, so that its force
    is that of a linear one of stiffness 1/G on the displacement of the modes: it needs no impact,
    and keeps all energy. A linear stop, and the spring of what slides, are in series with G.

    Parameters
    ----------
    names : sequence of str
        The interfaces.
    flexibility : (m, m) array
        G in m/N.

    References
    ----------
    R.H. MacNeal (1971) *Computers & Structures* 1, 581-601; C. Monjaraz-Tec, J. Gross, M. Krack
    (2022) *Computers & Structures* 260, 106698.
    """

    names: Sequence[str]
    flexibility: Real

    def __post_init__(self) -> None:
        values = np.linalg.eigvalsh(self.flexibility)
        if values[0] < -NEGATIVE * np.abs(values).max():
            raise SystemModelError(
                "the reduced model has a negative flexibility without mass, as components that are "
                "joined by 'dual-craig-bampton': reduce them by 'rubin' or 'craig-bampton'"
            )

    @property
    def bare(self) -> frozenset[str]:
        """Interfaces that have no mass."""
        pairs = zip(self.names, np.diag(self.flexibility), strict=True)
        return frozenset(name for name, own in pairs if own != 0.0)

    def between(self, ends: Ends, others: Ends) -> float:
        """How much a unit force between two interfaces moves two others apart, in m/N."""
        return float(self._signed(ends) @ self.flexibility @ self._signed(others))

    def _signed(self, ends: Ends) -> Real:
        vector = np.zeros(len(self.names))
        for end, sign in zip(ends, (1.0, -1.0), strict=True):
            if end is not None and end in self.names:
                vector[self.names.index(end)] += sign
        return vector

    def common(self, stops: Sequence[AnyStop]) -> Real | None:
        """How far a unit force at each stop lets each other one move at once, (n, n), or None.

        The two sides of one gap, which are never closed at once, need not know of each other.

        Raises
        ------
        SystemModelError
            If stops have all but all of it in common, so that nothing tells their forces.
        """
        rows = [
            getattr(stop, "direction", 0) * self._signed((stop.at, stop.against)) for stop in stops
        ]
        whole = np.array(rows).reshape(len(stops), len(self.names))
        found = whole @ self.flexibility @ whole.T
        own = np.sqrt(np.diag(found))
        found[np.abs(found) <= NEGATIVE * np.outer(own, own)] = 0.0
        one_side = list(range(len(stops)))
        for i, j in itertools.combinations(range(len(stops)), 2):
            if found[i, j] != 0.0 and facing(stops[i], stops[j]):
                found[i, j] = found[j, i] = 0.0
                one_side = [place for place in one_side if place != j]
        moved = [i for i in one_side if own[i] > 0.0]
        if moved:
            self._check_condition([stops[i] for i in moved], found[np.ix_(moved, moved)])
        np.fill_diagonal(found, 0.0)
        return found if np.any(found) else None

    @staticmethod
    def _check_condition(stops: Sequence[AnyStop], give: Real) -> None:
        """Refuse stops whose forces nothing tells apart, by the flexibility between them (n, n)."""
        springs = [1.0 / s.stiffness if isinstance(s, Stop) else 0.0 for s in stops]
        own = np.sqrt(np.diag(give))
        values, ways = np.linalg.eigh((give + np.diag(springs)) / np.outer(own, own))
        if values[0] * WORST_CONDITION >= values[-1]:
            return
        first, second = np.sort(np.argsort(np.abs(ways[:, 0]))[-2:]).tolist()
        condition = values[-1] / max(values[0], TINY)
        raise SystemModelError(
            f"contacts without mass have flexibilities of a condition number of {condition:.1e}, "
            f"more than {WORST_CONDITION:.0e}, so that nothing tells their forces apart, as at "
            f"{told((stops[first].at, stops[first].against))} and "
            f"{told((stops[second].at, stops[second].against))}: place them farther apart, keep "
            "fewer modes, or give them a stiffness"
        )

    def acting(self, elements: Mapping[str, tuple[Any, ...]]) -> dict[str, tuple[Any, ...]]:
        """Elements of a system with what is in series with its massless boundary.

        Raises
        ------
        SystemModelError
            For what cannot act at a point without mass, and stops there that have too much in
            common.
        """
        stops, dampers = elements.get("stops", ()), elements.get("dampers", ())
        sliding = [damper for damper in dampers if isinstance(damper, DryFriction)]
        for what, given in elements.items():
            for element in given:
                if what != "stops" and not isinstance(element, DryFriction):
                    self._refuse(what, element)
        self._check_apart(stops, sliding)
        return {
            **elements,
            "stops": tuple(self._stop(stop) for stop in stops),
            "dampers": tuple(
                replace(d, tangential_stiffness=self._spring((d.at, d.against), d))
                if isinstance(d, DryFriction)
                else d
                for d in dampers
            ),
        }

    def _refuse(self, what: str, element: Any) -> None:
        for end in (element.at, getattr(element, "against", None)):
            if end in self.bare:
                raise SystemModelError(
                    f"{what}: '{end}' has no mass, so that it has no equation of motion: only "
                    "stops and dry friction act there. Reduce by 'rubin' or 'craig-bampton', or by "
                    "'macneal' with massless = [...], the interfaces where stops act alone"
                )

    def _stop(self, stop: AnyStop) -> AnyStop:
        """The stop on the displacement of the modes."""
        if isinstance(stop, RoundStop):
            for at, against in stop.ends:
                for end in (at, against):
                    if end in self.bare:
                        raise SystemModelError(f"round clearance at '{end}', which has no mass")
            return stop
        give = self.between((stop.at, stop.against), (stop.at, stop.against))
        if isinstance(stop, RigidStop):
            if give == 0.0 and self.between(*[(stop.tangent, stop.tangent_against)] * 2) != 0.0:
                raise SystemModelError(
                    f"rigid stop at '{stop.at}': its friction acts along '{stop.tangent}', which "
                    "has no mass: then it must have none itself, or reduce by 'rubin'"
                )
            return stop if give == 0.0 else self._closed(stop, give)
        stiffness = stop.stiffness if give == 0.0 else self._series(stop, give)
        if stop.friction is None:
            return replace(stop, stiffness=stiffness)
        spring = self._spring((stop.tangent, stop.tangent_against), stop)
        return replace(stop, stiffness=stiffness, tangential_stiffness=spring)

    def _closed(self, stop: RigidStop, give: float) -> Stop:
        """A rigid stop: a linear one with the stiffness of what gives way at once."""
        if callable(stop.restitution) or stop.restitution != 1.0:
            raise SystemModelError(
                f"rigid stop at '{stop.at}', which has no mass: it closes without an impact that "
                "could lose energy; set restitution = 1, the structure's damping does the rest"
            )
        spring = None
        if stop.friction is not None:
            spring = self._spring((stop.tangent, stop.tangent_against), None)
        return Stop(
            stop.at, 1.0 / give, 1.0, stop.gap, stop.direction, stop.against,
            tangent=stop.tangent, friction=stop.friction, tangent_against=stop.tangent_against,
            tangential_stiffness=spring, area=stop.area, share=stop.share,
        )  # fmt: skip

    @staticmethod
    def _series(stop: Stop, give: float) -> float:
        """Stiffness of a linear stop in series with a flexibility."""
        if not stop.is_linear or stop.law or stop.dashpot or stop.dissipation:
            raise SystemModelError(
                f"stop at '{stop.at}', which has no mass: only a rigid stop or a linear one "
                "without a loss can act there; reduce by 'rubin' for others"
            )
        return 1.0 / (1.0 / stop.stiffness + give)

    def _spring(self, ends: Ends, of: Stop | DryFriction | None) -> float | None:
        """Stiffness of the spring before what slides, with what gives way, or None."""
        own, give = None if of is None else of.tangential_stiffness, self.between(ends, ends)
        if give == 0.0:
            return own
        return 1.0 / (give + (0.0 if own is None else 1.0 / own))

    def _check_apart(self, stops: Sequence[AnyStop], sliding: Sequence[DryFriction]) -> None:
        """Refuse contacts that move each other at once, but those of opposite sides of a gap."""
        normal = [(i, (stop.at, stop.against)) for i, stop in enumerate(stops) if plain(stop)]
        along = [
            (i, (stop.tangent, stop.tangent_against))
            for i, stop in enumerate(stops)
            if plain(stop) and stop.tangent is not None
        ]
        along += [(-1, (damper.at, damper.against)) for damper in sliding]
        pairs = [*itertools.product(along, normal), *itertools.combinations(along, 2)]
        for (i, ends), (j, others) in pairs:
            both = np.sqrt(self.between(ends, ends) * self.between(others, others))
            common = abs(self.between(ends, others))
            if common <= MOST_COMMON * both or (min(i, j) >= 0 and facing(stops[i], stops[j])):
                continue
            raise SystemModelError(
                f"contacts at {told(ends)} and {told(others)} have {100.0 * common / both:.3g} % "
                f"of their flexibility without mass in common, more than {100.0 * MOST_COMMON:g} %"
                ": keep more modes, or reduce by 'rubin'"
            )


def plain(stop: AnyStop) -> bool:
    """Whether a stop acts in one direction."""
    return not isinstance(stop, RoundStop)


def told(ends: Ends) -> str:
    """Both ends of a contact in words."""
    return f"'{ends[0]}'" + ("" if ends[1] is None else f" against '{ends[1]}'")


def facing(one: AnyStop, other: AnyStop) -> bool:
    """Whether two stops are the two sides of one gap, never closed at once."""
    same = (one.at, one.against) == (other.at, other.against)
    if isinstance(one, RoundStop) or isinstance(other, RoundStop) or not same:
        return False
    return one.direction == -other.direction and one.gap + other.gap >= 0.0
