"""Files that are written whole or not at all."""

from __future__ import annotations

import os
import secrets
from pathlib import Path

from nldyn.errors import shown
from nldyn.result_directory import OutputError, in_use, is_writable


def check_writable(path: str | Path) -> Path:
    """A path at which a file may be written, or an OutputError, before the work.

    Examples
    --------
    >>> check_writable("/no/such/folder/branch.h5")
    Traceback (most recent call last):
        ...
    nldyn.result_directory.OutputError: /no/such/folder/branch.h5: there is no such folder
    """
    try:
        target = Path(path)
        if "\0" in str(target):
            raise ValueError("it has a null character")
        if target.is_dir():
            raise OutputError(f"{path}: is a folder, not a file")
        if not target.parent.is_dir():
            raise OutputError(f"{path}: there is no such folder")
        if not is_writable(target.parent):
            raise OutputError(f"{path}: the folder is read-only")
    except (TypeError, ValueError) as error:
        if isinstance(error, OutputError):
            raise
        raise OutputError(f"{shown(path)} cannot be the name of a file: {error}") from None
    return target


def write_whole(path: str | Path, content: bytes) -> None:
    """Write a file beside its place, then put it there; on an error the place is as it was.

    Raises
    ------
    OutputError
        If the system refuses.
    """
    target = check_writable(path)
    draft = target.with_name(f".{target.name}.{secrets.token_hex(4)}.new")
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
        draft.unlink(missing_ok=True)
