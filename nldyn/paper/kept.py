"""What an interrupted `nldyn paper` has computed, kept beside its results until all is done."""

from __future__ import annotations

import hashlib
import pickle
import shutil
import sys
from collections.abc import Callable
from contextlib import suppress
from importlib.metadata import version
from pathlib import Path
from typing import Any, TypeVar

from nldyn.base.resources import PACKAGE
from nldyn.runtime.files import write_whole
from nldyn.runtime.result_directory import OutputError

Value = TypeVar("Value")
ENDING = ".unfinished"
DIGEST_SIZE = hashlib.sha256().digest_size
BESIDE = ("cms", "fem", "meshes", "docs/examples")  # what results depend on, beside the package


def unfinished_folder(directory: str | Path) -> Path:
    """Folder beside a directory of results that keeps what an interrupted run has computed."""
    target = Path(directory).resolve()
    return target.with_name(target.name + ENDING)


def kept_folder(directory: str | Path) -> Path:
    """Folder in it for what the code as it is now computes; that of other code is removed."""
    above = unfinished_folder(directory)
    folder = above / _stamp()
    for other in above.glob("*"):
        if other != folder:
            shutil.rmtree(other, ignore_errors=True)
    folder.mkdir(parents=True, exist_ok=True)
    return folder


def kept(path: Path, function: Callable[..., Value], *arguments: object) -> Value:
    """Value of a function, from a file if it was computed before."""
    known: Value | None = read_kept(path)
    if known is not None:
        return known
    value = function(*arguments)
    keep(path, value)
    return value


def read_kept(path: Path) -> Any:
    """What a file keeps; None if there is none, or it is not as it was written."""
    try:
        written = path.read_bytes()
    except OSError:
        return None
    digest, content = written[:DIGEST_SIZE], written[DIGEST_SIZE:]
    return pickle.loads(content) if digest == hashlib.sha256(content).digest() else None


def keep(path: Path, value: object) -> None:
    """Keep a value in a file, whole or not at all; not where it cannot be written."""
    content = pickle.dumps(value, pickle.HIGHEST_PROTOCOL)
    with suppress(OutputError):
        write_whole(path, hashlib.sha256(content).digest() + content)


def has_values(folder: Path) -> bool:
    """Whether anything is kept in a folder of `unfinished_folder`."""
    return any(folder.glob("*/*.pickle"))


def _stamp() -> str:
    """Digest of the code, the data and the packages that results depend on."""
    digest = hashlib.sha256(sys.version.encode())
    for package in ("numpy", "scipy", "numba", "scikit-fem"):
        digest.update(version(package).encode())
    for place in (PACKAGE, *(PACKAGE.parent / name for name in BESIDE)):
        for path in sorted(place.rglob("*")):
            if path.suffix in (".py", ".csv", ".toml", ".msh", ".vtu", ".inp"):
                digest.update(path.name.encode() + path.read_bytes())
    return digest.hexdigest()[:16]
