"""Directories of results that appear whole or not at all.

Files are written into a hidden directory beside the wanted one, which takes its place by renaming
when all is well. A directory that was written before is replaced; what somebody else put there
is kept, and a directory that holds only other people's files is refused.
"""

from __future__ import annotations

import json
import os
import re
import secrets
import shutil
import stat
import tomllib
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

try:
    import fcntl
except ImportError:  # Windows: drafts of a killed run stay there
    fcntl = None  # type: ignore[assignment]

MANIFEST = ".nldyn.json"
SCENE = "scene.toml"  # the copy of the scene whose results a directory holds
ATTEMPTS = 100  # to make a folder whose parents other processes make and remove


class OutputError(ValueError):
    """A directory that results cannot be written to; one sentence says why."""


def check_directory(directory: str | Path) -> Path:
    """Check that results may be written to a directory, before the work that makes them.

    Parameters
    ----------
    directory : str or Path
        A directory that does not exist, is empty, or holds results written before.

    Returns
    -------
    Path
        The absolute path, symbolic links resolved.

    Raises
    ------
    OutputError
        If it is a file, is read-only, holds only other files, or cannot be written to.

    Examples
    --------
    >>> import tempfile
    >>> check_directory(tempfile.mkdtemp()).is_dir()
    True
    """
    try:
        target = Path(directory).resolve()
        with _alone(target.parent):
            clear_leftovers(target)
            _check(target, directory)
        with _new_directory(target):
            return target
    except (OSError, ValueError, RuntimeError) as error:
        if isinstance(error, OutputError):
            raise
        fault = getattr(error, "strerror", None) or error
        raise OutputError(f"{directory}: cannot be made: {fault}") from error


def _check(target: Path, directory: str | Path) -> None:
    if target.exists() and not target.is_dir():
        raise OutputError(f"{directory}: is a file, not a directory for results")
    if target.is_dir() and any(target.iterdir()) and not (target / MANIFEST).is_file():
        raise OutputError(
            f"{directory}: holds files that were not written by nldyn; choose another directory"
        )
    if target.is_dir() and not is_writable(target):
        raise OutputError(f"{directory}: is read-only; choose another directory")
    above = next(folder for folder in (target, *target.parents) if folder.exists())
    if not is_writable(above):
        raise OutputError(f"{directory}: cannot be made: {above} is read-only")
    if target.is_mount():
        raise OutputError(f"{directory}: cannot be replaced; choose a folder in it")


def is_writable(folder: Path) -> bool:
    """Whether files may be put into a directory; where its mode says no, not by root either."""
    return bool(folder.stat().st_mode & stat.S_IWUSR) and os.access(folder, os.W_OK)


@contextmanager
def _new_directory(target: Path) -> Iterator[Path]:
    """Make the hidden directory beside the wanted one; leave nothing of it behind."""
    made = [folder for folder in target.parents if not folder.exists()]
    new = target.with_name(f".{target.name}.{secrets.token_hex(4)}.new")
    handle = None
    try:
        handle = _make(new)
        yield new
    finally:
        if handle is not None:
            os.close(handle)
        shutil.rmtree(new, ignore_errors=True)
        for folder in made:
            with suppress(OSError):
                folder.rmdir()


def _make(new: Path) -> int | None:
    """Make a directory and lock it; another run may just be removing the folders above it."""
    for left in reversed(range(ATTEMPTS)):
        try:
            if not new.parent.exists():
                new.parent.mkdir(parents=True, exist_ok=True)
            with _alone(new.parent):
                new.mkdir()
                return _locked(new)
        except FileNotFoundError:
            if not left:
                raise
    return None


@contextmanager
def result_directory(directory: str | Path, kind: str) -> Iterator[Path]:
    """Give a directory to write results in, and move it to its place at the end.

    Parameters
    ----------
    directory : str or Path
        Where the results shall be.
    kind : str
        Name of what is written. Files that the same kind left before are replaced; all others
        in a directory of results are kept, unless they are results of a scene that says something
        else than the ``scene.toml`` that is written.

    Yields
    ------
    Path
        An empty directory to write in.

    Raises
    ------
    OutputError
        As `check_directory`. After any exception, also one of the caller's own, the directory is
        as it was before.

    Examples
    --------
    >>> import tempfile
    >>> place = Path(tempfile.mkdtemp()) / "results"
    >>> with result_directory(place, "run") as folder:
    ...     _ = (folder / "table.csv").write_text("1")
    >>> (place / "table.csv").read_text()
    '1'
    """
    target = check_directory(directory)
    try:
        with _new_directory(target) as new:
            try:
                yield new
            except OutputError as error:  # names a file of the draft
                raise OutputError(str(error).replace(str(new), str(directory))) from error
            with _alone(target.parent):
                _complete(new, target, kind)
                _swap(new, target)
    except OSError as error:
        fault = (error.strerror or str(error)).lower()
        raise OutputError(f"{directory}: cannot be written: {fault}") from error


def _complete(new: Path, target: Path, kind: str) -> None:
    """Write the manifest, and carry over what is not replaced."""
    manifest = _read_manifest(target)
    written = sorted(entry.name for entry in new.iterdir())
    scene = new / SCENE
    if scene.is_file() and says_something_else(target, scene.read_text(encoding="utf-8")):
        manifest = {kind: [name for names in manifest.values() for name in names]}
    replaced = {MANIFEST, *written, *manifest.get(kind, [])}
    if target.is_dir():
        for entry in target.iterdir():
            if entry.name not in replaced:
                _link(entry, new / entry.name)
    kept = {other: [n for n in names if n not in written] for other, names in manifest.items()}
    (new / MANIFEST).write_text(json.dumps({**kept, kind: written}, indent=1) + "\n")


def says_something_else(
    directory: Path, text: str, apart_from: tuple[str, ...] = ("title",)
) -> bool:
    """Whether a scene differs from the copy in a directory of results, if there is one.

    Comments and the tables or keys ``apart_from`` do not count.

    Examples
    --------
    >>> says_something_else(Path("nowhere"), "[[stops]]")
    False
    """

    def asked(told: str) -> dict[str, object]:
        return {key: value for key, value in tomllib.loads(told).items() if key not in apart_from}

    try:
        before = asked((directory / SCENE).read_text(encoding="utf-8-sig"))
    except (OSError, ValueError):
        return False
    return before != asked(text.removeprefix("\ufeff"))


def written_files(directory: str | Path, kind: str) -> list[str]:
    """Names of the files of a kind in a directory of results, see `result_directory`.

    Examples
    --------
    >>> written_files("nowhere", "run")
    []
    """
    return list(_read_manifest(Path(directory)).get(kind, []))


def _read_manifest(target: Path) -> dict[str, list[str]]:
    try:
        manifest = json.loads((target / MANIFEST).read_text())
    except (OSError, ValueError):
        return {}
    return manifest if isinstance(manifest, dict) else {}


def _link(source: Path, copy: Path) -> None:
    """Carry over a file or a folder, without copying its bytes where the file system allows."""

    def link(old: str, new: str) -> None:
        try:
            os.link(old, new, follow_symlinks=False)
        except OSError:
            shutil.copy2(old, new, follow_symlinks=False)

    if source.is_dir() and not source.is_symlink():
        shutil.copytree(source, copy, symlinks=True, copy_function=link)
    else:
        link(str(source), str(copy))


def _swap(new: Path, target: Path) -> None:
    """Put the new directory in the place of the old one, or leave the old one where it was."""
    if not target.exists():
        new.rename(target)
        return
    shutil.copymode(target, new)
    old = target.with_name(f".{target.name}.{secrets.token_hex(4)}.old")
    with in_use(target):
        target.rename(old)
        try:
            new.rename(target)
        except BaseException:
            old.rename(target)
            raise
        shutil.rmtree(old, ignore_errors=True)


@contextmanager
def _alone(parent: Path) -> Iterator[None]:
    """Let no other run put anything into a folder, or clear it, meanwhile."""
    handle = None
    if fcntl is not None:
        with suppress(OSError):  # a file system without locks
            handle = os.open(parent, os.O_RDONLY | os.O_DIRECTORY)
            fcntl.flock(handle, fcntl.LOCK_EX)
    try:
        yield
    finally:
        if handle is not None:
            os.close(handle)


@contextmanager
def in_use(path: Path) -> Iterator[None]:
    """Hold a lock that tells other processes that a draft is not left over; it ends with this one.

    Examples
    --------
    >>> import tempfile
    >>> with in_use(Path(tempfile.mkdtemp()) / "not_there"):
    ...     pass
    """
    handle = _locked(path)
    try:
        yield
    finally:
        if handle is not None:
            os.close(handle)


def _locked(path: Path) -> int | None:
    """An open handle that locks a file or folder; None if another has it, or none can be had."""
    if fcntl is None:
        return None
    try:
        handle = os.open(path, os.O_RDONLY)
    except OSError:
        return None
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        os.close(handle)
        return None
    return handle


def clear_leftovers(target: Path) -> None:
    """Remove the drafts of runs that were killed, and put back results they had moved away."""
    pattern = re.compile(rf"\.{re.escape(target.name)}\.[0-9a-f]{{8}}\.(new|old)")
    try:
        found = [entry for entry in target.parent.iterdir() if pattern.fullmatch(entry.name)]
    except OSError:
        return
    for entry in found:
        handle = _locked(entry)
        if handle is None:
            continue
        with suppress(OSError):
            if entry.name.endswith(".old") and not target.exists():
                entry.rename(target)
            elif entry.is_dir():
                shutil.rmtree(entry, ignore_errors=True)
            else:
                entry.unlink()
        os.close(handle)
