"""Files come back as they were; bad input gets one clear sentence."""

from __future__ import annotations

import numpy as np
import pytest
from chains import chain

import cms


def test_save_and_load(tmp_path, cantilever):
    reduced = cms.reduce(cantilever, modes=3)
    path = tmp_path / "beam.reduced"
    reduced.save(path)
    loaded = cms.ReducedModel.load(path)
    np.testing.assert_array_equal(loaded.frequencies_hz, reduced.frequencies_hz)
    np.testing.assert_array_equal(loaded.basis, reduced.basis)
    np.testing.assert_array_equal(loaded.residuals, reduced.residuals)
    assert loaded.interfaces == ("tip", "middle")
    np.testing.assert_array_equal(loaded.participation["middle"], reduced.participation["middle"])
    assert (loaded.modes, loaded.residual_modes) == (3, 2)
    assert [file.name for file in tmp_path.iterdir()] == ["beam.reduced"]


def test_file_may_be_read_by_whom_the_system_lets_read_new_files(tmp_path, cantilever):
    (tmp_path / "ordinary").touch()
    cms.reduce(cantilever, modes=1).save(tmp_path / "a.npz")
    assert (tmp_path / "a.npz").stat().st_mode == (tmp_path / "ordinary").stat().st_mode


def test_model_without_interfaces_survives_its_file(tmp_path, cantilever):
    reduced = cms.reduce(cms.Matrices(cantilever.stiffness, cantilever.mass, {}), modes=2)
    assert reduced.residual_modes == 0
    reduced.save(tmp_path / "a.npz")
    assert cms.ReducedModel.load(tmp_path / "a.npz").participation == {}


def test_failed_save_leaves_the_old_file(tmp_path, cantilever, monkeypatch):
    path = tmp_path / "a.npz"
    cms.reduce(cantilever, modes=3).save(path)
    before = path.read_bytes()

    def fails(file, **arrays):
        file.write(b"half")
        raise OSError("disk full")

    monkeypatch.setattr(np, "savez", fails)
    with pytest.raises(cms.ReductionError, match=r"a\.npz cannot be written \(disk full\)"):
        cms.reduce(cantilever, modes=1).save(path)
    assert path.read_bytes() == before
    assert list(tmp_path.iterdir()) == [path]


def test_save_where_there_is_no_folder_names_the_file(tmp_path, cantilever):
    with pytest.raises(cms.ReductionError, match=r"/none/x\.npz cannot be written \(No such file"):
        cms.reduce(cantilever, modes=1).save(tmp_path / "none" / "x.npz")


def test_load_names_the_file(tmp_path, cantilever):
    with pytest.raises(cms.ReductionError, match=r"there is no file .*missing\.npz"):
        cms.ReducedModel.load(tmp_path / "missing.npz")
    (tmp_path / "text.npz").write_text("hello")
    with pytest.raises(cms.ReductionError, match=r"text\.npz is not a readable"):
        cms.ReducedModel.load(tmp_path / "text.npz")
    np.savez(tmp_path / "other.npz", a=np.zeros(3))
    with pytest.raises(cms.ReductionError, match="does not hold a reduced model"):
        cms.ReducedModel.load(tmp_path / "other.npz")
    reduced = cms.reduce(cantilever, modes=1)
    reduced.save(tmp_path / "new.npz")
    with np.load(tmp_path / "new.npz") as file:
        arrays = dict(file)
    np.savez(tmp_path / "new.npz", **(arrays | {"version": np.array(99)}))
    with pytest.raises(cms.ReductionError, match="format version 99"):
        cms.ReducedModel.load(tmp_path / "new.npz")
    del arrays["basis"]
    np.savez(tmp_path / "new.npz", **arrays)
    with pytest.raises(cms.ReductionError, match=r"new\.npz is damaged"):
        cms.ReducedModel.load(tmp_path / "new.npz")


def test_arrays_cannot_be_changed(cantilever):
    reduced = cms.reduce(cantilever, modes=1)
    for array in (reduced.basis, reduced.frequencies_hz, reduced.participation["tip"]):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 1.0


@pytest.mark.parametrize(
    "request_, sentence",
    [
        ({}, "give either modes or cutoff_hz; neither is given"),
        ({"modes": 1, "cutoff_hz": 5.0}, "both are given"),
        ({"modes": -1}, "modes = -1 must be a whole number"),
        ({"modes": 1.5}, r"modes = 1\.5 must be a whole number"),
        ({"modes": True}, "modes = True must be a whole number"),
        ({"modes": 31}, "modes = 31, but the component has only 30 degrees"),
        ({"modes": 0, "residual": False}, "modes = 0 without residual modes"),
        ({"cutoff_hz": -3.0}, r"cutoff_hz = -3\.0 must be a positive"),
        ({"cutoff_hz": float("nan")}, "cutoff_hz = nan must be a positive"),
        ({"cutoff_hz": "500"}, "cutoff_hz = '500' must be a positive"),
        ({"cutoff_hz": 1e-3, "residual": False}, r"no mode .* below cutoff_hz = 0\.001"),
    ],
)
def test_bad_requests(cantilever, request_, sentence):
    with pytest.raises(cms.ReductionError, match=sentence):
        cms.reduce(cantilever, **request_)


def changed(matrix, row, column, value):
    array = matrix.toarray()
    array[row, column] = value
    return array


@pytest.mark.parametrize(
    "change, sentence",
    [
        (lambda c: {"stiffness": changed(c.stiffness, 3, 3, np.nan)}, "stiffness .* nan in row 3"),
        (lambda c: {"mass": changed(c.mass, 2, 2, np.inf)}, "mass matrix has the entry inf"),
        (lambda c: {"stiffness": changed(c.stiffness, 0, 9, 5.0)}, "stiffness .* not symmetric"),
        (lambda c: {"mass": changed(c.mass, 4, 4, -1.0)}, "mass .* not positive: .* row 4"),
        (lambda c: {"stiffness": changed(c.stiffness, 4, 4, -1.0)}, "stiffness .* row 4"),
        (lambda c: {"stiffness": changed(c.stiffness, 4, 4, 0.1)}, "indefinite .* buckling load"),
        (lambda c: {"mass": 0 * c.mass}, "mass matrix is zero"),
        (lambda c: {"stiffness": np.ones((3, 2))}, r"shape \(3, 2\), it must be square"),
        (lambda c: {"stiffness": np.zeros((0, 0))}, "stiffness matrix is empty"),
        (lambda c: {"mass": np.eye(3)}, r"shape \(30, 30\), but the mass matrix \(3, 3\)"),
        (lambda c: {"mass": 1j * np.eye(30)}, "mass matrix is complex"),
        (lambda c: {"mass": "heavy"}, "mass cannot be read as a matrix"),
        (lambda c: {"interfaces": {"a": np.ones(3)}}, r"interface 'a' has shape \(3,\)"),
        (lambda c: {"interfaces": {"a": np.zeros(30)}}, "interface 'a' is a zero vector"),
        (lambda c: {"interfaces": {"a": np.full(30, np.nan)}}, "interface 'a' has an entry"),
        (lambda c: {"interfaces": {"a": ["x"] * 30}}, "interface 'a' is not a vector"),
        (lambda c: {"interfaces": {}}, "no interface for a residual mode"),
    ],
)
def test_bad_components(cantilever, change, sentence):
    given = {
        "stiffness": cantilever.stiffness,
        "mass": cantilever.mass,
        "interfaces": cantilever.interfaces,
    }
    with pytest.raises(cms.ReductionError, match=sentence):
        cms.reduce(cms.Matrices(**(given | change(cantilever))), modes=0)


def test_not_a_component():
    with pytest.raises(cms.ReductionError, match=r"\(a dict\) has no attribute 'stiffness'"):
        cms.reduce({}, modes=1)


def test_unknown_interface(cantilever):
    reduced = cms.reduce(cantilever, modes=1)
    with pytest.raises(cms.ReductionError, match=r"no interface 'end' \(there are: tip, middle\)"):
        reduced.static_flexibility("end")
    with pytest.raises(cms.ReductionError, match="no interface 'end'"):
        reduced.receptance(1.0, "tip", "end")
    with pytest.raises(cms.ReductionError, match="frequency_hz must be finite"):
        cms.accuracy(cantilever, reduced).receptance_error(np.nan, "tip", "tip")


def test_wrong_state(cantilever):
    with pytest.raises(cms.ReductionError, match=r"q has shape \(2,\), it must be \(3,\)"):
        cms.reduce(cantilever, modes=1).expand([1.0, 2.0])
    with pytest.raises(cms.ReductionError, match="q must hold numbers only"):
        cms.reduce(cantilever, modes=1).expand("x")
    with pytest.raises(cms.ReductionError, match="q has an entry that is not a finite number"):
        cms.reduce(cantilever, modes=1).expand([1.0, np.nan, 0.0])


def test_errors_are_value_errors_of_one_line():
    assert issubclass(cms.ReductionError, ValueError)
    with pytest.raises(ValueError) as caught:
        cms.reduce(chain(5), modes=9)
    assert "\n" not in str(caught.value)


def test_too_many_modes_of_a_large_model():
    with pytest.raises(cms.ReductionError, match="more than a quarter"):
        cms.reduce(chain(6001), modes=2000)


def test_fields_that_do_not_belong_together():
    with pytest.raises(cms.ReductionError, match="do not belong together"):
        cms.ReducedModel([1.0], {}, np.zeros((3, 2)), [0.0], 1)
    with pytest.raises(cms.ReductionError, match="'a' has shape"):
        cms.ReducedModel([1.0], {"a": [1.0, 2.0]}, np.zeros((3, 1)), [0.0], 1)
