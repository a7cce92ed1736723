"""The HDF5 file in which a running computation keeps what it has found."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from nldyn.base.errors import SystemModelError, shown
from nldyn.branches.branch import Branch
from nldyn.branches.checkpoint import Tally
from nldyn.curves.curves import Curve
from nldyn.io.branches import load_bare_branches, load_exploration, save_branches, save_exploration
from nldyn.io.curves import (
    FORMAT,
    is_self_excited,
    load_curves,
    save_curves,
    save_self_excited,
)
from nldyn.io.flow import laws_of
from nldyn.io.hdf5 import kind_of
from nldyn.orbits.orbit import Orbit
from nldyn.runtime.files import check_writable
from nldyn.runtime.keeper import begun_before
from nldyn.search.exploration import Exploration
from nldyn.system.system import System


@dataclass(frozen=True)
class CheckpointFile:
    """A file in which a computation keeps what it has found, now and then and at its end.

    It is also written when an exception such as Ctrl-C ends the computation. If it holds this very
    computation, that one goes on, and gives what an uninterrupted one gives.

    Parameters
    ----------
    path : str or Path
        An HDF5 file, new or of an earlier run; `nldyn.load` reads it at any time.

    Examples
    --------
    >>> CheckpointFile("harmonic.h5")
    CheckpointFile('harmonic.h5')
    """

    path: str | Path

    def __post_init__(self) -> None:
        if not isinstance(self.path, str | Path):
            raise SystemModelError(f"CheckpointFile: {shown(self.path)} is not the name of a file")

    def __repr__(self) -> str:
        return f"CheckpointFile({str(self.path)!r})"

    @property
    def name(self) -> str:
        """How messages call it."""
        return str(self.path)

    def exists(self) -> bool:
        """Whether an earlier run has written it."""
        return Path(self.path).exists()

    def check_writable(self) -> None:
        """Raise an `OutputError` if it cannot be written."""
        check_writable(self.path)

    def remove(self) -> None:
        """Delete it, if it is there."""
        Path(self.path).unlink(missing_ok=True)

    def read_branches(self, system: System) -> tuple[list[Branch], Tally | None]:
        """The branches of a system that it holds, and how far a search has come; none if new."""
        if not self.exists():
            return [], None
        laws = laws_of(system)

        def read(path: Path) -> tuple[list[Branch], Tally | None]:
            if kind_of(path)[0] != FORMAT:
                return load_bare_branches(path, laws)
            found = load_curves(path, laws=laws)
            return [each for each in found if isinstance(each, Branch)], None

        return begun_before(read, Path(self.path))

    def write_branches(self, branches: Sequence[Branch], tally: Tally | None = None) -> None:
        """Keep branches in place of what it holds."""
        if any(map(is_self_excited, branches)):
            save_self_excited(self.path, branches)
        else:
            save_branches(self.path, branches, tally)

    def read_exploration(self, system: System) -> Exploration:
        """The exploration of a system that it holds."""
        laws = laws_of(system)
        return begun_before(lambda path: load_exploration(path, laws=laws), Path(self.path))

    def write_exploration(self, found: Exploration) -> None:
        """Keep an exploration in place of what it holds."""
        save_exploration(self.path, found)

    def read_curves(self, system: System, monitor: Callable[[Orbit], float] | None) -> list[Curve]:
        """The curves of a system that it holds."""
        laws = laws_of(system)
        found = begun_before(
            lambda path: load_curves(path, laws=laws, monitor=monitor), Path(self.path)
        )
        return [each for each in found if isinstance(each, Curve)]

    def write_curves(self, curves: Sequence[Curve]) -> None:
        """Keep curves in place of what it holds."""
        save_curves(self.path, curves)
