"""Files that appear whole or not at all."""

from __future__ import annotations

import secrets
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


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
