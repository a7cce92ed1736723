"""Processes that share all computations of the paper, and the line that says what they do."""

from __future__ import annotations

import multiprocessing
import os
import threading
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import FIRST_EXCEPTION, Future, ProcessPoolExecutor, wait
from contextlib import contextmanager
from dataclasses import dataclass
from multiprocessing.queues import SimpleQueue
from pathlib import Path
from typing import TypeVar

from nldyn.paper.kept import kept
from nldyn.runtime.progress import Progress, progress_line

Key = TypeVar("Key")
Value = TypeVar("Value")
Message = tuple[str, float]
_messages: SimpleQueue[Message] | None = None  # of a worker process, to its parent


@dataclass(frozen=True)
class Workers:
    """Processes, what they tell, and where that is reported.

    Parameters
    ----------
    pool : ProcessPoolExecutor
        Takes what is to be computed.
    messages : SimpleQueue
        What each of them is at, with a frequency in Hz.
    report : callable
        Called as ``report(what, frequency_hz, done)``.
    folder : Path
        Keeps what is computed.
    """

    pool: ProcessPoolExecutor
    messages: SimpleQueue[Message]
    report: Progress
    folder: Path

    def submit(
        self, name: str, function: Callable[..., Value], *arguments: object
    ) -> Future[Value]:
        """Compute a function in one of the processes, unless its value is kept under this name."""
        return self.pool.submit(kept, self.folder / f"{name}.pickle", function, *arguments)

    def values(self, futures: Mapping[Key, Future[Value]], what: str) -> dict[Key, Value]:
        """Results of computations of one kind, once all are done; a failure is raised at once."""
        waiting = set(futures.values())
        while waiting:
            ended, waiting = wait(waiting, timeout=0.1, return_when=FIRST_EXCEPTION)
            for future in ended:
                future.result()  # or the error that ended it
            done = f"{len(futures) - len(waiting)} of {len(futures)} {what}"
            while not self.messages.empty():
                at, frequency_hz = self.messages.get()
                self.report(f"{done}, {at}", frequency_hz, 0.0)
            if ended:
                self.report(done, 0.0, 1.0 - len(waiting) / max(len(futures), 1))
        return {key: future.result() for key, future in futures.items()}


@contextmanager
def worker_processes(count: int, folder: Path) -> Iterator[Workers]:
    """Processes that end with their parent and at once when something goes wrong."""
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # small matrices: threads only hinder
    context = multiprocessing.get_context("spawn")
    messages: SimpleQueue[Message] = context.SimpleQueue()
    with (
        progress_line() as report,
        ProcessPoolExecutor(count, context, _prepare, (messages,)) as pool,
        _ended_at_failure(),
    ):
        yield Workers(pool, messages, report, folder)


def tell(what: str, frequency_hz: float) -> None:
    """Say from within a worker process what it is at; nobody listens elsewhere."""
    if _messages is not None:
        _messages.put((what, frequency_hz))


def _prepare(messages: SimpleQueue[Message]) -> None:
    """Let a worker process tell what it computes, and end when its parent ends."""
    global _messages
    _messages = messages
    threading.Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    assert parent is not None
    parent.join()
    os._exit(1)


@contextmanager
def _ended_at_failure() -> Iterator[None]:
    """End the worker processes at once when something goes wrong."""
    try:
        yield
    except BaseException:
        for worker in multiprocessing.active_children():
            worker.terminate()
        raise
