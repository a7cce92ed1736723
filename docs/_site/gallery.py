"""Run scripts of the gallery, draw their pictures, and write its page.

``python docs/_site/gallery.py [NAME ...]`` runs those that are named, or all.
"""

from __future__ import annotations

import ast
import runpy
import sys
from pathlib import Path

GALLERY = Path(__file__).resolve().parents[1] / "gallery"
HEAD = """# Gallery

Each example is a script of at most 60 lines that draws its picture and checks one number against an
independent one: a closed form, a published value or another method. The tests run all of them. The
site that `make docs` builds has them as notebooks, too.

"""
COLUMNS = 3


def scripts() -> list[Path]:
    """All scripts, by their titles' order in the page: that of their names."""
    return sorted(GALLERY.glob("*.py"))


def title_of(script: Path) -> str:
    """The first line of its docstring."""
    said = ast.get_docstring(ast.parse(script.read_text(encoding="utf-8"))) or ""
    return said.split("\n")[0].rstrip(".")


def page() -> str:
    """The page of the gallery: a table of pictures with titles."""
    cells = [
        f"[![{title_of(path)}](images/{path.stem}.png)]({path.name})<br>{title_of(path)}"
        for path in scripts()
    ]
    cells += [""] * (-len(cells) % COLUMNS)
    rows = [cells[i : i + COLUMNS] for i in range(0, len(cells), COLUMNS)]
    lines = ["| " * COLUMNS + "|", "|---" * COLUMNS + "|"]
    lines += ["| " + " | ".join(row) + " |" for row in rows]
    return HEAD + "\n".join(lines) + "\n"


def draw(script: Path) -> None:
    """Run a script, and keep the figure that it leaves as its picture."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt
    from PIL import Image

    plt.close("all")
    with matplotlib.rc_context({"figure.figsize": (5.4, 3.6), "figure.dpi": 110}):
        runpy.run_path(str(script))
        target = GALLERY / "images" / f"{script.stem}.png"
        figure = plt.gcf()
        if figure.get_layout_engine() is None:
            figure.set_layout_engine("tight")
        figure.savefig(target)
    Image.open(target).convert("RGB").quantize(64).save(target, optimize=True)


if __name__ == "__main__":
    for path in scripts():
        if len(sys.argv) == 1 or path.stem in sys.argv[1:]:
            print(path.stem)
            draw(path)
    (GALLERY / "README.md").write_text(page(), encoding="utf-8")
