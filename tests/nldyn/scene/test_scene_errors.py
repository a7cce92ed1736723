"""Every fault of a scene is told in one line, with the file, the key and exit code 2."""

import os
import re

import pytest
from click.testing import CliRunner

import fem
from nldyn.app.cli import main
from nldyn.base.errors import SceneError
from nldyn.base.resources import example, mesh
from nldyn.scene.read import parse_scene

MODAL = """
[modal]
frequencies_hz = [13.1, 125.1]
participation.middle = [0.6, 0.5]
[[stops]]
at = "middle"
stiffness = 5e9
[[excitation]]
at = "middle"
kind = "unbalance"
mass_times_radius = 4.92e-6
[continuation]
range_hz = [5.0, 90.0]
"""
BEAM = (
    example("two_dof_xi_0.01.toml")
    .read_text()
    .replace("../../meshes/half_beam.msh", mesh("half_beam.msh").as_posix())
)


def check(tmp_path, text, command="check"):
    """Run a scene that must be refused, and give the one line that says why."""
    file = tmp_path / "scene.toml"
    file.write_text(text)
    more = ["--out", str(tmp_path / "out")] if command == "run" else []
    return refused([command, str(file), *more]).replace(f"{tmp_path}/", "")


def refused(arguments):
    result = CliRunner().invoke(main, arguments)
    assert result.exit_code == 2, result.output
    assert result.stdout == ""
    lines = [line for line in result.stderr.split("\r") if "nldyn: " in line]
    assert len(lines) == 1 and lines[0].count("\n") == 1
    assert "Traceback" not in result.stderr
    return lines[0].strip().removeprefix("nldyn: ")


def test_the_scenes_that_the_faults_are_put_into_are_good(tmp_path):
    for text in (MODAL, BEAM):
        file = tmp_path / "scene.toml"
        file.write_text(text)
        result = CliRunner().invoke(main, ["check", str(file)])
        assert result.exit_code == 0, result.output
        assert "no fault found" in result.stdout


def test_missing_file(tmp_path):
    file = tmp_path / "none.toml"
    assert refused(["check", str(file)]) == f"{file}: does not exist"


def test_folder(tmp_path):
    assert refused(["check", str(tmp_path)]) == f"{tmp_path}: is a folder"


def test_not_text(tmp_path):
    file = tmp_path / "scene.toml"
    file.write_bytes(b"\xff\xfe\x00")
    assert "not UTF-8" in refused(["check", str(file)])


def test_not_toml_names_the_line(tmp_path):
    said = check(tmp_path, "[modal]\nfrequencies_hz = \n")
    fault = "scene.toml: is not valid TOML: invalid value (at line 2, column 18)"
    assert said == f"{fault}; in 'frequencies_hz =' the value is missing"


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        ("[damping]\n[damping]\n", "the table [damping] is given twice (at line 2, column 9)"),
        ("[a.b]\n[a.b]\n", "the table [a.b] is given twice (at line 2, column 5)"),
        ("title = ''\ntitle = ''\n", "a key or table is given twice (at line 2, column 11)"),
    ],
)
def test_what_is_given_twice_is_told_in_words_of_toml(tmp_path, text, fault):
    assert check(tmp_path, text) == f"scene.toml: is not valid TOML: {fault}"


@pytest.mark.parametrize(
    ("old", "new", "sentence"),
    [
        (
            "stiffness = 5e9",
            "stifness = 5e9",
            "stops[0].stifness is not a known key; did you mean 'stiffness'?",
        ),
        (
            "stiffness = 5e9",
            "direction = true\nstiffness = 5e9",
            "stops[0].direction must be 1 or -1",
        ),
        (
            "stiffness = 5e9",
            "range_hz = [1, 2]\nstiffness = 5e9",
            "stops[0].range_hz is not a known key here; did you mean continuation.range_hz?",
        ),
        (
            "[[stops]]",
            "[[stop]]",
            "stop is not a known key; did you mean 'stops'?",
        ),
        (
            "stiffness = 5e9",
            "zzz = 1\nstiffness = 5e9",
            "stops[0].zzz is not a known key; known here: 'at', 'against', 'law', 'gap', "
            "'direction', 'dashpot', 'dissipation', 'restitution', 'impact_speed', 'stiffness', "
            "'exponent', 'radius', 'youngs_modulus', 'poissons_ratio'",
        ),
        ("5e9", "-5e9", "stops[0].stiffness must be greater than 0, not -5000000000.0"),
        ("5e9", "0.0", "stops[0].stiffness must be greater than 0, not 0.0"),
        ("5e9", "nan", "stops[0].stiffness must be a finite number, not nan"),
        ("5e9", "inf", "stops[0].stiffness must be a finite number, not inf"),
        ("5e9", "'much'", "stops[0].stiffness must be a number, not 'much'"),
        ("5e9", "true", "stops[0].stiffness must be a number, not true"),
        ("[13.1,", "[nan,", "modal.frequencies_hz[0] must be a finite number, not nan"),
        (
            "[0.6, 0.5]",
            "[0.6]",
            "modal.participation.middle must have 2 numbers, one per mode, not [0.6]",
        ),
        (
            "[0.6, 0.5]",
            "[0, 0]",
            "modal.participation.middle must not be zero throughout: nothing could move there",
        ),
        (
            "[5.0, 90.0]",
            "[90.0, 5.0]",
            "continuation.range_hz must run from the lower to the higher frequency, "
            "not [90.0, 5.0]",
        ),
        (
            "[5.0, 90.0]",
            "[5.0, 90.0]\nperiods = [1, 2, 1]",
            "continuation.periods must name each period once, not [1, 2, 1]",
        ),
        (
            "[5.0, 90.0]",
            "[5.0]",
            "continuation.range_hz must be two frequencies, [lowest, highest], not [5.0]",
        ),
        ("[5.0, 90.0]", "[0.0, 9.0]", "continuation.range_hz[0] must be at least 1e-06, not 0.0"),
        (
            'stops]]\nat = "middle"',
            'stops]]\nat = "midle"',
            "stops[0].at 'midle' is not an interface; did you mean 'middle'?",
        ),
        (
            'excitation]]\nat = "middle"',
            'excitation]]\nat = "q"',
            "excitation[0].at 'q' is not an interface; known: 'middle'",
        ),
        ('[[stops]]\nat = "middle"', "[[stops]]", "stops[0].at is missing"),
        (
            "stiffness = 5e9",
            "",
            "stops[0] needs 'stiffness' (N/m^exponent), or 'radius' and 'youngs_modulus' of a "
            "sphere",
        ),
        (
            "stiffness = 5e9",
            "law = 'linear'\nstiffness = 5e9\nexponent = 1.5",
            "stops[0].exponent is not a key of law 'linear', but of law 'hertz'",
        ),
        (
            "stiffness = 5e9",
            "law = 'hertzian'\nstiffness = 5e9",
            "stops[0].law must be 'hertz', 'linear' or 'rigid', not 'hertzian'",
        ),
        (
            "stiffness = 5e9",
            "law = 'lin'\nstiffness = 5e9\npulls = true",  # a key of one law
            "stops[0].law must be 'hertz', 'linear' or 'rigid', not 'lin'",
        ),
        ('kind = "unbalance"', "", "excitation[0].kind is missing"),
        (
            "mass_times_radius = 4.92e-6",
            "",
            "excitation[0].mass_times_radius is missing: kind 'unbalance' needs it",
        ),
        (
            "[13.1, 125.1]",
            "{a = 1}",
            "modal.frequencies_hz must be a list in square brackets, not a table",
        ),
        (
            "[5.0, 90.0]",
            "[5.0, 5.000000000000001]",
            "continuation.range_hz must be wider than 1e-9 of its frequencies, "
            "not [5.0, 5.000000000000001]",
        ),
        ("[[stops]]", "[stops]", "stops must be written with two brackets: [[stops]]"),
        (
            '"unbalance"',
            '"harmonic"',
            "excitation[0].mass_times_radius is not a key of kind 'harmonic', but of kind "
            "'unbalance'; also excitation[0].amplitude is missing: kind 'harmonic' needs it",
        ),
        (
            "[continuation]",
            "[damping]\nmodal_ratio = [0.1]\n[continuation]",
            "damping.modal_ratio has 1 entries for a model with 2 modes",
        ),
        (
            "[continuation]",
            "[damping]\nmodal_ratio = -0.1\n[continuation]",
            "damping.modal_ratio must be a number from 0 to below 1, or one per mode, not -0.1",
        ),
        (
            "[modal]",
            "[mesh]\nfile = 'beam.msh'\n[modal]",
            "modal cannot stand beside [mesh]; keep one of them",
        ),
        (
            "[continuation]",
            "[reduction]\nmodes = 1\n[continuation]",
            "reduction describes a mesh, but the structure is given by [modal]",
        ),
        ("[modal]", "mesh = 'beam.msh'\n[modal]", "mesh must be a table: [mesh]"),
        (
            "[continuation]",
            "[[subharmonics]]\nperiod = 5\nnear_hz = 95.0\n[continuation]",
            "subharmonics[0].near_hz must lie within continuation.range_hz, not at 95",
        ),
        (
            "[5.0, 90.0]",
            "[5.0, 1e300]",
            "continuation.range_hz[1] must be at most 1e+12, not 1e+300",
        ),
        (
            "[5.0, 90.0]",
            "[5.0, 90.0]\nsearch_points = 1000000",
            "continuation.search_points must be at most 1000, not 1000000",
        ),
        (
            "[5.0, 90.0]",
            "[5.0, 90.0]\nperiods = [1, 5000]",
            "continuation.periods[1] must be at most 100, not 5000",
        ),
        (
            "[5.0, 90.0]",
            "[5.0, 90.0]\nfollow_doublings = 99",
            "continuation.follow_doublings must be at most 10, not 99",
        ),
        ("5e9", "5e99", "stops[0].stiffness must be 0 or from 1e-50 to 1e+50 in size, not 5e+99"),
        (
            "5e9",
            "5e9\nagainst = 'middle'",
            "stops[0] needs another interface than its own in 'against'",
        ),
        (
            "[5.0, 90.0]",
            "[5.0, 90.0]\nperiods = [1, 2.5]",
            "continuation.periods[1] must be a whole number, not 2.5",
        ),
    ],
)
def test_fault_in_modal_scene(tmp_path, old, new, sentence):
    assert old in MODAL
    assert check(tmp_path, MODAL.replace(old, new, 1)) == f"scene.toml: {sentence}"


@pytest.mark.parametrize(
    ("old", "new", "sentence"),
    [
        (
            'at = "foot"',
            'at = "fooot"',
            "supports[1].at 'fooot' is not a point or face of the mesh MESH, of [places] or of "
            "[[couplings]]; did you mean 'foot'?",
        ),
        (
            "[parts.leaf]",
            "[parts.laef]",
            "parts.laef is not a part of the mesh MESH; did you mean 'leaf'?",
        ),
        (
            "[[supports]]",
            "[[hinges]]\nat='corner'\npart='lief'\n[[supports]]",
            "hinges[0].part 'lief' is not a part of the mesh MESH; did you mean 'leaf'?",
        ),
        (
            'mirror = "middle"',
            'mirror = "foot"',
            "mesh.mirror 'foot' is not on a plane of symmetry, where [[supports]] fix "
            "['x', 'rotation'] or ['y', 'rotation'] and no more",
        ),
        (
            '[interfaces.middle]\nat = "middle"\ndirection = "y"',
            '[interfaces.middle]\nat = "middle"\ndirection = "x"',
            "interfaces.middle.direction 'x' is held by a support at 'middle'",
        ),
        (
            'at = "foot"',
            'at = "clamp"',
            "supports[1].at 'clamp' is not a point or face of the mesh MESH, of [places] or of "
            "[[couplings]]; known: 'corner', 'middle', 'foot', 'beam', 'leaf'",
        ),
        ("modes = 1", "modes = -1", "reduction.modes must be at least 0, not -1"),
        (
            "modes = 1",
            "modes = 1\ncutoff_hz = 500.0",
            "reduction has both 'modes' and 'cutoff_hz'; keep one",
        ),
        (
            "modes = 1",
            "modes = 1\ncutoff_hz = 500.0\ntolerance = 0.1",
            "reduction has 'modes', 'cutoff_hz' and 'tolerance'; keep one",
        ),
        (
            "modes = 1",
            "",
            "reduction needs one of 'modes', 'cutoff_hz' and 'tolerance'",
        ),
        ("modes = 1", "tolerance = 1.0", "reduction.tolerance must be less than 1, not 1.0"),
        ("modes = 1", "tolerance = 0", "reduction.tolerance must be at least 1e-06, not 0"),
        (
            "modes = 1",
            'tolerance = 0.1\nmethod = "truncation"',
            "reduction has 'tolerance', which is not a key of methods other than 'rubin'",
        ),
        ("half_beam.msh", "full.msh", "mesh.file names FULL, which does not exist"),
        ("half_beam.msh", "", "mesh.file names FOLDER, which is a folder"),
        (
            "density = 7746.0",
            "density = nan",
            "parts.beam.density must be a finite number, not nan",
        ),
        (
            "height = 0.01 ",
            "# ",
            "parts.beam needs one section: 'width' and 'height', or 'diameter' (and 'bore'), or "
            "'area' and 'second_moment'; given: 'width'",
        ),
        (
            "[interfaces.middle]",
            "[interfaces.center]",
            "dampers[0].at 'middle' is not an interface; known: 'center'; also stops[0].at "
            "'middle' is not an interface; known: 'center'; also excitation[0].at 'middle' is "
            "not an interface; known: 'center'",
        ),
        (
            "[mesh]",
            "[matrices]\nmass=[[1.0]]\nstiffness=[[1.0]]\ninterfaces.a=[1.0]\n[mesh]",
            "matrices cannot stand beside [mesh]; keep one of them",
        ),
    ],
)
def test_fault_in_mesh_scene(tmp_path, old, new, sentence):
    assert old in BEAM
    path = mesh("half_beam.msh").as_posix()
    sentence = sentence.replace("MESH", path)
    sentence = sentence.replace("FULL", path.replace("half_beam", "full"))
    sentence = sentence.replace("FOLDER", mesh("half_beam.msh").parent.as_posix())
    assert check(tmp_path, BEAM.replace(old, new, 1)) == f"scene.toml: {sentence}"


def test_part_without_material(tmp_path):
    start, end = BEAM.index("[parts.leaf]"), BEAM.index("# Symmetry")
    said = check(tmp_path, BEAM[:start] + BEAM[end:])
    path = mesh("half_beam.msh").as_posix()
    assert said == (
        f"scene.toml: {path}: line 72 is in no part of the model, whose parts are 'beam' (the mesh"
        " has 'beam', 'leaf')"
    )


def test_mode_count_too_large(tmp_path):
    said = check(tmp_path, BEAM.replace("modes = 1", "modes = 1000"))
    assert re.fullmatch(
        r"scene.toml: reduction.modes = 1000, but the component has only \d+ degrees of freedom",
        said,
    )


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="needs named pipes")
def test_mesh_that_is_a_pipe_is_refused_without_waiting_for_it(tmp_path):
    os.mkfifo(tmp_path / "pipe.msh")
    said = check(tmp_path, BEAM.replace(mesh("half_beam.msh").as_posix(), "pipe.msh"))
    assert said.endswith("names pipe.msh, which cannot be read: it is not a regular file")


@pytest.mark.parametrize("content", ["", "$MeshFormat\n4.1 0 8\n$EndMeshFormat\n"])
def test_empty_mesh(tmp_path, content):
    (tmp_path / "empty.msh").write_text(content)
    said = check(tmp_path, BEAM.replace(mesh("half_beam.msh").as_posix(), "empty.msh"))
    assert said.startswith("scene.toml: mesh.file: empty.msh: ")


def test_nothing_to_compute(tmp_path):
    start, end = MODAL.index("[[excitation]]"), MODAL.index("[continuation]")
    said = check(tmp_path, MODAL[:start] + MODAL[end:], "run")
    assert said == "scene.toml: excitation is missing: nothing moves the structure"
    said = check(tmp_path, MODAL[:end], "run")
    assert said.startswith("scene.toml: continuation is missing: ")
    assert not (tmp_path / "out").exists()


def test_check_tells_what_run_would_miss_after_printing_the_modes(tmp_path):
    file = tmp_path / "scene.toml"
    file.write_text(MODAL[: MODAL.index("[continuation]")])
    result = CliRunner().invoke(main, ["check", str(file)])
    assert result.exit_code == 2
    assert "13.1" in result.stdout and "no fault" not in result.stdout
    assert result.stderr.startswith(f"nldyn: {file}: continuation is missing: ")


def test_a_byte_order_mark_is_passed_over(tmp_path):
    file = tmp_path / "scene.toml"
    file.write_text(MODAL, encoding="utf-8-sig")
    assert CliRunner().invoke(main, ["check", str(file)]).exit_code == 0


def test_parts_that_only_touch(tmp_path):
    """Two nodes in one place do not join the parts: refused, or if meant the model floats."""
    points = {"middle": (0, 0), "corner": (1, 0), "top": (1, 0), "foot": (1, -0.1)}
    loose = fem.frame_mesh(points, [("beam", "middle", "corner", 2), ("leaf", "top", "foot", 2)])
    fem.write_mesh(loose, tmp_path / "loose.vtu")
    text = BEAM.replace(mesh("half_beam.msh").as_posix(), "loose.vtu")
    assert check(tmp_path, text) == (
        "scene.toml: loose.vtu: 2 pieces of the mesh touch but share no node: 2 nodes are at the "
        "place of another one, the first at (1, 0, 0); merge them ('merge' in a scene, "
        "fem.joined), or say that they are meant ('separate')"
    )
    said = check(tmp_path, text.replace('"loose.vtu"', '"loose.vtu"\nseparate = true'))
    assert said == (
        "scene.toml: reduction: the component floats (1 rigid-body mode); "
        "the mesh is in 2 pieces that share no node"
    )


def test_a_whole_number_of_thousands_of_digits_is_told_without_words_of_python(tmp_path):
    said = check(tmp_path, "title = " + "9" * 5000)
    assert said == "scene.toml: is not valid TOML: a whole number has thousands of digits"


def test_deep_nesting_and_long_numbers_are_not_toml(tmp_path):
    for value in ("[" * 5000, "9" * 5000):
        assert check(tmp_path, f"title = {value}").startswith("scene.toml: is not valid TOML: ")


def test_no_structure(tmp_path):
    said = check(tmp_path, "title = 'empty'")
    assert said.startswith("scene.toml: gives no structure")


def test_matrices(tmp_path):
    base = "[matrices]\nmass = {}\nstiffness = {}\ninterfaces.a = [1.0, 0.0]\n"
    one = "[[1.0, 0.0], [0.0, 1.0]]"
    for mass, stiffness, sentence in (
        ("[[1.0, 0.0]]", one, "matrices.mass must be square, but has 1 row and one of 2 numbers"),
        ("1.0", one, "matrices.mass must be a list in square brackets, not 1.0"),
        (one, "[[1.0]]", "matrices.stiffness must have 2 rows of 2 numbers"),
        (one, "[[1.0, 0.5], [0.0, 1.0]]", "matrices.stiffness must be symmetric; a skew part"),
        ("[[1.0]]", "[[1.0]]", "matrices.interfaces.a must have 1 number, one per"),
        ("[[1.0, 2.0], [2.0, 1.0]]", one, "matrices.mass must be positive definite"),
        (one, "[[1.0, 0.0], [0.0, -1.0]]", "matrices: the stiffness matrix is not positive"),
        ("[[1e-320, 0], [0, 1]]", one, "matrices.mass[0][0] must be 0 or from 1e-50"),
        ("[[1e308, 0], [0, 1]]", one, "matrices.mass[0][0] must be 0 or from 1e-50"),
    ):
        assert check(tmp_path, base.format(mass, stiffness)).startswith(f"scene.toml: {sentence}")


def test_negative_gap_is_a_preload(tmp_path):
    file = tmp_path / "scene.toml"
    file.write_text(MODAL.replace("stiffness = 5e9", "stiffness = 5e9\ngap = -1e-6"))
    result = CliRunner().invoke(main, ["check", str(file)])
    assert result.exit_code == 0
    assert "gap -1e-06 m" in result.stdout


@pytest.mark.parametrize(
    ("table", "words"),
    [
        ("[[forces]]", "forces are [[excitation]] of kind 'harmonic', 'constant' or 'measured'"),
        ("[gravity]", "gravity is [[excitation]] of kind 'weight'"),
        ("[[masses]]", "masses on a mesh are [[point_masses]]"),
        ("[[boundary_conditions]]", "what is held is in [[supports]]"),
        ("[[springs]]\nbetween = 'x'", "what joins two interfaces is [[springs]] and [[dampers]]"),
    ],
)
def test_words_that_users_try_lead_to_what_there_is(table, words):
    text = (
        f"[matrices]\nmass = [[1.0]]\nstiffness = [[1.0]]\ninterfaces.x = [1.0]\n{table}\nat = 'x'"
    )
    with pytest.raises(SceneError) as told:
        parse_scene(text)
    assert words in str(told.value)


MATRICES = """
[matrices]
mass = [[1.0]]
stiffness = [[1.0]]
interfaces.middle = [1.0]
[[excitation]]
at = "middle"
kind = "harmonic"
amplitude = 1.0
[continuation]
range_hz = [0.1, 0.2]
"""


@pytest.mark.parametrize("command", ["check", "run"])
@pytest.mark.parametrize(
    ("spring", "fault"),
    [
        ("stiffness = -1e9", "make the linear stiffness negative in a direction"),
        ("coefficients = [-1e9, 0.0, -1.0]", "at 'middle' let it run away"),
    ],
)
def test_springs_that_let_the_structure_run_away_are_told_as_springs(
    tmp_path, command, spring, fault
):
    said = check(tmp_path, f'{MATRICES}[[springs]]\nat = "middle"\n{spring}\n', command)
    assert said.startswith(f"scene.toml: springs {fault}")


def test_all_faults_are_told_in_one_line(tmp_path):
    """But for what may come of an unknown key: that 'stiffness' is missing is not told."""
    text = MODAL.replace("stiffness = 5e9", "stifness = 5e9").replace("[5.0, 90.0]", "[90.0, 5.0]")
    assert check(tmp_path, text.replace('"unbalance"', '"unbalanced"')) == (
        "scene.toml: stops[0].stifness is not a known key; did you mean 'stiffness'?; also "
        "excitation[0].kind must be 'unbalance', 'harmonic', 'constant', 'measured', 'weight' or "
        "'base', not 'unbalanced'; also continuation.range_hz must run from the lower to the "
        "higher frequency, not [90.0, 5.0]"
    )


def test_all_unknown_names_are_told_at_once(tmp_path):
    two = MODAL.replace('at = "middle"', 'at = "midle"')
    found = check(tmp_path, two)
    assert "stops[0].at 'midle' is not an interface; did you mean 'middle'?" in found
    assert "; also excitation[0].at 'midle' is not an interface" in found
    names = BEAM.replace("[parts.leaf]", "[parts.lief]").replace('at = "foot"', 'at = "foto"')
    found = check(tmp_path, names)
    assert "parts.lief is not a part of the mesh" in found and "did you mean 'leaf'?" in found
    assert "'foto' is not a point or face of the mesh" in found and "did you mean 'foot'?" in found
