"""Compressed VTK files that cannot unpack to more than a mesh of their size may hold."""

from __future__ import annotations

import lzma
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from threading import Lock
from types import SimpleNamespace

from meshio.vtu import _vtu

ALWAYS, TIMES = 200_000_000, 50  # bytes, and bytes for each one of the file
_lock = Lock()


@contextmanager
def bounded_unpacking(path: Path) -> Iterator[None]:
    """Let meshio unpack at most 200 MB and fifty times the size of a file, then raise ValueError.

    meshio itself has no bound, and a few megabytes can unpack to as many gigabytes.

    Examples
    --------
    >>> with bounded_unpacking(Path("meshes/half_beam.vtu")):
    ...     pass
    """
    left = ALWAYS + TIMES * path.stat().st_size

    def unpack(codec: zlib._Decompress | lzma.LZMADecompressor, data: bytes) -> bytes:
        nonlocal left
        content = codec.decompress(data, left + 1)
        left -= len(content)
        if left < 0:
            raise ValueError("it unpacks to far more than a mesh of its size holds")
        if not codec.eof:
            raise ValueError("its compressed data are cut off")
        return content

    bounded = {
        "zlib": SimpleNamespace(decompress=lambda data: unpack(zlib.decompressobj(), data)),
        "lzma": SimpleNamespace(decompress=lambda data: unpack(lzma.LZMADecompressor(), data)),
    }
    with _lock:
        before = {name: getattr(_vtu, name) for name in bounded}
        try:
            for name, codec in bounded.items():
                setattr(_vtu, name, codec)
            yield
        finally:
            for name, codec in before.items():
                setattr(_vtu, name, codec)
