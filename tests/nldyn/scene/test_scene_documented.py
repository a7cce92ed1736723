"""docs/reference/scene.md lists exactly the keys of the schema, with their defaults."""

import re
import runpy
import tomllib
from pathlib import Path

import pytest

from nldyn.base.resources import example, examples
from nldyn.scene.messages import all_keys, table_at
from nldyn.scene.read import load_scene, parse_scene
from nldyn.scene.schema import PlaceOfMatrices, Scene, StopTable

DOCS = Path(__file__).parents[3] / "docs"
DOC = (DOCS / "reference" / "scene.md").read_text(encoding="utf-8")
with_tables = runpy.run_path(str(DOCS / "_site" / "scene_keys.py"))["with_tables"]
LOAD_VECTOR = {f"matrices.interfaces.NAME.{key}" for key in PlaceOfMatrices.model_fields}


def documented():
    """Give default and meaning of every documented key, by its path in the schema."""
    table, rows = "", {}
    for line in DOC.splitlines():
        if line.startswith("#"):
            heading = re.search(r"`\[+([\w.]+)\]+`(?: with `law = \"(\w+)\"`)?", line)
            table = " ".join(filter(None, heading.groups())) + "." if heading else ""
        row = re.fullmatch(r"\| `(\w+)` \|.*?\|.*?\|(.*?)\|(.*)\|", line)
        if row:
            rows[table + row.group(1)] = (row.group(2).strip(), row.group(3).strip())
    return rows


def schema_keys():
    """Give the keys that hold a value, without those that hold tables, each once.

    A component has the tables of a scene's structure; a stop has the keys of its law, too.
    """
    elsewhere = ("components.NAME.", "stops.", "matrices.interfaces.", "matrices.loads.")
    keys = [key for key in all_keys(Scene) if not key.startswith(elsewhere)]
    plain = [
        key
        for key in keys
        if key not in ("components", "stops")
        and not any(other.startswith(key + ".") for other in keys)
    ]
    common = [f"stops.{name}" for name in StopTable.model_fields]
    of_laws = [
        f"stops {law}.{name}"
        for law in ("hertz", "linear", "rigid")
        for name in table_at(Scene, ("stops", 0, law)).model_fields
        if name not in StopTable.model_fields
    ]
    return [*plain, *common, *of_laws]


def field(key):
    *tables, name = key.split(".")
    if tables[:1] and tables[0].startswith("stops"):
        law = tables[0].partition(" ")[2] or "hertz"
        return table_at(Scene, ("stops", 0, law)).model_fields[name]
    path = [0 if step == "NAME" else step for step in tables]
    if tables and tables[0] in Scene.model_fields and len(tables) == 1:
        annotation = str(Scene.model_fields[tables[0]].annotation)
        path = [tables[0], 0] if annotation.startswith("list") else path
    return table_at(Scene, tuple(path)).model_fields[name]


def test_the_tables_are_what_the_schema_says():
    assert with_tables(DOC) == DOC, "python docs/_site/scene_keys.py"


def test_every_key_is_documented_and_no_other():
    assert set(documented()) == set(schema_keys()) | LOAD_VECTOR


def test_types_and_units_are_those_of_the_schema():
    begins = {
        tuple(cell.strip() for cell in row.split("|")[1:4])
        for row in DOC.splitlines()
        if row.startswith("| `")
    }
    assert begins >= {
        ("`youngs_modulus`", "number above 0", "N/m²"),
        ("`exponent`", "number from 1 to 4", ""),
        ("`box`", "list of 2 lists of 3 numbers", "m"),
        ("`law`", '`"hertz"`, `"linear"`, `"rigid"`', ""),
    }


@pytest.mark.parametrize("key", schema_keys())
def test_default_is_documented(key):
    default, meaning = documented()[key]
    assert meaning
    if field(key).is_required():
        assert default == ""
    elif field(key).default is None:
        assert default == "none"
    else:
        value = tomllib.loads(f"v = {default.strip('`')}")["v"]
        assert value == field(key).default


def test_every_table_is_documented():
    for name in Scene.model_fields:
        assert re.search(rf"`(\[+{name}(\.NAME)?\]+|{name})`", DOC)


def test_scene_in_the_document_is_good():
    blocks = re.findall(r"```toml\n(.*?)```", DOC, flags=re.DOTALL)
    assert len(blocks) == 1
    assert parse_scene(blocks[0]).continuation.periods == [1, 2, 3]


@pytest.mark.parametrize("name", examples())
def test_example_is_good_and_explains_its_tables(name):
    scene = load_scene(example(name))
    assert scene.title and scene.excitation and scene.continuation
    lines = scene.text.splitlines()
    for number, line in enumerate(lines):
        if re.match(r"\[+(?!modal\.|parts\.leaf|observe|mesh)", line):
            nearby = [lines[number - 1], *lines[number + 1 : number + 4]]
            assert any("#" in text for text in nearby), f"{name}: {line} is not explained"
