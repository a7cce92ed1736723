"""The 1-DOF system of equation 3.1, and branches of it."""

import pytest
from one_dof import RANGE_HZ, THREE_HZ, make_one_dof

from nldyn import Diagram, ExploreOptions, System, continue_branch, explore, solve_orbit


@pytest.fixture(scope="session")
def one_dof() -> System:
    """m = 2.48 kg, k = 16877 N/m, ζ = 0.0142, k_s = 5.17e9 N/m^1.5, m_e r_e = 4.92e-6 kg m."""
    return make_one_dof()


@pytest.fixture(scope="session")
def harmonic_branch(one_dof):
    """The harmonic branch from 5.7 to 90 Hz."""
    return continue_branch(solve_orbit(one_dof, 26.0), RANGE_HZ)


@pytest.fixture(scope="session")
def three(one_dof) -> Diagram:
    """The branches of periods 1, 2 and 3 at THREE_HZ, the last of which ends at a fold."""
    found = explore(one_dof, THREE_HZ, 3, effort=ExploreOptions(spacing=0.01, starts=2)).diagram
    assert sorted(branch.period for branch in found.branches) == [1, 2, 3]
    return found
