"""Files that appear whole or not at all."""

from __future__ import annotations

import secrets
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from fem.base.errors import ModelError


@contextmanager
def plain_write_errors(target: Path) -> Iterator[None]:
    """Tell what the system says when a file cannot be written as a ModelError that names it.

    Examples
    --------
    >>> with plain_write_errors(Path("/no/such/folder/x.npz")):
    ...     raise FileNotFoundError(2, "No such file or directory", "/no/such/folder/.x-1.npz")
    Traceback (most recent call last):
        ...
    fem.base.errors.ModelError: /no/such/folder/x.npz: cannot be written: no such file or directory
    """
    try:
        yield
    except OSError as error:
        reason = error.strerror or str(error)
        raise ModelError(
            f"{target}: cannot be written: {reason[:1].lower() + reason[1:]}"
        ) from error


@contextmanager
def draft_of(target: Path) -> Iterator[Path]:
    """Name of a file beside the target that takes its place at the end, or vanishes on an error.

    Examples
    --------
    >>> import tempfile
    >>> target = Path(tempfile.mkdtemp()) / "note.txt"
    >>> with draft_of(target) as draft:
    ...     _ = draft.write_text("whole")
    >>> [path.name for path in target.parent.iterdir()]
    ['note.txt']
    """
    draft = target.with_name(f".{target.stem}-{secrets.token_hex(4)}{target.suffix.lower()}")
    try:
        yield draft
        draft.replace(target)
    finally:
        draft.unlink(missing_ok=True)
