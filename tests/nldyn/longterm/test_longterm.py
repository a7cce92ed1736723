"""Attractors, diagrams by brute force, basins, manifolds, contact measures and spectra."""

from __future__ import annotations

import math
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from problems import make_one_dof
from scipy.spatial import cKDTree

from nldyn import (
    ContinuationOptions,
    ExploreOptions,
    FlowMap,
    HarmonicForce,
    RigidStop,
    StatePlane,
    Stop,
    System,
    SystemModelError,
    basins,
    classify_attractor,
    continue_branch,
    find_attractors,
    harmonics,
    impacts,
    lyapunov_exponents,
    simulate,
    solve_orbit,
    sweep,
)
from nldyn.base.errors import ConvergenceError
from nldyn.longterm import (
    basin_edge,
    brute_force,
    contact_measures,
    impact_section,
    spectra_map,
    stable_manifold,
    stroboscopic_section,
)
from nldyn.longterm.attractors import Attractor, AttractorOptions, zero_one_test
from nldyn.longterm.measures import measures_table, power_spectrum, spectra_table
from nldyn.longterm.neighbourhoods import settle, target_of
from nldyn.longterm.poincare import BruteForce, Column
from nldyn.orbits import OrbitSearchOptions
from nldyn.plot.longterm import (
    plot_basins,
    plot_brute_force,
    plot_section,
    plot_spectra,
    plot_sweep,
    plot_wear,
    strobe_curves,
)


@pytest.fixture(scope="module")
def one_dof() -> System:
    return make_one_dof()


@pytest.fixture(scope="module")
def plane(one_dof) -> StatePlane:
    return StatePlane.at_interface(one_dof, (-3e-4, 0.4e-4), (-0.05, 0.05))


@pytest.fixture(scope="module")
def at_50_hz(one_dof, plane):
    return basins(one_dof, 50.0, plane, shape=(16, 16), starts=6, checks=24)


# attractors


@pytest.mark.parametrize(("hz", "name"), [(25.3, "period 1"), (50.0, "period 2")])
def test_periodic_attractors_are_the_stable_orbits(one_dof, hz, name):
    found = classify_attractor(one_dof, hz)
    assert found.name == name
    assert found.orbit is not None and found.orbit.stable
    value, error = found.largest_exponent
    multiplier = abs(found.orbit.largest_multiplier)
    assert value == pytest.approx(math.log(multiplier) * hz / found.period, abs=error + 1e-9)
    assert "stable orbit" in found.evidence


def test_chaos_is_found_by_two_independent_tests(one_dof):
    found = classify_attractor(one_dof, 36.0)
    assert found.kind == "chaotic"
    assert found.exponents is not None and found.exponents.chaotic
    assert found.zero_one > 0.8
    assert "Lyapunov" in found.evidence
    assert "seen for 2000 periods only: `chaos_lifetime`" in found.evidence


def free_body() -> System:
    return System.from_modal(
        [0.0, 29.2], {"a": [0.6, 0.5], "b": [0.3, -0.5]}, modal_damping=0.02,
        excitation=[HarmonicForce("b", 1.0)],
    )  # fmt: skip


@pytest.mark.parametrize("speed", [1e-3, -2.0])
def test_a_free_body_that_moves_on_is_drifting(speed):
    found = classify_attractor(free_body(), 20.0, start=[0.0, 0.0, speed, 0.0])
    assert found.name == "drifting" and "rigid-body mode" in found.evidence
    place = found.flow.to_modal(found.states)[:, 0]
    way = speed * (len(place) - 1) / 20.0
    assert place[-1] - place[0] == pytest.approx(way, rel=1e-6)


def test_a_free_body_that_stays_is_not_drifting():
    assert classify_attractor(free_body(), 20.0).kind == "undecided"


def test_basins_of_a_system_without_damping_are_refused():
    system = System.from_modal([13.0], {"a": [0.6]}, stops=[Stop("a", 1e9, gap=1e-4)])
    plane = StatePlane.at_interface(system, (-1e-3, 1e-4), (-0.05, 0.05))
    with pytest.raises(SystemModelError, match="system without damping has no attractors"):
        basins(system, 20.0, plane, shape=(4, 4))


def test_free_vibration_under_forcing_is_quasi_periodic():
    system = System.from_modal([10.0], {"tip": [1.0]}, excitation=[HarmonicForce("tip", 1.0)])
    found = classify_attractor(system, 10.0 * (1.0 + math.sqrt(5.0)), start=[1e-3, 0.0])
    assert found.kind == "quasi-periodic" and "power of the time" in found.evidence
    assert found.zero_one < 0.2


def test_a_torus_of_a_damped_structure_is_quasi_periodic():
    from nldyn.base.resources import example
    from nldyn.scene.build import build_system
    from nldyn.scene.read import load_scene

    found = classify_attractor(build_system(load_scene(example("four_dof_xi_0.01.toml"))), 62.0)
    assert found.kind == "quasi-periodic"
    value, error = found.largest_exponent
    assert abs(value) < 3.0 * error
    assert abs(found.zero_one) < 0.2


def lightly_damped(ratio: float, **changes) -> System:
    elements = {"excitation": [HarmonicForce("tip", 1.0)], **changes}
    return System.from_modal([10.0], {"tip": [1.0]}, modal_damping=ratio, **elements)


@pytest.mark.parametrize(("ratio", "name"), [(1e-2, "period 1"), (1e-4, "period 1")])
def test_a_slow_transient_is_followed_to_the_orbit_that_newton_finds(ratio, name):
    system = lightly_damped(ratio)
    hz = 7.0 * math.sqrt(2.0)
    found = classify_attractor(system, hz)
    assert found.name == name
    value, _ = found.largest_exponent
    assert value == pytest.approx(-ratio * 20.0 * math.pi, rel=1e-4)
    shares = find_attractors(system, hz, starts=4)
    assert [(share.attractor.name, share.count) for share in shares] == [(name, 4)]


@pytest.mark.parametrize("ratio", [1e-5, 1e-6])
def test_a_transient_too_slow_to_end_is_undecided_and_told(ratio):
    system = lightly_damped(ratio)
    hz = 7.0 * math.sqrt(2.0)
    found = classify_attractor(system, hz)
    assert found.kind == "undecided"
    assert found.largest_exponent[0] == pytest.approx(-ratio * 20.0 * math.pi, rel=1e-2)
    assert "slow transient to the stable orbit of period 1" in found.evidence
    assert [share.count for share in find_attractors(system, hz, starts=3)] == [3]


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("gap", [0.0, 1e-5, 1e-3])
def test_rest_is_the_attractor_of_a_damped_motion_without_forcing(gap):
    system = lightly_damped(0.01, excitation=[], stops=[Stop("tip", 1e6, gap=gap)])
    starts = np.array([[1e-3, 0.0], [2e-3, 0.0]])
    (share,) = find_attractors(system, 20.0, starts=starts)
    assert share.attractor.name == "period 1" and share.count == 2
    assert np.abs(share.attractor.states).max() < 1e-9
    multiplier = abs(share.attractor.orbit.largest_multiplier)
    assert multiplier == pytest.approx(math.exp(-0.01 * math.pi), rel=1e-6)  # free decay


@pytest.mark.parametrize(("start", "after"), [([0.0, 0.0], 1), ([1e-2, 0.0], 2)])
def test_a_motion_that_repeats_but_attracts_nothing_is_not_quasi_periodic(start, after):
    system = System.from_modal([15.0], {"tip": [1.0]})
    found = classify_attractor(system, 10.0, start=start)
    assert found.kind == "undecided"
    assert f"repeats after {after} period" in found.evidence


def test_chaos_that_ends_is_told_as_a_transient_of_the_orbit_after_it(one_dof):
    """From a third of the starts it ends sooner than it is seen to be chaos."""
    starts = ([s * 1e-6, 0.0] for s in range(24))
    found = next(
        a for a in (classify_attractor(one_dof, 35.38, start=s) for s in starts) if a.chaotic_runs
    )
    assert found.orbit is not None and found.orbit.stable
    assert found.chaotic_runs[0].chaotic
    assert "a chaotic transient before" in found.evidence


def test_chaos_that_lasts_is_confirmed_by_a_second_run(one_dof):
    found = classify_attractor(one_dof, 36.0)
    assert found.exponents is not None
    (first,) = found.chaotic_runs
    apart = abs(first.largest - found.exponents.largest)
    assert apart < 4.0 * math.hypot(first.largest_error, found.exponents.largest_error)
    assert "chaotic before, too" in found.evidence


def test_zero_one_test_tells_a_torus_from_the_logistic_map():
    steps = np.arange(1000)
    assert zero_one_test(np.cos(0.3 * steps) + np.cos(math.sqrt(2.0) * steps)) < 0.1
    x = [0.3]
    for _ in steps:
        x.append(3.97 * x[-1] * (1.0 - x[-1]))
    assert zero_one_test(np.array(x)) > 0.9
    assert zero_one_test(np.ones(200)) == 0.0


def test_many_starts_lead_to_distinct_attractors(one_dof):
    found = find_attractors(one_dof, 18.4, starts=16)
    assert sum(share.count for share in found) == 16
    names = [share.attractor.name for share in found]
    assert "period 3" in names and "period 1" in names  # section 3 lists the 1/3 at 18.4 Hz


# sections


@pytest.fixture(scope="module")
def from_35_to_40(one_dof):
    return brute_force(one_dof, (35.0, 40.0), points=6, starts=1, recorded=48)


def test_peaks_of_periodic_columns_lie_on_their_orbits(from_35_to_40):
    periodic = [c for c in from_35_to_40.columns if c.attractor.orbit is not None]
    assert len(periodic) > 3
    for column in periodic:
        orbit = column.attractor.orbit
        assert column.peaks.max() == pytest.approx(orbit.max_abs_displacement, rel=1e-6)
        assert len(np.unique(np.round(column.strobe, 10))) == orbit.period


def test_chaotic_ranges_hold_their_frequencies(from_35_to_40):
    chaotic = {c.frequency_hz for c in from_35_to_40.columns if c.attractor.kind == "chaotic"}
    assert 36.0 in chaotic
    ranges = from_35_to_40.ranges()
    for hz in np.linspace(35.0, 40.0, 6):
        assert any(a <= hz <= b for a, b in ranges) == (hz in chaotic)
    count, total = from_35_to_40.share(35.0, 40.0)
    assert (count, total) == (len(chaotic), 6)


def test_ranges_join_neighbours_only(one_dof):
    flow = FlowMap(one_dof)
    empty = np.empty(0)

    def column(hz: float, kind: str) -> Column:
        attractor = Attractor(flow, hz, kind, np.zeros((1, 2)))
        return Column("up", attractor, empty, empty, empty, empty)

    kinds = ["chaotic", "periodic", "chaotic", "chaotic", "periodic", "chaotic"]
    found = BruteForce("middle", tuple(column(float(k), kind) for k, kind in enumerate(kinds)))
    assert found.ranges() == [(0.0, 0.5), (1.5, 3.5), (4.5, 5.0)]


def test_sections_of_a_subharmonic_have_its_points(one_dof):
    motion = simulate(one_dof, 50.0, periods=40, transient=1500)
    y, v = stroboscopic_section(motion)
    assert len(set(zip(np.round(y, 9), np.round(v, 6), strict=True))) == 2
    phase, speed = impact_section(motion)
    assert len(phase) == 20  # one impact in two periods
    np.testing.assert_allclose(phase, phase[0], atol=1e-3)
    np.testing.assert_allclose(speed, speed[0], rtol=1e-5)


# basins and manifolds


def test_cells_agree_with_their_classification(at_50_hz):
    assert at_50_hz.undecided == 0.0
    assert (at_50_hz.checked, at_50_hz.wrong) == (24, 0)
    (basin,) = at_50_hz.basins
    assert basin.attractor.name == "period 2"
    assert basin.share == 1.0 and basin.integrity == pytest.approx(0.5, abs=0.04)


def test_phases_are_those_that_a_simulation_has(one_dof, plane, at_50_hz):
    attractor = at_50_hz.attractors[0]
    flow = attractor.flow
    states = plane.states((16, 16))
    phases = np.linspace(0.0, 2000.0 * np.pi, 1001)
    for row, column in [(0, 0), (3, 9), (8, 8), (12, 2), (15, 15), (6, 4)]:
        start = flow.to_state(states[row, column])
        end = flow.shoot(start[None], phases, 100.0 * np.pi, chained=True).ends[-1]
        away = np.linalg.norm(attractor.states - end, axis=1)
        assert int(np.argmin(away)) == at_50_hz.phases[row, column]
        assert away.min() < 1e-6 * away.max()


@pytest.mark.slow
def test_stable_manifold_separates_the_phases(one_dof, plane):
    saddle = solve_orbit(one_dof, 50.0)
    assert not saddle.stable
    pieces = stable_manifold(saddle, plane, max_points=1200)
    flow = saddle.problem.flow
    width = np.array([np.ptp(plane.x_range), np.ptp(plane.y_range)])
    for piece in pieces:  # the map takes the curve to itself
        tree = cKDTree(piece / width)
        for point in piece[20::100]:
            start = plane.origin + point[0] * plane.x + point[1] * plane.y
            image = simulate(flow, 50.0, periods=2, start=start).end
            place = plane.coordinates(image[None])[0][0]
            assert tree.query(place / width)[0] < 0.004


def test_points_of_a_stable_manifold_lie_on_the_edge_between_the_phases(one_dof, plane):
    width = np.array([np.ptp(plane.x_range), np.ptp(plane.y_range)])

    def phase(point: np.ndarray) -> bool:
        start = plane.origin + point[0] * plane.x + point[1] * plane.y
        ends = simulate(one_dof, 50.0, periods=2, start=start, transient=300).strobe
        return bool(ends[0, 0] > ends[1, 0])

    for piece in stable_manifold(solve_orbit(one_dof, 50.0), plane, max_points=600):
        assert len(piece) == 300
        for k in range(10, 299, 40):
            along = (piece[k + 1] - piece[k - 1]) / width
            across = np.array([-along[1], along[0]]) / np.linalg.norm(along) * width
            assert phase(piece[k] + 1e-8 * across) != phase(piece[k] - 1e-8 * across)


def test_two_stable_orbits_share_the_plane_and_unstable_ones_sit_on_the_edge():
    from nldyn.base.resources import example
    from nldyn.scene.build import build_system
    from nldyn.scene.read import load_scene

    system = build_system(load_scene(example("two_dof_xi_0.01.toml")))
    plane = StatePlane.at_interface(system, (-3e-5, 1e-5), (-0.006, 0.006))
    told = []
    found = basins(
        system, 22.8, plane, shape=(10, 10), starts=12, checks=10,
        progress=lambda done, total: told.append((done, total)),
    )  # fmt: skip
    work = 10 * 12 + 100 + 10 * 10  # motions count as ten cells
    assert told[:12] == [(10 * done, work) for done in range(1, 13)]
    assert told[12] == (220, work) and told[-1][0] == told[-1][1] >= work
    assert found.wrong == 0 and found.undecided == 0.0
    impacts_of = sorted(a.orbit.impacts for a in found.attractors)
    assert impacts_of == [1, 2]  # branches (c) and (a) of Figure 4
    points, saddles = basin_edge(found, 5)
    assert saddles and not any(saddle.stable for saddle in saddles)
    flow = found.attractors[0].flow
    targets = [target_of(attractor) for attractor in found.attractors]
    sides = np.array([[1, 0], [-1, 0], [0, 200], [0, -200], [1, 200], [-1, 200]])
    steps = np.concatenate([size * sides for size in (1e-11, 1e-10, 1e-9)])
    for point in points:  # the edge is folded: any neighbourhood holds both basins
        nearby = point + steps
        starts = plane.origin + nearby[:, :1] * plane.x + nearby[:, 1:] * plane.y
        reached = settle(flow, 2.0 * np.pi * 22.8, targets, 500, flow.to_state(starts)).labels
        assert set(reached) == {0, 1}


@pytest.mark.parametrize("ratio", ["0.01", "0.001"])
def test_of_the_two_stable_branches_below_23_hz_one_is_left_at_23_hz(ratio):
    from nldyn.base.resources import example
    from nldyn.scene.build import build_system
    from nldyn.scene.read import load_scene

    system = build_system(load_scene(example(f"two_dof_xi_{ratio}.toml")))
    for hz, impacts_of in ((22.8, {1, 2}), (23.0, {2})):
        found = [share.attractor for share in find_attractors(system, hz, starts=12)]
        assert {a.period for a in found} == {1}
        assert {a.orbit.impacts for a in found if a.orbit} == impacts_of


def test_neighbourhood_of_an_orbit_leads_to_it(one_dof):
    attractor = classify_attractor(one_dof, 25.3)
    target = target_of(attractor)
    assert target.shapes is not None
    flow = attractor.flow
    rng = np.random.default_rng(7)
    lower = np.linalg.cholesky(target.shapes[0])
    phases = np.linspace(0.0, 1600.0 * np.pi, 801)
    for direction in rng.standard_normal((20, 2)):
        start = target.states[0] + 0.99 * np.linalg.solve(
            lower.T, direction / np.linalg.norm(direction)
        )
        assert target.reached(start[None])[0] == 0
        end = flow.shoot(start[None], phases, 2.0 * np.pi * 25.3, chained=True).ends[-1]
        assert np.linalg.norm(end - target.states[0]) < 1e-6 * np.linalg.norm(target.states[0])


# noise and wear


def test_mean_contact_force_balances_the_spring(one_dof):
    for hz, period in ((25.3, 1), (50.0, 2)):
        orbit = solve_orbit(one_dof, hz, period)
        mean = float(harmonics(orbit).phasor[0].real)
        found = contact_measures(orbit)
        assert found.impulse_rate == pytest.approx(-16877.0 * mean, rel=1e-6)
        assert found.impact_rate == pytest.approx(orbit.impacts * hz / period)
        depth = orbit.max_penetration
        power = 5.17e9 * depth**2.5 / 2.5 * found.impact_rate  # all impacts of one depth
        assert found.impact_power == pytest.approx(power, rel=1e-3)
        assert found.peak_force == pytest.approx(5.17e9 * depth**1.5, rel=1e-5)


def test_impulses_on_a_rigid_stop_balance_the_spring_and_their_losses_the_excitation():
    orbit = solve_orbit(make_one_dof(stops=[RigidStop("middle", 0.7)]), 25.3)
    found, h = contact_measures(orbit), orbit.history(100000)
    assert found.impulse_rate == pytest.approx(-16877.0 * harmonics(orbit).phasor[0].real, rel=1e-5)
    speed, omega = h.modal_velocity[:-1, 0] / math.sqrt(2.48), orbit.omega
    push = 4.92e-6 * omega**2 * np.cos(omega * h.time[:-1])
    damping = 2.0 * 0.0142 * math.sqrt(16877.0 * 2.48)
    taken = np.mean(push * speed) - np.mean(damping * speed**2)
    assert found.loss_power == pytest.approx(taken, rel=1e-3)
    assert found.impact_power == pytest.approx(found.loss_power / (1.0 - 0.7**2), rel=1e-9)


def test_rms_force_agrees_with_a_fine_history(one_dof):
    orbit = solve_orbit(one_dof, 25.3)
    force = orbit.history(200000).force[:-1, 0]
    found = contact_measures(orbit)
    assert found.rms_force == pytest.approx(math.sqrt(np.mean(force**2)), rel=1e-4)
    assert found.contact_share == pytest.approx(np.mean(force > 0.0), rel=1e-3)


def test_power_of_excitation_is_lost_in_damping_and_contact():
    system = make_one_dof(stops=[Stop("middle", 5.17e9, dissipation=5.0)])
    orbit = solve_orbit(system, 25.3)
    h = orbit.history(100000)
    omega = orbit.omega
    y1 = h.modal_velocity[:-1, 0] / math.sqrt(2.48)
    push = 4.92e-6 * omega**2 * np.cos(omega * h.time[:-1])
    damping = 2.0 * 0.0142 * math.sqrt(16877.0 * 2.48)
    lost = contact_measures(orbit).loss_power
    assert lost > 0.0
    assert np.mean(push * y1) == pytest.approx(np.mean(damping * y1**2) + lost, rel=1e-5)


def test_measures_of_chaos_and_of_branches_fit_one_table(one_dof, from_35_to_40):
    attractors = [column.attractor for column in from_35_to_40.columns]
    table = measures_table([solve_orbit(one_dof, 37.2), *attractors], periods=64)
    assert np.all(np.diff(table["frequency_hz"]) >= -1e-9)
    assert "chaotic" in table["attractor"]
    assert np.all(table["peak_force"] > table["rms_force"])


def test_a_diagram_and_a_branch_are_measured_as_they_are(one_dof, from_35_to_40):
    branch = continue_branch(solve_orbit(one_dof, 50.0, 2), (49.9, 50.1))
    table = measures_table([branch, from_35_to_40], periods=64)
    count = len(branch.points) + len(from_35_to_40.columns)
    assert len(table["frequency_hz"]) == count
    alone = measures_table(from_35_to_40, periods=64)
    attractors = [column.attractor for column in from_35_to_40.columns]
    listed = measures_table(attractors, periods=64)
    np.testing.assert_array_equal(alone["peak_force"], listed["peak_force"])
    assert measures_table(branch)["peak_force"].size == len(branch.points)


def test_harmonics_of_orbits_are_those_of_their_spectra(one_dof):
    orbits = [solve_orbit(one_dof, 25.3), solve_orbit(one_dof, 50.0, 2)]
    table = spectra_table(orbits, orders=4)
    for index, orbit in enumerate(orbits):
        lines = harmonics(orbit)
        assert table["mean"][index] == pytest.approx(lines.phasor[0].real, rel=1e-6)
        for order in range(1, 5):
            said = lines.amplitude[order * orbit.period]
            assert table[f"order_{order}"][index] == pytest.approx(said, rel=1e-4)
        others = np.delete(lines.amplitude, np.arange(5) * orbit.period)
        rest = math.sqrt(0.5 * float(others @ others))
        assert table["rest"][index] == pytest.approx(rest, rel=1e-3)
    assert table["attractor"].tolist() == ["period 1", "period 2"]


def test_harmonics_of_every_attractor_hold_its_whole_power(one_dof, from_35_to_40):
    with ThreadPoolExecutor(1) as pool:
        table = spectra_table(from_35_to_40, orders=3, periods=64, executor=pool)
    assert len(table["frequency_hz"]) == len(from_35_to_40.columns)
    assert np.all(np.diff(table["frequency_hz"]) >= 0.0)
    chaotic = np.flatnonzero(table["attractor"] == "chaotic")[0]
    hz = table["frequency_hz"][chaotic]
    column = next(
        c
        for c in from_35_to_40.columns  # up and down
        if c.attractor.name == "chaotic" and math.isclose(c.frequency_hz, hz)
    )
    y = column.attractor.motion(64).history(64 * 1000).displacement["middle"][:-1]
    lines = sum(table[f"order_{k}"][chaotic] ** 2 for k in (1, 2, 3))
    power = 0.5 * lines + table["rest"][chaotic] ** 2
    assert power == pytest.approx(float(np.var(y)), rel=1e-3)
    assert table["rest"][chaotic] > 0.1 * math.sqrt(power)  # chaos lies between the lines


def test_bands_of_a_spectra_map_hold_the_lines_of_orbits(one_dof):
    orbits = [solve_orbit(one_dof, 50.0, 2), solve_orbit(one_dof, 25.3)]
    found = spectra_map(orbits, orders=4, parts=6)
    assert found.attractor.tolist() == ["period 1", "period 2"]
    for rms, orbit in zip(found.rms, orbits[::-1], strict=True):
        lines = harmonics(orbit, orders=4)
        expected = np.zeros(25)
        expected[:: 6 // orbit.period] = lines.amplitude / math.sqrt(2.0)
        expected[0] *= math.sqrt(2.0)  # the mean has no twin
        np.testing.assert_allclose(rms, expected, atol=1e-5 * expected.max())
    assert spectra_map(orbits[0], orders=4, parts=6).rms.shape == (1, 25)  # one may stand alone


def test_bands_of_a_chaotic_motion_hold_its_power_at_their_places(one_dof):
    motion = simulate(one_dof, 36.0, periods=65, transient=300)  # no line lies between two bands
    found = spectra_map([motion], orders=2, parts=3)
    y = motion.history(65 * 1000).displacement["middle"][:-1]
    total = float(found.rms[0] @ found.rms[0] + found.rest[0] ** 2)
    assert total == pytest.approx(float(np.mean(y * y)), rel=1e-3)
    power = np.abs(np.fft.fft(y) / y.size) ** 2
    orders = np.abs(np.fft.fftfreq(y.size, 1.0 / 1000.0))  # 1000 samples in a period
    for order, rms in zip(found.order, found.rms[0], strict=True):
        here = np.abs(orders - order) < 1.0 / 6.0
        assert rms == pytest.approx(math.sqrt(power[here].sum()), rel=2e-3)
    assert found.rms[0, 1] > 0.1 * found.rms[0, 3]  # between the lines


def test_spectra_map_is_drawn_in_columns_of_the_motions(one_dof):
    orbits = [solve_orbit(one_dof, 50.0, 2), solve_orbit(one_dof, 50.0), solve_orbit(one_dof, 52.0)]
    found = spectra_map(orbits, orders=3, parts=2)
    ax = plot_spectra(found)
    columns = [mesh.get_coordinates() for mesh in ax.collections]
    ends = [[49.0, 50.0], [50.0, 51.0], [51.0, 53.0]]
    np.testing.assert_allclose([c[0, :, 0] for c in columns], ends)
    assert columns[2][:, 0, 1].max() == pytest.approx(3.25 * 52.0)
    assert plot_spectra(spectra_map(orbits[2])).get_xlim() == pytest.approx((51.5, 52.5))
    assert ax.figure.axes[1].get_ylabel() == "r.m.s. displacement in a band (µm)"
    assert plot_spectra(found, scale="order").get_ylim() == (0.0, 3.25)
    for bad, text in (
        ({"found": spectra_map([])}, "no motion"),
        ({"found": found, "decades": 0.0}, "decades must lie"),
        ({"found": found, "decades": 400}, "decades must lie"),
        ({"found": found, "scale": "time"}, "scale must be one of"),
        ({"found": found, "unit": "km"}, "unit must be one of"),
    ):
        with pytest.raises(SystemModelError, match=text):
            plot_spectra(**bad)


def test_wear_is_drawn_by_kind_and_measure(one_dof, from_35_to_40):
    table = measures_table([from_35_to_40, solve_orbit(one_dof, 50.0)], periods=64)
    ax = plot_wear(table)
    assert ax.get_ylabel() == "contact force (N)"
    assert {"periodic, peak force", "chaotic, r.m.s. force"} <= set(labels_of(ax))
    drawn = np.sort(np.concatenate([line.get_ydata() for line in ax.lines]))
    expected = np.sort(np.concatenate([table["peak_force"], table["rms_force"]]))
    np.testing.assert_array_equal(drawn, expected)
    hollow = [line for line in ax.lines if line.get_markerfacecolor() == "white"]
    np.testing.assert_allclose([line.get_xdata() for line in hollow], 50.0)  # it is unstable
    assert len(hollow) == 2
    for given, said in (
        (["speed"], "measures must be of periods, peak_force"),
        (["peak_force", "impact_power"], "names of one unit"),
        ([], "names of one unit"),
    ):
        with pytest.raises(SystemModelError, match=said):
            plot_wear(table, measures=given)
    with pytest.raises(SystemModelError, match="table has no column 'attractor'"):
        plot_wear({"frequency_hz": np.ones(1)})


def test_long_motions_of_rotations_are_drawn_and_listed_in_rad(one_dof):
    """The numbers stay as they are: rad stands for m, and N m for N."""
    turning = replace(one_dof, rotations=frozenset(one_dof.interfaces))
    straight, turned = (
        brute_force(system, (20.0, 21.0), points=2, directions=["up"])
        for system in (one_dof, turning)
    )
    assert plot_brute_force(turned).get_ylabel() == "largest rotation of middle (µrad)"
    assert plot_brute_force(turned, quantity="impact speed").get_ylabel().endswith("(mrad/s)")
    assert plot_wear(measures_table(turned)).get_ylabel() == "contact force (N m)"
    tables = measures_table(straight), measures_table(turned)
    np.testing.assert_array_equal(tables[0]["peak_force"], tables[1]["peak_force"])
    assert (spectra_map(straight).unit, spectra_map(turned).unit) == ("m", "rad")
    orbit = solve_orbit(turning, 20.0)
    assert contact_measures(orbit).units["fastest_impact"] == "rad/s"
    motion = simulate(turning, 20.0, 4, transient=100)
    assert plot_section(motion).get_xlabel() == "rotation of middle (µrad)"
    assert plot_section(motion, stop=0).get_ylabel() == "impact speed (mrad/s)"


def test_a_sweep_has_no_harmonics(one_dof):
    with pytest.raises(SystemModelError, match="needs a motion at constant frequency"):
        spectra_table([sweep(one_dof, (20.0, 21.0), 5.0)])


def test_power_spectrum_holds_the_variance(one_dof):
    motion = simulate(one_dof, 36.0, periods=512, transient=300)
    hz, density = power_spectrum(motion)
    y = motion.history(64 * 512).displacement["middle"]
    assert np.sum(density) * hz[1] == pytest.approx(float(np.var(y)), rel=0.15)


def test_spectrum_at_any_point_is_that_of_its_modes():
    system = System.from_modal(
        [13.1, 40.0], {"middle": [0.6, 0.3]}, modal_damping=0.02,
        excitation=[HarmonicForce("middle", 1.0)],
    )  # fmt: skip
    orbit = solve_orbit(system, 20.0)
    row = np.array([0.1, -0.7])
    steady = system.response(orbit.omega).amplitudes[0]
    displacement = (system.linear.right @ steady)[:2]
    assert harmonics(orbit, row).phasor[1] == pytest.approx(row @ displacement, rel=1e-9)
    with pytest.raises(SystemModelError, match="displacements of 2 modes"):
        harmonics(orbit, np.ones(3))


# pictures and bad input


def test_pictures_show_what_was_found(one_dof, from_35_to_40, at_50_hz, tmp_path):
    ax = plot_brute_force(from_35_to_40)
    labels = [text.get_text() for text in ax.get_legend().get_texts()]
    assert "chaotic range" in labels and "periodic motion" in labels
    ax = plot_basins(at_50_hz, times=True)
    labels = [text.get_text() for text in ax.get_legend().get_texts()]
    assert labels[0].startswith("1: 100.0 ± 0.5 %\nperiod 2, 1 impact, ")
    assert [label.partition(":")[0] for label in labels[1:]] == ["phase 0", "phase 1"]
    motion = simulate(one_dof, 36.0, periods=20)
    assert plot_section(motion).get_xlabel() == "displacement of middle (µm)"
    assert len(plot_sweep(sweep(one_dof, (20.0, 21.0), 5.0)).lines) == 1
    ax.figure.savefig(tmp_path / "basins.png")


def test_shares_are_those_of_the_possible_states_with_the_error_of_a_count(at_50_hz):
    labels = np.zeros((16, 16), dtype=int)
    labels[:, 12:] = -2  # impossible: 192 cells are left
    labels[:, 6:12] = -1
    found = replace(at_50_hz, labels=labels)
    assert found.undecided == 0.5
    (basin,) = found.basins
    assert (basin.share, basin.uncertainty) == (0.5, pytest.approx(0.5 / math.sqrt(196)))
    assert "25.0 % of the plane lies behind a rigid stop" in found.report()


def test_a_plane_of_two_displacements_has_them_and_changes_the_rest_least():
    system = System.from_modal([1.0, 2.0, 3.0], {"a": [1.0, 2.0, 3.0], "b": [1.0, 0.0, -1.0]})
    origin = np.arange(1.0, 7.0)
    a, b = ("displacement", "a"), ("displacement", "b")
    plane = StatePlane.spanned_by(system, a, b, (-1.0, 1.0), (2.0, 4.0), origin=origin)
    states = plane.states((2, 4))
    x, y = plane.axes((2, 4))
    assert states[..., :3] @ [1.0, 2.0, 3.0] == pytest.approx(np.tile(x, (2, 1)))
    assert states[..., :3] @ [1.0, 0.0, -1.0] == pytest.approx(np.tile(y[:, None], 4))
    kept = np.cross([1.0, 2.0, 3.0], [1.0, 0.0, -1.0])  # no direction of either interface
    assert states[..., :3] @ kept == pytest.approx(float(origin[:3] @ kept))
    assert np.all(states[..., 3:] == origin[3:])


def test_no_motion_begins_behind_a_rigid_stop():
    system = System.from_matrices(
        [[1.0]], [[1.0]], {"x": [-1.0]}, modal_damping=0.1,
        stops=[RigidStop("x", 0.5, gap=0.5, direction=-1)],
    )  # fmt: skip
    assert simulate(system, 1.0, 1, start=[0.5, 1.0]).failure == ""
    for run in (partial(simulate, periods=1), classify_attractor, lyapunov_exponents):
        with pytest.raises(SystemModelError, match="start lies behind a rigid stop"):
            run(system, 1.0, start=[0.51, -1.0])


def test_basins_are_drawn_in_units_of_their_size(at_50_hz):
    ax = plot_basins(at_50_hz)
    assert ax.get_xlabel() == "displacement of middle (µm)"
    assert ax.get_ylabel() == "velocity of middle (mm/s)"
    assert ax.xaxis.get_major_formatter()(-2e-4) == "-200"
    assert ax.yaxis.get_major_formatter()(0.02) == "20"
    low, high = at_50_hz.basins[0].attractor.span
    texts = [text.get_text() for text in ax.get_legend().get_texts()]
    assert f"{1e6 * low:.3g} to {1e6 * high:.3g} µm at 'middle'" in texts[0]


@pytest.mark.parametrize(
    ("quantity", "said"),
    [
        ("peak", "largest displacement of middle (µm)"),
        ("strobe", "displacement of middle at forcing phase zero (µm)"),
        ("impact speed", "impact speed (mm/s)"),
        ("impact phase", "forcing phase of impacts (°)"),
    ],
)
def test_motions_are_drawn_in_the_quantity_asked_for(from_35_to_40, quantity, said):
    ax = plot_brute_force(from_35_to_40, quantity=quantity)
    assert ax.get_ylabel() == said
    drawn = np.concatenate([line.get_ydata() for line in ax.lines])
    fields = {"peak": "peaks", "impact speed": "impact_speed", "impact phase": "impact_phase_deg"}
    columns = [getattr(c, fields.get(quantity, quantity)) for c in from_35_to_40.columns]
    scale = {"impact speed": 1e3, "impact phase": 1.0}.get(quantity, 1e6)
    np.testing.assert_allclose(np.sort(drawn), np.sort(np.concatenate(columns)) * scale)


def test_stroboscopic_points_lie_on_the_curves_of_their_branch(one_dof):
    branch = continue_branch(solve_orbit(one_dof, 50.0, 2), (49.0, 50.5))
    hz, values, stable = strobe_curves(branch, "middle")
    assert values.shape == (hz.size, 2) and stable.all()
    found = brute_force(one_dof, (49.5, 50.0), points=2, directions=["up"], recorded=8)
    for column in found.columns:
        order = np.argsort(hz)
        lines = [np.interp(column.frequency_hz, hz[order], y[order]) for y in values.T]
        off = np.abs(column.strobe[:, None] - np.array(lines)).min(axis=1)
        assert off.max() < 1e-3 * np.ptp(lines)
    ax = plot_brute_force(found, quantity="strobe", diagram=[branch])
    assert {"1/2 subharmonic", "periodic motion"} <= set(labels_of(ax))
    with pytest.raises(SystemModelError, match="branches have no impact speed to draw"):
        plot_brute_force(found, quantity="impact speed", diagram=[branch])
    with pytest.raises(SystemModelError, match="quantity must be one of peak, strobe"):
        plot_brute_force(found, quantity="speed")


def test_impacts_are_drawn_by_phase_and_speed(one_dof):
    motion = simulate(one_dof, 50.0, periods=8, transient=600)
    ax = plot_section(motion, stop=0)
    phase, speed = impact_section(motion)
    np.testing.assert_allclose(ax.lines[0].get_xdata(), phase)
    np.testing.assert_allclose(ax.lines[0].get_ydata(), speed * 1e3)
    assert ax.get_xlabel() == "forcing phase of impacts on middle (°)"
    assert ax.get_ylabel() == "impact speed (mm/s)"
    with pytest.raises(SystemModelError, match="stop must be a whole number from 0 to 0"):
        plot_section(motion, stop=3)


def labels_of(ax):
    return [text.get_text() for text in ax.get_legend().get_texts()]


def test_a_sweep_is_labelled_with_the_rate_it_was_asked_for(one_dof):
    up, down = sweep(one_dof, [(20.0, 21.0), (21.0, 20.0)], 5.0)
    assert (up.rate_hz_per_s, down.rate_hz_per_s) == (5.0, -5.0)
    steady = simulate(one_dof, 20.0, 10)
    said = ["run-up, 5 Hz/s", "run-down, 5 Hz/s", "constant 20 Hz"]
    assert labels_of(plot_sweep([up, down, steady])) == said
    with pytest.raises(SystemModelError, match="entry 1 is shorter than an excitation period"):
        plot_sweep([up, sweep(one_dof, (20.0, 20.01), 5.0)])


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (
            lambda: AttractorOptions(periods=10**29),
            "classify_attractor: periods must be a whole number",
        ),
        (
            lambda: AttractorOptions(max_period=10**15),
            "classify_attractor: max_period must be a whole",
        ),
        (
            lambda: AttractorOptions(transient=10**29),
            "classify_attractor: transient must be a whole",
        ),
        (
            lambda: AttractorOptions(confirmations=10**29),
            "classify_attractor: confirmations must be",
        ),
        (lambda: OrbitSearchOptions(starts=10**15), "search: starts must be a whole number"),
        (lambda: OrbitSearchOptions(transient=10**15), "search: transient must be a whole number"),
        (lambda: ExploreOptions(starts=10**15), "explore: starts must be a whole number"),
        (lambda: ExploreOptions(unstable_period=10**15), "explore: unstable_period must be"),
        (lambda: ExploreOptions(doubled_points=10**15), "explore: doubled_points must be"),
        (lambda: ContinuationOptions(max_points=10**15), "continuation: max_points must be"),
    ],
)
def test_effort_beyond_all_bounds_is_refused(call, said):
    with pytest.raises(SystemModelError, match=f"{said}.* from .* to "):
        call()


@pytest.mark.parametrize("take", [contact_measures, impact_section, lambda m: measures_table([m])])
def test_a_system_without_stops_is_told_so(take):
    with pytest.raises(SystemModelError, match="the system has no stops"):
        take(simulate(make_one_dof(stops=[]), 20.0, 2))


def small_plane(system):
    return StatePlane.at_interface(system, (-2e-4, 0.0), (-0.05, 0.05))


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (lambda s: brute_force(s, (40.0, 30.0)), "range"),
        (lambda s: brute_force(s, (30.0, 40.0), directions=["left"]), "must be one of up, down"),
        (lambda s: brute_force(s, (30.0, 40.0), directions=[]), "needs a direction or random"),
        (
            lambda s: StatePlane.at_interface(s, (1.0, 0.0), (0.0, 1.0)),
            "x_range must be two ascending",
        ),
        (
            lambda s: StatePlane.at_interface(s, (0, 1), (0, 1), interface="top"),
            "unknown interface",
        ),
        (lambda s: StatePlane(np.zeros(2), np.ones(2), np.ones(2), (0, 1), (0, 1)), "parallel"),
        (lambda s: stable_manifold(solve_orbit(s, 25.3), small_plane(s)), "no saddle: 0 of its"),
        (
            lambda s: stable_manifold(solve_orbit(s, 25.3), None),
            "plane must be a StatePlane, got None",
        ),
        (lambda s: basin_edge(None), "found must be a Basins, got None"),
        (lambda s: measures_table([None]), "entry 0 must be an Orbit or a Motion or an Attractor"),
        (lambda s: measures_table([simulate(s, 20.0, 1)], stop=1), "stop must be a whole number"),
        (lambda s: impact_section(simulate(s, 20.0, 1), 3), "stop must be a whole number"),
        (lambda s: contact_measures(solve_orbit(s, 25.3), stop=1), "stop must be a whole number"),
        (lambda s: brute_force(s, (30.0, 40.0), directions=None), "directions must be a Sequence"),
        (lambda s: brute_force(s, (30.0, 40.0), executor=2), "executor must be an Executor"),
        (lambda s: find_attractors(s, 25.3, executor=2), "executor must be an Executor"),
        (lambda s: classify_attractor(s, 25.3, options={}), "options must be an AttractorOptions"),
        (lambda s: impacts(None), "motion must be a Motion or an Orbit, got None"),
        (lambda s: StatePlane.at_interface(s, 1.0, (0.0, 1.0)), "displacement must be a Sequence"),
        (lambda s: StatePlane.at_interface(s, (0.0, 1.0), None), "velocity must be a Sequence"),
        (lambda s: basins(s, 50.0, None), "plane must be a StatePlane, got None"),
        (lambda s: basins(s, 50.0, small_plane(s), shape=5), "basins: shape must be a Sequence"),
        (lambda s: small_plane(s).states(4), "plane: shape must be a Sequence"),
        (lambda s: basins(s, 50.0, small_plane(s), executor=2), "executor must be an Executor"),
        (lambda s: basins(s, 50.0, small_plane(s), attractors=[1]), "entry 0 must be an Attractor"),
        (lambda s: simulate(s, 20.0, 1, start=[1e300, 0.0]), "the motion at 20 Hz failed at once"),
        (lambda s: sweep(s, (20.0, 21.0), 1.0, start=[1e300, 0.0]), "sweep from 20 Hz failed"),
        (lambda s: simulate(s, 20.0, 1).states(0.01), r"a list of times, got shape \(\)"),
        (lambda s: simulate(s, 20.0, 1).frequency_hz(1e9), "time must lie between 0 and 0.05 s"),
        (lambda s: simulate(s, 20.0, 1).frequency_hz(np.nan), "time has an entry that is not"),
    ],
)
def test_bad_input_is_one_sentence(one_dof, call, said):
    with pytest.raises((SystemModelError, ConvergenceError), match=said):
        call(one_dof)


def test_basins_take_attractors_of_their_own_system_and_frequency_only(one_dof):
    def of(system, hz):
        found = classify_attractor(make_one_dof(**system), hz)
        return basins(
            one_dof, 50.0, small_plane(one_dof), shape=(2, 2), starts=1, checks=1,
            attractors=[found],
        )  # fmt: skip

    assert [a.name for a in of({}, 50.0).attractors] == ["period 2"]  # equal, not the same object
    with pytest.raises(SystemModelError, match=r"entry 0 is one at 25\.3 Hz, but .* at 50 Hz"):
        of({}, 25.3)
    for other in ({"stops": [Stop("middle", stiffness=4e9)]}, {"stops": []}):
        with pytest.raises(SystemModelError, match="entry 0 is one of another system"):
            of(other, 50.0)
