"""Files that are written whole or not at all."""

from __future__ import annotations

import os
import secrets
from contextlib import suppress
from pathlib import Path

from nldyn.base.errors import shown
from nldyn.runtime.result_directory import OutputError, in_use, is_writable


def check_writable(path: str | Path) -> Path:
    """Where a file is written, at the end of all links, or an OutputError, before the work.

    Examples
    --------
    >>> check_writable("/no/such/folder/branch.h5")
    Traceback (most recent call last):
        ...
    nldyn.runtime.result_directory.OutputError: /no/such/folder/branch.h5: there is no such folder
    """
    try:
        if "\0" in str(path):
            raise ValueError("it has a null character")
        place = Path(path)
        if place.is_dir():
            raise OutputError(f"{path}: is a folder, not a file")
        if place.exists() and not place.is_file():
            raise OutputError(f"{path}: is a device or a pipe, not a file")
        target = place.resolve()
        if not target.parent.is_dir():
            raise OutputError(f"{path}: there is no such folder")
        if not is_writable(target.parent):
            raise OutputError(f"{path}: the folder is read-only")
        with suppress(FileNotFoundError):
            os.lstat(_draft(target))  # its name may be too long
        with suppress(FileNotFoundError):
            os.stat(target)  # links may lead in a circle: Python before 3.13 has raised by now
    except OutputError:
        raise
    except (TypeError, ValueError, OSError, RuntimeError) as error:
        fault = (error.strerror or "").lower() if isinstance(error, OSError) else error
        raise OutputError(f"{shown(path)} cannot be the name of a file: {fault}") from None
    return target


def write_whole(path: str | Path, content: bytes) -> None:
    """Write a file beside its place, then put it there; on an error the place is as it was.

    A link stays one.

    Raises
    ------
    OutputError
        If the system refuses.
    """
    target = check_writable(path)
    draft = _draft(target)
    try:
        with draft.open("wb") as file, in_use(draft):
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        os.replace(draft, target)
    except OSError as error:
        fault = (error.strerror or str(error)).lower()
        raise OutputError(f"{path}: cannot be written: {fault}") from error
    finally:
        with suppress(OSError):
            draft.unlink(missing_ok=True)


def _draft(target: Path) -> Path:
    """Where a file is written before it is put in its place."""
    return target.with_name(f".{target.name}.{secrets.token_hex(4)}.new")
