"""The 1-DOF system of equation 3.1, and its harmonic branch."""

import pytest
from one_dof import RANGE_HZ, make_one_dof

from nldyn import System, continue_branch, solve_orbit


@pytest.fixture(scope="session")
def one_dof() -> System:
    """m = 2.48 kg, k = 16877 N/m, ζ = 0.0142, k_s = 5.17e9 N/m^1.5, m_e r_e = 4.92e-6 kg m."""
    return make_one_dof()


@pytest.fixture(scope="session")
def harmonic_branch(one_dof):
    """The harmonic branch from 5.7 to 90 Hz."""
    return continue_branch(solve_orbit(one_dof, 26.0), RANGE_HZ)
