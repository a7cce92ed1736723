"""Changes of a mesh are followed or refused, never passed over: in each format, at random."""

from __future__ import annotations

import random
import re
from itertools import product

import numpy as np
import pytest
from drafts import WRITERS, Draft
from mutations import contradicted, frame, mutated, shell, solid
from scipy.linalg import eigh

import fem
import fem.formats.read

pytestmark = pytest.mark.filterwarnings("ignore::fem.LockingWarning")

QUICK, FULL = 15, 2500
"""Cases for each of the four formats: 60 in the gate, 10,000 in the long run."""


def read(draft: Draft, path):
    return fem.read_mesh(path)


def squares(component):
    """All squares of angular frequencies."""
    return eigh(component.stiffness.toarray(), component.mass.toarray(), eigvals_only=True)


def mass_of(component) -> float:
    """The mass with all of its digits."""
    return float(component.rigid_mass[0, 0])


def places(mesh) -> dict[str, dict[str, list]]:
    """What each name stands for, by coordinates from the first corner of the mesh."""
    points = (mesh.points - mesh.points.min(axis=0)).round(9) + 0.0

    def sorted_places(nodes):
        return sorted(map(tuple, points[nodes].tolist()))

    return {
        "groups": {
            name: sorted(
                sorted_places(mesh.cells[kind][i]) for kind, of in group.items() for i in of
            )
            for name, group in mesh.groups.items()
            if any(len(of) for of in group.values())
        },
        "sets": {name: sorted_places(n) for name, n in mesh.point_sets.items() if len(n)},
    }


def judge(draft: Draft, path) -> None:
    """The file is the component of the draft, or what it is not is told."""
    known = None if draft.faults else draft.component()
    if known is None:
        with pytest.raises(fem.ModelError) as caught:
            draft.assembled(read(draft, path))
        assert re.search("|".join(draft.faults) or ".", str(caught.value)), draft.faults
        return
    mesh = read(draft, path)
    found = draft.assembled(mesh)
    assert mass_of(found) == pytest.approx(draft.mass(), rel=1e-12)
    wanted, there = places(draft.mesh()), places(mesh)
    for what, of_names in wanted.items():
        more = [name for name in there[what] if name not in of_names]
        assert all(re.match(r"(body|one)\.", name) for name in more)
        assert {name: there[what].get(name) for name in of_names} == of_names
    expected = squares(known)
    np.testing.assert_allclose(squares(found), expected, rtol=1e-9, atol=1e-12 * expected.max())


def one_case(end: str, number: int, folder) -> None:
    """Write a random draft, or a contradiction, and judge what is made of it."""
    chance = random.Random(f"{end} {number}")
    draft = mutated(chance, end)
    text = WRITERS[end](draft, chance)
    if not draft.faults and chance.random() < 0.15:
        text, said = contradicted(text, chance, end)
        draft.faults.append(said)
    path = folder / f"{number}.{end}"
    path.write_text(text, encoding="utf-8")
    try:
        judge(draft, path)
    except BaseException as error:
        error.add_note(f"case {number} of {end}")
        raise
    path.unlink()


@pytest.mark.parametrize("end", WRITERS)
def test_a_changed_mesh_is_followed_or_refused(tmp_path, end):
    for number in range(QUICK):
        one_case(end, number, tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize("end", WRITERS)
def test_thousands_of_changed_meshes(tmp_path, end):
    for number in range(QUICK, QUICK + FULL):
        one_case(end, number, tmp_path)


def lose_a_cell(content) -> None:
    cells = [(len(b.data), i) for i, b in enumerate(content.cells) if b.type != "vertex"]
    index = max(cells)[1]
    last = len(content.cells[index].data) - 1
    content.cells[index].data = content.cells[index].data[:last]
    for blocks in content.cell_sets.values():
        blocks[index] = np.array([cell for cell in blocks[index] if cell < last], dtype=int)
    for blocks in content.cell_data.values():
        blocks[index] = blocks[index][:last]


def lose_a_member(content) -> None:
    """Of the held points: a node of the set, a mark, or a vertex."""
    if "root" in content.point_sets:
        content.point_sets["root"] = content.point_sets["root"][1:]
    elif "set:root" in content.point_data:
        marks = content.point_data["set:root"]
        marks[np.flatnonzero(marks)[0]] = 0
    else:
        blocks = content.cell_sets["root"]
        index = next(i for i, found in enumerate(blocks) if len(found))
        blocks[index] = blocks[index][1:]


def mix_up_two_parts(content) -> None:
    sets = content.cell_sets if "a" in content.cell_sets else content.cell_data
    a, b = ("a", "b") if "a" in sets else ("set:a", "set:b")
    sets[a], sets[b] = sets[b], sets[a]


MAKES, SPOILS = (solid, shell, frame), (lose_a_cell, lose_a_member, mix_up_two_parts)


def one_of_three(end, make, spoil):
    """Each two of a format, a model and a loss in the gate, all three together in the long run."""
    together = sum(which.index(one) for which, one in ((list(WRITERS), end), (MAKES, make)))
    marks = () if (together - SPOILS.index(spoil)) % 3 == 0 else pytest.mark.slow
    return pytest.param(end, make, spoil, marks=marks)


@pytest.mark.parametrize(
    ("end", "make", "spoil"), [one_of_three(*three) for three in product(WRITERS, MAKES, SPOILS)]
)
def test_a_reader_that_loses_something_is_noticed(tmp_path, monkeypatch, end, make, spoil):
    draft, path = make(random.Random(1)), tmp_path / f"whole.{end}"
    path.write_text(WRITERS[end](draft, random.Random(1)), encoding="utf-8")
    judge(draft, path)
    as_it_is = fem.formats.read.without_cells

    def spoiled(content, ignore, source):
        spoil(content)
        return as_it_is(content, ignore, source)

    monkeypatch.setattr(fem.formats.read, "without_cells", spoiled)
    with pytest.raises(AssertionError):
        judge(draft, path)
