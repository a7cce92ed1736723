"""The file beside a directory of results that keeps an interrupted run."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from nldyn.runtime.result_directory import clear_leftovers

ENDING = ".unfinished.h5"


def unfinished_path(directory: str | Path) -> Path:
    """Name the file that keeps what was computed for a directory of results.

    Examples
    --------
    >>> unfinished_path("results/one_dof").name
    'one_dof.unfinished.h5'
    """
    target = Path(directory).resolve()
    return target.with_name(target.name + ENDING)


@contextmanager
def unfinished_file(directory: str | Path) -> Iterator[Path]:
    """Give the place of that file; it is removed when all is well, and stays otherwise.

    Parameters
    ----------
    directory : str or Path
        Where the results shall be. Folders above it that do not exist are made, and removed again
        if nothing is in them at the end.

    Yields
    ------
    Path
        For the checkpoints of the computation.

    Examples
    --------
    >>> import tempfile
    >>> with unfinished_file(Path(tempfile.mkdtemp()) / "results") as path:
    ...     _ = path.write_text("some branches")
    >>> path.exists()
    False
    """
    path = unfinished_path(directory)
    clear_leftovers(path)
    made = [folder for folder in path.parents if not folder.exists()]
    path.parent.mkdir(parents=True, exist_ok=True)
    try:
        yield path
        path.unlink(missing_ok=True)
    finally:
        for folder in made:
            with suppress(OSError):
                folder.rmdir()
