"""Scenes whose mesh is a deck that says more than a mesh."""

import math
import re

import numpy as np
import pytest
from click.testing import CliRunner

from nldyn.app.cli import main
from nldyn.base.errors import SceneError
from nldyn.scene.build import build_reduced, build_system
from nldyn.scene.component import build_component
from nldyn.scene.read import load_scene

DECK = """*NODE
{nodes}*ELEMENT, TYPE=B21, ELSET=BEAM
1, 1, 2
*ELGEN, ELSET=BEAM
1, 10
*NSET, NSET=ROOT
1
*NSET, NSET=TIP
11
*ELEMENT, TYPE=MASS, ELSET=LUMP
21, 11
*MASS, ELSET=LUMP
40.0
*ELEMENT, TYPE=DASHPOT1, ELSET=DAMPER
22, 11
*DASHPOT, ELSET=DAMPER
2
30.0
*BOUNDARY
ROOT, 1, 6
*MATERIAL, NAME=STEEL
*ELASTIC
2.1e11, 0.3
*DENSITY
7800.0
*BEAM SECTION, ELSET=BEAM, MATERIAL=STEEL, SECTION=RECT
0.02, 0.01
""".format(nodes="".join(f"{i + 1}, {i / 10!r}, 0.0\n" for i in range(11)))

SCENE = """
supports = [{at = "ROOT", fixed = ["x", "y", "rotation"]}]
interfaces.tip = {at = "TIP", direction = "y"}
reduction = {modes = 2}
excitation = [{at = "tip", kind = "harmonic", amplitude = 1.0}]
continuation = {range_hz = [0.5, 2.0]}
"""
FROM_FILE = SCENE + 'mesh = {file = "deck.inp", parts_from_file = ["BEAM"]}\n'
PART = "youngs_modulus = 2.1e11\npoissons_ratio = 0.3\ndensity = 7800.0\nwidth = 0.02\n"
GIVEN = SCENE + f'mesh = {{file = "deck.inp"}}\n[parts.BEAM]\n{PART}height = 0.01\n'


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "deck.inp").write_text(DECK)
    (tmp_path / "file.toml").write_text(FROM_FILE)
    (tmp_path / "given.toml").write_text(GIVEN + 'theory = "timoshenko"\n')
    return tmp_path


def test_a_damper_of_the_deck_damps_the_system(folder):
    """A heavy mass on a cantilever: one oscillator with the ratio c / (2 m omega)."""
    system = build_system(load_scene(folder / "given.toml"))
    mass = 40.0 + 33 / 140 * 7800.0 * 0.02 * 0.01
    stiffness = 3 * 2.1e11 * 0.02 * 0.01**3 / 12
    omega = 2 * math.pi * system.frequencies_hz[0]
    assert omega == pytest.approx(math.sqrt(stiffness / mass), rel=1e-3)
    assert system.damping[0, 0] == pytest.approx(30.0 / mass, rel=1e-4)


def test_parts_of_the_deck_are_those_given_by_hand(folder):
    given, taken = (build_reduced(load_scene(folder / f"{n}.toml")) for n in ("given", "file"))
    assert np.array_equal(given.frequencies_hz, taken.frequencies_hz)


def test_an_area_of_contact_of_parts_of_the_deck_is_that_of_parts_given_by_hand(folder):
    area = '[[contact_areas]]\nat = "BEAM"\ndirection = "-y"\nstiffness = 1e4\ngap = 1e-3\n'
    systems = []
    for name in ("given", "file"):
        path = folder / f"{name}.toml"
        path.write_text(path.read_text() + area)
        systems.append(build_system(load_scene(path)))
    given, taken = systems
    assert given.stops == taken.stops and len(taken.area_stops("BEAM")) == 10
    assert np.array_equal(given.frequencies_hz, taken.frequencies_hz)


def test_a_finer_frame_keeps_what_the_deck_attaches(folder):
    finer = build_component(load_scene(folder / "given.toml"), refinement=3)
    assert len(finer.model.mesh.attachments.point_masses) == 1 and finer.damping is not None
    assert len(finer.model.mesh.element_types["B21"]["line"]) == 30


def test_check_tells_what_is_left_out_and_what_is_taken(folder):
    result = CliRunner().invoke(main, ["check", str(folder / "file.toml")])
    assert result.exit_code == 0, result.output
    assert "left out of the file: *BOUNDARY (1, first in line " in result.output
    assert "taken from the file: point masses: 1, links: 1" in result.output


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        (('["BEAM"]', '["LUMP"]'), "names 'LUMP', which the mesh file does not describe.*'BEAM'"),
        (('["BEAM"]', '["BEAM"]}\nparts = {BEAM = {youngs_modulus = 1.0, density = 1.0, area = 1.0,'
          ' second_moment = 1.0}'), r"names 'BEAM', which \[parts\] gives, too"),
        (('["BEAM"]', "[]"), "parts.* is missing: a mesh needs it"),
    ],
)  # fmt: skip
def test_parts_that_cannot_be_taken_are_told(folder, change, sentence):
    assert change[0] in FROM_FILE
    (folder / "bad.toml").write_text(FROM_FILE.replace(*change))
    with pytest.raises(SceneError, match=sentence):
        build_component(load_scene(folder / "bad.toml"))


def test_an_orthotropic_material_is_not_taken(folder):
    (folder / "deck.inp").write_text(DECK.replace("*ELASTIC", "*ELASTIC, TYPE=LAMINA"))
    with pytest.raises(SceneError, match=r"'BEAM': \*BEAM SECTION in line .* is not isotropic"):
        build_component(load_scene(folder / "file.toml"))


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("0.02, 0.01", "0.02, 0.012", "'BEAM' is as in the scene, not as in the file: height 0.01"),
        ("SECTION=RECT", "SECTION=BOX", "not as in the file: .* a section 'BOX'"),
        ("no change", "", ""),
    ],
)
def test_a_part_that_the_deck_describes_otherwise_is_told(folder, old, new, said):
    (folder / "deck.inp").write_text(DECK.replace(old, new))
    told = CliRunner().invoke(main, ["check", str(folder / "given.toml")]).stdout
    assert re.search(said, told)
    assert ("as in the scene" in told) == bool(said)


NASTRAN = """SOL 103
CEND
SPC = 1
BEGIN BULK
{grids}{bars}PBARL,7,1,,BAR
,.02,.01
MAT1,1,2.1+11,,.3,7800.
SPC1,1,123456,1
CONM2,90,11,,40.
CDAMP2,91,30.,11,2
CELAS2,92,1000.,11,2
ENDDATA
""".format(
    grids="".join(f"GRID,{i + 1},,{i / 10!r},0.,0.\n" for i in range(11)),
    bars="".join(f"CBAR,{i},7,{i},{i + 1},0.,1.,0.\n" for i in range(1, 11)),
)
OF_NASTRAN = """
interfaces.tip = {at = "node 11", direction = "y"}
reduction = {modes = 2}
excitation = [{at = "tip", kind = "harmonic", amplitude = 1.0}]
continuation = {range_hz = [0.5, 2.0]}
"""


@pytest.mark.parametrize("named", ['"all"', '["PBARL 7"]'])
def test_a_deck_of_nastran_is_a_system_without_retyping(tmp_path, named):
    """The same oscillator, with a spring at its tip: supports, sections and masses of the deck."""
    (tmp_path / "deck.bdf").write_text(NASTRAN)
    mesh = f'mesh = {{file = "deck.bdf", model = "structure", parts_from_file = {named}}}\n'
    (tmp_path / "nastran.toml").write_text(OF_NASTRAN + mesh)
    system = build_system(load_scene(tmp_path / "nastran.toml"))
    mass = 40.0 + 33 / 140 * 7800.0 * 0.02 * 0.01
    stiffness = 3 * 2.1e11 * 0.02 * 0.01**3 / 12 + 1000.0
    omega = 2 * math.pi * system.frequencies_hz[0]
    assert omega == pytest.approx(math.sqrt(stiffness / mass), rel=1e-3)


def test_a_part_of_nastran_that_the_scene_gives_otherwise_is_told(tmp_path):
    (tmp_path / "deck.bdf").write_text(NASTRAN)
    mesh = 'mesh = {file = "deck.bdf", model = "structure"}\n'
    part = f"[parts.'PBARL 7']\n{PART}height = 0.01\norientation = [0.0, 1.0, 0.0]\n"
    part = part.replace("density = 7800.0", "density = 2700.0")
    (tmp_path / "nastran.toml").write_text(OF_NASTRAN + mesh + part)
    notes = build_component(load_scene(tmp_path / "nastran.toml")).model.mesh.notes
    assert any("'PBARL 7' is as in the scene, not as in the file: density 2700" in n for n in notes)
