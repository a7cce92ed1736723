"""One HTML file that works offline: a template, what all pages share, plotly, and the data."""

from __future__ import annotations

import base64
import gzip
import html
import json
import platform
import re
from collections.abc import Mapping, Sequence
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from plotly.offline import get_plotlyjs

from fem.render.viewer import viewer_script, viewer_style
from nldyn.base.version import software_version

HERE = Path(__file__).parent
PACKAGES = ("numpy", "scipy", "scikit-fem", "plotly")

Table = tuple[Sequence[str], Sequence[Sequence[object]]]


def write_html(path: Path, template: str, content: Mapping[str, Any]) -> None:
    """Write a page for a browser.

    Parameters
    ----------
    path : Path
        The file.
    template : str
        Name of a file beside this one, in which ``__TITLE__``, ``__STYLE__``, ``__PLOTLY__``,
        ``__DATA__``, ``__COMMON__`` and ``__VIEWER__`` are filled in.
    content : dict
        What the page shows, ready for JSON, with its ``title``.
    """

    def text(name: str) -> str:
        return (HERE / name).read_text(encoding="utf-8").rstrip("\n")

    parts = {
        "__TITLE__": html.escape(content["title"]),
        "__STYLE__": f"{text('common.css')}\n{viewer_style()}",
        "__PLOTLY__": get_plotlyjs().replace("</script", "<\\/script"),
        "__DATA__": packed(content),
        "__COMMON__": text("common.js"),
        "__VIEWER__": viewer_script(),
    }
    filled = re.sub("|".join(parts), lambda found: parts[found[0]], text(template))
    path.write_text(filled + "\n", encoding="utf-8")


def packed(content: Mapping[str, Any]) -> str:
    """The content of a page as JSON, compressed by gzip, in base64; the same on every run."""
    text = json.dumps(content, ensure_ascii=False, allow_nan=False, separators=(",", ":"))
    return base64.b64encode(gzip.compress(text.encode("utf-8"), mtime=0)).decode("ascii")


def unpacked(page: str) -> dict[str, Any]:
    """The content of a page that `write_page` wrote, from its text.

    Examples
    --------
    >>> unpacked('<script id="data" type="text/plain">' + packed({"unit": "mm"}) + "</script>")
    {'unit': 'mm'}
    """
    data = page.split('<script id="data" type="text/plain">')[1].split("<")[0]
    found: dict[str, Any] = json.loads(gzip.decompress(base64.b64decode(data)))
    return found


def as_table(table: Table) -> dict[str, Any]:
    """A table for JSON."""
    columns, rows = table
    return {"columns": list(columns), "rows": [list(map(plain, row)) for row in rows]}


def plain(value: object) -> object:
    """A cell for JSON: None, a text or a finite number, with all its digits."""
    return value if value is None or isinstance(value, int | float) else str(value)


def versions() -> list[list[str]]:
    """The versions of what the numbers rest on."""
    found = [["nldyn", software_version()], ["Python", platform.python_version()]]
    for name in PACKAGES:
        try:
            found.append([name, version(name)])
        except PackageNotFoundError:
            continue
    return found
