"""Compute the tables of the page of element tests, and draw its picture.

``python docs/_site/elements.py`` writes both; tests compare the tables with what is computed.
"""

from __future__ import annotations

import sys
from pathlib import Path

import matplotlib
import numpy as np

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / "tests" / "fem"), str(ROOT / "tests" / "fem" / "elements")]
matplotlib.use("Agg")

import matplotlib.pyplot as plt  # noqa: E402
import mesh_errors  # noqa: E402
import test_fem_macneal_harder as tested  # noqa: E402
from macneal_harder import FIRST_ORDER, SHELLS, SOLIDS, problems  # noqa: E402

PICTURE = ROOT / "docs" / "images" / "element_tests.png"


def write_tables() -> None:
    """Put what is computed between the marks of the page."""
    text = tested.DOC.read_text(encoding="utf-8")
    tables = [(name, kinds, tested.rows) for name, kinds in tested.TABLES.items()]
    tables += [(name, kinds, mesh_errors.rows) for name, kinds in mesh_errors.TABLES.items()]
    for name, kinds, rows in tables:
        head = ["| problem |" + "".join(f" {kind} |" for kind in kinds)]
        head.append("| --- |" + " ---: |" * len(kinds))
        lines = "\n".join([*head, *rows(kinds)])
        first, last = f"<!-- {name} -->\n", f"<!-- end of {name} -->"
        before, rest = text.split(first)
        text = f"{before}{first}{lines}\n{last}{rest.split(last)[1]}"
    tested.DOC.write_text(text, encoding="utf-8")


def draw() -> None:
    """All problems and kinds, coloured by the ratio of computed and published deflection."""
    kinds = (*SHELLS, *SOLIDS, *FIRST_ORDER)
    rows = problems(SOLIDS[0])
    texts = [[tested.entry(problem, kind) for kind in kinds] for problem in rows]
    values = np.array([[float(t) if t[:1].isdigit() else np.nan for t in row] for row in texts])
    figure, axes = plt.subplots(figsize=(12.5, 9.0), layout="constrained")
    shown = axes.imshow(values, cmap="viridis", vmin=0.0, vmax=1.1, aspect="auto")
    for (row, column), value in np.ndenumerate(values):
        said = (
            f"{value:.2f}" if np.isfinite(value) else {"": "", "refused": "–"}[texts[row][column]]
        )
        colour = "black" if value > 0.6 or not np.isfinite(value) else "white"
        axes.text(column, row, said, ha="center", va="center", fontsize=8, color=colour)
    axes.set_xticks(range(len(kinds)), kinds, rotation=40, ha="right", rotation_mode="anchor")
    axes.set_yticks(range(len(rows)), [problem.name for problem in rows])
    for edge in (len(SHELLS), len(SHELLS) + len(SOLIDS)):
        axes.axvline(edge - 0.5, color="white", linewidth=4)
    places = (0, len(SHELLS), len(SHELLS) + len(SOLIDS))
    for place, words in zip(
        places, ("shells", "solids of second order", "of first order"), strict=True
    ):
        axes.text(place - 0.45, -0.65, words, ha="left", va="bottom", fontsize=10)
    figure.colorbar(shown, label="computed over published deflection", shrink=0.6)
    figure.savefig(PICTURE, dpi=110)


if __name__ == "__main__":
    write_tables()
    draw()
