"""Self-excited motions against closed forms and an integration that shares no code with them."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from nldyn import (
    ConvergenceError,
    HarmonicForce,
    Stop,
    System,
    SystemModelError,
    continue_branch,
    limit_cycle,
    load,
    save,
    solve_orbit,
)
from nldyn.bifurcations.just_sticking import just_sticks
from nldyn.branches.endings import Ending, has_ending
from nldyn.io import CheckpointFile
from nldyn.system import CubicDamper, DryFriction, Friction


def on_belt(
    speed, *, mass=1.0, stiffness=1.0, force=1.0, law=(0.3, 0.4, 0.05), damping=0.0, cubic=0
):
    friction = DryFriction("block", force, Friction(*law, base_speed=speed))
    return System.from_matrices(
        [[mass]],
        [[stiffness]],
        {"block": [1.0]},
        damping=[[damping]],
        dampers=[friction, *([CubicDamper("block", cubic)] if cubic else [])],
    )


@pytest.mark.parametrize("speed", [0.02, 0.25])
def test_stick_slip_with_a_drop_at_once_has_its_closed_form(speed):
    """It slips where k x = μ₀ N, at the speed of the belt, swings about μ N, and sticks again."""
    mass, stiffness, force = 2.0, 8.0, 3.0
    block = on_belt(speed, mass=mass, stiffness=stiffness, force=force, law=(0.3, 0.5, None))
    drop, rate = 0.2 * force / stiffness, math.sqrt(stiffness / mass)
    slips = 2.0 / rate * (math.pi - math.atan(drop * rate / speed))
    sticks = 2.0 * drop / speed
    found = limit_cycle(block, [0.0, math.sqrt(mass) * speed])  # as it sticks
    assert found.duration == pytest.approx(slips + sticks, rel=1e-9)
    top = 0.3 * force / stiffness + math.hypot(drop, speed / rate)
    assert found.max_abs_displacement == pytest.approx(top, rel=1e-9)
    assert abs(found.multipliers[0]) < 1e-7  # what sticks forgets
    assert found.multiplier_along == pytest.approx(1.0, abs=1e-7)
    begins = found.duration - math.acos(drop / math.hypot(drop, speed / rate)) / rate
    slipping = found.history_at(np.array([found.omega * begins]))
    assert slipping.displacement["block"][0] == pytest.approx(0.5 * force / stiffness, rel=1e-8)


def test_stick_slip_with_a_drop_at_once_ends_where_the_block_just_gets_as_fast_as_the_belt():
    damping, drop = 0.04, 0.1
    rate = math.sqrt(1.0 - 0.25 * damping**2)

    def missing(belt):
        """By how much the fastest speed, a swing after it slips, is more than the belt's."""
        place = drop - damping * belt
        other = (belt + 0.5 * damping * place) / rate

        def moved(t):
            faded, c, s = math.exp(-0.5 * damping * t), math.cos(rate * t), math.sin(rate * t)
            speed = rate * (other * c - place * s) - 0.5 * damping * (place * c + other * s)
            return faded * (place * c + other * s), faded * speed

        top = brentq(lambda t: moved(t)[0] + damping * moved(t)[1], 4.0, 7.0, xtol=1e-14)
        return moved(top)[1] - belt

    start = limit_cycle(on_belt(0.15, law=(0.3, 0.4, None), damping=damping), [0.0, 0.15])
    branch = continue_branch(start, (0.1, 0.3), parameter="base_speed")
    last = branch.points[np.argmax(branch.values)]
    assert has_ending(branch.stop_reasons, Ending.JUST_STICKS)
    assert branch.values.max() == pytest.approx(brentq(missing, 0.15, 0.25), rel=1e-5)
    assert last.friction[0].stuck > 0.05  # it would stick for so long
    assert just_sticks(start) is None


STRIBECK = Friction(0.3, 0.4, 0.05)


def slip(speed, start, *, law=STRIBECK, damping=0.0):
    """Time, state and integral of the trace from a state on to where the block is so fast again."""

    def rate(_, y):
        behind = speed - y[1]
        fall = law.adhesion / law.fading_speed * math.exp(-behind / law.fading_speed)
        return [y[1], float(law.at(behind)) - y[0] - damping * y[1], fall - damping]

    def as_fast(t, y):
        return speed - y[1] if t > 1.0 else 1.0

    as_fast.terminal, as_fast.direction = True, -1
    found = solve_ivp(
        rate, (0.0, 30.0), [*start, 0.0], "DOP853", rtol=3e-14, atol=1e-15, events=as_fast
    )
    return found.t[-1], found.y[:, -1]


@pytest.mark.parametrize("fading", [0.05, 1e-3])
def test_stick_slip_by_stribecks_curve_agrees_with_an_integration(fading):
    law, speed = Friction(0.3, 0.4, fading), 0.1
    time, state = slip(speed, [0.4, speed], law=law)
    found = limit_cycle(on_belt(speed, law=(0.3, 0.4, fading)))
    assert found.duration == pytest.approx(time + (0.4 - state[0]) / speed, rel=1e-9)
    assert found.self_excited
    assert found.stable
    assert abs(found.multipliers[0]) < 1e-6  # what sticks forgets
    assert found.multiplier_along == pytest.approx(1.0, abs=1e-9)


@pytest.fixture(scope="module")
def family():
    start = limit_cycle(on_belt(0.1, damping=0.04))
    return continue_branch(start, (0.05, 1.0), parameter="base_speed")


def test_a_branch_over_the_speed_of_the_belt_follows_the_frequency(family):
    for orbit in (family.points[0], family.at(0.3)[0]):
        speed = orbit.system.sliders[0].friction.base_speed
        slips_at = 0.4 - 0.04 * speed
        time, state = slip(speed, [slips_at, speed], damping=0.04)
        assert orbit.duration == pytest.approx(time + (slips_at - state[0]) / speed, rel=1e-8)


def test_sticking_is_lost_where_the_slowest_slip_is_zero_and_the_branch_turns(family):
    lost = family.special_points[0]
    assert lost.kind == "GS"

    def fastest(speed):
        """Top speed in the swing from where it slips, as if nothing stuck, beside the belt's."""

        def rate(_, y):
            return [y[1], 0.3 + 0.1 * math.exp((y[1] - speed) / 0.05) - y[0] - 0.04 * y[1]]

        def top(t, y):
            return rate(t, y)[1] if t > 4.0 else 1.0

        top.terminal, top.direction = True, -1
        start = [0.4 - 0.04 * speed, speed]
        found = solve_ivp(rate, (0.0, 30.0), start, "DOP853", rtol=3e-14, atol=1e-15, events=top)
        return found.y[1, -1] - speed

    begins = brentq(fastest, 0.5, 0.6, xtol=1e-13)
    assert lost.value == pytest.approx(begins, rel=1e-8)
    assert lost.value == pytest.approx(family.values.max(), rel=1e-8)


def test_the_cycle_that_does_not_stick_is_unstable_by_liouvilles_formula(family):
    sticks, slides = family.at(0.4)
    assert (sticks.stable, slides.stable) == (True, False)
    assert slides.friction[0].stuck == 0.0
    start = slides.states(np.zeros(1))[0]

    def rate(_, y):
        fall = math.exp(-(0.4 - y[1]) / 0.05)
        return [y[1], 0.3 + 0.1 * fall - y[0] - 0.04 * y[1], 2.0 * fall - 0.04]

    found = solve_ivp(
        rate, (0.0, slides.duration), [*start, 0.0], "DOP853", rtol=3e-14, atol=1e-15
    ).y[:, -1]
    assert found[:2] == pytest.approx(start, abs=1e-8)
    assert slides.multipliers[0].real == pytest.approx(math.exp(found[2]), rel=1e-8)


def test_a_limit_cycle_shrinks_to_rest_where_friction_falls_as_fast_as_damping_takes(family):
    """2 ζ ω m = (μ₀ - μ) N/v₀ exp(-v/v₀) at the Hopf point."""
    hopf = family.special_points[-1]
    assert hopf.kind == "Hopf"
    exact = 0.05 * math.log(0.1 / 0.05 / 0.04)
    assert abs(math.log(hopf.value / exact)) < min(hopf.error, 1e-5)
    assert "Hopf" in family.stop_reasons[1]


def test_cycles_meet_in_a_fold_with_a_multiplier_of_one():
    block = on_belt(0.6, law=(0.3, 0.5, 0.2), damping=0.02, cubic=0.2)
    branch = continue_branch(limit_cycle(block), (0.6, 0.85), parameter="base_speed")
    _, fold, hopf = branch.special_points
    assert fold.kind == "LP"
    assert fold.orbit.multipliers[0] == pytest.approx(1.0, abs=1e-6)
    assert fold.orbit.friction[0].stuck == 0.0
    start = fold.orbit.states(np.zeros(1))[0]

    def rate(_, y):  # and the trace
        fall = math.exp(-(fold.value - y[1]) / 0.2)
        pull = 0.3 + 0.2 * fall - 0.02 * y[1] - 0.2 * y[1] ** 3
        return [y[1], pull - y[0], fall - 0.02 - 0.6 * y[1] ** 2]

    end = solve_ivp(
        rate, (0.0, fold.orbit.duration), [*start, 0.0], "DOP853", rtol=3e-14, atol=1e-15
    ).y[:, -1]
    assert end[:2] == pytest.approx(start, abs=1e-8)
    assert math.exp(end[2]) == pytest.approx(1.0, abs=1e-6)  # Liouville's formula
    unstable, stable = (orbit for orbit in branch.at(0.72) if orbit.friction[0].stuck == 0.0)
    assert (unstable.stable, stable.stable) == (False, True)
    exact = 0.2 * math.log(0.2 / 0.2 / 0.02)
    assert hopf.value == pytest.approx(exact, rel=1e-7)


def test_multipliers_of_two_blocks_are_those_of_the_whole_map_but_one():
    belt = Friction(0.3, 0.4, 0.2, base_speed=1.2)
    blocks = System.from_matrices(
        np.eye(2),
        [[2.0, -1.0], [-1.0, 2.3]],
        {"first": [1.0, 0.0], "second": [0.0, 1.0]},
        modal_damping=0.002,
        dampers=[DryFriction("first", 5.0, belt), CubicDamper("second", 0.1)],
    )
    found = limit_cycle(blocks)
    whole = np.linalg.eigvals(found.monodromy)
    along = int(np.argmin(np.abs(whole - 1.0)))
    others = np.delete(whole, along)
    assert abs(whole[along] - 1.0) < 1e-6
    assert np.sort_complex(found.multipliers) == pytest.approx(np.sort_complex(others), abs=1e-6)


def test_what_has_no_limit_cycle_is_told():
    free = System.from_matrices([[1.0]], [[1.0]], {"x": [1.0]})
    with pytest.raises(SystemModelError, match="backbone"):
        limit_cycle(free)
    driven = System.from_matrices(
        [[1.0]], [[1.0]], {"x": [1.0]}, modal_damping=0.1, excitation=[HarmonicForce("x", 1.0)]
    )
    with pytest.raises(SystemModelError, match="without excitation"):
        limit_cycle(driven)
    with pytest.raises(ConvergenceError, match="comes to rest"):
        limit_cycle(on_belt(2.0, damping=0.1), [0.1, 0.0])
    cycle = limit_cycle(on_belt(0.1))
    with pytest.raises(SystemModelError, match="found, not given"):
        continue_branch(cycle, (0.1, 0.2))
    forced = solve_orbit(driven, 0.1)
    assert not forced.self_excited
    assert forced.multiplier_along is None


def test_a_branch_is_saved_goes_on_after_an_interruption_and_is_extended(tmp_path):
    start = limit_cycle(on_belt(0.5, damping=0.04), [0.0, 0.5])  # as it sticks
    whole = continue_branch(start, (0.45, 0.6), parameter="base_speed", at=[0.55], name="cycles")
    save(whole, tmp_path / "whole.h5")
    (back,) = load(tmp_path / "whole.h5")
    assert back.name == "cycles"
    assert back.values.tolist() == whole.values.tolist()
    assert back.frequency_hz.tolist() == whole.frequency_hz.tolist()
    assert [mark.kind for mark in back.special_points] == ["GS"]
    assert len(back.requested) == len(whole.requested) == 2
    kept = CheckpointFile(tmp_path / "kept.h5")
    short = continue_branch(start, (0.45, 0.54), parameter="base_speed", checkpoint=kept)
    again = continue_branch(start, (0.45, 0.54), parameter="base_speed", checkpoint=kept)
    assert again.values.tolist() == short.values.tolist()
    assert continue_branch(short, (0.45, 0.56)).values.max() == pytest.approx(0.56)


def fluttering(mu, speed, spring=None):
    """A block that is pressed on a belt, of mass 1, with dashpots c = 0.01 along and across.

    Where it never parts nor sticks its stiffness is 2 both ways, with couplings 0.6 and 0.6 - μ: a
    pair is on the axis where 0.6 (μ - 0.6) = 2 c².
    """
    stop = Stop(
        "y", 1.0, exponent=1.0, gap=-1.0, direction=-1, tangent="x",
        friction=Friction(mu, base_speed=speed), tangential_stiffness=spring,
    )  # fmt: skip
    return System.from_matrices(
        np.eye(2), [[2.0, -0.6], [-0.6, 1.0]], {"x": [1.0, 0.0], "y": [0.0, 1.0]},
        damping=0.01 * np.eye(2), stops=[stop],
    )  # fmt: skip


def test_a_motion_that_settles_slowly_has_the_period_of_one_cycle():
    """On a faster belt the same motion settles in another rhythm, as long as it does not stick."""
    slow, fast = (limit_cycle(fluttering(0.9, speed)) for speed in (0.5, 2.0))
    assert slow.impacts == fast.impacts == 1
    assert fast.frequency_hz == pytest.approx(slow.frequency_hz, rel=1e-9)


@pytest.mark.parametrize(
    ("mu", "speed", "spring"), [(0.9, 0.5, None), (0.9, 2.0, None), (0.9, 0.5, 20.0)]
)
def test_cycles_of_one_friction_are_no_folds(mu, speed, spring):
    """Flutter of a block that never parts nor sticks is linear: all sizes have one friction."""
    start = limit_cycle(fluttering(mu, speed, spring))
    branch = continue_branch(start, (0.55, mu), parameter="friction")
    first, second, *_ = branch.special_points
    assert {mark.kind for mark in branch.special_points} == {"Hopf", "GR"}
    for mark in (first, second):
        assert mark.error < 1e-8
        assert mark.value == pytest.approx(0.6 + 2e-4 / 0.6, abs=max(mark.error, 1e-12))
