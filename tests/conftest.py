"""The order of the files of tests: so that workers end together and compile nothing twice."""

from contextlib import suppress
from pathlib import Path

import pytest
from hypothesis import settings

settings.register_profile("gate", deadline=None, derandomize=True, max_examples=20)
settings.register_profile("long", deadline=None, max_examples=500)
settings.load_profile("gate")

HERE = Path(__file__).parent

# The first worker compiles the kernels with the first file, while the second one has those that
# need none; then the longest files, so that no worker is left alone with one.
COMPILES = ("nldyn/orbits/test_multipliers.py",)
SCENES = "nldyn/scene/test_scene_errors.py", "nldyn/scene/test_scene_documented.py"
NEEDS_NO_KERNELS = ("cms", "fem", "test_layers.py", "test_links.py", *SCENES)
LONGEST = (
    "nldyn/search/test_exploration.py",
    "nldyn/curves/test_curves.py",
    "nldyn/branches/test_close_branches.py",
    "nldyn/runtime/test_executors.py",
    "nldyn/io/test_resume.py",
    "nldyn/flow/test_contacts.py",
    "nldyn/longterm/test_longterm.py",
    "nldyn/paper/test_paper_starts.py",
)


def rank(item):
    """Place of the file of a test among the others."""
    file = item.path.relative_to(HERE).as_posix()
    for place, names in enumerate((COMPILES, NEEDS_NO_KERNELS, LONGEST)):
        for within, name in enumerate(names):
            if file == name or file.startswith(f"{name}/"):
                return place, within
    return len(LONGEST), 0


def pytest_collection_modifyitems(items):
    """Sort the files, and leave the tests of each in their order."""
    items.sort(key=rank)


@pytest.fixture(scope="session")
def kernels(tmp_path_factory, worker_id):
    """The kernels, compiled or read from the disk by one worker at a time: so one compiles."""
    from nldyn import Stop, System, Unbalance, continue_branch, solve_orbit

    place = tmp_path_factory.getbasetemp()
    with ((place if worker_id == "master" else place.parent) / "kernels.lock").open("w") as file:
        with suppress(ImportError):  # only there where the system has such locks
            from fcntl import LOCK_EX, flock

            flock(file, LOCK_EX)  # until the file is closed
        system = System.from_modal(
            [10.0, 40.0], {"tip": [1.0, 0.5]}, modal_damping=0.05, stops=[Stop("tip", 1e9)],
            excitation=[Unbalance("tip", 1e-5)],
        )  # fmt: skip
        assert continue_branch(solve_orbit(system, 12.0), (11.9, 12.1)).points


@pytest.fixture(scope="module", autouse=True)
def kernels_where_needed(request):
    """Before the first test of a file that may need them; no limit of time is for compiling."""
    file = request.path.relative_to(HERE).as_posix()
    if not file.startswith(NEEDS_NO_KERNELS):
        request.getfixturevalue("kernels")
