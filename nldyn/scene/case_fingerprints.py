"""What a kept case of a study belongs to: its scene, its mesh and the function that measures."""

from __future__ import annotations

import dataclasses
import dis
import hashlib
import json
import sys
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from pathlib import Path, PurePath
from types import BuiltinFunctionType, CodeType, FunctionType, MethodType, ModuleType
from typing import Any

import numpy as np

from cms.files.matrix_files import split_source
from nldyn.base.errors import SystemModelError, shown

PLAIN = (bool, int, float, complex, str, bytes, np.generic, PurePath, range, slice)


def case_fingerprints(
    cases: list[dict[str, Any]], folder: Path, measure: Callable[..., Any], name: str | None
) -> list[str]:
    """A fingerprint of each case, of its tables, the bytes of the files it names and the measure.

    Raises
    ------
    SystemModelError
        If the measure depends on an object that has none and no name is given.
    """
    identity = (
        ["named", name] if name is not None else ["measure", MeasureFingerprint(measure).of_measure]
    )
    read: dict[str, str] = {}
    keys = []
    for tables in cases:
        structures = [tables, *tables.get("components", {}).values()]
        sources = [*(s.get("mesh", {}) for s in structures), *tables.get("excitation", [])]
        files = [str(source.get("file", "")) for source in sources]
        files += [file for s in structures for file in _matrix_files(s.get("matrices", {}))]
        for file in files:
            if file not in read:
                read[file] = _bytes_hash(folder / file) if file else ""
        contents = [read[file] for file in files]
        keys.append(_hash(json.dumps([tables, contents, identity], sort_keys=True, default=str)))
    return keys


def _matrix_files(table: Mapping[str, Any]) -> list[str]:
    """Files that matrices and their vectors are read from, and those read beside them."""
    keys = ("mass", "stiffness", "damping", "gyroscopic", "circulatory")
    values = [place.get(key) for place in (table, table.get("spin", {})) for key in keys]
    for kind in ("interfaces", "loads"):
        values += table.get(kind, {}).values()
    files = [split_source(value)[0] for value in values if isinstance(value, str)]
    return [str(path) for file in files for path in (file, file.with_suffix(".dof"))]


def _hash(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()[:24]


def _bytes_hash(path: Path) -> str:
    try:
        if path.is_file():  # no device, which would have no end
            return hashlib.sha256(path.read_bytes()).hexdigest()
    except (OSError, ValueError):
        pass
    return "unreadable"  # the case itself will tell why


class MeasureFingerprint:
    """What a measure computes, as plain nested lists.

    Its code counts, with its constants, defaults, closure and the global names that it uses, and
    that of functions of its own module which it calls. Functions and classes of other modules count
    by their names.

    Parameters
    ----------
    measure : callable
        A function, or a `functools.partial` or method of one.

    Examples
    --------
    >>> def times(factor):
    ...     return lambda system: {"f": factor * system.size}
    >>> keys = [MeasureFingerprint(times(factor)).of_measure for factor in (2, 2, 3)]
    >>> keys[0] == keys[1], keys[1] == keys[2]
    (True, False)
    """

    def __init__(self, measure: Callable[..., Any]) -> None:
        self.measure = measure
        self.home = getattr(_innermost(measure), "__module__", None)
        self.seen: set[int] = set()

    @property
    def of_measure(self) -> Any:
        """That of the whole."""
        self.seen.clear()
        inner = _innermost(self.measure)
        if not isinstance(inner, FunctionType | BuiltinFunctionType):
            self._refuse("it", self.measure)
        return self._of("it", self.measure)

    def _of(self, name: str, value: object) -> Any:
        """That of a value; one that is met within itself counts by its kind."""
        if value is None or value is ... or isinstance(value, PLAIN):
            return [type(value).__name__, repr(value)]
        if isinstance(value, ModuleType):
            return ["module", value.__name__]
        if isinstance(value, type):
            return ["named", value.__module__, value.__qualname__]
        if id(value) in self.seen:
            return ["again", type(value).__name__]
        self.seen.add(id(value))
        try:
            return self._of_composed(name, value)
        finally:
            self.seen.discard(id(value))

    def _of_composed(self, name: str, value: Any) -> Any:
        if isinstance(value, partial):
            parts = [self._of(name, part) for part in (value.func, value.args, value.keywords)]
            return ["partial", *parts]
        if isinstance(value, MethodType):
            return ["method", self._of(name, value.__func__), self._of(name, value.__self__)]
        if isinstance(value, FunctionType):
            return self._of_function(value)
        module = getattr(value, "__module__", None)
        if module == self.home and hasattr(value, "__wrapped__"):  # compiled, or with a cache
            return ["wrapped", self._of(name, value.__wrapped__)]
        if module != self.home and _importable(value):
            return ["named", module, value.__qualname__]
        if isinstance(value, CodeType):
            return self._of_code(value)
        if isinstance(value, np.ndarray) and not value.dtype.hasobject:
            found = hashlib.sha256(np.ascontiguousarray(value).tobytes()).hexdigest()
            return ["array", str(value.dtype), list(value.shape), found]
        if isinstance(value, list | tuple):
            return [type(value).__name__, *(self._of(name, part) for part in value)]
        if isinstance(value, set | frozenset):
            return ["set", *sorted(json.dumps(self._of(name, part)) for part in value)]
        if isinstance(value, Mapping):
            return ["mapping", *([self._of(name, k), self._of(name, v)] for k, v in value.items())]
        if dataclasses.is_dataclass(value):
            parts = [self._of(name, getattr(value, f.name)) for f in dataclasses.fields(value)]
            return ["data", type(value).__module__, type(value).__qualname__, *parts]
        return self._refuse(f"'{name}'", value)

    def _of_function(self, function: FunctionType) -> Any:
        label = ["function", function.__module__, function.__qualname__]
        if function.__module__ != self.home and function is not _innermost(self.measure):
            return label
        code = function.__code__
        closure = [
            [name, self._of(name, _content(cell))]
            for name, cell in zip(code.co_freevars, function.__closure__ or (), strict=True)
        ]
        names = sorted(set(_global_names(code)) & set(function.__globals__))
        used = [[name, self._of(name, function.__globals__[name])] for name in names]
        defaults = [function.__defaults__, function.__kwdefaults__]
        return [*label, self._of_code(code), self._of("a default", defaults), closure, used]

    def _of_code(self, code: CodeType) -> Any:
        return [
            code.co_code.hex(),
            [*code.co_names, *code.co_varnames, *code.co_freevars],
            [self._of("a constant", constant) for constant in code.co_consts],
        ]

    def _refuse(self, where: str, value: object) -> Any:
        label = getattr(self.measure, "__qualname__", shown(self.measure))
        raise SystemModelError(
            f"study: keep cannot tell measure {label} from others, because {where} is "
            f"{shown(value)}: name it by keep_name"
        )


def _innermost(measure: Any) -> Any:
    """The function of partials and methods."""
    while isinstance(measure, partial | MethodType):
        measure = measure.func if isinstance(measure, partial) else measure.__func__
    return measure


def _importable(value: object) -> bool:
    """Whether a module has a value under its own name."""
    place: Any = sys.modules.get(str(getattr(value, "__module__", None)))
    for part in str(getattr(value, "__qualname__", "")).split("."):
        place = getattr(place, part, None)
    return place is value


def _content(cell: Any) -> object:
    try:
        return cell.cell_contents
    except ValueError:  # not filled yet
        return None


def _global_names(code: CodeType) -> Iterator[str]:
    """Global names that a code reads, also within functions defined in it."""
    for instruction in dis.get_instructions(code):
        if instruction.opname in ("LOAD_GLOBAL", "LOAD_NAME"):
            yield str(instruction.argval)
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from _global_names(constant)
