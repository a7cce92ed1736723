"""Pages of the public names: a table of those of a room, and a page for each with its members."""

from __future__ import annotations

import inspect
import re
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from typing import Any

from sphinx.util import logging

import nldyn
from nldyn.base.face import homes

log = logging.getLogger(__name__)
PUBLIC = re.compile(r"```\{public\} ([\w.]+)\n```\n")
FOLDER = "names"
"""Below `docs/api`: a page for each name, written anew by each build."""


def public_names(room: str) -> list[str]:
    """Full names of what a package shows, or a room of nldyn, by the alphabet."""
    known = homes("nldyn", nldyn.__path__)
    in_the_face = [name for name in nldyn.__all__ if known[name].startswith(f"{room}.")]
    shown = getattr(import_module(room), "__all__", ())
    names = [f"nldyn.{name}" for name in in_the_face] + [f"{room}.{name}" for name in shown]
    return sorted(names, key=str.lower)


def thing_of(name: str) -> Any:
    """What a full name stands for."""
    package, _, last = name.rpartition(".")
    return getattr(import_module(package), last)


def kind_of(thing: Any) -> str:
    """What Sphinx calls it."""
    if inspect.isclass(thing):
        return "exception" if issubclass(thing, BaseException) else "class"
    return "function" if callable(thing) else "data"


def members_of(thing: Any) -> dict[str, Any]:
    """The public methods and properties that a class has of its own."""
    if not inspect.isclass(thing):
        return {}
    own = {key: value for key, value in vars(thing).items() if not key.startswith("_")}
    return {
        key: value
        for key, value in own.items()
        if inspect.isfunction(value) or isinstance(value, property | classmethod | staticmethod)
    }


def undocumented(name: str, thing: Any) -> Iterator[str]:
    """Names of what lacks a docstring: the thing itself, its public methods and properties."""
    if not inspect.getdoc(thing):
        yield name
    yield from (f"{name}.{key}" for key, value in members_of(thing).items() if not value.__doc__)


def first_words(thing: Any) -> str:
    """The first paragraph of a docstring, for a cell of a table."""
    paragraph = (inspect.getdoc(thing) or "").split("\n\n")[0]
    return " ".join(paragraph.split()).replace("|", "\\|")


def table(room: str, page: str) -> str:
    """The names of a room with what they are; one without a docstring is a fault."""
    names = public_names(room)
    if not names:
        log.warning("%s shows no public name", room, location=page)
    for name in names:
        for lacking in undocumented(name, thing_of(name)):
            log.warning("%s has no docstring", lacking, location=page)
    rows = [f"| [`{n}`]({FOLDER}/{n}.md) | {first_words(thing_of(n))} |" for n in names]
    listed = "\n".join(f"{FOLDER}/{name}" for name in names)
    return (
        "\n".join(["| name | what it is |", "| --- | --- |", *rows])
        + f"\n\n```{{toctree}}\n:hidden:\n\n{listed}\n```\n"
    )


def name_page(name: str, room: Path) -> str:
    """The page of a name: for a class a table of its members, and all docstrings."""
    thing = thing_of(name)
    rows = [
        f"| [`{key}`](#{name}.{key}) | {first_words(value)} |"
        for key, value in members_of(thing).items()
    ]
    members = "\n".join(["| of it | what it is |", "| --- | --- |", *rows, ""]) if rows else ""
    return (
        f"# {name.rpartition('.')[2]}\n\n[{room.stem}](../{room.name})\n\n{members}\n"
        f"```{{eval-rst}}\n.. auto{kind_of(thing)}:: {name}\n```\n"
    )


def write_pages(docs: Path) -> None:
    """Write the page of each name that a page of `docs/api` shows, and remove others."""
    folder = docs / "api" / FOLDER
    folder.mkdir(exist_ok=True)
    pages = {}
    for page in sorted((docs / "api").glob("*.md")):
        for room in PUBLIC.findall(page.read_text(encoding="utf-8")):
            pages |= {folder / f"{name}.md": name_page(name, page) for name in public_names(room)}
    for page in set(folder.glob("*.md")) - set(pages):
        page.unlink()
    for page, text in pages.items():
        if not page.exists() or page.read_text(encoding="utf-8") != text:
            page.write_text(text, encoding="utf-8")
