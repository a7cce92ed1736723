"""What a release must hold: one version everywhere, and packages that are its own."""

import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import cms
import fem
import nldyn

ROOT = Path(__file__).resolve().parents[1]


def test_one_version_everywhere():
    cited = re.search(r"^version: (.+)$", (ROOT / "CITATION.cff").read_text("utf-8"), re.M)
    changed = re.search(r"^## ([\d.]+)$", (ROOT / "CHANGELOG.md").read_text("utf-8"), re.M)
    assert {fem.__version__, cms.__version__, cited[1], changed[1]} == {nldyn.__version__}


@pytest.fixture
def installed(tmp_path):
    """A folder of packages with ours, as far as `import nldyn` needs them."""
    folder = tmp_path / "site"
    for package in ("fem", "cms", "nldyn"):
        (folder / package).mkdir(parents=True)
        for stub in (ROOT / package).glob("__init__.py*"):
            shutil.copy(stub, folder / package)
    shutil.copytree(ROOT / "nldyn" / "base", folder / "nldyn" / "base")
    return folder


def told_on_import(installed, *before):
    """The last line that `import nldyn` prints, with folders before it on the path."""
    path = [str(folder) for folder in (*before, installed)]
    code = f"import sys; sys.path[:0] = {path}; import nldyn"
    run = subprocess.run(
        [sys.executable, "-I", "-S", "-c", code], capture_output=True, text=True, check=False
    )
    return run.stderr.splitlines()[-1] if run.stderr else ""


def test_its_own_packages_are_taken(installed):
    assert told_on_import(installed) == ""


@pytest.mark.parametrize("name", ["fem.py", "cms/__init__.py"])
def test_a_package_in_the_place_of_ours_is_named(installed, tmp_path, name):
    other = tmp_path / "other" / name
    other.parent.mkdir(parents=True)
    other.touch()
    told = told_on_import(installed, tmp_path / "other")
    assert str(other) in told and "rename that" in told


def test_a_package_that_was_written_over_ours_is_named(installed):
    ours = installed / "cms" / "__init__.py"
    ours.write_text('__version__ = "5.0.1"\n', encoding="utf-8")
    assert f"{ours} is not that of nldyn" in told_on_import(installed)
    ours.unlink()
    assert "has a package 'cms' of its own, but" in told_on_import(installed)
