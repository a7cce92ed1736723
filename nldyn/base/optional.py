"""Packages that only some results need."""

from __future__ import annotations

from importlib import import_module
from typing import Any

from nldyn.base.errors import SystemModelError
from nldyn.base.extras import how_to_install


def optional(package: str, asked: str) -> Any:
    """Give a package of an extra, or say how to install it.

    Parameters
    ----------
    package : str
        One of `extras.EXTRAS`.
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
        raise SystemModelError(how_to_install(package, asked)) from None
