import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))


@pytest.fixture(scope="session", autouse=True)
def compiled():
    """The kernels are compiled before the time of anything is limited."""
    from nldyn import System, solve_orbit

    system = System.from_modal([10.0], {"tip": [1.0]}, modal_damping=0.05)
    assert solve_orbit(system, 12.0).impacts == 0
