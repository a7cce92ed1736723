"""Threads of the libraries for linear algebra."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache

from threadpoolctl import ThreadpoolController


@cache
def controller() -> ThreadpoolController:
    """The thread pools of the libraries that numpy and scipy call; not those of MKL."""
    return ThreadpoolController().select(internal_api="openblas")


@contextmanager
def one_thread() -> Iterator[None]:
    """Within this BLAS takes one thread.

    Most blocks are small, and wait longer for a second thread than it saves where other programs
    run, too. The rounding does then not depend on the machine's number of cores.
    """
    with controller().limit(limits=1):
        yield
