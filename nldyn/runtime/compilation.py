"""What is known of the compilation of kernels: it is told once, and its time is measured.

This module needs no compiler; `nldyn.runtime.kernel_cache` lets it know.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager

COMPILING = (
    "nldyn: compiling the kernels, once: one to two minutes of processor time "
    "('nldyn warm' does it beforehand)"
)


class Compilations:
    """Those of this process.

    Examples
    --------
    >>> own = Compilations()
    >>> own.muted = True
    >>> own.begin(), own.end()
    (None, None)
    >>> 0.0 <= own.seconds() < 1.0
    True
    """

    def __init__(self) -> None:
        self.muted = False
        self._told = False
        self._running = 0
        self._since = self._spent = 0.0

    def __repr__(self) -> str:
        return f"<Compilations: {self.seconds():.0f} s>"

    def seconds(self) -> float:
        """Time in s spent in them so far, with the one that lasts."""
        return self._spent + (time.monotonic() - self._since if self._running else 0.0)

    def begin(self) -> None:
        """One begins, perhaps within another; the first of the process is told on stderr."""
        if not self._running:
            self._since = time.monotonic()
        self._running += 1
        if not (self._told or self.muted):
            self._told = True
            start = "\r\x1b[K" if sys.stderr.isatty() else ""
            print(f"{start}{COMPILING}", file=sys.stderr, flush=True)

    def end(self) -> None:
        """One ends."""
        self._running -= 1
        if not self._running:
            self._spent += time.monotonic() - self._since

    @contextmanager
    def silenced(self, quiet: bool = True) -> Iterator[None]:
        """Tell nothing meanwhile, if quiet."""
        before = self.muted
        self.muted = before or quiet
        try:
            yield
        finally:
            self.muted = before


compilations = Compilations()
