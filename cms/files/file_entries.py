"""Which entry of a file is meant."""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path

from cms.base.errors import ReductionError


def chosen_entry(
    path: Path, known: Collection[str], name: str | None, kinds: tuple[str, str], example: str
) -> str:
    """The entry of a file that is asked for, or the only one.

    ``kinds`` is what an entry is called, and several are; ``example`` stands for one where there is
    none.

    Raises
    ------
    ReductionError
        If there is no such entry, or there are several and no name is given.
    """
    listed = ", ".join(known) or "none"
    if name is None:
        if len(known) != 1:
            full = f"{path.name}:{next(iter(known), example)}"
            raise ReductionError(f'must be told as "{full}", as it has the {kinds[1]} {listed}')
        return next(iter(known))
    if name not in known:
        raise ReductionError(f"has no {kinds[0]} '{name}'; it has: {listed}")
    return name
