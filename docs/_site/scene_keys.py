"""The tables of keys in the reference of the scene file, made from the schema.

``python docs/_site/scene_keys.py`` writes them anew in docs/reference/scene.md. What stands between
them is written by hand.
"""

from __future__ import annotations

import ast
import inspect
import json
import re
from collections.abc import Iterator, Mapping
from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import Any

from nldyn.scene.schema.scene import Scene
from nldyn.scene.schema.table import Table

PAGE = Path(__file__).resolve().parents[1] / "reference" / "scene.md"
HEAD = "| key | type | unit | default | meaning |\n|---|---|---|---|---|\n"
TABLE = re.compile(r"^\| key \|.*\n(?:\|.*\n)+", flags=re.M)
NAME = re.compile(r"`\[+([\w.]+)\]+`+( (?:at|of|with) [^:.\n]+)?")
KINDS = {"string": "text", "number": "number", "integer": "whole number", "boolean": "true, false"}
BOUNDS = (
    ("above", ("exclusiveMinimum", "gt")),
    ("from", ("minimum", "ge")),
    ("below", ("exclusiveMaximum", "lt")),
    ("to", ("maximum", "le")),
)


def tables() -> dict[str, type[Table]]:
    """The tables of a scene by the names that their docstrings begin with; "" is its top.

    Where there are several tables of one name, what tells them apart is behind the name.

    Examples
    --------
    >>> tables()["stops"].__name__
    'StopTable'
    """
    named = {name_of(table.__doc__ or ""): table for table in subclasses(Table)}
    return {**named, "": Scene}


def subclasses(table: type[Table]) -> Iterator[type[Table]]:
    """All classes made of one."""
    for each in table.__subclasses__():
        yield each
        yield from subclasses(each)


def name_of(text: str) -> str:
    """The name of the table that a text tells first, and which of several, if it tells that."""
    found = NAME.search(text)
    return "".join(filter(None, found.groups())).replace("`", "") if found else ""


@cache
def meanings(table: type[Table]) -> dict[str, str]:
    """What stands below each key of a class of the schema."""
    (found,) = ast.parse(inspect.getsource(table)).body
    assert isinstance(found, ast.ClassDef)
    return {
        key.target.id: " ".join(below.value.value.split())
        for key, below in pairwise(found.body)
        if isinstance(key, ast.AnnAssign)
        and isinstance(key.target, ast.Name)
        and isinstance(below, ast.Expr)
        and isinstance(below.value, ast.Constant)
        and isinstance(below.value.value, str)
    }


def keys_table(table: type[Table]) -> str:
    """Keys of a table with type, unit, default and meaning, as Markdown."""
    told = table.model_json_schema()
    required = told.get("required", ())
    bases = [base for base in table.__mro__[1:] if issubclass(base, Table)]
    above = {key for base in bases if name_of(base.__doc__ or "") for key in base.model_fields}
    rows = {key: text for each in reversed([table, *bases]) for key, text in meanings(each).items()}
    return HEAD + "".join(
        row(name, told["properties"][name], name in required, meaning)
        for name, meaning in rows.items()
        if name not in above
    )


def row(name: str, said: Mapping[str, Any], required: bool, meaning: str) -> str:
    """One key; its meaning begins with its unit in square brackets, if it has one."""
    found = re.fullmatch(r"(?:\[([^]]*)\] )?(.*)", meaning)
    assert found is not None
    default = "" if required else default_text(said["default"])
    cells = [f"`{name}`", type_text(said), found[1], default, found[2]]
    return "|" + "|".join(f" {cell} " if cell else " " for cell in cells) + "|\n"


def default_text(value: object) -> str:
    """A default as it would stand in a scene."""
    return "none" if value is None else f"`{json.dumps(value)}`"


def type_text(said: Mapping[str, Any]) -> str:
    """What JSON Schema says of a value, in words.

    Examples
    --------
    >>> type_text({"type": "integer", "minimum": 1, "maximum": 100})
    'whole number from 1 to 100'
    >>> type_text({"anyOf": [{"type": "number", "gt": 0}, {"type": "null"}]})
    'number above 0'
    >>> type_text({"type": "array", "items": {"type": "number"}, "minItems": 2, "maxItems": 2})
    'list of 2 numbers'
    """
    options = said.get("anyOf") or said.get("oneOf")
    if options:
        return " or ".join(type_text(o) for o in options if o.get("type") != "null")
    if "enum" in said:
        return ", ".join(f"`{json.dumps(value)}`" for value in said["enum"])
    if "const" in said:
        return f"`{json.dumps(said['const'])}`"
    if "$ref" in said or said.get("type") == "object":
        inner = said.get("additionalProperties")
        return f"table of {several(inner)}" if inner else "table"
    if said.get("type") == "array":
        return f"list of {how_many(said)}{several(said['items'])}"
    return KINDS[said["type"]] + bounds(said)


def several(said: Mapping[str, Any]) -> str:
    """The type of the entries of a list, in the plural."""
    return re.sub(r"^(text|number|whole number|list)\b", r"\1s", type_text(said))


def how_many(said: Mapping[str, Any]) -> str:
    """How many entries a list has, if that is bounded."""
    least, most = said.get("minItems", 0), said.get("maxItems")
    return "" if most is None else f"{most} " if least == most else f"{least} to {most} "


def bounds(said: Mapping[str, Any]) -> str:
    """The bounds of a number."""
    known = [(word, said[name]) for word, names in BOUNDS for name in names if name in said]
    return "".join(f" {word} {value:g}" for word, value in known)


def with_tables(page: str) -> str:
    """The page with the tables of keys made anew; the heading above each names its table."""
    known = tables()

    def made(found: re.Match[str]) -> str:
        heading = re.findall(r"^#+ .*$", page[: found.start()], flags=re.M)[-1]
        return keys_table(known[name_of(heading)])

    return TABLE.sub(made, page)


if __name__ == "__main__":
    PAGE.write_text(with_tables(PAGE.read_text(encoding="utf-8")), encoding="utf-8")
