"""The 1-DOF case of the benchmark."""

import pytest

from bench.models import Case, Flip, load_flip


@pytest.fixture(scope="session")
def flip() -> Flip:
    return load_flip("one_dof")


@pytest.fixture(scope="session")
def case(flip) -> Case:
    return flip.case
