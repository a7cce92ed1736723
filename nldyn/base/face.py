"""The face of a package: one list of names, which are loaded when they are first asked for."""

import ast
from collections.abc import Callable, Sequence
from importlib import import_module
from pathlib import Path

from nldyn.base.extras import how_to_install


def homes(package: str, path: Sequence[str]) -> dict[str, str]:
    """Modules of the names in a package's stub; a sub-package that it lists is its own home."""
    stub = ast.parse(Path(path[0], "__init__.pyi").read_text(encoding="utf-8"))
    return {
        name.name: f"{package}.{name.name}" if node.module == package else str(node.module)
        for node in stub.body
        if isinstance(node, ast.ImportFrom)
        for name in node.names
    }


def face(
    package: str, path: Sequence[str]
) -> tuple[Callable[[str], object], Callable[[], list[str]], list[str]]:
    """``__getattr__``, ``__dir__`` and ``__all__`` of a package whose stub lists its names.

    Sub-packages are attributes, but no part of ``__all__``.
    """
    known = homes(package, path)

    def load(name: str) -> object:
        if name not in known:
            raise AttributeError(f"module '{package}' has no attribute '{name}'")
        try:
            module = import_module(known[name])
        except ModuleNotFoundError as error:
            told = how_to_install(error.name or "", f"{package}.{name}")
            raise ModuleNotFoundError(told or str(error), name=error.name) from error
        return module if known[name] == f"{package}.{name}" else getattr(module, name)

    names = sorted(name for name, home in known.items() if home != f"{package}.{name}")
    return load, lambda: sorted(known), names
