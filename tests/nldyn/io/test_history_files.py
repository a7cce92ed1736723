"""Time histories are read back from every format, by other programs' readers, and are right."""

import csv

import numpy as np
import pytest
from scipy.io import loadmat

from nldyn import Stop, System, SystemModelError, Unbalance, simulate, solve_orbit
from nldyn.io import write_history

MASS, STIFFNESS, RATIO, UNBALANCE, HZ, GAP = 2.48, 16877.0, 0.0142, 4.92e-6, 10.0, 3e-5


@pytest.fixture(scope="module")
def system():
    return System.from_matrices(
        [[MASS]],
        [[STIFFNESS]],
        {"middle": [1.0], "the other, way": [-1.0]},
        modal_damping=RATIO,
        stops=[Stop("middle", stiffness=1e6, gap=GAP)],
        excitation=[Unbalance("middle", UNBALANCE)],
    )


@pytest.fixture(scope="module")
def history(system):
    return solve_orbit(system, frequency_hz=HZ).history(samples=40)


def steady(time):
    """The closed form of a linear oscillator, which does not reach the stop."""
    w, w0 = 2 * np.pi * HZ, np.sqrt(STIFFNESS / MASS)
    answer = UNBALANCE * w**2 / MASS / (w0**2 - w**2 + 2j * RATIO * w0 * w)
    return (answer * np.exp(1j * w * time)).real


def test_csv(history, tmp_path):
    write_history(history, tmp_path / "a.csv")
    with (tmp_path / "a.csv").open(newline="") as file:
        head, *rows = csv.reader(file)
    found = dict(zip(head, np.array(rows, dtype=float).T, strict=True))
    assert list(found) == list(history.table())
    for name, column in history.table().items():
        assert np.array_equal(found[name], column)
    u = steady(found["time_s"])
    assert found["displacement_m[middle]"] == pytest.approx(u, abs=1e-8 * abs(u).max())
    assert found["displacement_m[the other, way]"] == pytest.approx(-u, abs=1e-8 * abs(u).max())
    assert found["penetration_m[0]"] == pytest.approx(u - GAP, abs=1e-12)


def test_mat(history, tmp_path):
    write_history(history, tmp_path / "a.MAT")
    found = loadmat(tmp_path / "a.MAT")
    assert [name.item() for name in found["interfaces"].ravel()] == ["middle", "the other, way"]
    assert found["time_s"].shape == (41, 1) and found["displacement_m"].shape == (41, 2)
    u = steady(found["time_s"].ravel())
    assert found["displacement_m"] == pytest.approx(
        np.column_stack([u, -u]), abs=1e-8 * abs(u).max()
    )
    assert np.array_equal(found["modal"], history.modal)
    assert np.array_equal(found["force_n"], np.zeros((41, 1)))


def test_uff(history, tmp_path):
    pyuff = pytest.importorskip("pyuff")
    write_history(history, tmp_path / "a.uff")
    units, *sets = pyuff.UFF(str(tmp_path / "a.uff")).read_sets()
    assert units["type"] == 164 and units["length"] == 1.0
    assert [one["id1"].strip() for one in sets] == [
        "displacement middle",
        "displacement the other, way",
        "penetration stop 0",
        "force stop 0",
    ]
    assert [one["ordinate_axis_units_lab"].strip() for one in sets] == ["m", "m", "m", "N"]
    time = np.linspace(0.0, 1.0 / HZ, 41)
    assert sets[0]["x"] == pytest.approx(time, abs=1e-6)
    assert sets[0]["data"] == pytest.approx(steady(time), abs=1e-8 * abs(steady(time)).max())


def test_a_simulation_in_contact_keeps_its_forces(system, tmp_path):
    """Force and penetration obey Hertz's law in the file, of a motion that hits the stop."""
    pyuff = pytest.importorskip("pyuff")
    motion = simulate(system, frequency_hz=13.0, periods=3, transient=20)
    write_history(motion.history(300), tmp_path / "a.uff")
    *_, depth, force = pyuff.UFF(str(tmp_path / "a.uff")).read_sets()
    inside = np.maximum(depth["data"], 0.0)
    assert inside.max() > 1e-6
    assert force["data"] == pytest.approx(1e6 * inside**1.5, rel=1e-8)
    assert force["x"][[0, -1]] == pytest.approx([20 / 13, 23 / 13], rel=1e-5)


def test_another_ending_and_another_thing_are_refused(history, tmp_path, monkeypatch):
    with pytest.raises(SystemModelError, match=r"'a\.xls' must end in one of \.csv, \.mat, \.uff"):
        write_history(history, tmp_path / "a.xls")
    with pytest.raises(SystemModelError, match="history must be a History, got"):
        write_history([1.0], tmp_path / "a.csv")
    monkeypatch.setitem(__import__("sys").modules, "pyuff", None)
    with pytest.raises(SystemModelError, match=r'needs pyuff, .* pip install "nldyn\[uff\]"'):
        write_history(history, tmp_path / "a.uff")
    assert not any(tmp_path.iterdir())


def test_pandas_and_xarray(history):
    pytest.importorskip("pandas")
    pytest.importorskip("xarray")
    frame, data = history.to_pandas(), history.to_xarray()
    assert frame.index.name == "time_s"
    assert np.array_equal(frame["displacement_m[middle]"], history.displacement["middle"])
    assert data.sizes == {"time": 41, "interface": 2, "stop": 1, "mode": 1}
    other = data["displacement"].sel(interface="the other, way")
    assert np.array_equal(other, history.displacement["the other, way"])
    assert other.attrs["units"] == "m"
    assert np.array_equal(data["penetration"].isel(stop=0), history.penetration[:, 0])
