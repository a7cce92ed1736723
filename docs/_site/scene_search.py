"""The keys of the scene file, as what a search finds first."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

from docutils.nodes import Element
from scene_keys import PAGE, TABLE, name_of
from sphinx.domains import Domain, ObjType

ROW = re.compile(r"^\| `(\w+)` \|", flags=re.MULTILINE)


def with_places(page: str) -> tuple[str, dict[str, str]]:
    """The page with a place at the row of each key, and these by the full names of the keys."""
    places: dict[str, str] = {}

    def marked(found: re.Match[str]) -> str:
        heading = re.findall(r"^#+ .*$", page[: found.start()], flags=re.MULTILINE)[-1]
        words = name_of(heading).replace('"', "").split()  # of several tables the last tells which
        table = ".".join([*words[:1], *words[1:][-1:]])

        def row(key: re.Match[str]) -> str:
            name = f"{table}.{key[1]}".lstrip(".")
            places[name] = f"key-{name}"
            return f'| <span id="key-{name}"></span>`{key[1]}` |'

        return ROW.sub(row, found[0])

    return TABLE.sub(marked, page), places


class SceneDomain(Domain):
    """Keys of the scene file: ``stops.gap``."""

    name = "scene"
    label = "scene file"
    object_types = {"key": ObjType("key of a scene file")}  # noqa: RUF012

    def get_objects(self) -> Iterator[tuple[str, str, str, str, str, int]]:
        """Each key with its place; nothing else goes before them in a search."""
        for name, place in with_places(Path(PAGE).read_text(encoding="utf-8"))[1].items():
            yield name, name, "key", "reference/scene", place, 0

    def resolve_any_xref(self, *_: object) -> list[tuple[str, Element]]:
        """Pages link to keys by nothing."""
        return []

    def merge_domaindata(self, docnames: set[str], otherdata: dict[str, object]) -> None:
        """Nothing is kept of what pages say."""
