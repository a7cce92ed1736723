"""What initial states that were drawn at random may have missed."""

import pytest
from scipy.stats import binomtest

from nldyn.base.errors import SystemModelError
from nldyn.longterm import Attractors


@pytest.mark.parametrize("drawn", [1, 19, 300])
@pytest.mark.parametrize("confidence", [0.8, 0.95])
def test_the_bound_is_the_one_sided_limit_of_clopper_and_pearson(drawn, confidence):
    limits = binomtest(0, drawn, alternative="less").proportion_ci(confidence, "exact")
    assert Attractors([], drawn).missed_share(confidence) == pytest.approx(limits.high, rel=1e-12)


def test_no_random_start_may_have_missed_all():
    assert Attractors([], 0).missed_share() == 1.0
    with pytest.raises(SystemModelError, match="confidence must lie between 0 and 1, got 1"):
        Attractors([], 3).missed_share(1.0)
