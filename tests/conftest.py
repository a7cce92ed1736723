"""The order of the files of tests: so that workers end together."""

from pathlib import Path

from hypothesis import settings

settings.register_profile("gate", deadline=None, derandomize=True, max_examples=20)
settings.register_profile("long", deadline=None, max_examples=500)
settings.load_profile("gate")

HERE = Path(__file__).parent

# the longest files first, so that no worker is left alone with one
LONGEST = (
    "nldyn/search/test_exploration.py",
    "nldyn/curves/test_curves.py",
    "nldyn/branches/test_close_branches.py",
    "nldyn/runtime/test_executors.py",
    "nldyn/io/test_resume.py",
    "nldyn/flow/test_contacts.py",
    "nldyn/longterm/test_longterm.py",
    "paper/test_paper_starts.py",
)


def rank(item):
    """Place of the file of a test among the others."""
    file = item.path.relative_to(HERE).as_posix()
    return LONGEST.index(file) if file in LONGEST else len(LONGEST)


def pytest_collection_modifyitems(items):
    """Sort the files, and leave the tests of each in their order."""
    items.sort(key=rank)
