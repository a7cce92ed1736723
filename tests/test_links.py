"""The links of all pages lead somewhere."""

import os
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]


@pytest.mark.skipif(os.sep != "/", reason="paths are written as in a checkout")
@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_links_lead_somewhere(page):
    text = page.read_text(encoding="utf-8")
    targets = re.findall(r"\]\(([\w./-]+)(?:#[^)]*)?\)", text)
    targets += re.findall(r"(?:src|href)=\"([\w./-]+)\"", text)
    assert [target for target in targets if not (page.parent / target).exists()] == []


@pytest.mark.parametrize("folder", ["docs", "nldyn", "fem", "cms", "tests", "meshes"])
def test_pages_that_files_name_are_there(folder):
    files = [p for p in (ROOT / folder).rglob("*") if p.suffix in (".py", ".toml", ".md")]
    named = {
        (path.name, page)
        for path in files
        for page in re.findall(r"docs/[\w/-]+\.md", path.read_text(encoding="utf-8"))
    }
    assert [(name, page) for name, page in sorted(named) if not (ROOT / page).exists()] == []
