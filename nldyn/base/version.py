"""The version of the installed package."""

from __future__ import annotations


def software_version() -> str:
    """Give the version of the installed package, or ``unknown`` in a bare checkout.

    Examples
    --------
    >>> bool(software_version())
    True
    """
    from importlib.metadata import PackageNotFoundError, version

    try:
        return version("nldyn")
    except PackageNotFoundError:
        return "unknown"
