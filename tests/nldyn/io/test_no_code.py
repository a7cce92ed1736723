"""No file that nldyn reads can run code: only processes that it starts itself exchange pickles."""

import ast
import pickle
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

import cms
import fem
import nldyn
from cms import ReducedModel
from fem.model.store import load_model
from nldyn import diagram, parameter_study
from nldyn.app.cli import main
from nldyn.base.resources import example
from nldyn.io import CheckpointFile
from nldyn.io.branches import load_branches, load_diagram, load_exploration
from nldyn.io.curves import load_curves
from nldyn.runtime.unfinished import unfinished_path

RUN_CODE = {"pickle", "_pickle", "cloudpickle", "dill", "joblib", "marshal", "shelve"}
BETWEEN_PROCESSES = {"nldyn/runtime/prefetch.py"}
ran = []


def run(what):
    ran.append(what)


class Malice:
    def __reduce__(self):
        return run, ("code of the file",)


def imported(path):
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from (alias.name.partition(".")[0] for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            yield node.module.partition(".")[0]


@pytest.mark.parametrize("package", [fem, cms, nldyn], ids=lambda p: p.__name__)
def test_what_can_run_code_is_imported_only_where_processes_exchange_it(package):
    (folder,) = package.__path__
    found = {
        f"{package.__name__}/{path.relative_to(folder).as_posix()}"
        for path in Path(folder).rglob("*.py")
        if RUN_CODE & set(imported(path))
    }
    assert found <= BETWEEN_PROCESSES


@pytest.fixture(params=["pickle", "numpy"])
def malicious(request, tmp_path):
    """A file that runs code when it is unpickled, alone or within arrays of numpy."""
    path = tmp_path / "sent.h5"
    if request.param == "pickle":
        path.write_bytes(pickle.dumps(Malice()))
    else:
        with path.open("wb") as file:
            np.savez(file, format=np.array([Malice()], dtype=object))
    ran.clear()
    yield path
    assert not ran


def test_the_malicious_file_would_run_code():
    ran.clear()
    pickle.loads(pickle.dumps(Malice()))
    assert ran == ["code of the file"]


@pytest.mark.parametrize(
    "load",
    [
        load_branches, load_diagram, load_exploration, load_curves,
        load_model, ReducedModel.load,
    ],
    ids=lambda load: load.__qualname__,
)  # fmt: skip
def test_malicious_file_is_refused_in_one_sentence(malicious, load):
    with pytest.raises(ValueError, match=r"sent\.h5") as refusal:
        load(malicious)
    assert "\n" not in str(refusal.value)


def test_malicious_checkpoint_is_refused(malicious, one_dof):
    with pytest.raises(ValueError, match="is not an HDF5 file") as refusal:
        diagram(one_dof, (24.0, 27.0), [1], checkpoint=CheckpointFile(malicious))
    assert "\n" not in str(refusal.value)


def measure(diagram):
    return {}


def test_malicious_cases_of_a_study_are_refused(malicious):
    with pytest.raises(ValueError, match=r"sent\.h5"):
        parameter_study(
            example("one_dof.toml"), {"stops.0.gap": [0.0, 1e-6]}, measure, keep=malicious
        )


def test_malicious_rest_of_a_run_is_refused(malicious, tmp_path):
    out = tmp_path / "out"
    unfinished_path(out).write_bytes(malicious.read_bytes())
    result = CliRunner().invoke(main, ["run", str(example("one_dof.toml")), "--out", str(out)])
    assert result.exit_code == 2
    assert result.stderr.count("\n") == 1 and "is not an HDF5 file" in result.stderr
