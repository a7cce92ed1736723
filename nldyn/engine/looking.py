"""Looks that a caller takes during long calls of the flow map, to end them."""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar

from nldyn.engine.library import HOST, host

_CALLBACK = ctypes.PYFUNCTYPE(ctypes.c_int)


class Looks:
    """Calls of a function from within the engine, until it raises.

    Parameters
    ----------
    look : callable
        What is called.

    Examples
    --------
    >>> Looks(lambda: None)
    <Looks that go on>
    """

    def __init__(self, look: Callable[[], None]) -> None:
        self.raised: BaseException | None = None

        def enough() -> int:
            try:
                look()
            except BaseException as error:  # an error that leaves a callback is lost
                self.raised = error
            return int(self.raised is not None)

        self._callback = _CALLBACK(enough)
        address = ctypes.cast(self._callback, ctypes.c_void_p).value or 0
        self.host = host(address)

    def __repr__(self) -> str:
        return f"<Looks that {'go on' if self.raised is None else 'ended'}>"


_looks: ContextVar[Looks | None] = ContextVar("looks", default=None)


@contextmanager
def looking(look: Callable[[], None]) -> Iterator[None]:
    """Call a function every 0.05 s during the calls of the flow map in a block, of this thread.

    What it raises ends the call, and is raised from there.

    Examples
    --------
    >>> with looking(lambda: None):
    ...     pass
    """
    token = _looks.set(Looks(look))
    try:
        yield
    finally:
        _looks.reset(token)


def host_now() -> bytes:
    """The structure Host for a call of the flow map."""
    looks = _looks.get()
    return HOST if looks is None else looks.host


def raise_ended() -> None:
    """Raise what a look raised during the last call, if it ended that."""
    looks = _looks.get()
    if looks is not None and looks.raised is not None:
        error, looks.raised = looks.raised, None
        raise error
