"""A solid, a shell and a frame by every writer there is: always the same component and names."""

from __future__ import annotations

import random
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import meshio
import numpy as np
import pytest
from drafts import DIMENSION, GMSH, WRITERS, Draft
from mutations import frame, shell, solid
from test_fem_formats import as_meshio, write_med
from test_fem_silence import mass_of, places, read, squares
from universal_files import write_unv
from with_gmsh import gmsh_at_work

import fem

pytestmark = pytest.mark.filterwarnings("ignore::fem.LockingWarning")

Writer = Callable[[Draft, Path], None]
DOCS = Path(__file__).parents[3] / "docs" / "tutorials" / "own_mesh.md"


def drafts() -> dict[str, Draft]:
    """Three parts, which are also one group, two sets of points, and a face or an edge."""
    made = {make.__name__: make(random.Random(7)) for make in (solid, shell, frame)}
    first = len(made["shell"].cells) + 1
    edge = {first: ("line", (1, 5)), first + 1: ("line", (5, 9))}
    made["shell"].cells.update(edge)
    made["shell"].names.append(("skin", list(edge)))
    for draft in made.values():
        members = [label for name, of in draft.names if name != "skin" for label in of]
        draft.names.append(("all", sorted(members)))
    return made


def structure(draft: Draft) -> fem.StructureMesh:
    """The draft as a mesh of a structure, whatever it is."""
    return replace(draft, model="solid").mesh()


def by_hand(end: str, seed: int) -> Writer:
    def write(draft: Draft, path: Path) -> None:
        path.write_text(WRITERS[end](draft, random.Random(seed)), encoding="utf-8")

    return write


def by_meshio(form: str, **options) -> Writer:
    return lambda draft, path: meshio.write(path, as_meshio(structure(draft)), form, **options)


def by_fem(draft: Draft, path: Path) -> None:
    fem.write_mesh(draft.mesh(), path)


def by_gmsh(version: float, binary: int, parts: int = 1) -> Writer:
    """Gmsh's own files, of an entity for each run of cells."""

    def write(draft: Draft, path: Path) -> None:
        with gmsh_at_work() as gmsh:
            model = gmsh.model
            tags: dict[tuple[int, int], list[int]] = {}
            for number, (kind, names, labels) in enumerate(draft.runs(), start=1):
                dimension = DIMENSION.get(kind, 3)
                model.addDiscreteEntity(dimension, number)
                if number == 1:
                    coordinates = np.array(list(draft.nodes.values())).ravel()
                    model.mesh.addNodes(dimension, number, list(draft.nodes), coordinates)
                nodes = [n for label in labels for n in draft.cells[label][1]]
                model.mesh.addElementsByType(number, GMSH[kind], labels, nodes)
                for name in names:
                    tags.setdefault((dimension, name), []).append(number)
            for (dimension, name), entities in tags.items():
                model.addPhysicalGroup(dimension, entities, name=draft.names[name][0])
            first = max(draft.cells) + 1
            for name, nodes in draft.sets:
                for node in nodes:
                    model.addDiscreteEntity(0, node)
                    model.mesh.addElementsByType(node, 15, [first + node], [node])
                model.addPhysicalGroup(0, nodes, name=name)
            if parts > 1:
                model.mesh.partition(parts)
            gmsh.option.setNumber("Mesh.MshFileVersion", version)
            gmsh.option.setNumber("Mesh.Binary", binary)
            gmsh.write(str(path))

    return write


FORMATS: dict[str, tuple[str, dict[str, Writer]]] = {
    "Gmsh 2.2": (
        ".msh",
        {
            "Gmsh, ASCII": by_gmsh(2.2, 0),
            "Gmsh, binary": by_gmsh(2.2, 1),
            "Gmsh, partitioned": by_gmsh(2.2, 0, 2),
            "by hand": by_hand("2.2.msh", 0),
        },
    ),
    "Gmsh 4.1": (
        ".msh",
        {
            "Gmsh, ASCII": by_gmsh(4.1, 0),
            "Gmsh, binary": by_gmsh(4.1, 1),
            "Gmsh, partitioned": by_gmsh(4.1, 0, 2),
            "by hand": by_hand("4.1.msh", 0),
        },
    ),
    "VTK": (
        ".vtu",
        {
            "meshio, zlib": by_meshio("vtu", compression="zlib"),
            "meshio, lzma": by_meshio("vtu", compression="lzma"),
            "fem": by_fem,
            "by hand": by_hand("vtu", 0),
        },
    ),
    "VTK legacy": (
        ".vtk",
        {
            "meshio 4.2, ASCII": by_meshio("vtk42", binary=False),
            "meshio 4.2, binary": by_meshio("vtk42"),
            "meshio 5.1, ASCII": by_meshio("vtk51", binary=False),
            "meshio 5.1, binary": by_meshio("vtk51"),
        },
    ),
    "MED": (".med", {"h5py": lambda draft, path: write_med(structure(draft), path)}),
    "Universal": (".unv", {"by hand": lambda draft, path: write_unv(structure(draft), path)}),
    "Abaqus": (
        ".inp",
        {"by hand, flat": by_hand("inp", 1), "by hand, a part with an instance": by_hand("inp", 2)},
    ),
}
"""By the name of the format: the end of the file's name, and its writers."""
CASES = [
    (name, by, model)
    for name, (_, writers) in FORMATS.items()
    for by in writers
    for model in ("solid", "shell", "frame")
    if (name, model) != ("Universal", "solid")  # which has pyramids, as the format has not
]


def without_edge(draft: Draft) -> Draft:
    """A deck has no cells for the edge of a shell."""
    edge = {label for label, (kind, _) in draft.cells.items() if kind == "line"}
    return replace(
        draft,
        cells={label: cell for label, cell in draft.cells.items() if label not in edge},
        names=[(name, of) for name, of in draft.names if name != "skin"],
    )


def table() -> list[str]:
    """The rows of the docs: each format with its writers and what is kept."""
    rows = []
    for name, (end, writers) in FORMATS.items():
        edge = "faces of solids; there are no elements for edges" if end == ".inp" else "yes"
        rows.append(f"| {name} `{end}` | {'; '.join(writers)} | yes | yes | {edge} |")
    return rows


@pytest.mark.parametrize(("name", "by", "model"), CASES)
def test_every_writer_gives_the_same_component(tmp_path, name, by, model):
    draft, (end, writers) = drafts()[model], FORMATS[name]
    if (end, model) == (".inp", "shell"):
        draft = without_edge(draft)
    path = tmp_path / f"{model}{end}"
    writers[by](draft, path)
    mesh = read(draft, path)
    found, expected = draft.assembled(mesh), squares(draft.component())
    assert mass_of(found) == pytest.approx(draft.mass(), rel=1e-12)
    wanted, there = places(draft.mesh()), places(mesh)
    for what, of_names in wanted.items():
        plain = {n: at for n, at in there[what].items() if not re.match(r"(body|one)\.", n)}
        assert plain == of_names
    scale = 1e-12 * expected.max()
    np.testing.assert_allclose(squares(found), expected, rtol=1e-9, atol=scale)


def test_the_table_of_the_docs_is_what_is_tested():
    text = DOCS.read_text(encoding="utf-8")
    block = text.split("<!-- formats -->")[1].split("<!-- end of formats -->")[0]
    assert block.strip().splitlines()[2:] == table()
