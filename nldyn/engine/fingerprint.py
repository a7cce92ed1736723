"""The fingerprint of the engine's sources, which a library holds and their folder is asked for.

It is also read where the engine is built, before nldyn can be imported.
"""

from __future__ import annotations

from hashlib import sha256
from pathlib import Path


def fingerprint(folder: Path) -> int | None:
    """A number of 60 bits that changes with the C files of a folder; None where it has none.

    Examples
    --------
    >>> fingerprint(Path("nowhere"))
    """
    sources = sorted([*folder.glob("*.c"), *folder.glob("*.h")])
    digest = sha256()
    for source in sources:
        digest.update(source.name.encode() + b"\0" + source.read_bytes())
    return int(digest.hexdigest()[:15], 16) if sources else None
