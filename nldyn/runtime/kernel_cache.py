"""Compiled kernels: where they are kept, when they are outdated, and their first call."""

from __future__ import annotations

import atexit
import gc
import hashlib
import os
import shutil
import sys
import tempfile
from pathlib import Path
from typing import Any

import numba
from numba.core import event
from numba.core.caching import FunctionCache

from nldyn.runtime.compilation import compilations
from nldyn.runtime.interruption import deferred_interruption

ADVICE = (
    "nldyn: no folder to keep compiled code in, so each start compiles for a minute or two; "
    "set NUMBA_CACHE_DIR to a folder to write in"
)

_save = FunctionCache.save_overload
_told: set[str] = set()
_watching: list[event.Listener] = []


class _Watch(event.Listener):
    """Tells of the compilations of this package's kernels; code from the cache needs none."""

    def on_start(self, event: Any) -> None:
        if _is_own(event):
            compilations.begin()

    def on_end(self, event: Any) -> None:
        if _is_own(event):
            compilations.end()


def _is_own(event: Any) -> bool:
    return str(event.data["dispatcher"].py_func.__module__).startswith("nldyn.")


def ensure_cache() -> None:
    """Give numba a folder for this process and its children where it finds none by itself.

    From then on code that cannot be kept in its folder, on a full disk for instance, is used all
    the same, and compilations are told.
    """
    if not _watching:
        _watching.append(_Watch())
        event.register("numba:compile", _watching[0])  # type: ignore[no-untyped-call]
    FunctionCache.save_overload = _save_if_possible  # type: ignore[method-assign, assignment]
    try:
        numba.njit(cache=True)(_probe)
    except RuntimeError:
        folder = tempfile.mkdtemp(prefix="nldyn-")
        atexit.register(shutil.rmtree, folder, ignore_errors=True)
        os.environ["NUMBA_CACHE_DIR"] = folder
        os.environ.setdefault("MPLCONFIGDIR", folder)  # matplotlib would complain in two lines
        numba.config.reload_config()  # type: ignore[no-untyped-call]
        print(ADVICE, file=sys.stderr)


def _save_if_possible(cache: FunctionCache, signature: Any, data: Any) -> None:
    """Keep compiled code as numba does; where that fails, say so once for each folder."""
    try:
        _save(cache, signature, data)  # type: ignore[no-untyped-call]
    except OSError as error:
        folder = cache.cache_path
        if folder not in _told:
            fault = (error.strerror or str(error)).lower()
            print(
                f"nldyn: warning: compiled code cannot be kept in {folder}: {fault}; without it "
                "each start compiles for a minute or two",
                file=sys.stderr,
            )
            _told.add(folder)


def resting_on(decorator: Any, *files: str | None) -> Any:
    """A compiling decorator whose cached code is also outdated when one of the files changes.

    numba looks at the file of the function alone, not at those of the functions that it calls.
    """
    contents = b"".join(Path(file).read_bytes() for file in files if file)
    stamp = hashlib.sha256(contents).hexdigest()

    def decorate(function: Any) -> Any:
        kernel = decorator(function)
        cache_file = getattr(getattr(kernel, "_cache", None), "_cache_file", None)
        if cache_file is not None:
            cache_file._source_stamp = (cache_file._source_stamp, stamp)
        return kernel

    return decorate


def first_call(kernel: Any, *arguments: object) -> Any:
    """Call a kernel that may have to be compiled for it, without Python's collector of cycles.

    The compiler makes millions of objects that stay; to search them again and again for cycles
    takes a sixth of its time. The call comes after it, and a Ctrl-C after the call: numba takes an
    interruption of what it prepares for a kernel's first results for a result, and that crashes.
    """
    enabled = gc.isenabled()
    gc.disable()
    try:
        kernel.compile(tuple(kernel.typeof_pyval(argument) for argument in arguments))
    finally:
        if enabled:
            gc.enable()
    with deferred_interruption():
        return kernel(*arguments)


def _probe() -> None:
    """Nothing: only its place in the file system counts."""
