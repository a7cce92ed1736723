"""The compiled library: where it lies, which of its forms fits the processor, its link to Python.

It knows nothing of Python: threads, interruption and BLAS are handed over as addresses. It is
called with Python's lock held; long functions give it back meanwhile, and look from time to time
whether a signal came, whose handler's exception the call then raises.
"""

from __future__ import annotations

import ctypes
import os
import struct
import sys
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cython_blas

from nldyn.engine.fingerprint import fingerprint
from nldyn.engine.layout import FIRST_POWER, SYSTEM_FIELDS, UNDECIDED
from nldyn.engine.numbers import address_of

SOURCES = Path(__file__).resolve().parent  # without C files in what a wheel installs
FOLDER = Path(os.environ.get("NLDYN_ENGINE", SOURCES)).resolve()  # of sanitizers
SUFFIX = {"win32": ".dll", "darwin": ".dylib"}.get(sys.platform, ".so")
REBUILT = "'pip install .' or '-e .' builds it"
NOT_BUILT = f"the engine of nldyn is not built: {REBUILT}"
PAUSE = 0.05  # s between two looks whether Ctrl-C was pressed, or a caller has had enough
LAYOUT = 10000 * SYSTEM_FIELDS + 100 * FIRST_POWER + UNDECIDED  # as `nldyn_layout` of the engine


def library_name(level: str = "") -> str:
    """File of the library for a level of the processor, "" for all or "v3"."""
    return f"engine{level}{SUFFIX}"


def _fits(library: ctypes.PyDLL, sources: int | None) -> bool:
    """Whether a library has the layout, and the fingerprint of the C files where they lie here."""
    if not hasattr(library, "nldyn_fingerprint") or library.nldyn_layout() != LAYOUT:
        return False
    library.nldyn_fingerprint.restype = ctypes.c_int64
    return sources in (None, library.nldyn_fingerprint())


def _load() -> ctypes.PyDLL:
    """The library's best form for this processor; $NLDYN_PROCESSOR=baseline asks for the first."""
    base = FOLDER / library_name()
    if not base.exists():
        raise ImportError(f"{NOT_BUILT} (no {base})")
    library = ctypes.PyDLL(str(base))
    if not _fits(library, fingerprint(SOURCES)):
        raise ImportError(
            f"the engine of nldyn, {base}, was built from other sources than these: run "
            f"'python compile_engine.py' in {SOURCES.parents[1]}"
        )
    wider = FOLDER / library_name("v3")
    baseline = os.environ.get("NLDYN_PROCESSOR") == "baseline"
    if wider.exists() and library.nldyn_runs_v3() and not baseline:
        return ctypes.PyDLL(str(wider))
    return library


class Packed:
    """Numbers and arrays as the engine reads them: eight bytes each, an array by its address.

    Parameters
    ----------
    *fields : int, float or array
        In the order of the C structure.

    Examples
    --------
    >>> Packed(3, 0.5, np.zeros(2))
    <Packed of 3 fields>
    """

    def __init__(self, *fields: int | float | NDArray[Any]) -> None:
        # whose memory must live
        self.fields = [np.ascontiguousarray(f) if isinstance(f, np.ndarray) else f for f in fields]
        form = "".join("d" if isinstance(field, float) else "q" for field in fields)
        numbers = [address_of(f) if isinstance(f, np.ndarray) else f for f in self.fields]
        self.content = struct.pack(form, *numbers)

    def __reduce__(self) -> tuple[Any, ...]:
        """Addresses are those of this process."""
        return Packed, tuple(self.fields)

    def __repr__(self) -> str:
        return f"<Packed of {len(self.fields)} fields>"


def _capsule(name: str) -> int:
    """Address of a function of BLAS, as scipy hands it to compiled code."""
    functions: dict[str, Any] = vars(cython_blas)["__pyx_capi__"]
    api = ctypes.pythonapi
    api.PyCapsule_GetName.restype = ctypes.c_char_p
    api.PyCapsule_GetName.argtypes = [ctypes.py_object]
    api.PyCapsule_GetPointer.restype = ctypes.c_void_p
    api.PyCapsule_GetPointer.argtypes = [ctypes.py_object, ctypes.c_char_p]
    return int(api.PyCapsule_GetPointer(functions[name], api.PyCapsule_GetName(functions[name])))


def _function(name: str) -> int:
    """Address of a function of Python."""
    return int(ctypes.cast(getattr(ctypes.pythonapi, name), ctypes.c_void_p).value or 0)


def host(enough: int = 0) -> bytes:
    """The structure Host, with the address of a function that tells whether a call is to end."""
    return Packed(*_GIVEN, enough, PAUSE).content


LIBRARY = _load()
_GIVEN = (
    _function("PyEval_SaveThread"),
    _function("PyEval_RestoreThread"),
    _function("PyErr_CheckSignals"),
    _capsule("dgemm"),
)
HOST = host()


def function(name: str, *arguments: Any, result: Any = ctypes.c_int64) -> Any:
    """A function of the library with the types of its arguments."""
    found = LIBRARY[name]
    found.argtypes, found.restype = arguments, result
    return found


def built_by() -> str:
    """What the library was compiled by, and for which processors.

    Examples
    --------
    >>> built_by().startswith(("gcc", "clang"))
    True
    """
    name: bytes = function("nldyn_built_by", result=ctypes.c_char_p)()
    wide = Path(LIBRARY._name).stem.endswith("v3")
    return f"{name.decode()} for {'processors with AVX2' if wide else 'all processors'}"
