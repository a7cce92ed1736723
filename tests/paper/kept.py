"""What an interrupted `make paper` has computed, kept beside its results until all is done.

Diagrams are kept in HDF5 files of branches, everything else as JSON with a digest: data, no code.
"""

from __future__ import annotations

import hashlib
import json
import shutil
import sys
from collections.abc import Callable
from contextlib import suppress
from importlib.metadata import version
from pathlib import Path
from typing import Any

from nldyn.base.errors import SystemModelError
from nldyn.base.resources import PACKAGE
from nldyn.io.branches import load_diagram
from nldyn.io.store import save
from nldyn.runtime.files import write_whole
from nldyn.runtime.result_directory import OutputError
from nldyn.search.diagram import Diagram

ENDING = ".unfinished"
# what results depend on, beside the package
BESIDE = ("cms", "fem", "meshes", "docs/examples", "tests/paper")
SOURCES = (".py", ".c", ".h", ".csv", ".toml", ".msh", ".vtu", ".inp")


def unfinished_folder(directory: str | Path) -> Path:
    """Folder beside a directory of results that keeps what an interrupted run has computed."""
    target = Path(directory).resolve()
    return target.with_name(target.name + ENDING)


def kept_folder(directory: str | Path) -> Path:
    """Folder in it for what the code as it is now computes; that of other code is removed."""
    above = unfinished_folder(directory)
    folder = above / stamp()
    for other in above.glob("*"):
        if other != folder:
            shutil.rmtree(other, ignore_errors=True)
    folder.mkdir(parents=True, exist_ok=True)
    return folder


def has_values(folder: Path) -> bool:
    """Whether anything is kept in a folder of `unfinished_folder`."""
    return any(path.suffix in (".h5", ".json") for path in folder.glob("*/*"))


def kept_diagram(path: Path, compute: Callable[[], Diagram]) -> Diagram:
    """A diagram from a file if it was computed before; else it is computed, and kept there."""
    known = read_diagram(path)
    if known is not None:
        return known
    found = compute()
    with suppress(OutputError):  # a full disk, say: nothing is lost but what could be kept
        save(found, path)
    return found


def read_diagram(path: Path) -> Diagram | None:
    """The diagram in a file; None if there is none, or it is not as it was written."""
    try:
        return load_diagram(path) if path.exists() else None
    except SystemModelError:
        return None


def kept_numbers(path: Path, compute: Callable[[], Any]) -> Any:
    """Numbers and texts, in lists and dictionaries, from a JSON file if they were computed before.

    Else they are computed, and kept there.
    """
    known = read_numbers(path)
    if known is not None:
        return known
    found = compute()
    with suppress(OutputError):
        write_numbers(path, found)
    return found


def read_numbers(path: Path) -> Any:
    """What a file of `write_numbers` holds; None if there is none, or it is damaged."""
    try:
        kept = json.loads(path.read_bytes())
        values = kept["values"]
        return values if kept["sha256"] == _digest(values) else None
    except (OSError, ValueError, KeyError, TypeError):
        return None


def write_numbers(path: Path, values: Any) -> None:
    """Write numbers and texts as JSON with a digest of them, whole or not at all.

    Raises
    ------
    OutputError
        If the file cannot be written.
    """
    write_whole(path, json.dumps({"sha256": _digest(values), "values": values}).encode())


def _digest(values: Any) -> str:
    return hashlib.sha256(json.dumps(values).encode()).hexdigest()


def stamp() -> str:
    """Digest of the code, the data and the packages that results depend on."""
    digest = hashlib.sha256(sys.version.encode())
    for package in ("numpy", "scipy", "scikit-fem"):
        digest.update(version(package).encode())
    for place in (PACKAGE, *(PACKAGE.parent / name for name in BESIDE)):
        for path in sorted(place.rglob("*")):
            if path.suffix in SOURCES:
                digest.update(path.name.encode() + path.read_bytes())
    return digest.hexdigest()[:16]
