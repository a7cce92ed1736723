"""Compiles the engine in nldyn/engine to a library: ``python compile_engine.py [FLAG ...]``.

$NLDYN_ENGINE is another folder for it, where the package then looks for it, too.
The compiler is $CC, else cc, gcc or clang on the path (not on Windows), else that of the package
ziglang. $NLDYN_PLATFORM asks for another platform, by the tag of its wheels, and for ziglang.
"""

from __future__ import annotations

import os
import platform
import runpy
import shlex
import shutil
import subprocess
import sys
import sysconfig
import tempfile
from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path

ROOT = Path(__file__).parent
ENGINE = ROOT / "nldyn" / "engine"
FINGERPRINT = runpy.run_path(str(ENGINE / "fingerprint.py"))["fingerprint"](ENGINE)
FLAGS = [
    "-std=c11", "-O3", "-shared", "-fPIC", "-fvisibility=hidden", "-fno-math-errno",
    "-fno-trapping-math", "-ffp-contract=off",
]  # fmt: skip
# the forms of the library, for all processors and, on x86-64, for those of the last ten years
LEVELS = {"": [], "v3": ["-march=x86-64-v3"]}
# without a table of symbols; else ziglang compiles for this processor
LEVELS_OF_ZIG = {"": ["-s", "-mcpu=baseline"], "v3": ["-s", "-mcpu=x86_64_v3"]}
# platforms of wheels, and what ziglang is told for each
TARGETS = {
    "manylinux_2_17_x86_64": ["-target", "x86_64-linux-gnu.2.17"],
    "manylinux_2_17_aarch64": ["-target", "aarch64-linux-gnu.2.17"],
    "macosx_11_0_x86_64": ["-target", "x86_64-macos.11.0"],
    "macosx_11_0_arm64": ["-target", "aarch64-macos.11.0"],
    "win_amd64": ["-target", "x86_64-windows-gnu"],
}
# on Windows gcc misplaces numbers of AVX on the stack, and clang needs the headers of another
COMPILERS = () if sys.platform == "win32" else ("cc", "gcc", "clang")
HELP = "install gcc or clang, or 'pip install ziglang', or set $CC to a C compiler"


def asked_platform() -> str | None:
    """The platform in $NLDYN_PLATFORM."""
    asked = os.environ.get("NLDYN_PLATFORM")
    if asked and asked not in TARGETS:
        raise SystemExit(f"nldyn: $NLDYN_PLATFORM is '{asked}', not one of {', '.join(TARGETS)}")
    return asked


def platform_tag() -> str:
    """Tag of the platform that the engine is built for."""
    return asked_platform() or sysconfig.get_platform().replace("-", "_").replace(".", "_")


def compiler() -> list[str] | None:
    """The command that compiles, if there is one."""
    asked = asked_platform()
    if not asked and os.environ.get("CC"):
        return shlex.split(os.environ["CC"])
    for name in () if asked else COMPILERS:
        if shutil.which(name):
            return [name]
    if find_spec("ziglang") is None:
        return None
    return [sys.executable, "-m", "ziglang", "cc", *(TARGETS[asked] if asked else [])]


def suffix(tag: str) -> str:
    """Ending of the files of libraries of a platform."""
    endings = {"win": ".dll", "macosx": ".dylib"}
    return next((end for system, end in endings.items() if tag.startswith(system)), ".so")


def compile_engine(folder: Path = ENGINE, flags: Sequence[str] = ()) -> list[Path]:
    """Compile the engine into a folder; the libraries, one for each level of the processor.

    Raises
    ------
    SystemExit
        With what to install, if that fails.
    """
    command, tag = compiler(), platform_tag()
    if command is None:
        raise SystemExit(f"nldyn: there is no C compiler for the engine: {HELP}")
    if sys.maxsize < 2**32:
        raise SystemExit("nldyn: the engine needs a Python of 64 bits: install one")
    # a Python for both processors of macOS builds for the one it runs on
    machine = tag if asked_platform() else platform.machine().lower()
    x86 = machine.endswith(("x86_64", "amd64"))
    libraries = []
    for level, more in (LEVELS_OF_ZIG if "ziglang" in command else LEVELS).items():
        if x86 or not level:
            library = folder / f"engine{level}{suffix(tag)}"
            of_sources = f"-DFINGERPRINT={FINGERPRINT}"
            _compile([*command, *FLAGS, of_sources, *more, *flags], library)
            libraries.append(library)
    print(f"nldyn: the engine is built by '{shlex.join(command)}'", file=sys.stderr)
    return libraries


def _compile(command: list[str], library: Path) -> None:
    """Compile one library, beside which some compilers leave files of their own."""
    with tempfile.TemporaryDirectory(dir=library.parent) as folder:
        fresh = Path(folder) / library.name
        last = [] if library.suffix == ".dll" else ["-lm"]
        whole = [*command, str(ENGINE / "all.c"), "-o", str(fresh), *last]
        try:
            told = subprocess.run(whole, capture_output=True, text=True, check=False)
        except OSError as error:
            reason = (error.strerror or str(error)).lower()
            raise SystemExit(f"nldyn: '{command[0]}' cannot be run: {reason}: {HELP}") from None
        if told.returncode:
            print(told.stderr, file=sys.stderr)
            raise SystemExit(f"nldyn: '{shlex.join(command)}' cannot compile the engine: {HELP}")
        try:
            fresh.replace(library)  # a program that has loaded the old one goes on with it
        except PermissionError:  # but on Windows
            raise SystemExit(f"nldyn: end what uses '{library}', then build anew") from None


if __name__ == "__main__":
    place = Path(os.environ.get("NLDYN_ENGINE", ENGINE))
    place.mkdir(parents=True, exist_ok=True)
    compile_engine(place, sys.argv[1:])
