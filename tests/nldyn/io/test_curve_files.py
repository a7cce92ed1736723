"""Curves are saved, loaded, tabulated and extended."""

from __future__ import annotations

import h5py
import numpy as np
import pytest
from problems import make_one_dof

from nldyn import (
    ContinuationOptions,
    Damper,
    HarmonicForce,
    Stop,
    System,
    SystemModelError,
    continue_branch,
    continue_constant,
    continue_special,
    save,
    solve_orbit,
)
from nldyn.io import CheckpointFile
from nldyn.io.branches import load_branches
from nldyn.io.curves import load_curves, save_curves
from nldyn.orbits.conditions import peak_force


def symmetric() -> System:
    stops = [Stop.linear("m", 3000.0, gap=0.01, direction=side) for side in (1, -1)]
    return System.from_matrices(
        [[1.0]], [[100.0]], {"m": [1.0]}, modal_damping=0.02, stops=stops,
        dampers=[Damper("m", 0.01)], excitation=[HarmonicForce("m", 1.0)],
    )  # fmt: skip


def special(system, kind, window, start=None):
    branch = continue_branch(solve_orbit(system, start or window[0]), window)
    return next(s for s in branch.special_points if s.kind == kind)


def force(orbit):
    return peak_force(orbit)


def make(kind):
    one_dof = make_one_dof()
    few = ContinuationOptions(max_points=4)
    if kind == "BP":
        found = special(symmetric(), "BP", (0.5, 1.0), 1.0)
        return continue_special(
            found, ("frequency_hz", "coefficient"), ((0.3, 2.0), (0.005, 0.02)), options=few
        )
    if kind in ("LP", "PD", "GR"):
        window, start = {
            "LP": ((12.0, 26.0), 26.0), "PD": ((33.0, 34.0), 33.0), "GR": ((5.7, 6.5), 6.5)
        }[kind]  # fmt: skip
        found = special(one_dof, kind, window, start)
        pair = ("frequency_hz", "modal_damping" if kind == "PD" else "gap")
        ranges = ((5.0, 60.0), (0.01, 0.02) if kind == "PD" else (-1e-7, 1e-7))
        return continue_special(found, pair, ranges, options=few)
    start = solve_orbit(one_dof, 26.0)
    monitor = {"own": force, "max_abs_displacement": "max_abs_displacement"}[kind]
    window = ((25.0, 27.0), (-1e-7, 1e-7))
    return continue_constant(start, monitor, ("frequency_hz", "gap"), window, options=few)


@pytest.fixture(scope="module", params=["LP", "PD", "GR", "BP", "own", "max_abs_displacement"])
def curve(request):
    return make(request.param)


@pytest.fixture(scope="module")
def loaded(curve, tmp_path_factory):
    path = tmp_path_factory.mktemp("curves") / "curve.h5"
    save(curve, path)
    return load_curves(path, monitor=force if curve.kind == "force" else None)[0]


def test_loaded_curve_has_the_unknowns_of_the_saved_one(curve, loaded):
    assert (loaded.kind, loaded.parameters) == (curve.kind, curve.parameters)
    assert (loaded.stop_reasons, loaded.notes) == (curve.stop_reasons, curve.notes)
    assert np.array_equal(loaded.values, curve.values)
    for a, b in zip(curve.points, loaded.points, strict=True):
        for name in ("point", "tangent", "arclength", "corner"):
            assert np.array_equal(getattr(a, name), getattr(b, name))
    assert [m.kind for m in loaded.marks] == [m.kind for m in curve.marks]
    for one, other in zip(curve.marks, loaded.marks, strict=True):
        assert other.values == pytest.approx(one.values, rel=1e-14)
        assert other.orbit.frequency_hz == pytest.approx(one.orbit.frequency_hz, rel=1e-14)
        assert other.orbit.multipliers == pytest.approx(one.orbit.multipliers, rel=1e-9, abs=1e-12)


def test_loaded_curve_has_its_orbits_and_conditions(curve, loaded):
    assert loaded.residuals == pytest.approx(curve.residuals, abs=1e-12)
    for a, b in zip(curve.orbits, loaded.orbits, strict=True):
        assert b.multipliers == pytest.approx(a.multipliers, rel=1e-12)
        assert b.max_abs_displacement == pytest.approx(a.max_abs_displacement, rel=1e-12)
        assert (b.period, b.observe, b.impacts) == (a.period, a.observe, a.impacts)


def test_table_has_the_parameters_and_the_orbits(curve, loaded):
    for part, rows in (("points", curve.points), ("marks", curve.marks)):
        table = curve.table(part)
        for number, parameter in enumerate(curve.parameters):
            assert table[parameter.name].tolist() == [row.values[number] for row in rows]
        assert table["impacts"].tolist() == [row.orbit.impacts for row in rows]
        assert {len(column) for column in table.values()} == {len(rows)}
        again = loaded.table(part)
        assert list(again) == list(table)
    with pytest.raises(SystemModelError, match="part must be one of points, marks, got 'nodes'"):
        curve.table("nodes")


def assert_same_curves(one, other):
    """To the last bit."""
    assert (one.stop_reasons, one.notes) == (other.stop_reasons, other.notes)
    assert [m.kind for m in one.marks] == [m.kind for m in other.marks]
    for some, others in ((one.points, other.points), (marked(one), marked(other))):
        assert len(some) == len(others)
        for a, b in zip(some, others, strict=True):
            assert np.array_equal(a.point, b.point) and np.array_equal(a.tangent, b.tangent)
            assert a.arclength == b.arclength


def marked(curve):
    return [mark.point for mark in curve.marks]


@pytest.mark.parametrize("kind", ["LP", "PD", "GR"])
def test_an_extended_curve_is_the_curve_through_the_longer_range(kind, tmp_path):
    """From the file, and beyond the ends of both parameters."""
    window, start = {
        "LP": ((12.0, 26.0), 26.0), "PD": ((33.0, 34.0), 33.0), "GR": ((5.7, 6.5), 6.5)
    }[kind]  # fmt: skip
    found = special(make_one_dof(), kind, window, start)
    pair = ("frequency_hz", "modal_damping")
    hz = found.frequency_hz
    narrow, wide = ((0.98 * hz, 1.03 * hz), (0.0135, 0.015)), ((0.9 * hz, 1.1 * hz), (0.013, 0.016))
    save(continue_special(found, pair, narrow), tmp_path / "short.h5")
    short = load_curves(tmp_path / "short.h5")[0]
    longer = short.extend(wide)
    assert len(longer.points) > len(short.points)
    assert_same_curves(longer, continue_special(found, pair, wide))
    with pytest.raises(SystemModelError, match="lies outside the range"):
        short.extend((narrow[0], (0.0139, 0.0141)))


def test_a_loaded_curve_goes_on(tmp_path):
    few = ContinuationOptions(max_points=3)
    start = solve_orbit(make_one_dof(), 26.0)
    ranges = ((25.0, 27.0), (-1e-8, 1e-8))
    short = continue_constant(start, "peak_force", ("frequency_hz", "gap"), ranges, options=few)
    assert "3 points" in short.stop_reasons
    save(short, tmp_path / "short.h5")
    usual = ContinuationOptions()
    longer = load_curves(tmp_path / "short.h5")[0].extend(ranges, options=usual)
    assert_same_curves(
        longer, continue_constant(start, "peak_force", ("frequency_hz", "gap"), ranges)
    )
    assert longer.stop_reasons == ("end of the range of gap",) * 2
    assert sorted(longer.values[[0, -1], 1]) == pytest.approx([-1e-8, 1e-8], rel=1e-12)


@pytest.mark.parametrize("share", [pytest.param(0.2, marks=pytest.mark.slow), 0.7])
def test_an_interrupted_curve_is_kept_and_finished(tmp_path, share):
    """In the leg forward, and in the one backward."""
    path = tmp_path / "curve.h5"
    found = special(make_one_dof(), "PD", (33.0, 34.0), 33.0)
    pair, ranges = ("frequency_hz", "gap"), ((5.0, 60.0), (-1e-7, 2e-7))
    whole = continue_special(found, pair, ranges)
    seen = []

    def stop(values):
        seen.append(values)
        if len(seen) > share * len(whole.points):
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        continue_special(found, pair, ranges, progress=stop, checkpoint=CheckpointFile(path))
    kept = load_curves(path)[0]
    assert "not finished" in kept.stop_reasons
    assert len(kept.points) >= len(seen) - 2
    assert (kept.points[0].arclength < 0.0) is (share > 0.5)
    assert_same_curves(kept.extend(ranges), whole)
    again = continue_special(found, pair, ranges, checkpoint=CheckpointFile(path))
    assert_same_curves(again, whole)
    assert_same_curves(load_curves(path)[0], whole)
    few = ContinuationOptions(max_points=2)
    next_flip = special(make_one_dof(), "PD", (12.0, 20.0), 20.0)
    other = continue_special(next_flip, pair, ranges, options=few)
    with pytest.raises(SystemModelError, match="holds another continuation"):
        other.extend(ranges, checkpoint=CheckpointFile(path))


def test_an_interrupted_closed_curve_closes_where_it_began(tmp_path):
    """Folds of a bilinear oscillator, in the frequency and the gap."""
    stop = Stop.linear("m", 15791.0, gap=1e-3)
    system = System.from_modal(
        [10.0], {"m": [1.0]}, modal_damping=0.03, stops=[stop], excitation=[HarmonicForce("m", 1.0)]
    )
    fold = special(system, "LP", (5.0, 20.0), 8.0)
    pair, ranges = ("frequency_hz", "gap"), ((3.0, 40.0), (1e-4, 5e-3))
    whole = continue_special(fold, pair, ranges)
    assert whole.stop_reasons == ("closed curve", "closed curve")
    seen = []

    def stop(values):
        seen.append(values)
        if len(seen) == len(whole.points) // 2:
            raise KeyboardInterrupt

    path = tmp_path / "curve.h5"
    with pytest.raises(KeyboardInterrupt):
        continue_special(fold, pair, ranges, progress=stop, checkpoint=CheckpointFile(path))
    assert_same_curves(load_curves(path)[0].extend(ranges), whole)


def test_several_curves_in_one_file_and_what_is_refused(tmp_path):
    path, curve = tmp_path / "curves.h5", make("own")
    few = make("PD")
    save_curves(path, [few, few])
    assert [c.kind for c in load_curves(path)] == ["PD", "PD"]
    with pytest.raises(SystemModelError, match="is not a file of branches"):
        load_branches(path)
    with pytest.raises(SystemModelError, match="curves must be a list of curves, got 3"):
        save_curves(path, 3)
    save(curve, path)
    with pytest.raises(SystemModelError, match="a file cannot hold: pass monitor="):
        load_curves(path)
    with pytest.raises(SystemModelError, match="the monitor passed is not 'force'"):
        load_curves(path, monitor=lambda orbit: 2.0 * force(orbit))
    with h5py.File(path, "a") as file:
        file.attrs["format_version"] = 99
    with pytest.raises(SystemModelError, match="has format version 99, written by nldyn"):
        load_curves(path, monitor=force)
    path.write_bytes(path.read_bytes()[:3000])
    with pytest.raises(SystemModelError, match="cut off or damaged"):
        load_curves(path)
