"""What `make docs` would miss: every page is listed, every room of nldyn has its page."""

import json
import re
import runpy
from pathlib import Path

import matplotlib
import matplotlib.pyplot as plt
import pytest

import nldyn
from nldyn.base.face import homes

DOCS = Path(__file__).resolve().parents[1] / "docs"
LIST = (DOCS / "README.md").read_text(encoding="utf-8")


def test_every_page_is_in_the_list():
    pages = {page.relative_to(DOCS).as_posix() for page in DOCS.glob("*/*.md")}
    listed = set(re.findall(r"\]\(([\w/-]+\.md)\)", LIST))
    assert pages - listed == set()


def test_every_room_with_public_names_has_a_page():
    homes_of_all = homes("nldyn", nldyn.__path__).values()
    rooms = {".".join(home.split(".")[:2]) for home in homes_of_all}
    shown = "".join(page.read_text(encoding="utf-8") for page in DOCS.glob("api/*.md"))
    assert rooms - set(re.findall(r"^```\{public\} (.*)$", shown, flags=re.M)) == set()


def test_a_notebook_of_the_gallery_runs(monkeypatch, tmp_path):
    """What can be downloaded from the site: its cells give what its script gives."""
    for package in ("jupytext", "sphinx", "latex2mathml"):  # of the extra `docs`
        pytest.importorskip(package)
    monkeypatch.chdir(tmp_path)
    matplotlib.use("Agg")
    monkeypatch.syspath_prepend(str(DOCS / "_site"))
    made = runpy.run_path(str(DOCS / "_site" / "from_sources.py"))
    script = (DOCS / "gallery" / "cantilever_modes.py").read_text(encoding="utf-8")
    told, *code = json.loads(made["notebook"](script))["cells"]
    assert told["cell_type"] == "markdown" and "".join(told["source"]).startswith("# ")
    names: dict[str, object] = {}
    assert len(code) > 1  # a cell for each paragraph
    for cell in code:
        assert cell["cell_type"] == "code"
        exec("".join(cell["source"]), names)  # its own assertion fails where the number is another
    assert plt.get_fignums()
    plt.close("all")
