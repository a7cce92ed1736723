"""docs/reference/commands.md is what the commands say of themselves."""

from pathlib import Path

from nldyn.app.reference import reference

PAGE = Path(__file__).parents[3] / "docs" / "reference" / "commands.md"


def test_the_page_is_up_to_date():
    assert PAGE.read_text(encoding="utf-8") == reference()
