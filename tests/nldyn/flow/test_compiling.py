import ast
from pathlib import Path

import nldyn
from nldyn.flow.kernels import compiling

ROOT = Path(nldyn.__file__).parent
FILES = [
    *map(Path, compiling.OURS),
    *(ROOT / "orbits").glob("*.py"),
    *(ROOT / "branches").glob("*.py"),
]


def kernels(kind):
    """Functions with a decorator, by name."""
    return {
        node.name: node
        for file in FILES
        for node in ast.parse(file.read_text(encoding="utf-8")).body
        if isinstance(node, ast.FunctionDef)
        and any(isinstance(d, ast.Name) and d.id == kind for d in node.decorator_list)
    }


def test_kernels_without_counted_references_call_none_that_make_arrays():
    """An array that such a kernel got from another one would never be released."""
    inner, allocating = kernels("inner"), kernels("allocating")
    assert len(inner) > 100
    assert "new_panel" in allocating
    for name, node in inner.items():
        called = {n.func.id for n in ast.walk(node)
                  if isinstance(n, ast.Call) and isinstance(n.func, ast.Name)}  # fmt: skip
        assert not called & (allocating.keys() - inner.keys()), name
