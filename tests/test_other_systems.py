"""The packages run where there is nothing but what Windows has of POSIX.

A process hides what the documentation of Python marks as not available on Windows, imports every
module and runs the command line. Other libraries are imported before.
"""

import ast
import os
import re
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = ("fem", "cms", "nldyn")
FILES = [path for package in PACKAGES for path in sorted((ROOT / package).rglob("*.py"))]
ONLY_POSIX = {"fcntl", "grp", "posix", "pty", "pwd", "resource", "syslog", "termios", "tty"}
HIDE = """
import os, signal, sys
import h5py, imageio, matplotlib, multiprocessing.pool, plotly, pydantic, pyvista
import scipy, skfem, subprocess, tempfile, threadpoolctl

for name in {modules}:
    sys.modules[name] = None                      # import raises ImportError
for name in ("fork", "forkpty", "getuid", "geteuid", "getgid", "getpgid", "killpg", "mkfifo",
             "nice", "posix_spawn", "sched_getaffinity", "setsid", "sysconf", "uname", "wait4",
             "pread", "O_DIRECTORY", "O_NOFOLLOW", "O_CLOEXEC", "getloadavg", "fchmod", "chown"):
    if hasattr(os, name):
        delattr(os, name)
known = {{"SIGABRT", "SIGFPE", "SIGILL", "SIGINT", "SIGSEGV", "SIGTERM", "SIG_DFL", "SIG_IGN"}}
other = {{"alarm", "setitimer", "pthread_sigmask", "pthread_kill", "sigwait", "siginterrupt"}}
for name in dir(signal):
    if name in other or name.startswith("SIG") and name not in known:
        delattr(signal, name)
"""
RUN = """
from importlib import import_module
from pathlib import Path
for name in sys.argv[1:]:
    import_module(name)
from nldyn.app.cli import main
text = Path({scene!r}).read_text(encoding="utf-8")
text = text.replace("range_hz = [5.0, 90.0]", "range_hz = [24.0, 25.0]")
text = text.replace("periods = [1, 2, 3]", "periods = [1]\\nsearch_points = 1")
Path("a.toml").write_text(text.replace('title = "', 'title = "\\u03be '), encoding="utf-8")
for arguments in (["new", "two_dof_xi_0.01", "beam"], ["check", "beam/two_dof_xi_0.01.toml"],
                  *[["run", "a.toml", "--out", "out", "--jobs", "1"]] * 2):
    main(arguments, standalone_mode=False)
"""


def test_modules_are_imported_and_commands_run(tmp_path):
    """Results replace others, with the encoding of a western Windows where none is named."""
    modules = [
        ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__")
        for path in FILES
        if path.name != "__main__.py"  # which runs the command line
    ]
    scene = ROOT / "docs" / "examples" / "one_dof.toml"
    told = {"PYTHONIOENCODING": "cp1252", "PYTHONWARNDEFAULTENCODING": "1"}
    done = subprocess.run(
        [
            sys.executable,
            "-c",
            HIDE.format(modules=ONLY_POSIX) + RUN.format(scene=str(scene)),
            *modules,
        ],
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": str(ROOT), **told},
        capture_output=True,
        check=False,
    )
    warned = done.stderr.decode("cp1252")
    assert done.returncode == 0, warned
    assert "no fault found" in done.stdout.decode("cp1252")
    ours = tuple(str(ROOT / package) for package in PACKAGES)
    assert [line for line in warned.splitlines() if line.startswith(ours)] == []  # no encoding
    assert (tmp_path / "out" / "report.html").stat().st_size > 1_000_000


def test_no_process_is_forked_and_no_module_of_posix_needed():
    """Processes are spawned, and what only POSIX has is imported where its absence is caught."""
    unguarded = []
    for path in FILES:
        text = path.read_text(encoding="utf-8")
        if not re.search(r"\bimport (" + "|".join(ONLY_POSIX) + r")\b|[\"']fork", text):
            continue
        tree = ast.parse(text)
        tried = {id(inner) for n in ast.walk(tree) if isinstance(n, ast.Try) for inner in n.body}
        for node in ast.walk(tree):
            names = [n.name for n in node.names] if isinstance(node, ast.Import) else []
            if set(names) & ONLY_POSIX and id(node) not in tried:
                unguarded.append(f"{path.name}:{node.lineno}")
            if isinstance(node, ast.Constant) and node.value in ("fork", "forkserver"):
                unguarded.append(f"{path.name}:{node.lineno}")
    assert unguarded == []
