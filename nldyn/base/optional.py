"""Packages that only some results need."""

from __future__ import annotations

from importlib import import_module
from typing import Any

from nldyn.base.errors import SystemModelError

EXTRAS = {"pandas": "tables", "xarray": "tables", "pyuff": "uff"}


def optional(package: str, asked: str) -> Any:
    """Give a package of an extra, or say how to install it.

    Parameters
    ----------
    package : str
        One of `EXTRAS`.
    asked : str
        What needs it.

    Raises
    ------
    SystemModelError
        If it is not installed.
    """
    try:
        return import_module(package)
    except ImportError:
        raise SystemModelError(
            f"{asked} needs {package}, which is not installed: "
            f'pip install "nldyn[{EXTRAS[package]}]"'
        ) from None
