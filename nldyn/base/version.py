"""The version, and whether the packages that it is of are found."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path

__version__ = "1.0.0"
PACKAGES = ("fem", "cms")


def software_version() -> str:
    """Give the version of the package.

    Examples
    --------
    >>> bool(software_version())
    True
    """
    return __version__


def check_packages() -> None:
    """Refuse packages of other projects, or of other versions, that stand in the place of ours.

    Raises
    ------
    ImportError
        With the file that is found instead.
    """
    home = Path(__file__).parents[2]
    for name in PACKAGES:
        ours = home / name / "__init__.py"
        spec = find_spec(name)
        found = spec.origin if spec else None
        if not (found and ours.exists() and ours.samefile(found)):
            raise ImportError(
                f"nldyn has a package '{name}' of its own, but {found or 'nothing'} is found in "
                "its place: rename that, or take its folder off the path"
            )
        if f'__version__ = "{__version__}"\n' not in ours.read_text(encoding="utf-8"):
            raise ImportError(
                f"{ours} is not that of nldyn {__version__}: another package has written its own "
                "in its place; install nldyn alone, or after it"
            )
