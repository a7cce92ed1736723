"""Motions that are followed from period to period until they have settled."""

from __future__ import annotations

import math
from collections.abc import Iterator

from nldyn.base.arrays import Real
from nldyn.base.errors import ConvergenceError
from nldyn.flow.flow_map import FlowMap


def settling_runs(
    flow: FlowMap, state: Real, omega: float, periods: int, piece: int, share: float = 0.0
) -> Iterator[Real]:
    """States z (k, 2n) of a motion after each excitation period from phase zero on, in pieces.

    Who takes the pieces looks at each, and asks for no more once the motion has settled.

    Parameters
    ----------
    flow : FlowMap
        What moves.
    state : (2n,) array
        State z at phase zero.
    omega : float
        Excitation frequency in rad/s.
    periods : int
        How many at most.
    piece : int
        Periods between two looks.
    share : float
        Of the periods before, which a piece has at least.

    Raises
    ------
    ConvergenceError
        If the motion cannot be simulated.

    Examples
    --------
    >>> import numpy as np
    >>> from nldyn import HarmonicForce, System
    >>> system = System.from_modal([10.0], {"a": [1.0]}, modal_damping=0.1,
    ...     excitation=[HarmonicForce("a", 1.0)])
    >>> for run in settling_runs(FlowMap(system), np.zeros(2), 50.0, 1000, 16):
    ...     if np.linalg.norm(run[-1] - run[-2]) < 1e-9 * np.linalg.norm(run[-1]):
    ...         break
    >>> np.allclose(run[-1], FlowMap(system).strobe(run[-1], 50.0, 1).ends[0])
    True
    """
    done = 0
    while done < periods:
        wanted = periods_at_once(flow, max(piece, int(share * (done + 1))))
        here = flow.at(omega, done * 2.0 * math.pi / omega)
        run = states_after(here, state, omega, min(wanted, periods - done))
        yield run
        state, done = run[-1], done + len(run)


def states_after(flow: FlowMap, state: Real, omega: float, periods: int) -> Real:
    """States z (periods, 2n) after each of some excitation periods from phase zero on.

    Raises
    ------
    ConvergenceError
        If the motion cannot be simulated.
    """
    found = flow.strobe(state, omega, periods)
    if found.failure:
        raise ConvergenceError(found.failure)
    return found.ends


def periods_at_once(flow: FlowMap, most: int) -> int:
    """How many periods one flow map serves: one where forces have frequencies of their own."""
    return 1 if flow.system.tones else most
