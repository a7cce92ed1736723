"""What `make docs` would miss: every page is listed, every room of nldyn has its page."""

import re
from pathlib import Path

import nldyn

DOCS = Path(__file__).resolve().parents[1] / "docs"
LIST = (DOCS / "README.md").read_text(encoding="utf-8")


def test_every_page_is_in_the_list():
    pages = {page.relative_to(DOCS).as_posix() for page in DOCS.glob("*/*.md")}
    listed = set(re.findall(r"\]\(([\w/-]+\.md)\)", LIST))
    assert pages - listed == set()


def test_every_room_with_public_names_has_a_page():
    rooms = {".".join(home.split(".")[:2]) for home in nldyn._HOMES.values()}
    shown = "".join(page.read_text(encoding="utf-8") for page in DOCS.glob("api/*.md"))
    assert rooms - set(re.findall(r"^```\{public\} (.*)$", shown, flags=re.M)) == set()
