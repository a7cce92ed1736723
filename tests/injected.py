"""Do the tests notice? Faults put into a copy of the program by hand, one at a time.

``python tests/injected.py [NUMBER ...]`` tells for each which test notices it first. It takes
twenty minutes of processor time for all; the exit code is 1 if one is not noticed.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).parents[1]
LEFT_OUT = shutil.ignore_patterns(".git", ".venv", "results", "images")


class Fault(NamedTuple):
    """A piece of a file, what takes its place, and the tests that are run."""

    what: str
    file: str
    right: str
    wrong: str
    tests: str


FAULTS = [
    Fault(
        "the first segment has the other sign in the monodromy matrix",
        "nldyn/orbits/orbit.py",
        "found, jacobians = floquet_spectrum(self.jacobians), self.jacobians",
        "found = floquet_spectrum(np.concatenate([-self.jacobians[:1], self.jacobians[1:]]))\n"
        "            jacobians = self.jacobians",
        "nldyn/orbits/test_mathieu.py",
    ),
    Fault(
        "contacts of the last of several stops are missed",
        "nldyn/engine/events.c",
        "stop < fl->n_stops; stop++) {\n        if (M->closed[stop]) position++;",
        "stop < fl->n_stops - (fl->n_stops > 1); stop++) {\n"
        "        if (M->closed[stop]) position++;",
        "nldyn/flow/test_contacts.py",
    ),
    Fault(
        "the tolerance of the flow map is loosened by 100",
        "nldyn/flow/options.py",
        "    rtol: float = 1e-9",
        "    rtol: float = 1e-7",
        "nldyn/flow/test_contacts.py",
    ),
    Fault(
        "at a branch point the branch is taken that one comes from",
        "nldyn/bifurcations/normal_forms.py",
        "tangents[int(np.argmin(along))]",
        "tangents[int(np.argmax(along))]",
        "nldyn/bifurcations/test_normal_forms.py",
    ),
    Fault(
        "all physical groups of a Gmsh file but the first are lost",
        "fem/formats/gmsh.py",
        "        for group in np.unique(block.groups[block.groups != 0]):\n            name",
        "        for group in np.unique(block.groups[block.groups != 0])[:1]:\n            name",
        "fem/formats/test_fem_meshes.py",
    ),
    Fault(
        "the last node of a generated Abaqus set is lost",
        "fem/formats/abaqus/sets.py",
        "range(first, last + 1, step)",
        "range(first, last, step)",
        "fem/formats/test_fem_meshes.py",
    ),
    Fault(
        "multipliers are paired with the moduli of others",
        "nldyn/orbits/multipliers.py",
        "return FloquetSpectrum(values, logarithms, squeeze)",
        "return FloquetSpectrum(values, logarithms[::-1].copy(), squeeze)",
        "nldyn/orbits/test_multipliers.py",
    ),
    Fault(
        "mass is lost where solid cells share a node",
        "fem/assembly/structure.py",
        "np.add.at(mass, at, M.ravel())",
        "mass[at] += M.ravel()",
        "fem/assembly/test_fem_structures.py",
    ),
    Fault(
        "the residual flexibility has a mode that is kept",
        "cms/reduction/reduction.py",
        "residual_flexibility(pencil, shifted, kept.vectors)",
        "residual_flexibility(pencil, shifted, kept.vectors[:, 1:])",
        "cms/reduction/test_cms_methods.py",
    ),
    Fault(
        "the test function of a flip has no sign",
        "nldyn/bifurcations/sign_changes.py",
        "PD=found.flip",
        "PD=abs(found.flip)",
        "nldyn/branches/test_harmonic_branch.py",
    ),
    Fault(
        "between recorded instants a motion is 1e-4 of the time late",
        "nldyn/engine/pieces.c",
        "double t = (phases[i] - piece.phase) / omega;",
        "double t = 0.9999 * (phases[i] - piece.phase) / omega;",
        "nldyn/longterm/test_simulation.py",
    ),
    Fault(
        "an index counts once, not for each point of its orbit",
        "nldyn/search/fixed_point_index.py",
        "sum(o.period * index(o",
        "sum(index(o",
        "nldyn/search/test_fixed_point_index.py",
    ),
    Fault(
        "damping is lost where components are coupled",
        "cms/reduction/coupling.py",
        "if model.damping is None else model.damping",
        "if True else model.damping",
        "cms/reduction/test_cms_coupling.py",
    ),
    Fault(
        "explore does not search again where the indices do not add up",
        "nldyn/search/explore.py",
        "for again in range(AGAIN if up else 0)",
        "for again in range(0)",
        "nldyn/search/test_exploration.py",
    ),
    Fault(
        "explore makes no further guesses on the way down",
        "nldyn/search/explore.py",
        "self._follow_guesses(frequency, (self.effort.seed, turn, place))",
        "pass",
        "nldyn/search/test_exploration.py",
    ),
    Fault(
        "explore does not look beside motions",
        "nldyn/search/explore.py",
        "self._beside(runs, known)",
        "pass",
        "nldyn/search/test_exploration.py",
    ),
    Fault(
        "wedges of a file are left out",
        "fem/formats/from_meshio.py",
        "        blocks = cells.setdefault(block.type, [])",
        '        if block.type == "wedge":\n            continue\n'
        "        blocks = cells.setdefault(block.type, [])",
        "fem/formats/test_fem_cell_orders.py",
    ),
    Fault(
        "a point mass in the plane has no inertia along y",
        "fem/assembly/structure.py",
        'directions = ("x", "y") if model.plane',
        'directions = ("x",) if model.plane',
        "fem/assembly/test_fem_structures.py",
    ),
    Fault(
        "Hertz's law has the exponent 1.4",
        "nldyn/system/contact_law.py",
        "    slope = stiffness\n    if exponent == 1.5:",
        "    slope = stiffness\n    exponent = 1.4 if exponent == 1.5 else exponent\n"
        "    if exponent == 1.5:",
        "nldyn/flow/test_contacts.py",
    ),
    Fault(
        "modal damping is half of what is asked for",
        "nldyn/system/system.py",
        "np.diag(2.0 * zeta * omega)",
        "np.diag(zeta * omega)",
        "nldyn/system",
    ),
    Fault(
        "harmonics have the opposite phase",
        "nldyn/orbits/harmonics.py",
        "phasor = np.fft.rfft(displacement)[",
        "phasor = np.conj(np.fft.rfft(displacement))[",
        "nldyn/orbits/test_harmonics.py",
    ),
    Fault(
        "sensitivities do not jump where a dashpot begins to act",
        "nldyn/engine/segments.c",
        "        jump_columns(M, stop, phase, t, M->closed[stop]);",
        "        (void)phase;",
        "nldyn/flow/test_dashpot.py",
    ),
    Fault(
        "folds are told as flips, and flips as folds",
        "nldyn/bifurcations/sign_changes.py",
        "LP=float(point.tangent[-1]),\n            PD=found.flip,",
        "PD=float(point.tangent[-1]),\n            LP=found.flip,",
        "nldyn/branches/test_harmonic_branch.py",
    ),
    Fault(
        "a checkpoint loses the last branch",
        "nldyn/branches/checkpoint.py",
        "[*held, *branches[known:]]",
        "[*held, *branches[known:-1]]",
        "nldyn/io/test_resume.py",
    ),
    Fault(
        "the last interface or load vector has no residual mode",
        "cms/reduction/residual.py",
        "residual = without_modes(static, modes, pencil)\n    basis",
        "residual = without_modes(static[:, :-1], modes, pencil)\n    basis",
        "cms/reduction/test_cms_methods.py",
    ),
]


def noticed_by(fault: Fault, folder: Path) -> str:
    """The first test that fails with a fault in a copy of the program; empty if none does."""
    copy = folder / "copy"
    shutil.copytree(ROOT, copy, ignore=LEFT_OUT)
    file = copy / fault.file
    text = file.read_text("utf-8")
    if text.count(fault.right) != 1:
        raise ValueError(f"{fault.file} does not hold {fault.right!r} once")
    file.write_text(text.replace(fault.right, fault.wrong), "utf-8")
    if file.suffix == ".c":
        subprocess.run([sys.executable, copy / "compile_engine.py"], check=True)
    command = [sys.executable, "-m", "pytest", "-n", "0", "-x", f"tests/{fault.tests}"]
    environment = {**os.environ, "PYTHONPATH": str(copy), "OPENBLAS_NUM_THREADS": "1"}
    done = subprocess.run(command, cwd=copy, env=environment, capture_output=True, text=True)
    failed = re.search(r"^(?:FAILED|ERROR) tests/(.+?)(?: - .*)?$", done.stdout, re.MULTILINE)
    return failed[1] if failed else ""


def main() -> int:
    """Try the faults whose numbers are given, or all."""
    missed = 0
    for number in map(int, sys.argv[1:] or range(len(FAULTS))):
        with tempfile.TemporaryDirectory() as folder:
            test = noticed_by(FAULTS[number], Path(folder))
        missed += not test
        print(f"{number}: {FAULTS[number].what}: {test or 'NOT NOTICED'}", flush=True)
    return int(missed > 0)


if __name__ == "__main__":
    sys.exit(main())
