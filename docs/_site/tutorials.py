"""Run the tutorials, and keep their pictures.

``python docs/_site/tutorials.py [NAME ...]`` runs those that are named, or all.
"""

from __future__ import annotations

import os
import re
import sys
import tempfile
from pathlib import Path

TUTORIALS = Path(__file__).resolve().parents[1] / "tutorials"


def blocks(page: Path, language: str) -> str:
    """All code of a page, or all that it says is printed."""
    return "".join(re.findall(rf"```{language}\n(.*?)```", page.read_text("utf-8"), flags=re.S))


def keep_pictures(page: Path) -> None:
    """Run a page where its pictures fall into a folder of their own, and copy them."""
    import matplotlib.pyplot as plt
    from PIL import Image

    plt.close("all")
    os.chdir(tempfile.mkdtemp())
    exec(blocks(page, "python"), {})
    for picture in Path().glob("*.png"):
        target = TUTORIALS.parent / "images" / picture.name
        Image.open(picture).convert("RGB").quantize(64).save(target, optimize=True)


if __name__ == "__main__":
    import matplotlib

    matplotlib.use("Agg")
    for path in sorted(TUTORIALS.glob("*.md")):
        if blocks(path, "text") and (len(sys.argv) == 1 or path.stem in sys.argv[1:]):
            print(path.stem)
            keep_pictures(path)
