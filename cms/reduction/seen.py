"""The modes that an interface sees; nothing moves the others, which are left out."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cms.base.arrays import FloatArray
from cms.base.errors import ReductionError
from cms.component.component import Pencil, symmetric_matrix, times
from cms.reduction.model import ReducedModel
from cms.solvers.eigen import DENSE_AT_MOST, Modes, Shifted, lowest_modes

BoolArray = NDArray[np.bool_]
NEGLIGIBLE_PARTICIPATION = 1e-9
NEGLIGIBLE_COUPLING = 1e-9
MOST_LISTED = 12


def lowest_seen_modes(
    pencil: Pencil, shifted: Shifted, count: int, loads: FloatArray
) -> tuple[Modes, Modes]:
    """The ``count`` lowest modes that some load moves, and those below that none does.

    Fewer where the component has no more. Rigid-body modes are among the first ones always.

    Raises
    ------
    ReductionError
        As `lowest_modes`, and if a large component has too few among a quarter of its modes.
    """
    most = pencil.size - pencil.massless.shape[1]
    limit = most if pencil.size <= DENSE_AT_MOST else pencil.size // 4
    asked = count
    while True:
        modes = lowest_modes(pencil, shifted, asked)
        seen = moved(modes, loads)
        found = int(np.count_nonzero(seen))
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


def moved(modes: Modes, loads: FloatArray) -> BoolArray:
    """Whether some load (N, m) moves each mode, (k,); rigid-body modes count as moved."""
    if not loads.shape[1]:
        return np.ones(modes.squares.shape, dtype=bool)
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
