"""The modes that an interface sees; nothing moves the others, which are left out."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import linalg

from cms.base.arrays import FloatArray
from cms.base.errors import ReductionError
from cms.component.component import Pencil, symmetric_matrix, times
from cms.reduction.model import ReducedModel
from cms.solvers.eigen import DENSE_AT_MOST, Modes, Shifted, lowest_modes

BoolArray = NDArray[np.bool_]
IntArray = NDArray[np.intp]
ONE_FREQUENCY = 1e-9  # relative difference of squares that are the same but for rounding
NEGLIGIBLE_PARTICIPATION = 1e-9
NEGLIGIBLE_COUPLING = 1e-9
MOST_LISTED = 12


def lowest_seen_modes(
    pencil: Pencil, shifted: Shifted, count: int, loads: FloatArray
) -> tuple[Modes, Modes]:
    """The ``count`` lowest modes that some load moves, and those below that none does.

    Fewer where the component has no more. Rigid-body modes are among the first ones always. Modes
    of one frequency are told apart by the loads, see `turned`.

    Raises
    ------
    ReductionError
        As `lowest_modes`, and if a large component has too few among a quarter of its modes.
    """
    if not count or not loads.shape[1]:
        modes = lowest_modes(pencil, shifted, count)
        return modes, chosen(modes, np.zeros(count, dtype=bool))
    most = pencil.size - pencil.massless.shape[1]
    limit = most if pencil.size <= DENSE_AT_MOST else pencil.size // 4
    asked = max(count, min(count + 1, limit))
    while True:
        modes = lowest_modes(pencil, shifted, asked)
        groups = of_one_frequency(modes)
        modes = turned(modes, groups, loads)
        seen = moved(modes, loads)
        whole = (groups < groups[-1]) | (asked >= limit)  # the last may have more modes
        found = int(np.count_nonzero(seen & whole))
        if found >= count or asked >= limit:
            break
        asked = min(2 * asked, limit)
    if found < count and asked < most:
        raise ReductionError(
            f"modes = {count}, but interfaces see only {found} of the component's lowest {asked} "
            "modes, and more are not computed; ask for fewer"
        )
    rank = np.cumsum(seen)
    return chosen(modes, seen & (rank <= count)), chosen(modes, ~seen & (rank < count))


def of_one_frequency(modes: Modes) -> IntArray:
    """A number for each mode (k,), the same for modes that only their errors tell apart."""
    doubt = np.maximum(ONE_FREQUENCY, modes.errors[1:] + modes.errors[:-1])
    apart = np.diff(modes.squares) > doubt * modes.squares[1:]
    return np.concatenate([[0], np.cumsum(apart)])


def turned(modes: Modes, groups: IntArray, loads: FloatArray) -> Modes:
    """The modes with those of one frequency turned among each other.

    The first of them is the one that the loads (N, m), scaled to one, move most; so only as many
    are moved as there are independent loads. Rigid-body modes stay.
    """
    forces = loads.T @ modes.vectors
    forces /= np.fmax(np.linalg.norm(loads, axis=0), np.finfo(float).tiny)[:, None]
    squares, vectors, errors = modes.squares.copy(), modes.vectors.copy(), modes.errors.copy()
    for group in np.flatnonzero(np.bincount(groups) > 1):
        same = np.flatnonzero(groups == group)
        if squares[same[0]] == 0.0:
            continue
        _, _, turn = linalg.svd(forces[:, same])
        vectors[:, same] = vectors[:, same] @ turn.T
        spread = np.ptp(squares[same]) / squares[same[0]]
        squares[same] = turn**2 @ squares[same]
        errors[same] = np.max(errors[same]) + spread
    return Modes(squares, vectors, errors)


def moved(modes: Modes, loads: FloatArray) -> BoolArray:
    """Whether some load (N, m) moves each mode, (k,); rigid-body modes count as moved."""
    share = np.abs(loads.T @ modes.vectors)
    size = np.linalg.norm(loads, axis=0)[:, None] * np.linalg.norm(modes.vectors, axis=0)
    seen: BoolArray = np.any(share > NEGLIGIBLE_PARTICIPATION * size, axis=0)
    seen |= modes.squares == 0.0
    return seen


def chosen(modes: Modes, which: BoolArray) -> Modes:
    """Some of the modes, by a mask (k,)."""
    return Modes(modes.squares[which], modes.vectors[:, which], modes.errors[which])


def couples(damping: Any, basis: FloatArray, left_out: FloatArray) -> bool:
    """Whether a damping matrix couples the modes left out (N, k) with a model's basis (N, r)."""
    if damping is None or not left_out.shape[1]:
        return False
    forces = times(symmetric_matrix(damping, "damping"), left_out)
    size = np.linalg.norm(basis, axis=0)[:, None] * np.linalg.norm(forces, axis=0)
    return bool(np.any(np.abs(basis.T @ forces) > NEGLIGIBLE_COUPLING * size))


def told_of_left_out(hz: Sequence[float], fewer: str = "") -> list[str]:
    """One sentence on the modes left out, with their frequencies; none where there are none."""
    if not hz:
        return []
    listed = [f"{one:.4g}" for one in hz]
    if len(listed) > MOST_LISTED:
        listed = [*listed[: MOST_LISTED - 1], "...", listed[-1]]
    modes, are = ("mode", "is") if len(hz) == 1 else ("modes", "are")
    head = f"{len(hz)} {modes} that no interface sees {are} left out: {', '.join(listed)} Hz"
    return [head + fewer]


def told_of_seen(reduced: ReducedModel, asked: int | None) -> list[str]:
    """As `told_of_left_out`, also of fewer modes than were asked for."""
    few = asked is not None and reduced.modes < asked
    fewer = f"; the component has only {reduced.modes} that one sees, not {asked}" if few else ""
    return told_of_left_out(reduced.left_out_hz, fewer)
