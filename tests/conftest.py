"""The order of the files of tests: so that workers end together and compile nothing twice."""

from pathlib import Path

HERE = Path(__file__).parent

# The first worker compiles the kernels with the first file, while the second one has those that
# need none; then the longest files, so that no worker is left alone with one.
COMPILES = ("nldyn/test_nldyn_multipliers.py",)
NEEDS_NO_KERNELS = ("cms", "fem", "scene/test_scene_errors.py", "scene/test_scene_documented.py")
LONGEST = (
    "nldyn/test_nldyn_close_branches.py",
    "nldyn/test_nldyn_exploration.py",
    "nldyn/test_nldyn_executors.py",
    "paper/test_paper_starts.py",
    "nldyn/test_nldyn_detour_search.py",
    "nldyn/test_nldyn_curves.py",
    "faults/test_faults_machine.py",
    "nldyn/test_nldyn_resume.py",
    "nldyn/test_nldyn_contacts.py",
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
