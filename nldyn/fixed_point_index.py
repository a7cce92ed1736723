"""Indices of fixed points: they add up to one at a frequency, unless orbits are missing there."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

import numpy as np

from nldyn.branch import Branch, check_branches
from nldyn.errors import SystemModelError, check_frequency, check_whole
from nldyn.orbit import Orbit
from nldyn.system import System

FREQUENCIES = 60  # at which the indices are added up
NOTE = "indices of the fixed points of "  # how the note on them begins


def index_sum(branches: Iterable[Branch], frequency_hz: float, period: int = 1) -> int:
    """Sum of the indices of all fixed points of Pⁿ on some branches, at one frequency.

    P takes the state over one period of the excitation. A fixed point has the index +1 or -1, the
    sign of det(I - DPⁿ), that is of ∏(1 - μᵢ). Motions of a structure with damping in all of its
    modes, forced periodically and held back by stops, end in a ball that Pⁿ maps into itself,
    whatever the stiffness of the stops; then the indices of all fixed points of Pⁿ add up to one
    [Krasnosel'skii 1968, chapter 2]. Another sum proves that orbits whose period divides n are
    missing from the branches, or that a branch was broken off.

    The converse does not hold: the two halves of an isola have opposite indices.

    Parameters
    ----------
    branches : iterable of Branch
        Of one system, each of them once; those of a `Diagram`, for example.
    frequency_hz : float
        Excitation frequency in Hz, within the range that the branches were followed in.
    period : int
        Number n of excitation periods.

    Returns
    -------
    int
        Every orbit of period p counts p times, once for each of its points.

    Raises
    ------
    SystemModelError
        If the frequency or the period is none, the frequency lies outside the range that a branch
        was followed in, there is no branch, they are of several systems, or a mode is not damped.

    References
    ----------
    M. A. Krasnosel'skii (1968), *The Operator of Translation along the Trajectories of Differential
    Equations*, American Mathematical Society.

    Examples
    --------
    At 12.15 Hz the superharmonic resonance has two stable orbits and an unstable one.

    >>> from nldyn import Stop, System, Unbalance, continue_branch, index_sum, solve_orbit
    >>> system = System.from_matrices([[2.48]], [[16877.0]], {"middle": [1.0]},
    ...     modal_damping=0.0142, stops=[Stop("middle", stiffness=5.17e9)],
    ...     excitation=[Unbalance("middle", 4.92e-6)])
    >>> branch = continue_branch(solve_orbit(system, 13.0), (11.0, 14.0))
    >>> [orbit.stable for orbit in branch.at(12.15)], index_sum([branch], 12.15)
    ([True, False, True], 1)
    """
    from nldyn.store import same_flow

    branches = list(branches) if isinstance(branches, Iterable) else branches
    check_branches("branches", branches)
    check_frequency("frequency_hz", frequency_hz)
    check_whole("period", period, 1)
    if not branches:
        raise SystemModelError("index_sum: branches must not be empty")
    for branch in branches:
        low, high = branch.course.range_hz if branch.course else (0.0, math.inf)
        if not low * (1.0 - 1e-12) <= frequency_hz <= high * (1.0 + 1e-12):
            raise SystemModelError(
                f"index_sum: branch '{branch.name}' was followed from {low:g} to {high:g} Hz, "
                f"which does not tell of {frequency_hz:g} Hz"
            )
    flow = branches[0].nodes[0].orbit.problem.flow
    if not all(same_flow(branch.nodes[0].orbit.problem.flow, flow) for branch in branches):
        raise SystemModelError("index_sum: the branches must be of one system and accuracy")
    counted = [branch for branch in branches if period % branch.period == 0]
    if counted and not is_damped(flow.system):
        raise SystemModelError(
            "index_sum: the indices add up to one only where every mode is damped, but one is not"
        )
    return sum_of_indices([o for branch in counted for o in branch.at(frequency_hz)], period)


def index_note(branches: Sequence[Branch], range_hz: tuple[float, float], longest: int) -> str:
    """Whether the indices of the fixed points of P to P^longest add up to one, in a sentence.

    They are added up at `FREQUENCIES` frequencies within the range.
    """
    low, high = range_hz
    inside = np.geomspace(low, high, FREQUENCIES + 2)[1:-1].tolist()
    powers = "P" if longest == 1 else f"P to {_power(longest)}"
    told = f"{NOTE}{powers} at {len(inside)} frequencies add up to one"
    counted = [branch for branch in branches if branch.period <= longest]
    orbits = [[orbit for branch in counted for orbit in branch.at(hz)] for hz in inside]
    wrong = []
    for n in range(1, longest + 1):
        at = [hz for hz, here in zip(inside, orbits, strict=True) if sum_of_indices(here, n) != 1]
        if len(at) > 1:
            wrong.append(f"{_power(n)} at {len(at)} of them from {at[0]:.5g} to {at[-1]:.5g} Hz")
        elif at:
            wrong.append(f"{_power(n)} at {at[0]:.5g} Hz")
    if not wrong:
        return told
    return f"{told} but for {', '.join(wrong)}: orbits are missing, or a branch was broken off"


def _power(n: int) -> str:
    return "P" if n == 1 else f"P^{n}"


def without_index_note(notes: Iterable[str]) -> list[str]:
    """Notes but those of `index_note`, which hold no longer once branches are added."""
    return [note for note in notes if not note.startswith(NOTE)]


def sum_of_indices(orbits: Iterable[Orbit], period: int) -> int:
    """Sum of the indices of the fixed points of Pⁿ on orbits, whose own period divides n."""
    return sum(o.period * index(o, period // o.period) for o in orbits if period % o.period == 0)


def index(orbit: Orbit, times: int = 1) -> int:
    """Sign of det(I - DPⁿ) with n = `times` periods of an orbit: the sign of ∏(1 - μᵢ^times).

    Complex multipliers come in pairs that contribute a positive factor, so that only real ones
    outside of the unit circle count.
    """
    real = np.real(orbit.multipliers[np.imag(orbit.multipliers) == 0.0])
    outside = np.abs(real) > 1.0 if times % 2 == 0 else real > 1.0
    return 1 - 2 * (int(np.count_nonzero(outside)) % 2)


def is_damped(system: System) -> bool:
    """Whether every mode of the structure without its stops loses energy."""
    return all(float(np.linalg.eigvals(b).real.max()) < 0.0 for b in system.linear.blocks)
