"""A page that a person reads: the figures and the table of claims."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from html import escape
from pathlib import Path

from nldyn.base.version import software_version
from nldyn.search.diagram import Diagram
from paper.claims import Claim, verdict_counts
from paper.figures import CAPTIONS, legend_text, title

STYLE = """
body { font: 15px/1.45 system-ui, sans-serif; max-width: 1100px; margin: 2em auto; padding: 0 1em; }
table { border-collapse: collapse; width: 100%; }
th, td { border-bottom: 1px solid #ddd; padding: .3em .5em; text-align: left; vertical-align: top; }
td.agrees { color: #00694a; } td.differs { color: #b03a00; } td.not { color: #666; }
img { max-width: 100%; } small { color: #555; } figure { margin: 2em 0; }
"""


def write_page(
    rows: Sequence[Claim], results: Mapping[str, Diagram], seconds: float, folder: Path
) -> None:
    """Write ``index.html`` beside the figures."""
    parts = [
        "<!doctype html><html lang='en'><head><meta charset='utf-8'>",
        f"<title>The paper, recomputed</title><style>{STYLE}</style></head><body>",
        "<h1>The paper's figures and claims, recomputed</h1>",
        f"<p>nldyn {escape(software_version())}; {len(rows)} claims: {verdict_counts(rows)}; "
        f"computed in {seconds:.0f} s. A number agrees if it deviates by no more than 1 % or half "
        "a unit of the last digit printed. In the diagrams stable orbits are drawn solid, unstable "
        "ones dotted.</p>",
        *[_figure(folder, name, title(name, results)) for name in CAPTIONS],
        "<h2>Claims</h2>",
        _claims_table(rows),
        "<h2>What was computed</h2>",
        _diagrams_table(results),
        "</body></html>",
    ]
    (folder / "index.html").write_text("\n".join(parts) + "\n", encoding="utf-8")


def _figure(folder: Path, name: str, caption: str) -> str:
    pictures = sorted(folder.glob(f"{name}*.png"))
    images = "".join(f"<img src='{p.name}' alt='{escape(caption)}'>" for p in pictures)
    text = escape(f"{caption}.{legend_text(name)}")
    return f"<figure>{images}<figcaption>{text}</figcaption></figure>"


def _claims_table(rows: Sequence[Claim]) -> str:
    titles = ("claim", "published", "computed", "deviation", "verdict")
    head = "<tr>" + "".join(f"<th>{title}</th>" for title in titles) + "</tr>"
    body = [
        f"<tr><td><b>{escape(r.id)}</b> ({escape(r.model)})<br>"
        f"<small>{escape(r.quantity)}</small></td>"
        f"<td>{escape(r.published)} {escape(r.unit)}</td>"
        f"<td>{escape(r.computed)}<br><small>{escape(r.note)}</small></td>"
        f"<td>{escape(r.deviation)}</td>"
        f"<td class='{r.verdict.split()[0]}'>{r.verdict}</td></tr>"
        for r in rows
    ]
    return "<table>" + head + "".join(body) + "</table>"


def _diagrams_table(results: Mapping[str, Diagram]) -> str:
    head = (
        "<tr><th>diagram</th><th>range</th><th>branches</th><th>orbits</th>"
        "<th>largest relative Newton step</th><th>largest error of Liouville's formula</th>"
        "<th>notes</th></tr>"
    )
    body = []
    for name in sorted(results):
        diagram = results[name]
        orbits = [orbit for branch in diagram.branches for orbit in branch.points]
        error = max((o.error for o in orbits), default=0.0)
        judged = [o.liouville_error for o in orbits if not math.isnan(o.liouville_error)]
        liouville = max(judged, default=0.0)
        low, high = diagram.limits
        body.append(
            f"<tr><td>{escape(name)}</td><td>{low:g} to {high:g} Hz</td>"
            f"<td>{len(diagram.branches)}</td><td>{len(orbits)}</td><td>{error:.1e}</td>"
            f"<td>{liouville:.1e}</td><td>{escape('; '.join(diagram.notes))}</td></tr>"
        )
    return "<table>" + head + "".join(body) + "</table>"
