"""Gmsh for tests that compare with it, where it is installed."""

from __future__ import annotations

import signal
from contextlib import contextmanager

import pytest


@contextmanager
def gmsh_at_work():
    """Gmsh, quiet; afterwards a broken pipe is an exception again, which Gmsh makes deadly."""
    gmsh = pytest.importorskip("gmsh")
    gmsh.initialize(interruptible=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        yield gmsh
    finally:
        gmsh.finalize()
        if hasattr(signal, "SIGPIPE"):
            signal.signal(signal.SIGPIPE, signal.SIG_IGN)
