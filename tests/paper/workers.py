"""Processes that share all computations of the paper, and the line that says what they do."""

from __future__ import annotations

import multiprocessing
import os
from collections.abc import Callable, Iterator
from concurrent.futures import FIRST_EXCEPTION, Future, ProcessPoolExecutor, wait
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from multiprocessing.queues import SimpleQueue
from typing import TypeVar

from nldyn.runtime.executors import quiet_process
from nldyn.runtime.progress import Progress, Shares, progress_line

Value = TypeVar("Value")
Message = tuple[str, str, float, float]  # task, what it is at, frequency in Hz, share done
_messages: SimpleQueue[Message] | None = None  # of a worker process, to its parent


@dataclass(frozen=True)
class Task:
    """Something to compute in one of the processes.

    Parameters
    ----------
    name : str
        Its name, also for the reader.
    function : callable
        Called as ``function(*arguments, progress)``.
    arguments : tuple
        Its arguments.
    weight : float
        Time that it takes, in proportion to others.
    """

    name: str
    function: Callable[..., object]
    arguments: tuple[object, ...]
    weight: float


@dataclass(frozen=True)
class Workers:
    """Processes, what they tell, and where that is reported.

    Parameters
    ----------
    pool : ProcessPoolExecutor
        Takes what is to be computed.
    messages : SimpleQueue
        What each of them is at.
    report : callable
        Called as ``report(what, frequency_hz, done)``.
    """

    pool: ProcessPoolExecutor
    messages: SimpleQueue[Message]
    report: Progress

    def values(self, tasks: tuple[Task, ...]) -> dict[str, object]:
        """Values of tasks by their names, the heaviest begun first; a failure is raised at once."""
        shares = Shares(self.report, {task.name: task.weight for task in tasks})
        futures = {
            task.name: self.pool.submit(_computed, task)
            for task in sorted(tasks, key=lambda task: -task.weight)
        }
        waiting: set[Future[object]] = set(futures.values())
        while waiting:
            ended, waiting = wait(waiting, timeout=0.1, return_when=FIRST_EXCEPTION)
            for future in ended:
                future.result()  # or the error that ended it
            self._tell(shares)
        return {task.name: futures[task.name].result() for task in tasks}

    def _tell(self, shares: Shares) -> None:
        """Report what the processes have told."""
        while not self.messages.empty():
            name, what, frequency_hz, done = self.messages.get()
            shares.part(name)(f"{name}: {what}", frequency_hz, done)


def _computed(task: Task) -> object:
    """Value of a task, in a worker process."""
    value = task.function(*task.arguments, partial(tell, task.name))
    tell(task.name, "done", 0.0, 1.0)
    return value


def tell(name: str, what: str, frequency_hz: float, done: float) -> None:
    """Say from within a worker process how far a task is; nobody listens elsewhere."""
    if _messages is not None:
        _messages.put((name, what, frequency_hz, done))


@contextmanager
def worker_processes(count: int, quiet: bool = False) -> Iterator[Workers]:
    """Processes that end with their parent and at once when something goes wrong."""
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # small matrices: threads only hinder
    context = multiprocessing.get_context("spawn")
    messages: SimpleQueue[Message] = context.SimpleQueue()
    with (
        progress_line(quiet) as report,
        ProcessPoolExecutor(count, context, _prepare, (messages,)) as pool,
        ended_at_failure(),
    ):
        yield Workers(pool, messages, report)


def _prepare(messages: SimpleQueue[Message]) -> None:
    """Let a worker process tell what it computes, and end when its parent ends."""
    global _messages
    _messages = messages
    quiet_process()


@contextmanager
def ended_at_failure() -> Iterator[None]:
    """End the worker processes at once when something goes wrong."""
    try:
        yield
    except BaseException:
        for worker in multiprocessing.active_children():
            worker.terminate()
        raise
