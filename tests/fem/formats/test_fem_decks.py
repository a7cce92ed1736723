"""Decks of Abaqus and CalculiX: what is read, what is left out, what is refused."""

import math
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import cms
import fem

STEEL = fem.Material(2.1e11, 7800.0, 0.3)
BAR = fem.BeamPart(STEEL, fem.RectangularSection(0.02, 0.01))
CLAMP = ("x", "y", "rotation")


def deck(folder, text, name="deck.inp"):
    path = folder / name
    path.write_text(text)
    return path


def cantilever_deck(
    elements="*ELEMENT, TYPE=B21, ELSET=BEAM\n1, 1, 2\n*ELGEN, ELSET=BEAM\n1, 10\n",
):
    nodes = "".join(f"{i + 1}, {i / 10!r}, 0.0\n" for i in range(11))
    return f"*NODE\n{nodes}{elements}*NSET, NSET=ROOT\n1\n*NSET, NSET=TIP\n11\n"


def frame_frequencies(path, modes=2, **options):
    model = fem.StructureModel(
        fem.read_mesh(path),
        {"BEAM": BAR},
        supports=[fem.Support("ROOT", CLAMP)],
        interfaces={"tip": fem.Interface("TIP", "y")},
        **options,
        plane=True,
    )
    component = fem.assemble(model)
    return component, cms.reduce(component, modes=modes).frequencies_hz


def bending_hz(length=1.0, height=0.01):
    """First bending frequency of a cantilever, by Euler and Bernoulli."""
    root = 1.8751040687119611
    return (
        root**2
        / (2 * math.pi * length**2)
        * math.sqrt(STEEL.youngs_modulus / STEEL.density * height**2 / 12)
    )


def test_a_cantilever_of_elgen_has_all_its_elements(tmp_path):
    path = deck(tmp_path, cantilever_deck())
    assert len(fem.read_mesh(path).part("BEAM")["line"]) == 10
    assert frame_frequencies(path)[1][0] == pytest.approx(bending_hz(), rel=1e-4)


def test_lines_of_three_nodes_are_two_beams(tmp_path):
    rows = "".join(f"{i}, {2 * i - 1}, {2 * i}, {2 * i + 1}\n" for i in range(1, 6))
    text = cantilever_deck(f"*ELEMENT, TYPE=B22, ELSET=BEAM\n{rows}")
    found, plain = (
        frame_frequencies(deck(tmp_path, each))[1] for each in (text, cantilever_deck())
    )
    np.testing.assert_allclose(found, plain, rtol=1e-9)


def test_elgen_makes_rows_and_layers(tmp_path):
    nodes = "".join(
        f"{100 * k + 10 * j + i}, {i}, {j}, {k}\n"
        for k in (1, 2, 3) for j in (1, 2, 3) for i in (1, 2, 3)
    )  # fmt: skip
    text = (
        f"*NODE\n{nodes}*ELEMENT, TYPE=C3D8, ELSET=CUBE\n"
        "1, 111, 112, 122, 121, 211, 212, 222, 221\n"
        "*ELGEN, ELSET=CUBE\n1, 2, 1, 1, 2, 10, 2, 2, 100, 4\n"
    )
    made = fem.read_mesh(deck(tmp_path, text))
    whole = fem.box_mesh("CUBE", (2.0, 2.0, 2.0), (2, 2, 2), origin=(1, 1, 1), kind="hexahedron")

    def places(mesh):
        return sorted(map(tuple, mesh.points[mesh.cells["hexahedron"]].mean(axis=1).tolist()))

    assert places(made) == places(whole)


def test_nodes_are_generated_between_along_and_from_others(tmp_path):
    text = (
        "*NODE, NSET=A\n1, 0., 0., 0.\n5, 4., 0., 0.\n*NGEN, NSET=BOTTOM\n1, 5, 1\n"
        "*NCOPY, OLD SET=BOTTOM, NEW SET=TOP, CHANGE NUMBER=100, SHIFT\n0., 2., 0.\n"
        "0., 0., 0., 0., 0., 1., 0.\n"
        "*NFILL, NSET=ALL\nBOTTOM, TOP, 2, 50\n"
        "*ELEMENT, TYPE=CPS4, ELSET=S\n1, 1, 2, 52, 51\n*ELGEN\n1, 4, 1, 1, 2, 50, 4\n"
        "*ELSET, ELSET=S, GENERATE\n1, 8\n"
    )
    mesh = fem.read_mesh(deck(tmp_path, text))
    assert len(mesh.points) == 15 and len(mesh.part("S")["quad"]) == 8
    assert sorted(map(tuple, mesh.points.tolist())) == sorted(
        (float(x), float(y), 0.0) for x in range(5) for y in range(3)
    )
    assert len(mesh.nodes("ALL")) == 15 and mesh.points[mesh.nodes("TOP"), 1].tolist() == [2.0] * 5


def test_copied_nodes_turn_about_an_axis(tmp_path):
    text = (
        "*NODE, NSET=A\n1, 1., 0., 0.\n2, 2., 0., 0.\n*NCOPY, OLD SET=A, CHANGE NUMBER=10,"
        " SHIFT, MULTIPLE=3\n0., 0., 0.\n0., 0., 0., 0., 0., 1., 90.\n"
        "*ELEMENT, TYPE=T3D2, ELSET=E\n1, 1, 2\n*ELCOPY, OLD SET=E, NEW SET=F, ELEMENT SHIFT=5,"
        " SHIFT NODES=10\n"
    )
    mesh = fem.read_mesh(deck(tmp_path, text))
    expected = [[1, 0], [2, 0], [0, 1], [0, 2], [-1, 0], [-2, 0], [0, -1], [0, -2]]
    assert mesh.points[:, :2] == pytest.approx(np.array(expected), abs=1e-12)
    assert mesh.cells["line"].tolist() == [[0, 1], [2, 3]]
    assert mesh.part("F")["line"].tolist() == [1]


def test_cylindrical_coordinates_and_local_systems(tmp_path):
    text = (
        "*NODE, SYSTEM=C\n1, 2., 90., 3.\n*SYSTEM\n1., 0., 0., 1., 1., 0.\n0., 0., 0.\n"
        "*NODE\n2, 1., 0., 0.\n3, 0., 1., 5.\n*SYSTEM\n*NODE\n4, 7., 8., 9.\n"
        "*ELEMENT, TYPE=B31, ELSET=E\n1, 1, 2\n2, 3, 4\n"
    )
    mesh = fem.read_mesh(deck(tmp_path, text))
    expected = [[0, 2, 3], [1, 1, 0], [0, 0, 5], [7, 8, 9]]
    assert mesh.points == pytest.approx(np.array(expected, dtype=float), abs=1e-15)


def test_sets_of_sets_defined_later_and_by_other_names(tmp_path):
    text = cantilever_deck() + (
        "*NSET, NAME=ENDS\nlast, 1\n*NSET, NSET=LAST, GENERATE\n10, 11\n"
        "*NSET, NSET=ALL, ELSET=BEAM\n*ELSET, ELSET=HALF,\nGENERATE\n1, 9, 2\n"
    )
    mesh = fem.read_mesh(deck(tmp_path, text))
    assert mesh.nodes("ENDS").tolist() == [0, 9, 10]
    assert mesh.nodes("ALL").tolist() == list(range(11))
    assert mesh.part("HALF")["line"].tolist() == [0, 2, 4, 6, 8]


def test_any_encoding_and_files_of_nodes_and_elements(tmp_path):
    text = cantilever_deck().replace("ROOT", "Füße")
    for encoding in ("utf-8", "latin-1", "utf-16", "utf-8-sig"):
        path = tmp_path / f"{encoding}.inp"
        path.write_bytes(text.encode(encoding))
        assert fem.read_mesh(path).node("Füße") == 0
    (tmp_path / "nodes.txt").write_text("1, 0., 0.\n2, 1., 0.\n")
    (tmp_path / "lines.txt").write_text("1, 1, 2\n")
    path = deck(
        tmp_path, "*NODE, INPUT=nodes.txt\n*ELEMENT, TYPE=B21, INPUT=lines.txt, ELSET=BEAM\n"
    )
    assert fem.read_mesh(path).points.tolist() == [[0, 0, 0], [1, 0, 0]]


def box_rows(counts=(4, 1, 1), kind="hexahedron20", name="C3D20R"):
    mesh = fem.box_mesh("BOX", (0.4, 0.02, 0.02), counts, kind=kind)
    rows = ["*NODE"]
    rows += [f"{i}, {x!r}, {y!r}, {z!r}" for i, (x, y, z) in enumerate(mesh.points.tolist(), 1)]
    rows.append(f"*ELEMENT, TYPE={name}, ELSET=BOX")
    for label, cell in enumerate((mesh.cells[kind] + 1).tolist(), 1):
        words = [str(label), *map(str, cell)]
        rows += [", ".join(words[:12]) + ("," if words[12:] else ""), ", ".join(words[12:])]
    for side in ("x0", "x1"):
        rows += [f"*NSET, NSET={side}", ", ".join(str(n + 1) for n in mesh.nodes(side))]
    return "\n".join(row for row in rows if row) + "\n", mesh


def solid_frequencies(mesh, modes=4, part="BOX", held="x0", loaded="x1", direction="y"):
    model = fem.StructureModel(
        mesh,
        {part: fem.SolidPart(STEEL)},
        supports=[fem.Support(held, ("x", "y", "z"))],
        couplings=[fem.Coupling("load", loaded, "averaging")],
        interfaces={"load": fem.Interface("load", direction)},
    )
    return cms.reduce(fem.assemble(model), modes=modes).frequencies_hz[:modes]


def test_names_of_the_part_and_of_the_assembly_stay_apart(tmp_path):
    rows, plain = box_rows()
    middle = np.flatnonzero(np.isclose(plain.points[:, 0], 0.2))
    text = (
        f"*Part, name=Plate\n{rows}*Nset, nset=Held\n{', '.join(str(n + 1) for n in middle)}\n"
        "*End Part\n*Assembly, name=A\n*Instance, name=Plate-1, part=Plate\n*End Instance\n"
        "*Nset, nset=Held, instance=Plate-1\nx0\n*End Assembly\n"
    )
    mesh = fem.read_mesh(deck(tmp_path, text))
    assert np.array_equal(mesh.nodes("Held"), plain.nodes("x0"))
    assert np.array_equal(mesh.nodes("Plate.Held"), middle)
    assert np.array_equal(mesh.nodes("Plate-1.Held"), middle)
    expected = solid_frequencies(plain)
    assert solid_frequencies(mesh, held="Held") == pytest.approx(expected, rel=1e-10)


def test_a_name_of_two_parts_needs_the_name_of_the_part(tmp_path):
    rows, _ = box_rows((1, 1, 1))
    text = "".join(f"*PART, NAME={p}\n{rows}*END PART\n" for p in "AB")
    text += "*ASSEMBLY, NAME=W\n*INSTANCE, NAME=A-1, PART=A\n*END INSTANCE\n"
    text += "*INSTANCE, NAME=B-1, PART=B\n1., 0., 0.\n*END INSTANCE\n*END ASSEMBLY\n"
    mesh = fem.read_mesh(deck(tmp_path, text))
    assert sorted(mesh.groups) == ["A-1.BOX", "A.BOX", "B-1.BOX", "B.BOX"]
    assert mesh.points[mesh.nodes("B.x0"), 0].tolist() == [1.0] * 8


def test_a_turned_instance_is_the_same_mesh_written_flat(tmp_path):
    """Shifted first, then turned by 90 degrees about an axis along z through (1, 0, 0)."""
    rows, plain = box_rows()
    text = (
        f"*PART, NAME=P\n{rows}*END PART\n*ASSEMBLY, NAME=A\n*INSTANCE, NAME=I, PART=P\n"
        "2., 0., 0.\n1., 0., 0., 1., 0., 1., 90.\n*END INSTANCE\n*END ASSEMBLY\n"
    )
    mesh = fem.read_mesh(deck(tmp_path, text))
    x, y, z = plain.points.T
    flat = plain.with_points(np.column_stack([1.0 - y, x + 2.0 - 1.0, z]))
    assert mesh.points == pytest.approx(flat.points, abs=1e-14)
    there = solid_frequencies(mesh, direction="x")
    assert there == pytest.approx(solid_frequencies(flat, direction="x"), rel=1e-9)
    assert there == pytest.approx(solid_frequencies(plain), rel=1e-7)


def test_a_surface_of_faces_is_a_set_of_nodes(tmp_path):
    for kind, name in (("hexahedron20", "C3D20"), ("tetra10", "C3D10")):
        rows, plain = box_rows((2, 1, 1), kind, name)
        cells = plain.cells[kind]
        ends = {f"x{side}": set(plain.nodes(f"x{side}").tolist()) for side in (0, 1)}
        faces = [
            f"{label + 1}, S{number}"
            for label in range(len(cells))
            for number, face in enumerate(fem.formats.abaqus.types.faces(kind), 1)
            if {int(cells[label][i]) for i in face} <= ends["x1"]
        ]
        assert faces
        text = f"{rows}*SURFACE, NAME=END, TYPE=ELEMENT\n" + "\n".join(faces) + "\n"
        text += "*SURFACE, NAME=HULL\nBOX,\n*SURFACE, NAME=FOOT, TYPE=NODE\nx0\n"
        mesh = fem.read_mesh(deck(tmp_path, text))
        assert set(mesh.nodes("END").tolist()) == ends["x1"]
        assert set(mesh.nodes("FOOT").tolist()) == ends["x0"]
        sides = np.concatenate([plain.nodes(f"{axis}{side}") for axis in "xyz" for side in (0, 1)])
        assert np.array_equal(mesh.nodes("HULL"), np.unique(sides))


def test_a_surface_and_a_set_of_one_name_stay_apart(tmp_path):
    rows, plain = box_rows((1, 1, 1))
    text = f"{rows}*SURFACE, NAME=x0, TYPE=NODE\nx1\n"
    mesh = fem.read_mesh(deck(tmp_path, text))
    assert np.array_equal(mesh.nodes("x0"), plain.nodes("x0"))
    assert np.array_equal(mesh.nodes("surface x0"), plain.nodes("x1"))
    with pytest.raises(fem.ModelError, match=r"'X0' is defined twice, first in line \d+"):
        fem.read_mesh(deck(tmp_path, text + "*SURFACE, NAME=X0\nBOX, S1\n"))


def test_a_27_node_hexahedron_has_its_centre_and_faces_in_place(tmp_path):
    mesh = fem.box_mesh("BOX", (1.0, 1.0, 1.0), (1, 1, 1), kind="hexahedron27")
    cell = mesh.cells["hexahedron27"][0]
    order = [*range(20), 26, 24, 25, 22, 21, 23, 20]  # centre, -z, +z, -y, +x, +y, -x
    rows = "".join(f"{i + 1}, {x}, {y}, {z}\n" for i, (x, y, z) in enumerate(mesh.points.tolist()))
    words = [str(cell[i] + 1) for i in order]
    text = f"*NODE\n{rows}*ELEMENT, TYPE=C3D27, ELSET=BOX\n1, {', '.join(words[:14])},\n"
    text += ", ".join(words[14:]) + "\n"
    back = fem.read_mesh(deck(tmp_path, text))
    assert back.cells["hexahedron27"][0].tolist() == cell.tolist()
    spoiled = text.replace(", ".join(words[14:]), ", ".join([*words[14:20], *words[:19:-1]]))
    with pytest.raises(fem.ModelError, match="nodes 21 to 27 are not its centre"):
        fem.read_mesh(deck(tmp_path, spoiled))


@pytest.mark.parametrize("kind", ["hexahedron27", "line3", "quad8", "wedge15"])
def test_what_is_written_is_read_again_with_its_types(tmp_path, kind):
    if kind == "line3":
        cells = {"line3": [[0, 2, 1], [2, 4, 3]]}
        mesh = fem.StructureMesh([[i, i, 0] for i in range(5)], cells, {"b": {kind: [0, 1]}})
    else:
        counts = (2, 1) if kind == "quad8" else (2, 1, 1)
        mesh = fem.box_mesh("b", (2.0, 1.0, 1.0)[: len(counts)], counts, kind=kind)
    fem.write_mesh(mesh, tmp_path / "a.inp")
    back = fem.read_mesh(tmp_path / "a.inp")
    assert np.array_equal(back.cells[kind], mesh.cells[kind])
    types = {"quad8": "S8R", "line3": "T3D3"}.get(kind, "C3D15R")
    named = replace(mesh, element_types={types: {kind: [1]}})
    if kind in ("quad8", "line3"):
        fem.write_mesh(named, tmp_path / "b.inp")
        again = fem.read_mesh(tmp_path / "b.inp")
        assert again.element_types[types][kind].tolist() == [1]
        assert np.array_equal(again.cells[kind], mesh.cells[kind])


def test_a_mesh_with_something_attached_is_not_written_without_it(tmp_path):
    mesh = fem.box_mesh("b", (1.0, 1.0, 1.0), (1, 1, 1))
    loaded = replace(mesh, attachments=fem.Attachments([fem.PointMass("x1", 2.0)]))
    for end in ("vtu", "inp"):
        with pytest.raises(fem.ModelError, match=r"attached to the mesh \(point masses: 1\)"):
            fem.write_mesh(loaded, tmp_path / f"a.{end}")


def test_a_mass_of_the_deck_is_the_models_own(tmp_path):
    text = cantilever_deck() + "*ELEMENT, TYPE=MASS, ELSET=M\n99, 11\n*MASS, ELSET=M\n50.\n"
    _, found = frame_frequencies(deck(tmp_path, text))
    plain = frame_frequencies(
        deck(tmp_path, cantilever_deck()), point_masses=[fem.PointMass("TIP", 50.0)]
    )[1]
    assert found == pytest.approx(plain, rel=1e-12)
    stiffness = 3 * STEEL.youngs_modulus * BAR.section.second_moment
    # a heavy mass on a cantilever, with 33/140 of the beam's own mass
    mass = 50.0 + 33 / 140 * STEEL.density * BAR.section.area
    assert found[0] == pytest.approx(math.sqrt(stiffness / mass) / (2 * math.pi), rel=1e-4)


def test_rotary_inertia_springs_and_dashpots_have_closed_forms(tmp_path):
    text = cantilever_deck() + (
        "*ELEMENT, TYPE=ROTARYI, ELSET=R\n20, 11\n*ROTARY INERTIA, ELSET=R\n1., 2., 3.\n"
        "*ELEMENT, TYPE=SPRING1, ELSET=G\n21, 11\n*SPRING, ELSET=G\n2\n5000.\n"
        "*ELEMENT, TYPE=SPRINGA, ELSET=A\n22, 1, 11\n*SPRING, ELSET=A\n\n1.0e6\n"
        "*ELEMENT, TYPE=SPRING2, ELSET=B\n23, 2, 11\n*SPRING, ELSET=B\n2, 6\n700.\n"
        "*ELEMENT, TYPE=DASHPOT1, ELSET=D\n24, 11\n*DASHPOT, ELSET=D\n2\n30.\n"
        "*ELEMENT, TYPE=DASHPOTA, ELSET=E\n25, 10, 11\n*DASHPOT, ELSET=E\n\n4.\n"
    )
    bare = frame_frequencies(deck(tmp_path, cantilever_deck()))[0]
    component = frame_frequencies(deck(tmp_path, text))[0]
    at = {name: 3 * (node - 1) - 3 for name, node in (("tip", 11), ("second", 2), ("tenth", 10))}
    stiffness = np.zeros((30, 30))
    stiffness[at["tip"] + 1, at["tip"] + 1] += 5000.0
    stiffness[at["tip"], at["tip"]] += 1e6  # the other end of the axial spring is held
    pair = np.zeros(30)
    pair[at["second"] + 1], pair[at["tip"] + 2] = 1.0, -1.0
    stiffness += 700.0 * np.outer(pair, pair)
    added = (component.stiffness - bare.stiffness).toarray()
    assert added == pytest.approx(stiffness, abs=1e-6)
    inertia = np.zeros((30, 30))
    inertia[at["tip"] + 2, at["tip"] + 2] = 3.0
    assert (component.mass - bare.mass).toarray() == pytest.approx(inertia, abs=1e-12)
    damping = np.zeros((30, 30))
    damping[at["tip"] + 1, at["tip"] + 1] = 30.0
    along = np.zeros(30)
    along[at["tip"]], along[at["tenth"]] = 1.0, -1.0
    assert component.damping.toarray() == pytest.approx(damping + 4.0 * np.outer(along, along))
    form = component.natural_form
    product = form.deformations.T @ (form.stiffness[:, None] * form.deformations.matmat(np.eye(30)))
    assert product == pytest.approx(component.stiffness.toarray(), rel=1e-9, abs=1e-3)


def test_two_masses_on_springs_beside_a_truss_have_a_closed_form(tmp_path):
    """Nodes on no cell move as what is attached to them says."""
    rows, _ = box_rows((1, 1, 1))
    text = rows + (
        "*NODE\n901, 5., 0., 0.\n902, 6., 0., 0.\n"
        "*ELEMENT, TYPE=MASS, ELSET=M\n901, 901\n902, 902\n*MASS, ELSET=M\n2.\n"
        "*ELEMENT, TYPE=SPRINGA, ELSET=S\n910, 901, 902\n"
        "*SPRING, ELSET=S\n\n800.\n*ELEMENT, TYPE=SPRING1, ELSET=G\n911, 901\n"
        "*SPRING, ELSET=G\n1\n800.\n"
    )
    mesh = fem.read_mesh(deck(tmp_path, text))
    model = fem.StructureModel(
        mesh,
        {"BOX": fem.SolidPart(STEEL)},
        supports=[fem.Support("BOX", ("x", "y", "z"))]
        + [fem.Support(f"node {label}", ("y", "z")) for label in (901, 902)],
        interfaces={"end": fem.Interface("node 902", "x")},
    )
    component = fem.assemble(model)
    K, M = component.stiffness.toarray(), component.mass.toarray()
    squares = np.sort(np.linalg.eigvals(np.linalg.solve(M, K)).real)
    golden = (3 + np.array([-1, 1]) * math.sqrt(5)) / 2  # of a chain of two equal oscillators
    assert squares == pytest.approx(400.0 * golden, rel=1e-12)


def two_boxes(second_nodes_apart):
    """Two boxes end to end, as a deck whose second one has nodes of its own, and merged."""
    rows, left = box_rows((2, 1, 1))
    right = left.with_points(left.points + np.array([0.4, 0.0, 0.0]))
    lines = [
        f"{i + 1001}, {x!r}, {y!r}, {z!r}" for i, (x, y, z) in enumerate(right.points.tolist())
    ]
    text = rows + "*NODE\n" + "\n".join(lines) + "\n*ELEMENT, TYPE=C3D20R, ELSET=BOX\n"
    for label, cell in enumerate((left.cells["hexahedron20"] + 1001).tolist(), 101):
        words = [str(label), *map(str, cell)]
        text += ", ".join(words[:12]) + ",\n" + ", ".join(words[12:]) + "\n"
    text += "*NSET, NSET=far\n" + ", ".join(str(n + 1001) for n in left.nodes("x1")) + "\n"
    text += "*NSET, NSET=touching\n" + ", ".join(str(n + 1001) for n in left.nodes("x0")) + "\n"
    merged = fem.box_mesh("BOX", (0.8, 0.02, 0.02), (4, 1, 1))
    pairs = [
        (int(a) + 1, int(b) + 1001)
        for b in left.nodes("x0")
        for a in left.nodes("x1")
        if np.allclose(left.points[a, 1:], left.points[b, 1:])
    ]
    return text, merged, pairs


JOINED = {
    "equation": lambda pairs: "*EQUATION\n" + "".join(
        f"2\n{b}, {way}, 1., {a}, {way}, -1.\n" for a, b in pairs for way in (1, 2, 3)),
    "tie": lambda pairs: "*MPC\n" + "".join(f"TIE, {b}, {a}\n" for a, b in pairs),
    "pin": lambda pairs: "*MPC\n" + "".join(f"PIN, {b}, {a}\n" for a, b in pairs),
    "surfaces": lambda pairs: "*SURFACE, NAME=A, TYPE=NODE\nx1\n*SURFACE, NAME=B, TYPE=NODE\n"
    "touching\n*TIE, NAME=T\nB, A\n",
}  # fmt: skip


@pytest.mark.parametrize("how", JOINED)
def test_joined_nodes_are_as_merged_ones(tmp_path, how):
    text, merged, pairs = two_boxes(True)
    assert len(pairs) == 8
    mesh = fem.read_mesh(deck(tmp_path, text + JOINED[how](pairs)))
    assert len(mesh.attachments.equations) == 24
    found = solid_frequencies(mesh, loaded="far")
    assert found == pytest.approx(solid_frequencies(merged), rel=1e-9)


def test_an_equation_with_held_and_chained_terms_is_solved_as_it_stands(tmp_path):
    """u2 = u3 / 2 + u1, u1 held, u3 = u4: the springs at 2 and 4 act on one coordinate."""
    rows, _ = box_rows((1, 1, 1))
    text = rows + "*NODE\n" + "".join(f"{900 + i}, {5 + i}., 0., 0.\n" for i in (1, 2, 3, 4))
    text += "*ELEMENT, TYPE=MASS, ELSET=M\n" + "".join(
        f"{900 + i}, {900 + i}\n" for i in (1, 2, 3, 4)
    )
    text += "*MASS, ELSET=M\n2.\n*ELEMENT, TYPE=SPRING1, ELSET=G\n911, 902\n912, 904\n"
    text += "*SPRING, ELSET=G\n1\n100.\n"
    text += "*EQUATION\n3\n902, 1, 2., 903, 1, -1., 901, 1, -2.\n2\n903, 1, 1., 904, 1, -1.\n"
    mesh = fem.read_mesh(deck(tmp_path, text))
    supports = [fem.Support("BOX", ("x", "y", "z")), fem.Support("node 901", "x")]
    supports += [fem.Support(f"node {900 + i}", ("y", "z")) for i in (1, 2, 3, 4)]
    component = fem.assemble(fem.StructureModel(mesh, {"BOX": fem.SolidPart(STEEL)}, supports))
    assert component.stiffness.toarray() == pytest.approx(np.array([[100.0 + 25.0]]))
    assert component.mass.toarray() == pytest.approx(np.array([[2.0 + 2.0 + 0.5]]))
    moved = component.shape(np.array([1.0]))
    ends = [moved[mesh.node(f"node {label}"), 0] for label in (901, 902, 903, 904)]
    assert ends == pytest.approx([0.0, 0.5, 1.0, 1.0])


RIGID = {
    "rigid body": "*RIGID BODY, NSET=x1, REF NODE=900\n",
    "kinematic": "*SURFACE, NAME=S, TYPE=NODE\nx1\n*COUPLING, REF NODE=900, SURFACE=S,"
    " CONSTRAINT NAME=C\n*KINEMATIC\n1, 6\n",
    "kinematic coupling": "*KINEMATIC COUPLING, REF NODE=900\nx1, 1, 3\n",
    "beam": "*MPC\nBEAM, x1, 900\n",
    "distributing": "*SURFACE, NAME=S, TYPE=NODE\nx1\n*COUPLING, REF NODE=900, SURFACE=S,"
    " CONSTRAINT NAME=C\n*DISTRIBUTING\n1, 6\n",
}


@pytest.mark.parametrize("how", RIGID)
def test_couplings_of_the_deck_are_those_of_the_model(tmp_path, how):
    rows, plain = box_rows()
    centre = plain.points[plain.nodes("x1")].mean(axis=0).tolist()
    node = f"*NODE\n900, {centre[0]!r}, {centre[1]!r}, {centre[2]!r}\n"
    lump = "*ELEMENT, TYPE=MASS, ELSET=M\n900, 900\n*MASS, ELSET=M\n3.\n"
    mesh = fem.read_mesh(deck(tmp_path, rows + node + lump + RIGID[how]))
    parts, supports = {"BOX": fem.SolidPart(STEEL)}, [fem.Support("x0", ("x", "y", "z"))]
    found = fem.assemble(
        fem.StructureModel(mesh, parts, supports, interfaces={"p": fem.Interface("node 900", "y")})
    )
    kind = "averaging" if how == "distributing" else "rigid"
    coupling = fem.Coupling(
        "p", "x1", kind, tuple(centre), weighting="nodes" if how == "distributing" else "area"
    )
    own = fem.assemble(
        fem.StructureModel(
            plain,
            parts,
            supports,
            [fem.PointMass("p", 3.0)],
            couplings=[coupling],
            interfaces={"p": fem.Interface("p", "y")},
        )
    )
    expected = cms.reduce(own, modes=4).frequencies_hz[:4]
    assert cms.reduce(found, modes=4).frequencies_hz[:4] == pytest.approx(expected, rel=1e-10)


def test_a_surface_of_nodes_within_an_instance_weighs_its_nodes(tmp_path):
    rows, _ = box_rows()
    text = f"*PART, NAME=P\n{rows}*SURFACE, NAME=S, TYPE=NODE\nx1\n*END PART\n"
    text += "*ASSEMBLY, NAME=A\n*INSTANCE, NAME=I, PART=P\n*END INSTANCE\n"
    text += "*NODE\n900, 0.4, 0., 0.\n"
    text += "*COUPLING, REF NODE=900, SURFACE=I.S, CONSTRAINT NAME=C\n*DISTRIBUTING\n1, 6\n"
    mesh = fem.read_mesh(deck(tmp_path, text + "*END ASSEMBLY\n"))
    assert [coupling.weighting for coupling in mesh.attachments.couplings] == ["nodes"]


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("*ELEMENT, TYPE=GAPUNI, ELSET=G\n50, 1, 2\n51, 3, 4\n*CONTACT PAIR\na, b\n*ROTTEN\n",
         r"elements of type GAPUNI \(2, first in line 22, element 50\): contact .*\[\[stops\]\].*"
         r"\*CONTACT PAIR \(1, first in line 24\).*\*ROTTEN \(1, first in line 26\): it is"),
        ("*ELEMENT, TYPE=CONN3D2\n50, 1, 2\n", r"type CONN3D2 \(1, first in line 22, element 50\)"),
        ("*ELEMENT, TYPE=SPRINGA, ELSET=S\n50, 1, 2\n",
         r"line 22: element 50 of type SPRINGA has no \*SPRING that gives its numbers"),
        ("*ELEMENT, TYPE=MASS, ELSET=S\n50, 1\n", r"element 50 of type MASS has no \*MASS"),
        ("*ELEMENT, TYPE=SPRINGA, ELSET=S\n50, 1, 2\n*SPRING, ELSET=S, NONLINEAR\n\n0, 0\n1, 1\n",
         "line 23: .*SPRING: its parameter 'NONLINEAR' is not read"),
        ("*NODE, SYSTEM=S\n50, 1., 2., 3.\n", "line 21: .*SYSTEM=S are not read"),
        ("*NGEN, LINE=C\n1, 5\n", "line 21: .*parameter 'LINE' is not read"),
        ("*NODE\n50 1. 2. 3.\n", "line 22: .*'50 1. 2. 3.' is not a whole number .numbers need"),
        ("*ELEMENT, TYPE=B21\n50, 1, 2, 3, 4\n", "line 22: .*element 50 of type B21 has 4 nodes"),
        ("*NSET, NSET=q\nEedges\n", "line 22: names the node set 'Eedges', which is not defined"),
        ("*NSET, NSET=q\nr\n*NSET, NSET=r\nq\n", "the set '[qr]' holds itself"),
        ("*MPC\nMEANROT, 1, 2, 3\n", r"\*MPC MEANROT \(1, first in line 22\): of these only BEAM"),
        ("*EQUATION\n2\n1, 1, 1., 2, 11, 1.\n", "line 22: .*11 is not a direction from 1 to 6"),
        ("*EQUATION\n2\n1, 1, 1., 2\n", "line 22: .*an equation of 2 terms needs 6 words"),
        ("*TRANSFORM, NSET=TIP\n1, 0, 0, 0, 1, 0\n*EQUATION\n2\n11, 1, 1., 2, 1, 1.\n",
         r"line 24: .*node 11 has axes of its own by \*TRANSFORM in line 21"),
        *((f"*KINEMATIC COUPLING, REF NODE=1\nTIP{ends}\n", "line 22: .* from 1 to 6")
          for ends in (", 0, 3", ", 1, 9", ", 3, 1", ", 1, 3, 5")),
        ("*RIGID BODY, NSET=TIP\n", "line 21: .*has no REF NODE"),
        ("*RELEASE\n1, S1, ALLM\n", r"\*RELEASE .*\[\[hinges\]\]"),
        ("*NODE\n77, 1, 1, 0\n*SURFACE, NAME=A, TYPE=NODE\n77\n*SURFACE, NAME=B, TYPE=NODE\nTIP\n"
         "*TIE, NAME=T\nA, B\n", r"\*TIE \(1, first in line 28\): surfaces whose nodes are"),
    ],
)  # fmt: skip
def test_what_is_not_read_is_named_with_its_place(tmp_path, text, sentence):
    path = deck(tmp_path, cantilever_deck() + text)
    with pytest.raises(fem.ModelError, match=sentence):
        fem.read_mesh(path)


def test_what_is_refused_can_be_ignored_by_name(tmp_path):
    text = cantilever_deck() + (
        "*ELEMENT, TYPE=GAPUNI, ELSET=GAPS\n50, 1, 2\n51, 3, 4\n*GAP, ELSET=GAPS\n0.1\n"
        "*ELSET, ELSET=ALL\nBEAM, GAPS, 51\n*Contact  pair\na, b\n"
    )
    path = deck(tmp_path, text)
    with pytest.raises(fem.ModelError, match=r"GAPUNI .*GAP .*CONTACT PAIR"):
        fem.read_mesh(path)
    with pytest.raises(fem.ModelError, match=r"not read: \*GAP \(1, first in line 24\)"):
        fem.read_mesh(path, ignore=["gapuni", "*CONTACT PAIR"])
    mesh = fem.read_mesh(path, ignore=["GAPUNI", "CONTACT PAIR", "*GAP"])
    assert len(mesh.part("ALL")["line"]) == 10
    told = [str(item) for item in mesh.left_out]
    assert told[0] == (
        "elements of type GAPUNI (2, first in line 22, element 50): it is to be ignored"
    )
    assert len(told) == 3
    with pytest.raises(fem.ModelError, match=r"no cell of '.ROTTEN' to ignore"):
        fem.read_mesh(path, ignore=["GAPUNI", "CONTACT PAIR", "*GAP", "*ROTTEN"])


@pytest.mark.parametrize(
    ("name", "sentence"),
    [
        ("PLATE", r"'PLATE' is to be ignored, but 1 of its .*the first is 50\) are mas"),
        ("LUMP", "'LUMP' is to be ignored, but 1 of its"),
        ("MASS", "no cell of 'MASS' to ignore; there are [^L]*'PLATE', "),
    ],
)
def test_a_mass_of_a_set_to_be_ignored_does_not_stay_in_silence(tmp_path, name, sentence):
    text = cantilever_deck() + (
        "*ELEMENT, TYPE=MASS, ELSET=LUMP\n50, 11\n*MASS, ELSET=LUMP\n2.0\n"
        "*ELSET, ELSET=PLATE\n50, 10\n"
    )
    with pytest.raises(fem.ModelError, match=sentence):
        fem.read_mesh(deck(tmp_path, text), ignore=[name])


def test_what_is_left_out_by_intention_is_listed(tmp_path):
    text = (
        cantilever_deck() + "*BOUNDARY\n1, 1, 6\n*STEP\n*FREQUENCY\n3\n*BOUNDARY\n2, 1\n*END STEP\n"
    )
    told = [str(item) for item in fem.read_mesh(deck(tmp_path, text)).left_out]
    assert told[0] == "*BOUNDARY (2, first in line 21): supports are given by the scene"
    assert [item.split()[0] for item in told] == ["*BOUNDARY", "*STEP", "*FREQUENCY", "*END"]


def test_no_word_is_read_and_left_out_and_refused_at_once():
    known = fem.formats.abaqus.known
    read, left, refused = known.READ, known.LEFT_OUT, known.ADVICE
    assert (
        not set(read) & set(left) and not set(read) & set(refused) and not set(left) & set(refused)
    )


def test_a_truss_is_no_beam_and_a_shell_no_sheet(tmp_path):
    text = cantilever_deck().replace("B21", "T2D2")
    with pytest.raises(
        fem.ModelError, match=r"part 'BEAM' is a BeamPart, but 10 .* type T2D2 .truss"
    ):
        frame_frequencies(deck(tmp_path, text))
    text = "*NODE\n1, 0, 0\n2, 1, 0\n3, 1, 1\n4, 0, 1\n*ELEMENT, TYPE=S4R, ELSET=E\n1, 1, 2, 3, 4\n"
    mesh = fem.read_mesh(deck(tmp_path, text))
    with pytest.raises(fem.ModelError, match=r"but 1 of its elements are of type S4R \(shell\)"):
        fem.StructureModel(mesh, {"E": fem.SolidPart(STEEL, "stress", 0.1)})
    sheet = fem.read_mesh(deck(tmp_path, text.replace("S4R", "CPS4R")))
    assert fem.StructureModel(sheet, {"E": fem.SolidPart(STEEL, "stress", 0.1)}).plane


def test_trusses_and_shells_of_the_deck_are_parts_of_their_kind(tmp_path):
    """A hanging truss with a mass: sqrt(E A / (L m)); what it cannot turn is refused."""
    text = (
        "*NODE\n1, 0., 0.\n2, 0., -2.\n*ELEMENT, TYPE=T2D2, ELSET=ROD\n1, 1, 2\n"
        "*ELEMENT, TYPE=MASS, ELSET=M\n2, 2\n*MASS, ELSET=M\n1e4\n*NSET, NSET=TOP\n1\n"
        "*MATERIAL, NAME=S\n*ELASTIC\n2.1e11, 0.3\n*DENSITY\n7800.\n"
        "*SOLID SECTION, ELSET=ROD, MATERIAL=S\n1e-4\n"
    )
    mesh = fem.read_mesh(deck(tmp_path, text))
    assert mesh.described["ROD"]["kind"] == "truss" and mesh.described["ROD"]["area"] == 1e-4
    parts = {"ROD": fem.TrussPart(STEEL, 1e-4)}
    held = [fem.Support("TOP", ("x", "y")), fem.Support("node 2", "x")]
    component = fem.assemble(fem.StructureModel(mesh, parts, held, plane=True))
    square = (component.stiffness / component.mass.toarray()[0, 0]).toarray()[0, 0]
    assert square == pytest.approx(2.1e11 * 1e-4 / 2.0 / (1e4 + 7800 * 1e-4 * 2 / 3), rel=1e-12)
    turned = text + "*ELEMENT, TYPE=ROTARYI, ELSET=R\n3, 2\n*ROTARY INERTIA, ELSET=R\n1., 1., 1.\n"
    with pytest.raises(fem.ModelError, match="it does not turn, since only solids or trusses"):
        fem.assemble(fem.StructureModel(fem.read_mesh(deck(tmp_path, turned)), parts, plane=True))
    plate = (
        "*NODE\n1, 0, 0, 0\n2, 1, 0, 0\n3, 1, 1, 0\n4, 0, 1, 0\n"
        "*ELEMENT, TYPE=S4R, ELSET=E\n1, 1, 2, 3, 4\n*MATERIAL, NAME=S\n*ELASTIC\n2.1e11, 0.3\n"
        "*DENSITY\n7800.\n*SHELL SECTION, ELSET=E, MATERIAL=S\n0.01, 5\n"
    )
    shell = fem.read_mesh(deck(tmp_path, plate))
    assert shell.described["E"]["thickness"] == 0.01 and shell.described["E"]["kind"] == "shell"
    mass = fem.assemble(fem.StructureModel(shell, {"E": fem.ShellPart(STEEL, 0.01)})).mass
    along = np.zeros(24)
    along[:12:3] = 1.0
    assert along @ mass @ along == pytest.approx(78.0, rel=1e-12)


def test_wedges_and_pyramids_of_the_deck_keep_their_types(tmp_path):
    for kind, name in (("wedge", "C3D6"), ("wedge15", "C3D15"), ("pyramid", "C3D5")):
        rows, plain = box_rows((2, 1, 1), kind, name)
        mesh = fem.read_mesh(deck(tmp_path, rows))
        assert np.array_equal(mesh.cells[kind], plain.cells[kind])
        assert len(mesh.element_types[name][kind]) == len(plain.cells[kind])
        assert solid_frequencies(mesh) == pytest.approx(solid_frequencies(plain), rel=1e-12)


def test_a_collapsed_element_keeps_its_type(tmp_path):
    text = (
        "*NODE\n1, 0, 0, 0\n2, 1, 0, 0\n3, 0, 1, 0\n5, 0, 0, 1\n6, 1, 0, 1\n7, 0, 1, 1\n"
        "*ELEMENT, TYPE=C3D8R, ELSET=E\n1, 1, 2, 3, 3, 5, 6, 7, 7\n"
    )
    mesh = fem.read_mesh(deck(tmp_path, text))
    assert {name: list(found) for name, found in mesh.element_types.items()} == {"C3D8R": ["wedge"]}
    assert mesh.part("E")["wedge"].tolist() == [0]


def test_what_the_file_attaches_is_saved_and_loaded(tmp_path):
    text = cantilever_deck() + "*ELEMENT, TYPE=MASS, ELSET=M\n99, 11\n*MASS, ELSET=M\n50.\n"
    text += "*ELEMENT, TYPE=DASHPOT1, ELSET=D\n24, 11\n*DASHPOT, ELSET=D\n2\n30.\n"
    component = frame_frequencies(deck(tmp_path, text))[0]
    component.save(tmp_path / "a.npz")
    back = fem.Component.load(tmp_path / "a.npz")
    assert back.model.mesh.attachments == component.model.mesh.attachments
    assert abs(back.mass - component.mass).max() == 0.0
    assert abs(back.damping - component.damping).max() == 0.0
    rows, _, pairs = two_boxes(True)
    mesh = fem.read_mesh(deck(tmp_path, rows + JOINED["equation"](pairs)))
    model = fem.StructureModel(mesh, {"BOX": fem.SolidPart(STEEL)})
    whole = fem.assemble(model)
    whole.save(tmp_path / "b.npz")
    again = fem.Component.load(tmp_path / "b.npz")
    assert again.model.mesh.element_types.keys() == {"C3D20R"}
    assert abs(again.stiffness - whole.stiffness).max() == 0.0


def test_joined_meshes_keep_what_is_attached(tmp_path):
    text = box_rows((1, 1, 1))[0]
    one = fem.read_mesh(
        deck(tmp_path, text + "*ELEMENT, TYPE=MASS, ELSET=M\n99, 2\n*MASS, ELSET=M\n5.\n")
    )
    other = fem.box_mesh("b", (0.1, 0.02, 0.02), (1, 1, 1), origin=(0.4, 0.0, 0.0))
    both = fem.joined([one, other])
    assert both.attachments == one.attachments and both.node("node 2") == one.node("node 2")
    assert both.element_types["C3D20R"]["hexahedron20"].tolist() == [0]
    with pytest.raises(fem.ModelError, match=r"something is attached to 'node 2', and .* has this"):
        fem.joined([one, one.with_points(one.points + 1.0)])


def test_materials_and_sections_of_the_deck_are_described(tmp_path):
    text = cantilever_deck() + (
        "*MATERIAL, NAME=STEEL\n*ELASTIC\n2.1E11, .3\n*DENSITY\n7800.\n*EXPANSION\n1e-5\n"
        "*BEAM SECTION, ELSET=BEAM, MATERIAL=steel, SECTION=RECT\n0.02, 0.01\n0., 0., -1.\n"
    )
    mesh = fem.read_mesh(deck(tmp_path, text))
    assert mesh.described["BEAM"] == {
        "kind": "beam", "theory": "timoshenko", "youngs_modulus": 2.1e11, "poissons_ratio": 0.3,
        "density": 7800.0, "height": 0.01, "width": 0.02,
    }  # fmt: skip
    spatial = fem.read_mesh(deck(tmp_path, text.replace("B21", "B31")))
    assert spatial.described["BEAM"]["height"] == 0.02
    assert spatial.described["BEAM"]["orientation"] == [0.0, 0.0, -1.0]
    for change, reason in (
        (("*ELASTIC\n", "*ELASTIC, TYPE=ENGINEERING CONSTANTS\n"), "not isotropic"),
        (("*EXPANSION\n1e-5", "*DAMPING, ALPHA=1."), r"\*DAMPING .* not taken over"),
        (("*DENSITY\n7800.\n", ""), "no density"),
        (("SECTION=RECT", "SECTION=I"), "a section 'I' of 2 numbers"),
        (("2.1E11, .3\n", "2.1E11, .3, 20.\n1.9E11, .3, 300.\n"), "2 lines of numbers"),
    ):
        assert text.replace(*change) != text
        told = fem.read_mesh(deck(tmp_path, text.replace(*change))).described["BEAM"]["refused"]
        assert re.search(reason, told), told


def test_elements_with_two_sections_are_refused(tmp_path):
    """The section of a set does not describe those of its elements that have another one."""
    text = cantilever_deck() + (
        "*ELSET, ELSET=HALF, GENERATE\n6, 10\n*ELSET, ELSET=REST, GENERATE\n1, 5\n"
        "*MATERIAL, NAME=STEEL\n*ELASTIC\n2.1E11, .3\n*DENSITY\n7800.\n"
        "*BEAM SECTION, ELSET=BEAM, MATERIAL=STEEL, SECTION=RECT\n0.02, 0.01\n"
        "*BEAM SECTION, ELSET=HALF, MATERIAL=STEEL, SECTION=RECT\n0.02, 0.03\n"
    )
    described = fem.read_mesh(deck(tmp_path, text)).described
    assert described["BEAM"] == described["HALF"]
    assert described["BEAM"]["refused"] == (
        "*BEAM SECTION of 'BEAM' in line 30 and *BEAM SECTION of 'HALF' in line 32 have 5"
        " element(s) in common, which can have one section only"
    )
    apart = fem.read_mesh(deck(tmp_path, text.replace("ELSET=BEAM, MAT", "ELSET=REST, MAT")))
    assert [apart.described[name]["height"] for name in ("REST", "HALF")] == [0.01, 0.03]
    same = fem.read_mesh(deck(tmp_path, text.replace("0.02, 0.03", "0.02, 0.01")))
    assert same.described["BEAM"] == same.described["HALF"]
    assert same.described["BEAM"]["height"] == 0.01


@pytest.mark.parametrize(
    ("more", "told"),
    [("*MATERIAL, NAME=steel\n*ELASTIC\n1E11, .3\n*DENSITY\n1.\n", "*MATERIAL twice, in line 21"
      " and in line 26"),
     ("*DENSITY\n1000.\n", "*DENSITY twice, in line 24 and in line 26"),
     ("*ELASTIC\n1E11, .3\n", "*ELASTIC twice, in line 22 and in line 26")],
)  # fmt: skip
def test_a_material_defined_twice_is_refused(tmp_path, more, told):
    text = cantilever_deck() + "*MATERIAL, NAME=STEEL\n*ELASTIC\n2.1E11, .3\n*DENSITY\n7800.\n"
    section = "*BEAM SECTION, ELSET=BEAM, MATERIAL=STEEL, SECTION=RECT\n0.02, 0.01\n"
    refused = fem.read_mesh(deck(tmp_path, text + more + section)).described["BEAM"]["refused"]
    assert refused.endswith(f"is of material 'STEEL', which has {told}")
    once = fem.read_mesh(deck(tmp_path, text + section)).described["BEAM"]
    assert (once["youngs_modulus"], once["density"]) == (2.1e11, 7800.0)


@pytest.mark.parametrize(
    "after",
    ["*BOUNDARY\nROOT, 1, 6\n", "*AMPLITUDE, NAME=A\n0., 0., 1., 1.\n",
     "*SURFACE INTERACTION, NAME=I\n", "*ORIENTATION, NAME=O\n1., 0., 0., 0., 1., 0.\n",
     "*SURFACE, NAME=S, TYPE=NODE\nTIP\n"],
)  # fmt: skip
def test_a_material_ends_where_something_else_begins(tmp_path, after):
    """Abaqus/CAE writes interactions and boundary conditions after the materials."""
    section = "*BEAM SECTION, ELSET=BEAM, MATERIAL=STEEL, SECTION=RECT\n0.02, 0.01\n0., 0., -1.\n"
    material = "*MATERIAL, NAME=STEEL\n*DENSITY\n7800.\n*ELASTIC\n2.1E11, .3\n"
    mesh = fem.read_mesh(deck(tmp_path, cantilever_deck() + section + material + after))
    assert mesh.described["BEAM"]["density"] == 7800.0


def test_the_docs_list_every_keyword_where_it_belongs():
    page = Path(__file__).parents[3] / "docs" / "reference" / "decks.md"
    text = page.read_text(encoding="utf-8")
    known = fem.formats.abaqus.known
    read, rest = text.split("**Read:**")[1].split("**Left out by intention:**")
    left, refused = rest.split("**Refused with advice**")

    def words(part):
        return set(re.findall(r"`([A-Z0-9-]+)`", part))

    assert set(known.READ) <= words(read)
    assert {word for word in known.LEFT_OUT if word} == words(left)
    assert set(known.ADVICE) <= words(refused)


@pytest.mark.parametrize(
    ("keyword", "row"),
    [
        ("*MPC", "1, 2"),
        ("*KINEMATIC COUPLING, REF NODE=1", "1, 3"),
    ],
)
def test_a_row_without_its_first_word_is_told_with_its_line(tmp_path, keyword, row):
    text = cantilever_deck()
    line = text.count("\n") + 1
    with pytest.raises(fem.ModelError, match=f"line {line}: .*has no data line"):
        fem.read_mesh(deck(tmp_path, f"{text}{keyword}\n"))
    with pytest.raises(fem.ModelError, match=f"line {line + 1}: .*nothing before its first comma"):
        fem.read_mesh(deck(tmp_path, f"{text}{keyword}\n, {row}\n"))


def test_a_surface_without_data_is_told_and_nothing_can_use_it(tmp_path):
    text = cantilever_deck()
    line = text.count("\n") + 1
    for kind, row in (("ELEMENT", "S1"), ("NODE", "1.0")):
        surface = f"{text}*SURFACE, NAME=Empty, TYPE={kind}\n"
        mesh = fem.read_mesh(deck(tmp_path, surface))
        assert "Empty" not in mesh.point_sets or not len(mesh.point_sets["Empty"])
        told = f"*SURFACE Empty (1, first in line {line}): it has no data line"
        assert any(str(item).startswith(told) for item in mesh.left_out)
        with pytest.raises(fem.ModelError, match=f"line {line + 1}: .*nothing before its first"):
            fem.read_mesh(deck(tmp_path, f"{surface}, {row}\n"))
    used = surface + "*COUPLING, CONSTRAINT NAME=C, REF NODE=1, SURFACE=EMPTY\n*KINEMATIC\n"
    with pytest.raises(fem.ModelError, match="names the surface 'EMPTY', which holds no node"):
        fem.read_mesh(deck(tmp_path, used))


@pytest.mark.parametrize(
    "change", ["*BEAM SECTION OFFSET\n0., 0.3\n", "*TRANSVERSE SHEAR STIFFNESS\n1E6, 1E6\n"]
)
def test_what_changes_a_section_after_it_is_refused_by_name(tmp_path, change):
    text = cantilever_deck() + (
        "*MATERIAL, NAME=M\n*ELASTIC\n2.1E11, .3\n*DENSITY\n7800.\n"
        "*BEAM SECTION, ELSET=BEAM, MATERIAL=M, SECTION=RECT\n0.02, 0.01\n"
    )
    shell = (
        "*NODE\n91, 0, 0, 1\n92, 1, 0, 1\n93, 0, 1, 1\n*ELEMENT, TYPE=S3, ELSET=SHELL\n"
        "91, 91, 92, 93\n*SHELL SECTION, ELSET=SHELL, MATERIAL=M\n0.1\n"
    )
    plain = fem.read_mesh(deck(tmp_path, text + shell)).described
    assert {plain[name]["kind"] for name in ("BEAM", "SHELL")} == {"beam", "shell"}
    told = f"has {change.split(chr(10))[0]} in line".replace("*", r"\*")
    for changed, name in ((text + change + shell, "BEAM"), (text + shell + change, "SHELL")):
        described = fem.read_mesh(deck(tmp_path, changed)).described
        assert re.search(told, described[name]["refused"])
        other = "SHELL" if name == "BEAM" else "BEAM"
        assert described[other] == plain[other]


def test_controls_of_sections_are_no_part_of_the_material_before_them(tmp_path):
    text = cantilever_deck() + (
        "*MATERIAL, NAME=M\n*ELASTIC\n2.1E11, .3\n*DENSITY\n7800.\n"
        "*SECTION CONTROLS, NAME=EC-1, HOURGLASS=ENHANCED\n1., 1., 1.\n"
        "*BEAM SECTION, ELSET=BEAM, MATERIAL=M, SECTION=RECT\n0.02, 0.01\n"
    )
    mesh = fem.read_mesh(deck(tmp_path, text))
    assert mesh.described["BEAM"]["density"] == 7800.0
    assert "*SECTION CONTROLS" in [item.keyword for item in mesh.left_out]


def test_an_empty_set_is_read_as_one(tmp_path):
    text = cantilever_deck() + "*NSET, NSET=EMPTY\n"
    assert len(fem.read_mesh(deck(tmp_path, text)).point_sets["EMPTY"]) == 0


def test_a_surface_whose_nodes_have_other_faces_tells_how_many(tmp_path):
    """Of one brick the lower and the upper face have all nodes, and so those of four more."""
    cube = fem.box_mesh("BOX", (1.0, 1.0, 1.0), (1, 1, 1), kind="hexahedron")
    fem.write_mesh(cube, tmp_path / "cube.inp")
    text = (tmp_path / "cube.inp").read_text() + "*SURFACE, NAME=ENDS\nBOX, S1\nBOX, S2\n"
    mesh = fem.read_mesh(deck(tmp_path, text))
    assert "'ENDS'" in mesh.notes[0] and "4 outer faces that it does not name" in mesh.notes[0]
    joined = "*NODE\n99, 0.5, 0.5, 0.5\n*COUPLING, REF NODE=99, SURFACE=ENDS, CONSTRAINT NAME=C\n"
    with pytest.raises(fem.ModelError, match="the nodes of 'ENDS' have 4 faces that are not in it"):
        fem.read_mesh(deck(tmp_path, text + joined + "*DISTRIBUTING\n1, 6\n"))
    one = text.replace("BOX, S2\n", "")
    assert not fem.read_mesh(deck(tmp_path, one)).notes
