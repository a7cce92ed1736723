"""Why a branch or a curve ends: what is told is read again from files and other processes."""

import pickle
from string import Formatter

import pytest

from nldyn.branches.endings import Ending, StopReason

GAPS = {
    "period": "2",
    "hz": "8.71",
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
