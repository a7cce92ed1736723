"""How exactly a flow is computed."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from scipy.special import gamma, rgamma

from nldyn.base.arrays import Real
from nldyn.base.errors import SystemModelError, check_whole, is_finite, numbers, shown
from nldyn.engine.layout import ROUND

FINEST, COARSEST = 1e-13, 1e-2  # relative tolerances that can be met, and that tell orbits apart
TAIL = 0.3  # of √rtol: the error of a Jacobian goes with the square of a panel's tail
NODE_ANGLE, NODE_ANGLE_PER_DECADE = 0.95, 0.08  # rad at rtol = 1e-9, and more per power of ten
FEW_STOPS = 10  # with which events are rare beside the swings of the fastest mode
FEW_MODES, MOST_NODES = 20, 40  # modes with which panels have the usual nodes; most nodes
LATEST = 1e-6  # error in the instant of an event, at most, as a share of the panel
SHARE = 0.01  # of rtol: what the start of an event may add to the error of a Jacobian
FINER, ITS_TAIL = 1e-3, 0.03  # times the tolerance and the tail: errors that are negligible


class PanelBounds(NamedTuple):
    """What bounds the panels of a system.

    Parameters
    ----------
    nodes : int
        Gauss nodes on each.
    tail : float
        Largest relative Legendre tail of a force.
    node_angle : float
        Phase of the fastest mode from node to node, in rad.
    """

    nodes: int
    tail: float
    node_angle: float


@dataclass(frozen=True)
class FlowOptions:
    """Accuracy of the flow map.

    Parameters
    ----------
    rtol : float
        Relative error to aim at in the state after a period, 1e-13 to 1e-2; that of the Jacobian
        is about ten times as large. It sets the two others unless these are given.
    nodes : int, optional
        Gauss nodes on a contact panel, 4 to 40, and more where the exponent of a stop needs them
        or, unless given, a system has many modes; the end of a panel is accurate to order 2 nodes.
    tail : float, optional
        A panel is halved until the last two Legendre coefficients of its force are below this
        fraction of the largest force. The error at its end goes with the square.

    Examples
    --------
    >>> FlowOptions(rtol=1e-6).panel_nodes
    10
    """

    rtol: float = 1e-9
    nodes: int | None = None
    tail: float | None = None

    def __post_init__(self) -> None:
        if not (is_finite(self.rtol) and FINEST <= self.rtol <= COARSEST):
            raise SystemModelError(
                f"FlowOptions: rtol must lie between 1e-13 and 1e-2, got {shown(self.rtol)}"
            )
        if self.nodes is not None:
            check_whole("FlowOptions: nodes", self.nodes, 4, MOST_NODES)
        if self.tail is not None and not (is_finite(self.tail) and 0.0 < self.tail < 1.0):
            raise SystemModelError(
                f"FlowOptions: tail must lie between 0 and 1, got {shown(self.tail)}"
            )

    @property
    def panel_nodes(self) -> int:
        """Gauss nodes on a panel: more for more digits, since panels converge spectrally."""
        return self.nodes or round(2.0 - 4.0 / 3.0 * math.log10(self.rtol))

    @property
    def panel_tail(self) -> float:
        """Legendre tail accepted on a panel."""
        return self.tail or TAIL * math.sqrt(self.rtol)

    @property
    def node_angle(self) -> float:
        """Phase of the fastest mode from node to node of a panel, in rad.

        Found by trials with up to 64 modes: with it, an undamped mode costs less than `rtol`, and
        the Jacobian less than ten times that where a contact is 1e-4 of the period.
        """
        return NODE_ANGLE + NODE_ANGLE_PER_DECADE * (math.log10(self.rtol) + 9.0)

    def panels_for(self, modes: int, stops: int = 1) -> PanelBounds:
        """What bounds panels of a system with so many modes, if neither nodes nor tail is given.

        Where the fastest mode bounds a panel, one of twice the nodes is more than twice as long:
        the angle goes to 2, short of the π of half an oscillation. Its tail is a third then, so
        that errors with up to 64 modes are what they are with 14 nodes. Where there are many stops,
        their events bound panels sooner.
        """
        few = self.panel_nodes
        if self.nodes is not None or self.tail is not None or stops > FEW_STOPS:
            return PanelBounds(few, self.panel_tail, self.node_angle)
        more = max(0, min(modes - FEW_MODES, MOST_NODES - few))
        angle = 2.0 - (2.0 - self.node_angle) * (few / (few + more)) ** 0.4
        return PanelBounds(few + more, self.panel_tail * 0.3 ** min(more / 6.0, 1.0), angle)

    @property
    def finer(self) -> FlowOptions:
        """A setting whose errors are negligible beside those of this one."""
        rtol, tail = max(FINER * self.rtol, FINEST), ITS_TAIL * self.panel_tail
        return FlowOptions(rtol, min(self.panel_nodes + 4, MOST_NODES), tail)

    def instant(self, exponent: float) -> float:
        """Error allowed in the instant of an event, as a share of the panel before it.

        The slope of the force starts with the power ``exponent - 1`` of the time, so an error ε
        of its start costs ε^exponent in the Jacobian. More than a millionth would make events of
        two stops look simultaneous.
        """
        if exponent < ROUND:
            return FINEST
        return min(float((SHARE * self.rtol) ** (1.0 / exponent)), LATEST)


def _floats(name: str, values: Real) -> Real:
    """The values, without a look at those that are an array of floats already."""
    known = isinstance(values, np.ndarray) and values.dtype == np.float64
    return values if known else numbers(name, values)


@lru_cache
def _nodes_for_switch(exponent: float, power: int, viscous: bool, nodes: int, tail: float) -> int:
    """Nodes, not fewer than asked for, with which the force after a switch can be resolved.

    On a panel that is short enough the penetration goes as s^power, the force as s^p with
    p = exponent power, its slope, times dχ/ds, as s^(p - 1) and, if it depends on the rate, its
    slope with that as s^(p + power - 1); with too few nodes their Legendre tails stay above what
    is accepted of the value at the last node, however short it is. The coefficients of s^p are
    (2k+1) Γ(p+1)² / (Γ(p-k+1) Γ(p+k+2)).
    """
    force = exponent * power

    def unresolved(p: float, nodes: int, tail: float) -> bool:
        last = 0.5 + 0.5 * float(np.polynomial.legendre.leggauss(nodes)[0][-1])
        k = np.array([nodes - 2, nodes - 1])
        shares = rgamma(p - k + 1.0) * rgamma(p + k + 2.0)
        coefficients = np.abs((2 * k + 1) * gamma(p + 1.0) ** 2 * shares)
        return bool((coefficients > tail * last**p).any())

    while (
        unresolved(force, nodes, tail)
        or unresolved(force - 1.0, nodes, 4.0 * tail)
        or (viscous and unresolved(force + power - 1.0, nodes, 4.0 * tail))
    ):
        nodes += 1
    return nodes
