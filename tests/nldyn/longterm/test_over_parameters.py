"""What motions settle on over the gap, the damping and the restitution."""

import numpy as np
import pytest
from problems import make_one_dof

from nldyn import (
    HarmonicForce,
    RigidStop,
    StatePlane,
    Stop,
    System,
    SystemModelError,
    Unbalance,
    basins,
    continue_branch,
    solve_orbit,
)
from nldyn.longterm import basins_over, brute_force
from nldyn.plot import plot_basins_over, plot_brute_force

HZ = 23.0


def one_mode(gap: float = 1e-6, damping: float = 0.0142) -> System:
    return System.from_matrices(
        [[2.48]], [[16877.0]], {"middle": [1.0]}, modal_damping=damping,
        stops=[Stop("middle", stiffness=5.17e9, gap=gap)],
        excitation=[Unbalance("middle", 4.92e-6)],
    )  # fmt: skip


@pytest.fixture(scope="module")
def over_gap():
    return brute_force(
        one_mode(), (0.0, 5e-5), parameter="gap", frequency_hz=HZ, points=9, recorded=4
    )


@pytest.fixture(scope="module")
def branch():
    found = continue_branch(solve_orbit(one_mode(), HZ), (0.0, 5e-5), parameter="gap")
    assert [s.kind for s in found.special_points].count("LP") == 2
    return found


def test_up_and_down_differ_between_the_folds_of_the_branch(over_gap, branch):
    low, high = sorted(s.value for s in branch.special_points if s.kind == "LP")
    values = over_gap.values
    assert values == [*np.linspace(0.0, 5e-5, 9), *np.linspace(0.0, 5e-5, 9)[::-1]]
    assert sum(low < value < high for value in values[:9]) > 2
    sides = {"up": {}, "down": {}}
    for value, column in zip(values, over_gap.columns, strict=True):
        sides[column.direction][value] = column.peaks.max()
    for value in values[:9]:
        same = sides["up"][value] == pytest.approx(sides["down"][value], rel=1e-6)
        assert same != (low < value < high)


def test_every_attractor_lies_on_the_branch(over_gap, branch):
    for value, column in zip(over_gap.values, over_gap.columns, strict=True):
        assert column.attractor.flow.system.stops[0].gap == value
        peaks = [orbit.max_abs_displacement for orbit in branch.at(value) if orbit.stable]
        assert min(abs(column.peaks.max() / peak - 1.0) for peak in peaks) < 1e-6


def test_the_axis_of_the_picture_is_that_of_the_parameter(over_gap, branch):
    ax = plot_brute_force(over_gap, diagram=[branch])
    assert ax.get_xlabel() == "gap (µm)"
    drawn = np.unique(np.concatenate([line.get_xdata() for line in ax.lines[-1:]]))
    np.testing.assert_allclose(drawn, np.linspace(0.0, 50.0, 9), atol=1e-12)
    with pytest.raises(SystemModelError, match="followed in frequency_hz, the motions differ in g"):
        plot_brute_force(over_gap, diagram=[continue_branch(solve_orbit(one_mode(), HZ), (22, 24))])


def test_a_state_is_carried_on_where_the_damping_changes_the_coordinates():
    found = brute_force(make_one_dof(), (0.01, 0.03), parameter="modal_damping", frequency_hz=50.0,
                        points=2, directions=["up"], recorded=2)  # fmt: skip
    for value, column in zip(found.values, found.columns, strict=True):
        orbit = solve_orbit(one_mode(0.0, value), 50.0, 2)
        assert column.attractor.period == 2
        assert column.peaks.max() == pytest.approx(orbit.max_abs_displacement, rel=1e-6)


def test_a_gap_that_shrinks_leaves_no_motion_behind_the_stop():
    system = System.from_matrices(
        [[1.0]], [[1.0]], {"m": [1.0]}, damping=[[0.5]],
        stops=[RigidStop("m", gap=0.5, restitution=0.3)], excitation=[HarmonicForce("m", 1.0)],
    )  # fmt: skip
    found = brute_force(system, (0.05, 1.0), parameter="gap", frequency_hz=0.2, points=3,
                        directions=["down"], recorded=2)  # fmt: skip
    assert [column.attractor.kind for column in found.columns] == ["periodic"] * 3


def test_shares_over_the_gap_are_those_of_basins_at_each_gap(branch):
    low, high = sorted(s.value for s in branch.special_points if s.kind == "LP")
    plane = StatePlane.at_interface(one_mode(), (-2e-4, 0.0), (-0.05, 0.05))
    over = basins_over(one_mode(), (0.0, 4e-5), plane, points=3, parameter="gap",
                       frequency_hz=HZ, shape=(6, 6), checks=0)  # fmt: skip
    assert over.values == (0.0, 2e-5, 4e-5)
    shares = over.shares()
    assert list(shares) == ["period 1, 1 impact", "period 1, no impacts"]
    alone = basins(one_mode(2e-5), HZ, plane, shape=(6, 6), checks=0)
    for basin in alone.basins:
        assert shares[basin.attractor.title][1] == basin.share
    assert 0.0 < low < 2e-5 < high < 4e-5  # beyond either fold there is one stable orbit
    assert [shares["period 1, 1 impact"][k] for k in (0, 2)] == [1.0, 0.0]
    assert sum(shares.values()) == pytest.approx(1.0)
    ax = plot_basins_over(over)
    assert ax.get_xlabel() == "gap (µm)"
    np.testing.assert_allclose(ax.lines[0].get_xdata(), [0.0, 20.0, 40.0])
    np.testing.assert_allclose(ax.lines[0].get_ydata(), 100.0 * shares["period 1, 1 impact"])


@pytest.mark.parametrize(
    ("given", "says"),
    [
        ({"parameter": "gap"}, "parameter 'gap': needs frequency_hz"),
        ({"frequency_hz": HZ}, "frequency_hz is what parameter 'frequency_hz' changes"),
        ({"parameter": "width", "frequency_hz": HZ}, "unknown parameter 'width'"),
    ],
)
def test_bad_questions_are_refused(given, says):
    with pytest.raises(SystemModelError, match=says):
        brute_force(one_mode(), (1e-6, 2e-6), **given)
