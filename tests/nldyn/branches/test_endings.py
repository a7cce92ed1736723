"""Why a branch or a curve ends: what is told is read again from files and other processes."""

import math
import pickle
from string import Formatter

import pytest

from nldyn import HarmonicForce, System, continue_branch, solve_orbit
from nldyn.branches.endings import Ending, StopReason

GAPS = {
    "period": "2",
    "place": "8.71 Hz",
    "what": "frequencies",
    "points": "100",
    "step": "1e-05",
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
