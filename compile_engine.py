"""Compiles the engine in nldyn/engine to a library: ``python compile_engine.py [FLAG ...]``.

$NLDYN_ENGINE is another folder for it, where the package then looks for it, too.
The compiler is $CC, else cc, gcc or clang on the path, else that of the package ziglang.
"""

from __future__ import annotations

import os
import shlex
import shutil
import subprocess
import sys
import sysconfig
from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path

ROOT = Path(__file__).parent
ENGINE = ROOT / "nldyn" / "engine"
SUFFIX = {"win32": ".dll", "darwin": ".dylib"}.get(sys.platform, ".so")
FLAGS = [
    "-std=c11", "-O3", "-shared", "-fPIC", "-fvisibility=hidden", "-fno-math-errno",
    "-fno-trapping-math", "-ffp-contract=off",
]  # fmt: skip
# the forms of the library, for all processors and, on x86-64, for those of the last ten years
LEVELS = {"": [], "v3": ["-march=x86-64-v3"]}
LEVELS_OF_ZIG = {"": ["-mcpu=baseline"], "v3": ["-mcpu=x86_64_v3"]}  # else for this processor
COMPILERS = "cc", "gcc", "clang"
HELP = "install gcc or clang, or 'pip install ziglang', or set $CC to a C compiler"


def compiler() -> list[str] | None:
    """The command that compiles, if there is one."""
    if os.environ.get("CC"):
        return shlex.split(os.environ["CC"])
    for name in COMPILERS:
        if shutil.which(name):
            return [name]
    return [sys.executable, "-m", "ziglang", "cc"] if find_spec("ziglang") else None


def compile_engine(folder: Path = ENGINE, flags: Sequence[str] = ()) -> list[Path]:
    """Compile the engine into a folder; the libraries, one for each level of the processor.

    Raises
    ------
    SystemExit
        With what to install, if that fails.
    """
    command = compiler()
    if command is None:
        raise SystemExit(f"nldyn: there is no C compiler for the engine: {HELP}")
    machine = sysconfig.get_platform().rsplit("-")[-1].lower()
    found = []
    for level, more in (LEVELS_OF_ZIG if "ziglang" in command else LEVELS).items():
        if level and machine not in ("x86_64", "amd64"):
            continue
        target = folder / f"engine{level}{SUFFIX}"
        fresh = target.with_suffix(".new")
        last = ["-o", str(fresh), *([] if sys.platform == "win32" else ["-lm"])]
        whole = [*command, *FLAGS, *more, *flags, str(ENGINE / "all.c"), *last]
        try:
            told = subprocess.run(whole, capture_output=True, text=True, check=False)
        except OSError as error:
            reason = (error.strerror or str(error)).lower()
            raise SystemExit(f"nldyn: '{command[0]}' cannot be run: {reason}: {HELP}") from None
        if told.returncode:
            print(told.stderr, file=sys.stderr)
            raise SystemExit(f"nldyn: '{shlex.join(command)}' cannot compile the engine: {HELP}")
        fresh.replace(target)  # a program that has loaded the old one goes on with it
        found.append(target)
    print(f"nldyn: the engine is built by '{shlex.join(command)}'", file=sys.stderr)
    return found


if __name__ == "__main__":
    place = Path(os.environ.get("NLDYN_ENGINE", ENGINE))
    place.mkdir(parents=True, exist_ok=True)
    compile_engine(place, sys.argv[1:])
