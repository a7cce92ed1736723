"""Branches in files: exact to the last digit, whole or refused in one sentence."""

import dataclasses
import os
import shutil
from functools import partial

import h5py
import numpy as np
import pytest
from branches_alike import assert_same_branches
from hypothesis import given
from hypothesis import strategies as st
from problems import make_one_dof

from nldyn import (
    Branch,
    Damper,
    FlowMap,
    FlowOptions,
    HarmonicForce,
    Stop,
    System,
    SystemModelError,
    Unbalance,
    continue_branch,
    diagram,
    save,
    solve_orbit,
)
from nldyn.io import branches as store
from nldyn.io.branches import load_branches, load_diagram
from nldyn.runtime.files import check_writable
from nldyn.runtime.result_directory import OutputError


def two_modes():
    """A system that uses every number of every element; a damper couples its modes."""
    return System.from_modal(
        [13.0, 31.0],
        {"Spitze ü": [0.6, -0.3], "base": [0.2, 0.5]},
        modal_damping=[0.02, 0.01],
        stops=[
            Stop("Spitze ü", 2e7, 1.5, 1e-6, -1, "base", 0.4),
            Stop.linear("base", 1e5, gap=-1e-7),
        ],
        dampers=[Damper("base", 3.0)],
        excitation=[Unbalance("base", 5e-6, 30.0), HarmonicForce("Spitze ü", 0.01, -60.0)],
    )


@pytest.fixture(scope="module")
def branch():
    flow = FlowMap(two_modes(), FlowOptions(1e-8, nodes=12, tail=1e-4))
    orbit = solve_orbit(flow, 15.0, observe="base", segments=3)
    found = continue_branch(orbit, (14.0, 16.0), name="Ast 1", at=[14.5, 15.5])
    assert len(found.nodes) > 5 and len(found.requested) == 2
    return found


@pytest.fixture(scope="module")
def saved(branch, tmp_path_factory):
    path = tmp_path_factory.mktemp("saved") / "branch.h5"
    save(branch, path)
    return path


@pytest.fixture
def copy(saved, tmp_path):
    return shutil.copy(saved, tmp_path / "copy.h5")


def refused(path, *words, **options):
    """The file is refused with one sentence that names it and has the words."""
    with pytest.raises(SystemModelError) as caught:
        load_branches(path, **options)
    text = str(caught.value)
    assert text.startswith(f"{path}: ") and "\n" not in text
    for word in words:
        assert word in text, text


# --- round trip ----------------------------------------------------------------------------------


def test_loaded_branch_has_every_number_of_the_saved_one(branch, saved):
    loaded = load_branches(saved)[0]
    assert_same_branches(loaded, branch)
    assert loaded.name == "Ast 1"
    flow = loaded.points[0].problem.flow
    assert store.same_flow(flow, branch.points[0].problem.flow)
    assert flow.system.stops == branch.points[0].system.stops
    assert flow.options == FlowOptions(1e-8, nodes=12, tail=1e-4)


def test_loaded_motions_are_those_of_the_saved_branch(branch, saved):
    phases = np.linspace(0.0, 2.0 * np.pi, 50)
    for mine, other in zip(load_branches(saved)[0].points, branch.points, strict=True):
        assert np.array_equal(mine.states(phases), other.states(phases))
        assert mine.impact_list == other.impact_list


def test_tables_of_a_loaded_branch_are_the_same(branch, saved):
    loaded = load_branches(saved)[0]
    for part in ("points", "special_points", "requested"):
        mine, other = loaded.table(part), branch.table(part)
        assert list(mine) == list(other)
        for name in mine:
            assert np.array_equal(mine[name], other[name]), name


def test_special_points_and_folds_of_a_long_branch_come_back(harmonic_branch, tmp_path):
    save(harmonic_branch, tmp_path / "harmonic.h5")
    loaded = load_branches(tmp_path / "harmonic.h5")[0]
    assert {s.kind for s in loaded.special_points} >= {"LP", "PD", "GR"}
    assert_same_branches(loaded, harmonic_branch)


def test_a_branch_without_a_stop_comes_back(tmp_path):
    system = System.from_modal(
        [13.0], {"tip": [0.6]}, modal_damping=0.02, excitation=[Unbalance("tip", 5e-6)]
    )
    branch = continue_branch(solve_orbit(system, 10.0), (9.0, 12.0))
    save(branch, tmp_path / "linear.h5")
    assert_same_branches(load_branches(tmp_path / "linear.h5")[0], branch)


def test_saving_a_loaded_branch_gives_the_same_file(saved, tmp_path):
    save(load_branches(saved)[0], tmp_path / "again.h5")
    assert (tmp_path / "again.h5").read_bytes() == saved.read_bytes()


def test_states_keep_their_coordinates_where_another_basis_would_be_computed(saved, monkeypatch):
    """Another linear algebra library may choose other signs of the eigenvectors."""
    right = load_branches(saved)[0].points[0].system.linear.right

    def other_signs(*arguments):
        return dataclasses.replace(linear_part(*arguments), right=-right)

    linear_part = System.linear.func.__globals__["linear_part"]
    monkeypatch.setitem(System.linear.func.__globals__, "linear_part", other_signs)
    assert np.array_equal(load_branches(saved)[0].points[0].system.linear.right, right)


def test_several_branches_in_one_file(one_dof, tmp_path):
    whole = diagram(one_dof, (30.0, 40.0), [1, 2], search_points=1)
    assert len(whole.branches) > 1
    path = tmp_path / "diagram.h5"
    save(whole, path)
    loaded = load_diagram(path)
    assert (loaded.limits, loaded.observe, loaded.notes) == ((30.0, 40.0), "middle", whole.notes)
    for mine, other in zip(loaded.branches, whole.branches, strict=True):
        assert_same_branches(mine, other)
        assert mine.points[0].problem.flow is loaded.branches[0].points[0].problem.flow


def test_a_file_of_one_branch_is_no_diagram(saved):
    with pytest.raises(SystemModelError, match="without a diagram"):
        load_diagram(saved)


def test_tables_in_the_file_can_be_read_without_this_package(branch, saved):
    with h5py.File(saved) as file:
        table = file["branches/0000/table"]
        column = table["max_abs_displacement_m"]
        assert column.attrs["unit"] == "m"
        assert np.array_equal(column[()], branch.max_abs_displacement)
        assert np.array_equal(table["stable"][()], branch.stable)


def test_every_dataset_has_a_unit_and_the_file_its_version(saved):
    with h5py.File(saved) as file:
        assert file.attrs["format_version"] == store.FORMAT_VERSION
        assert file.attrs["software"].startswith("nldyn ")
        bare = []
        file.visititems(
            lambda name, item: (
                bare.append(name)
                if isinstance(item, h5py.Dataset) and not item.attrs.get("unit")
                else None
            )
        )
        assert bare == []


def test_points_of_different_systems_are_refused(branch, harmonic_branch, tmp_path):
    mixed = Branch("mixed", 1, (branch.nodes[0], harmonic_branch.nodes[0]), (), ("", ""))
    with pytest.raises(SystemModelError, match="'mixed' cannot be saved"):
        save(mixed, tmp_path / "mixed.h5")
    assert list(tmp_path.iterdir()) == []


# --- laws of the user's own ----------------------------------------------------------------------


def hertz(delta, speed):
    return 5e9 * delta**1.5, 7.5e9 * delta**0.5, 0.0


def stiffer(delta, speed):
    grown = 1.0 + 1e5 * delta  # begins as the other one
    force, slope, _ = hertz(delta, speed)
    return force * grown, slope * grown + 1e5 * force, 0.0


def test_a_law_of_the_users_own_is_passed_again(tmp_path):
    system = make_one_dof(stops=[Stop("middle", 5e9, law=hertz)])
    branch = continue_branch(solve_orbit(system, 26.0), (25.8, 26.2))
    path = tmp_path / "law.h5"
    save(branch, path)
    assert_same_branches(load_branches(path, laws={0: hertz})[0], branch)
    refused(path, "stop 0 at 'middle'", "laws={0: law}")
    refused(path, "no stop 1 has a law of its own", laws={0: hertz, 1: hertz})
    refused(path, "stop 0 at 'middle'", "is not the one", laws={0: stiffer})


# --- faults --------------------------------------------------------------------------------------


def test_newer_version_is_named(copy):
    with h5py.File(copy, "r+") as file:
        file.attrs["format_version"] = store.FORMAT_VERSION + 1
    refused(copy, f"format version {store.FORMAT_VERSION + 1}", f"up to {store.FORMAT_VERSION}")


def test_a_file_of_version_1_has_a_dataset_for_each_open_end(branch, copy):
    with h5py.File(copy, "r+") as file:
        file.attrs["format_version"] = 1
        course = file["branches/0000/course"]
        del course["open_ends"]
        course["open_ends/0000"] = branch.points[3].point
        course["open_ends/0001"] = np.zeros(3)
    assert np.array_equal(load_branches(copy)[0].course.open_ends, [branch.points[3].point])


def test_foreign_files_are_refused(tmp_path):
    refused(tmp_path / "none.h5", "no such file")
    refused(tmp_path, "is a directory")
    text = tmp_path / "text.h5"
    text.write_text("frequency_hz,stable\n")
    refused(text, "is not an HDF5 file")
    other = tmp_path / "other.h5"
    with h5py.File(other, "w") as file:
        file["data"] = [1.0, 2.0]
    refused(other, "is not a file of branches")


@pytest.mark.parametrize("share", [0.0, 0.01, 0.3, 0.9, 0.9999])
def test_truncated_file_is_refused(saved, tmp_path, share):
    content = saved.read_bytes()
    path = tmp_path / "short.h5"
    path.write_bytes(content[: int(share * len(content))])
    refused(path, "cut off")


def test_whatever_is_missing_is_named(saved, copy):
    """Each group, dataset and attribute in turn, but for the table that is for other readers."""
    places = []

    def note(name, item):
        if "table" not in name:
            places.append((name, None))
            places.extend((name, key) for key in item.attrs if key != "unit")

    with h5py.File(saved) as file:
        file.visititems(note)
        places += [("/", key) for key in file.attrs if key != "software"]
    optional = ("course", "backward", "forward", "0000")
    places = [
        (name, key)
        for name, key in places
        if key not in ("nodes", "tail") and not (key is None and name.endswith(optional))
    ]
    assert len(places) > 100
    for name, key in places:
        shutil.copy(saved, copy)
        with h5py.File(copy, "r+") as file:
            if key is None:
                del file[name]
            else:
                del file[name].attrs[key]
        if key == "format":
            refused(copy, "is not a file of branches")
        else:
            refused(copy, f"{'/' if name == '/' else f'/{name}/'}{key}" if key else f"/{name}")


@pytest.mark.parametrize(
    ("place", "change", "words"),
    [
        ("nodes/point", lambda x: x[:, :-1], "has shape"),
        ("nodes/tangent", lambda x: x[0], "has shape"),
        ("nodes/error", lambda x: x.astype(np.float32), "float32"),
        ("nodes/jacobians", lambda x: np.array(["a"] * len(x), dtype="S1"), "has shape"),
        ("nodes/motion/kind", lambda x: x.astype(float), "float64"),
        ("special_points/root_error", lambda x: np.zeros(99), "has shape"),
    ],
)
def test_wrong_shape_or_type_is_named(copy, place, change, words):
    with h5py.File(copy, "r+") as file:
        group = file["branches/0000"]
        values = change(group[place][()])
        del group[place]
        group[place] = values
    refused(copy, f"dataset '/branches/0000/{place}'", words)


@pytest.mark.parametrize(
    ("place", "value"),
    [
        ("period", "one"),
        ("flow_map", 7),
        ("observe", "nowhere"),
        ("stop_reasons", "once"),
        ("course/start", 10_000),
        ("course/forward/node", 10_000),
    ],
)
def test_wrong_attribute_is_named(copy, place, value):
    *groups, key = place.split("/")
    with h5py.File(copy, "r+") as file:
        file["/".join(["branches/0000", *groups])].attrs[key] = value
    refused(copy, f"attribute '/branches/0000/{place}'")


@given(share=st.floats(0.0, 1.0, exclude_max=True), bit=st.integers(0, 7))
def test_a_flipped_bit_is_noticed_or_does_no_harm(branch, saved, tmp_path_factory, share, bit):
    content = bytearray(saved.read_bytes())
    content[int(share * len(content))] ^= 1 << bit
    path = tmp_path_factory.mktemp("flipped") / "branch.h5"
    path.write_bytes(content)
    try:
        loaded = load_branches(path)[0]
    except SystemModelError as error:
        assert str(error).startswith(f"{path}: ")
    else:
        assert_same_branches(loaded, branch)


# --- writing -------------------------------------------------------------------------------------


@pytest.mark.parametrize("step", ["fsync", "replace"])
def test_an_error_while_writing_leaves_the_old_file(branch, copy, monkeypatch, step):
    def full(*_):
        raise OSError(28, "No space left on device")

    before = copy.read_bytes()
    monkeypatch.setattr(os, step, full)
    with pytest.raises(OutputError, match=r"copy\.h5: cannot be written: no space left"):
        save(branch, copy)
    assert copy.read_bytes() == before
    assert [entry.name for entry in copy.parent.iterdir()] == ["copy.h5"]


def test_ctrl_c_while_writing_leaves_the_old_file(branch, copy, monkeypatch):
    def interrupted(_):
        raise KeyboardInterrupt

    before = copy.read_bytes()
    monkeypatch.setattr(os, "fsync", interrupted)
    with pytest.raises(KeyboardInterrupt):
        save(branch, copy)
    assert copy.read_bytes() == before
    assert [entry.name for entry in copy.parent.iterdir()] == ["copy.h5"]


def test_places_that_cannot_be_written_are_named(branch, tmp_path):
    locked = tmp_path / "locked"
    locked.mkdir()
    locked.chmod(0o555)
    os.mkfifo(tmp_path / "pipe")
    for place, fault in (
        (tmp_path / "pipe", "is a device or a pipe, not a file"),
        (tmp_path / "none" / "b.h5", "there is no such folder"),
        (tmp_path, "is a folder"),
        (locked / "b.h5", "the folder is read-only"),
    ):
        with pytest.raises(OutputError, match=fault):
            save(branch, place)
    locked.chmod(0o755)
    assert list(locked.iterdir()) == []


def test_what_is_not_a_name_of_a_file_is_refused(branch):
    with pytest.raises(SystemModelError, match="3 is not the name of a file"):
        load_branches(3)
    for name in (3, "a\0b"):
        with pytest.raises(OutputError, match="cannot be the name of a file"):
            save(branch, name)


@pytest.mark.parametrize("length", [245, 255, 300])
def test_a_name_that_is_too_long_is_refused_before_any_work(branch, tmp_path, length):
    """Also one that is itself short enough, but not with what is added while it is written."""
    place = tmp_path / ("b" * (length - 3) + ".h5")
    for write in (partial(save, branch), check_writable):
        with pytest.raises(OutputError, match="cannot be the name of a file: file name too long"):
            write(place)


def test_writing_follows_a_link(branch, tmp_path):
    (there := tmp_path / "there").mkdir()
    link, place = tmp_path / "link.h5", there / "branch.h5"
    link.symlink_to(place)
    for _ in range(2):
        save(branch, link)
        assert link.is_symlink() and [entry.name for entry in there.iterdir()] == ["branch.h5"]
        assert_same_branches(load_branches(link)[0], branch)


def test_a_link_to_where_nothing_can_be_written_is_refused_before_any_work(tmp_path):
    link = tmp_path / "link.h5"
    for place, fault in (
        (tmp_path / "none" / "b.h5", "there is no such folder"),
        (tmp_path / ("b" * 250), "file name too long"),
        (link, "cannot be the name of a file: .*(loop|levels of symbolic links)"),
    ):
        link.unlink(missing_ok=True)
        link.symlink_to(place)
        with pytest.raises(OutputError, match=fault):
            check_writable(link)


def test_an_empty_list_of_branches_comes_back_empty(tmp_path):
    store.save_branches(tmp_path / "none.h5", [])
    assert load_branches(tmp_path / "none.h5") == []
