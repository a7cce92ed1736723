"""HDF5 files of nldyn, read with every fault told by its place."""

from __future__ import annotations

import io
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import ArrayLike, NDArray

from nldyn.base.arrays import Real
from nldyn.base.errors import SystemModelError, shown
from nldyn.base.version import software_version
from nldyn.runtime.files import write_whole


@contextmanager
def new_file(path: str | Path, format_: str, version: int) -> Iterator[h5py.File]:
    """A file with the attributes that tell what it is, written whole or not at all at the end.

    Raises
    ------
    OutputError
        If it cannot be written.
    """
    memory = io.BytesIO()
    with h5py.File(memory, "w", libver=("v110", "v110")) as file:
        file.attrs["format"] = format_
        file.attrs["format_version"] = version
        file.attrs["software"] = f"nldyn {software_version()}"
        yield file
    write_whole(path, memory.getvalue())


def put(group: Any, name: str, values: ArrayLike, unit: str) -> None:
    """A dataset with its unit and, so that damage is noticed, with checksums."""
    array = np.asarray(values)
    packed = {"compression": "gzip", "compression_opts": 1, "shuffle": True, "fletcher32": True}
    data = group.create_dataset(name, data=array, **(packed if array.size else {}))
    data.attrs["unit"] = unit


def set_attribute(group: Any, key: str, value: Any) -> None:
    """An attribute: a text, several, or numbers."""
    texts = [value] if isinstance(value, str) else value
    if isinstance(texts, list | tuple) and all(isinstance(text, str) for text in texts):
        # texts of fixed length lie where HDF5 keeps a checksum, others do not
        encoded = [text.encode() for text in texts]
        length = max(1, *(len(text) for text in encoded), 1)
        kind = h5py.string_dtype("utf-8", length)
        shape = () if isinstance(value, str) else (len(encoded),)
        group.attrs.create(key, np.array(encoded, dtype=kind).reshape(shape), dtype=kind)
    else:
        group.attrs[key] = np.asarray(value)


class Group:
    """A group of a file; what is missing or of another kind is told with file and place."""

    def __init__(self, path: str | Path, group: Any) -> None:
        self.path, self._group = path, group

    def __contains__(self, name: str) -> bool:
        return name in self._group

    def fault(self, kind: str, name: str, what: str) -> SystemModelError:
        place = f"{self._group.name.rstrip('/')}/{name}"
        return SystemModelError(f"{self.path}: {kind} '{place}' {what}")

    def group(self, name: str) -> Group:
        inner = self._group.get(name)
        if not isinstance(inner, h5py.Group):
            raise self.fault("group", name, "is missing")
        return Group(self.path, inner)

    def has_group(self, name: str) -> bool:
        return isinstance(self._group.get(name), h5py.Group)

    def groups(self) -> list[Group]:
        return [self.group(name) for name in sorted(self._group)]

    def array(self, name: str, *shape: int, kind: type = float) -> NDArray[Any]:
        """A dataset of a shape, of which -1 may be any length."""
        data = self._group.get(name)
        if not isinstance(data, h5py.Dataset):
            raise self.fault("dataset", name, "is missing")
        try:
            array = np.asarray(data[()])
        except OSError as error:
            raise self.fault("dataset", name, f"is damaged: {error}") from None
        fits = len(shape) == array.ndim and all(
            wanted in (-1, have) for wanted, have in zip(shape, array.shape, strict=True)
        )
        if not fits:
            raise self.fault("dataset", name, f"has shape {array.shape} instead of {shape}")
        if array.dtype != np.dtype(kind):
            raise self.fault("dataset", name, f"has numbers of type {array.dtype}")
        return array

    def arrays(self) -> list[Real]:
        return [self.array(name, -1) for name in sorted(self._group)]

    def has_attribute(self, name: str) -> bool:
        return name in self._group.attrs

    def pair(self, name: str) -> tuple[float, float]:
        value = np.asarray(self.attribute(name))
        if value.shape != (2,) or value.dtype.kind != "f":
            raise self.fault("attribute", name, "is not a pair of numbers")
        return float(value[0]), float(value[1])

    def attribute(self, name: str) -> Any:
        if name not in self._group.attrs:
            raise self.fault("attribute", name, "is missing")
        return self._group.attrs[name]

    def number(self, name: str) -> float:
        return float(self._single(name, "f"))

    def whole(self, name: str) -> int:
        return int(self._single(name, "iu"))

    def _single(self, name: str, kinds: str) -> Any:
        value = np.asarray(self.attribute(name))
        if value.shape or value.dtype.kind not in kinds:
            raise self.fault("attribute", name, "is not a number of its kind")
        return value.item()

    def text(self, name: str) -> str:
        (text,) = self._texts(name, 0)
        return text

    def texts(self, name: str) -> list[str]:
        return self._texts(name, 1)

    def _texts(self, name: str, dimensions: int) -> list[str]:
        value = np.asarray(self.attribute(name))
        if value.ndim != dimensions or not (value.dtype.kind in "SU" or value.size == 0):
            raise self.fault("attribute", name, "is not a text" + "s" * dimensions)
        return [text if isinstance(text, str) else text.decode() for text in value.ravel().tolist()]


def _file_of(path: str | Path) -> h5py.File:
    """A file, read into memory."""
    try:
        content = Path(path).read_bytes()
    except TypeError:
        raise SystemModelError(f"{shown(path)} is not the name of a file") from None
    except FileNotFoundError:
        raise SystemModelError(f"{path}: there is no such file") from None
    except (OSError, ValueError) as error:
        reason = (getattr(error, "strerror", None) or str(error)).lower()
        raise SystemModelError(f"{path}: cannot be read: {reason}") from None
    try:
        return h5py.File(io.BytesIO(content), "r")
    except (OSError, RuntimeError, KeyError):
        raise SystemModelError(f"{path}: is not an HDF5 file, or is cut off or damaged") from None


def kind_of(path: str | Path) -> tuple[str, set[str]]:
    """The format of a file, and the names of its groups and attributes."""
    with _file_of(path) as file:
        root = Group(path, file)
        format_ = root.text("format") if root.has_attribute("format") else ""
        return format_, {*file, *file.attrs}


@contextmanager
def opened(path: str | Path, format_: str, version: int) -> Iterator[Group]:
    """The root of a file of a format that this version can read."""
    file = _file_of(path)
    with file:
        root = Group(path, file)
        try:
            _check_format(root, format_, version)
            yield root
        except SystemModelError:
            raise
        except (OSError, RuntimeError, KeyError, ValueError, TypeError, MemoryError) as error:
            # what h5py raises where a text or a type cannot be decoded
            raise SystemModelError(f"{path}: is damaged: {error}") from error


def _check_format(root: Group, format_: str, newest: int) -> None:
    if not root.has_attribute("format") or root.text("format") != format_:
        raise SystemModelError(
            f"{root.path}: is not a file of {format_.removeprefix('nldyn ')} of nldyn"
        )
    version = root.whole("format_version")
    if version > newest:
        raise SystemModelError(
            f"{root.path}: has format version {version}, written by {root.text('software')}; this "
            f"is nldyn {software_version()}, which reads versions up to {newest}"
        )
