"""Which extra brings a package that only some results need."""

from __future__ import annotations

EXTRAS = {
    "matplotlib": "report", "plotly": "report", "pyvista": "render", "imageio": "render",
    "pandas": "tables", "xarray": "tables", "pyuff": "uff",
}  # fmt: skip
"""The extra that brings each of them."""


def how_to_install(package: str, asked: str) -> str:
    """A sentence on what is missing, or nothing for a package of no extra.

    Examples
    --------
    >>> how_to_install("matplotlib.axes", "a diagram")
    'a diagram needs matplotlib, which is not installed: pip install "nldyn[report]"'
    """
    package = package.split(".")[0]
    if package not in EXTRAS:
        return ""
    command = f'pip install "nldyn[{EXTRAS[package]}]"'
    return f"{asked} needs {package}, which is not installed: {command}"
