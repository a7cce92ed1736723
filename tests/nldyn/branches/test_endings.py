"""Why a branch or a curve ends: what is told is read again from files and other processes."""

import math
import pickle
from string import Formatter

import pytest

from nldyn import HarmonicForce, Stop, System, continue_branch, solve_orbit
from nldyn.branches.endings import Ending, StopReason

GAPS = {
    "period": "2",
    "place": "8.71 Hz",
    "at": "block",
    "what": "frequencies",
    "points": "100",
    "step": "1e-05",
    "share": "6e-06",
    "obstacle": "Newton's method: no convergence",
    "parameter": "gap",
    "sentence": "as an earlier version put it",
}


@pytest.mark.parametrize("ending", Ending)
def test_a_sentence_tells_its_ending(ending):
    names = [name for _, name, _, _ in Formatter().parse(ending.value) if name]
    values = {name: GAPS[name] for name in names}
    told = ending.told(**values)
    for read in (told, StopReason(str(told)), pickle.loads(pickle.dumps(told))):
        assert (read, read.ending, read.values) == (ending.value.format(**values), ending, values)


@pytest.mark.parametrize(("start", "end"), [(0.13, 1), (0.19, 0)])
def test_an_undamped_resonance_is_told(start, end):
    """The mode of 1 kg on 1 N/m is at 1/2π Hz; where nothing limits it, its motion has no end."""
    system = System.from_matrices(
        [[1.0]], [[1.0]], {"x": [1.0]}, damping=[[0.0]], excitation=[HarmonicForce("x", 1.0)]
    )
    branch = continue_branch(solve_orbit(system, start), (0.1, 0.2))
    reason, node = branch.stop_reasons[end], branch.nodes[-end]
    assert reason.ending is Ending.GROWS
    assert reason.startswith("grows without bound towards 0.159154943 Hz")
    assert node.orbit.frequency_hz == pytest.approx(0.5 / math.pi, rel=1e-6)
    assert branch.stop_reasons[1 - end].ending is Ending.RANGE_END


def test_damping_followed_to_none_at_a_resonance_names_the_damping():
    system = System.from_modal(
        [13.1], {"x": [1.0]}, modal_damping=0.02, excitation=[HarmonicForce("x", 1.0)]
    )
    branch = continue_branch(solve_orbit(system, 13.1), (0.0, 0.03), parameter="modal_damping")
    reason = branch.stop_reasons[0]
    assert reason.ending is Ending.GROWS
    assert reason.startswith("grows without bound towards modal_damping = 0, where")


def test_an_undamped_motion_that_a_stop_limits_is_lost_in_rounding():
    """Beyond the stop, the force of 1 N holds a motion of 10 MN: it keeps to the free vibration.

    That is a part of x'' + x = 0 up to the stop, and one of x'' + 10 x = 9 gap behind it.
    """
    gap = 1e7
    system = System.from_matrices(
        [[1.0]], [[1.0]], {"x": [1.0]}, damping=[[0.0]], stops=[Stop.linear("x", 9.0, gap=gap)],
        excitation=[HarmonicForce("x", 1.0)],
    )  # fmt: skip
    branch = continue_branch(solve_orbit(system, 0.159), (0.158, 0.3))
    reason, orbit = branch.stop_reasons[1], branch.nodes[-1].orbit
    assert reason.ending is Ending.LOST_IN_ROUNDING
    assert orbit.impacts == 1
    speed = math.sqrt(10.0 * (orbit.max_penetration + 0.1 * gap) ** 2 - 0.1 * gap**2)
    free = 2.0 * (math.pi - math.atan2(speed, gap))
    behind = 2.0 / math.sqrt(10.0) * math.atan2(speed / math.sqrt(10.0), 0.1 * gap)
    assert 1.0 / orbit.frequency_hz == pytest.approx(free + behind, rel=1e-6)
