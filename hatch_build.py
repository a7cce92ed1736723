"""Compiles the engine when a wheel or an editable install is made."""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

sys.path.insert(0, str(Path(__file__).parent))

from compile_engine import compile_engine, compiler, platform_tag


class EngineHook(BuildHookInterface):  # type: ignore[misc, type-arg]
    """Puts the compiled engine beside its Python modules."""

    def dependencies(self) -> list[str]:
        """A compiler from the package index, where there is none."""
        return [] if compiler() else ["ziglang"]

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Compile before the files are gathered; one wheel serves all versions of Python."""
        build_data["tag"] = f"py3-none-{platform_tag()}"
        build_data["pure_python"] = False
        if version == "editable":
            compile_engine()
            return
        self.folder = tempfile.TemporaryDirectory()
        for library in compile_engine(Path(self.folder.name)):
            build_data["force_include"][str(library)] = f"nldyn/engine/{library.name}"

    def finalize(self, version: str, build_data: dict[str, Any], artifact: str) -> None:
        """Remove what was compiled for a wheel."""
        if version != "editable":
            self.folder.cleanup()
