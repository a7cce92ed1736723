"""docs/reference/scene.md lists exactly the keys of the schema, with their defaults."""

import re
import runpy
import tomllib
from pathlib import Path

import pytest

from nldyn.base.resources import example, examples
from nldyn.scene.messages import all_keys, tables_at
from nldyn.scene.read import load_scene, parse_scene
from nldyn.scene.schema import connections, contacts, loads, parts
from nldyn.scene.schema.scene import Scene
from nldyn.scene.schema.structures import PlaceOfMatrices
from nldyn.scene.schema.table import Table

DOCS = Path(__file__).parents[3] / "docs"
DOC = (DOCS / "reference" / "scene.md").read_text(encoding="utf-8")
with_tables = runpy.run_path(str(DOCS / "_site" / "scene_keys.py"))["with_tables"]
LOAD_VECTOR = {f"matrices.interfaces.NAME.{key}" for key in PlaceOfMatrices.model_fields}


SEVERAL = {  # tables of one name: what all of them have, and what the headings of each say
    "parts.NAME": (
        parts.PartTable,
        {f'with kind = "{kind}"': getattr(parts, f"{kind.title()}Table")
         for kind in ("beam", "truss", "solid", "shell")},
    ),
    "springs": (
        Table,
        {"at an interface": connections.SpringTable,
         "with a direction": connections.MeshSpringTable},
    ),
    "stops": (
        contacts.StopTable,
        {f'with law = "{law}"': getattr(contacts, f"{law.title()}StopTable")
         for law in ("hertz", "linear", "rigid")},
    ),
    "contact_areas": (
        contacts.ContactAreaTable,
        {"of a mesh": contacts.MeshAreaTable,
         "of a list of interfaces": contacts.ListedAreaTable},
    ),
    "excitation": (
        loads.ExcitationTable,
        {f'with kind = "{kind}"': getattr(loads, f"{kind.title()}Table")
         for kind in ("unbalance", "harmonic", "constant", "measured", "weight", "base")},
    ),
}  # fmt: skip


def documented():
    """Give default and meaning of every documented key, by its path in the schema."""
    table, rows = "", {}
    for line in DOC.splitlines():
        if line.startswith("#"):
            heading = re.search(r"\[+([\w.]+)\]+`(.*)", line)
            table = f"{heading[1]}{heading[2]}.".replace("`", "") if heading else ""
        row = re.fullmatch(r"\| `(\w+)` \|.*?\|.*?\|(.*?)\|(.*)\|", line)
        if row:
            rows[table + row.group(1)] = (row.group(2).strip(), row.group(3).strip())
    return rows


def schema_fields():
    """Give the keys that hold a value, without those that hold tables, each once.

    A component has the tables of a scene's structure; of several tables of one name each has the
    keys that are common to all.
    """
    elsewhere = ("components", "matrices.interfaces.", "matrices.loads.", *SEVERAL)
    keys = [key for key in all_keys(Scene) if not key.startswith(elsewhere) and key != "parts"]
    found = {
        key: plain_field(key)
        for key in keys
        if not any(other.startswith(key + ".") for other in keys)
    }
    for name, (common, several) in SEVERAL.items():
        own = {f"{name}.{key}": field for key, field in common.model_fields.items()}
        for told, table in several.items():
            own |= {
                f"{name} {told}.{key}": field
                for key, field in table.model_fields.items()
                if key not in common.model_fields
            }
        found |= own
    return found


def plain_field(key):
    *tables, name = key.split(".")
    path = [0 if step == "NAME" else step for step in tables]
    if tables and len(tables) == 1:
        annotation = str(Scene.model_fields[tables[0]].annotation)
        path = [tables[0], 0] if annotation.startswith("list") else path
    return tables_at(Scene, tuple(path))[0].model_fields[name]


FIELDS = schema_fields()


@pytest.mark.parametrize("name", SEVERAL)
def test_all_tables_of_a_name_are_known_here(name):
    path = tuple(0 if step == "NAME" else step for step in name.split("."))
    path = path if len(path) > 1 else (*path, 0)
    assert set(tables_at(Scene, path)) == set(SEVERAL[name][1].values())


def test_the_tables_are_what_the_schema_says():
    assert with_tables(DOC) == DOC, "python docs/_site/scene_keys.py"


def test_every_key_is_documented_and_no_other():
    assert set(documented()) == set(FIELDS) | LOAD_VECTOR


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


@pytest.mark.parametrize("key", FIELDS)
def test_default_is_documented(key):
    default, meaning = documented()[key]
    assert meaning
    field = FIELDS[key]
    if field.is_required():
        assert default == ""
    elif field.default is None:
        assert default == "none"
    else:
        value = tomllib.loads(f"v = {default.strip('`')}")["v"]
        assert value == field.default


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
    assert scene.title and scene.continuation
    assert scene.excitation or scene.friction or scene.round_clearances
    lines = scene.text.splitlines()
    for number, line in enumerate(lines):
        if re.match(r"\[+(?!modal\.|parts\.leaf|observe|mesh)", line):
            nearby = [lines[number - 1], *lines[number + 1 : number + 4]]
            assert any("#" in text for text in nearby), f"{name}: {line} is not explained"
