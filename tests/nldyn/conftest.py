"""The 1-DOF system of equation 3.1, and branches of it."""

import inspect

import pytest
from problems import RANGE_HZ, THREE_HZ, make_one_dof

from nldyn import Diagram, System, continue_branch, solve_orbit

# whether an orbit is found is not to depend on how fast a machine is
inspect.unwrap(solve_orbit).__kwdefaults__["seconds"] = 1e6


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
    orbits = [
        solve_orbit(one_dof, 36.5),
        solve_orbit(one_dof, 36.9, 3, guess=[-1.784e-05, 3.800e-4]),
        solve_orbit(one_dof, 37.6, 2, guess=[-2.318e-05, 5.069e-5]),
    ]
    assert [orbit.period for orbit in orbits] == [1, 3, 2]
    names = "01 harmonic", "02 1/3", "03 1/2"
    branches = (
        continue_branch(o, THREE_HZ, name=name) for o, name in zip(orbits, names, strict=True)
    )
    return Diagram(tuple(branches), THREE_HZ, "middle")
