"""Compiles the engine when a wheel or an editable install is made."""

from __future__ import annotations

import os
import shlex
import shutil
import subprocess
import sys
import sysconfig
import tempfile
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

SOURCES = Path("nldyn", "engine")
SUFFIX = {"win32": ".dll", "darwin": ".dylib"}.get(sys.platform, ".so")
FLAGS = [
    "-std=c11", "-O3", "-shared", "-fPIC", "-fvisibility=hidden", "-fno-math-errno",
    "-fno-trapping-math", "-ffp-contract=off",
]  # fmt: skip
WIDER = "-march=x86-64-v3"  # a second form, for processors of the last ten years
COMPILERS = "cc", "gcc", "clang"


def compiler() -> list[str] | None:
    """The command that compiles: $CC, one on the path, or that of the package ziglang."""
    if os.environ.get("CC"):
        return shlex.split(os.environ["CC"])
    for name in COMPILERS:
        if shutil.which(name):
            return [name]
    return [sys.executable, "-m", "ziglang", "cc"] if find_spec("ziglang") else None


def build(root: Path, folder: Path, *more: str) -> list[Path]:
    """Compile the engine into a folder; the libraries, one for each level of the processor.

    Raises
    ------
    SystemExit
        With what to install, if that fails.
    """
    command = compiler()
    if command is None:
        raise SystemExit("nldyn: no C compiler: install one (gcc, clang), or pip's ziglang")
    machine = sysconfig.get_platform().rsplit("-")[-1].lower()
    levels = {"": ""} | ({"v3": WIDER} if machine in ("x86_64", "amd64") else {})
    found = []
    for level, flag in levels.items():
        target = folder / f"engine{level}{SUFFIX}"
        whole = [
            *command, *FLAGS, *filter(None, [flag]), *more, str(root / SOURCES / "all.c"),
            "-o", str(target), *([] if sys.platform == "win32" else ["-lm"]),
        ]  # fmt: skip
        try:
            told = subprocess.run(whole, capture_output=True, text=True, check=False)
        except OSError as error:
            raise SystemExit(
                f"nldyn: the C compiler '{command[0]}' cannot be run ({error.strerror}): install "
                "gcc or clang, set $CC, or install pip's ziglang"
            ) from None
        if told.returncode:
            raise SystemExit(
                f"nldyn: '{shlex.join(command)}' cannot compile the engine; install another C "
                f"compiler (gcc, clang, pip's ziglang) and set $CC to it\n{told.stderr}"
            )
        found.append(target)
    print(f"nldyn: the engine is built by {shlex.join(command)}", file=sys.stderr)
    return found


class EngineHook(BuildHookInterface):  # type: ignore[misc, type-arg]
    """Puts the compiled engine beside its Python modules."""

    def dependencies(self) -> list[str]:
        """A compiler from the package index, where there is none."""
        return [] if compiler() else ["ziglang"]

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Compile before the files are gathered."""
        root = Path(self.root)
        platform = sysconfig.get_platform().replace("-", "_").replace(".", "_")
        build_data["tag"] = f"py3-none-{platform}"
        build_data["pure_python"] = False
        if version == "editable":
            build(root, root / SOURCES)
            return
        self.folder = tempfile.TemporaryDirectory()
        for library in build(root, Path(self.folder.name)):
            build_data["force_include"][str(library)] = str(SOURCES / library.name)

    def finalize(self, version: str, build_data: dict[str, Any], artifact: str) -> None:
        """Remove what was compiled for a wheel."""
        if version != "editable":
            self.folder.cleanup()
