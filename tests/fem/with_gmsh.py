"""Gmsh for tests that compare with it, where it is installed."""

from contextlib import contextmanager

import bench.with_gmsh
import pytest


@contextmanager
def gmsh_at_work():
    """Gmsh, quiet; without it the test is skipped."""
    pytest.importorskip("gmsh")
    with bench.with_gmsh.gmsh_at_work() as gmsh:
        yield gmsh
