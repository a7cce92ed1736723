"""The command line called in this process, with limits of processor time and memory."""

from __future__ import annotations

import re
import resource
import signal
import traceback
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from click.testing import CliRunner, Result

from nldyn.app.cli import main

UNSEEN = re.compile(
    r"\d+ modes? that no interface sees (is|are) left out: |kept modes that no interface"
)
SECONDS = 10.0  # of processor time, for one command
PATIENCE = 60  # times as long by the clock, after which it counts as waiting for ever
MEMORY = 2_000_000_000  # bytes beyond what the process has at the start


class TooLongError(BaseException):
    """A command took longer than it may; not an Exception, so that nothing catches it."""


TIMERS = {signal.ITIMER_PROF: (signal.SIGPROF, 1), signal.ITIMER_REAL: (signal.SIGALRM, PATIENCE)}


@contextmanager
def limits(seconds: float = SECONDS, memory: int = MEMORY) -> Iterator[None]:
    """End what takes more than some seconds of the processor, and refuse it much memory.

    Not seconds by the clock: other programs may have the processor meanwhile.
    """

    def stop(*_: object) -> None:
        raise TooLongError

    pages = int(Path("/proc/self/statm").read_text().split()[0])
    before = resource.getrlimit(resource.RLIMIT_AS)
    resource.setrlimit(resource.RLIMIT_AS, (pages * resource.getpagesize() + memory, before[1]))
    handlers = {number: signal.signal(number, stop) for number, _ in TIMERS.values()}
    for timer, (_, times) in TIMERS.items():
        signal.setitimer(timer, times * seconds)
    try:
        yield
    finally:
        for timer in TIMERS:
            signal.setitimer(timer, 0.0)
        for number, handler in handlers.items():
            signal.signal(number, handler)
        resource.setrlimit(resource.RLIMIT_AS, before)


def command(*arguments: object, seconds: float = SECONDS) -> Result:
    """Call ``nldyn`` with some arguments."""
    with limits(seconds):
        return CliRunner().invoke(main, [str(argument) for argument in arguments])


def refusal(result: Result) -> str | None:
    """The sentence with which a command refused its input, None if it did its work.

    Fails where the command ended in any other way than these two.
    """
    error = result.exception
    if error is not None and not isinstance(error, SystemExit):
        raise AssertionError("".join(traceback.format_exception(error)))
    if result.exit_code == 0:
        return None
    assert result.exit_code == 2, result.output
    *warnings, line = result.stderr.splitlines()
    notes = ("nldyn: warning: ", *(text for text in warnings if UNSEEN.match(text)))
    assert all(text.startswith(notes) for text in warnings), result.stderr
    assert line.startswith("nldyn: ") and result.stderr.endswith("\n"), result.stderr
    assert line.isprintable(), repr(line)
    assert len(line) < 2000, line
    assert "Traceback" not in line
    return line.removeprefix("nldyn: ")
