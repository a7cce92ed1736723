"""The rooms of nldyn, fem and cms: a room imports rooms below it only."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from types import ModuleType

import pytest

ROOT = Path(__file__).resolve().parents[1]
# from the roof to the ground; rooms on one floor do not know each other
FLOORS = {
    "nldyn": "app report plot|scene longterm|reduction|io search curves branches bifurcations"
    " orbits flow runtime|system engine base",
    "fem": "render assembly checks elements formats model mesh base",
    "cms": "checks reduction solvers|files component base",
}
FLOOR = {
    package: {room: number for number, floor in enumerate(floors.split())
              for room in floor.split("|")}
    for package, floors in FLOORS.items()
}  # fmt: skip
ROOMS = [(package, room) for package, floors in FLOOR.items() for room in floors]
# who may import what of others
KEPT_TO = {
    "fem": {"reduction", "scene", "report", "app"},
    "cms": {"reduction", "scene", "report", "app"},
    "h5py": {"io"},
    "matplotlib": {"plot", "report"},
    "plotly": {"report"},
    "click": {"app"},
    "pydantic": {"scene"},
}
ABOVE_IMPORTS_IN_FUNCTIONS = {"scene", "report", "app", "plot"}
DOORS = {*FLOORS, "nldyn.__main__"}  # the faces of the packages and ``python -m nldyn``


def modules(package: str) -> dict[str, ast.Module]:
    """The modules of a package by name."""
    found = {}
    for path in sorted((ROOT / package).rglob("*.py")):
        name = ".".join(path.relative_to(ROOT).with_suffix("").parts)
        found[name.removesuffix(".__init__")] = ast.parse(path.read_text(encoding="utf-8"))
    return found


TREES = {package: modules(package) for package in FLOORS}
NLDYN = TREES["nldyn"]


def imports(tree: ast.AST, within: bool = False) -> Iterator[tuple[str, bool]]:
    """What a module imports, and whether it does so within a function."""
    for node in ast.iter_child_nodes(tree):
        if isinstance(node, ast.Import):
            yield from ((name.name, within) for name in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            yield from ((f"{node.module}.{name.name}", within) for name in node.names)
        inside = within or isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef)
        yield from imports(node, inside)


def room_of(name: str, package: str = "nldyn") -> str | None:
    """The room of a name of a package; none for its face and for other packages."""
    words = name.split(".")
    at_home = words[0] == package and len(words) > 1 and words[1] in FLOOR[package]
    return words[1] if at_home else None


@pytest.mark.parametrize("package", FLOORS)
def test_every_module_is_in_a_room(package):
    outside = [name for name in TREES[package] if room_of(name, package) is None]
    assert [name for name in outside if name not in DOORS] == []


@pytest.mark.parametrize(("package", "room"), ROOMS)
def test_a_room_imports_rooms_below_only(package, room):
    floor = FLOOR[package]
    up = [
        f"{name} imports {other}"
        for name, tree in TREES[package].items()
        if room_of(name, package) == room
        for other, _ in imports(tree)
        if (theirs := room_of(other, package)) not in (None, room) and floor[theirs] <= floor[room]
    ]
    assert up == []


@pytest.mark.parametrize("package", ["fem", "cms"])
def test_no_room_imports_the_face_of_its_package(package):
    above = [
        name
        for name, tree in TREES[package].items()
        if name != package and any(other.rpartition(".")[0] in ("", package) and
                                   other.split(".")[0] == package for other, _ in imports(tree))
    ]  # fmt: skip
    assert above == []


def test_below_the_scene_no_import_hides_in_a_function():
    hidden = [
        f"{name} imports {other}"
        for name, tree in NLDYN.items()
        if room_of(name) not in ABOVE_IMPORTS_IN_FUNCTIONS | {None}
        for other, within in imports(tree)
        if within and other.split(".")[0] in ("nldyn", "fem", "cms")
    ]
    assert hidden == []


@pytest.mark.parametrize("package", KEPT_TO)
def test_what_only_some_rooms_import(package):
    elsewhere = [
        name
        for name, tree in NLDYN.items()
        if room_of(name) not in KEPT_TO[package] | {None}
        and any(other.split(".")[0] == package for other, _ in imports(tree))
    ]
    assert elsewhere == []


@pytest.mark.parametrize(
    ("package", "unknown"), [("fem", ("cms", "nldyn")), ("cms", ("fem", "nldyn"))]
)
def test_what_a_package_does_not_know(package, unknown):
    for name, tree in TREES[package].items():
        known = {other.split(".")[0] for other, _ in imports(tree)}
        assert not known & set(unknown), name


def test_no_modules_import_each_other_in_a_circle():
    trees = {name: tree for package in TREES.values() for name, tree in package.items()}
    arrows = {
        name: {
            other if other in trees else other.rpartition(".")[0]
            for other, within in imports(tree)
            if not within
        }
        for name, tree in trees.items()
    }
    while ground := [name for name, below in arrows.items() if not (below - {name}) & set(arrows)]:
        for name in ground:
            del arrows[name]
    assert sorted(arrows) == []


def test_each_public_name_is_listed_once_and_loads():
    rooms = [room for room in FLOOR["nldyn"] if (ROOT / "nldyn" / room / "__init__.pyi").exists()]
    faces = ["nldyn", *(f"nldyn.{room}" for room in rooms)]
    listed = [name for package in faces for name in import_module(package).__all__]
    assert sorted(set(listed)) == sorted(listed)
    for package in faces:
        things = [getattr(import_module(package), name) for name in import_module(package).__all__]
        assert not any(isinstance(thing, ModuleType) for thing in things), package


@pytest.mark.parametrize("package", FLOORS)
def test_a_package_tells_that_it_has_types(package):
    """Without the file, mypy takes all of it for Any in the code of users."""
    assert (ROOT / package / "py.typed").is_file()
