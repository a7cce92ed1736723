"""docs/reference/commands.md is what the commands say of themselves."""

import runpy
from pathlib import Path

DOCS = Path(__file__).parents[3] / "docs"


def test_the_page_is_up_to_date():
    made = runpy.run_path(str(DOCS / "_site" / "commands.py"))["reference"]()
    assert (DOCS / "reference" / "commands.md").read_text(encoding="utf-8") == made
