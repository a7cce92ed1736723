"""A component that many tests share."""

import pytest
from chains import chain


@pytest.fixture
def cantilever():
    """A chain of 30 masses, held at one end, loaded at the other and in the middle."""
    return chain(30, stiffness=7.0, mass=0.3, interfaces={"tip": 29, "middle": 14})
