"""Many independent computations on any executor: threads, processes or a cluster."""

from __future__ import annotations

import multiprocessing
import os
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Executor, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

import numpy as np

from nldyn.base.errors import check_types
from nldyn.runtime.interruption import ignored_interruption, interrupted

Item = TypeVar("Item")
Value = TypeVar("Value")

HOPELESS = 8  # processes ended in a row after which a broken pool is given up


class TaskError(RuntimeError):
    """One of many computations failed; the text says which and why."""


@dataclass(frozen=True)
class Outcome(Generic[Value]):
    """What became of one computation.

    Parameters
    ----------
    index : int
        Its place among the items.
    value : object, optional
        What it gave; None if it failed.
    failure : str
        Empty, or the kind of the error and its text.
    """

    index: int
    value: Value | None
    failure: str = ""

    def value_or_raise(self) -> Value:
        """Give the value.

        Raises
        ------
        TaskError
            If the computation failed.
        """
        if self.failure:
            raise TaskError(f"computation {self.index} failed: {self.failure}")
        return self.value  # type: ignore[return-value]


def check_execution(executor: object, progress: object) -> None:
    """Refuse an executor or a progress function that is none; both are optional."""
    check_types(executor=(executor, Executor, None), progress=(progress, Callable, None))


def run_all(
    function: Callable[[Item], Value],
    items: Sequence[Item],
    executor: Executor | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> list[Outcome[Value]]:
    """Apply a function to every item, on an executor, and keep failures as results.

    Parameters
    ----------
    function : callable
        Of one item. For processes and clusters it and the items are pickled: a function at the top
        of a module, or a `functools.partial` of one.
    items : sequence
        What to apply it to.
    executor : concurrent.futures.Executor, optional
        ``ThreadPoolExecutor``, ``ProcessPoolExecutor``, ``client.get_executor()`` of
        dask.distributed, or any other; one after the other, here, unless given. Where a
        computation kills its process of a ``ProcessPoolExecutor``, only that one fails.
    progress : callable, optional
        Called as ``progress(done, total)`` after each one.

    Returns
    -------
    list of Outcome
        In the order of the items.

    Examples
    --------
    >>> [outcome.value for outcome in run_all(abs, [-1, 2])]
    [1, 2]
    >>> run_all(len, [1])[0].failure
    "TypeError: object of type 'int' has no len()"
    """
    check_types(function=(function, Callable), items=(items, Sequence, np.ndarray))
    check_execution(executor, progress)
    outcomes: dict[int, Outcome[Value]] = {}
    with _ended_by_ctrl_c([executor]):
        for outcome in as_finished(function, items, executor):
            outcomes[outcome.index] = outcome
            if progress is not None:
                progress(len(outcomes), len(items))
    return [outcomes[index] for index in range(len(items))]


def values_of(
    function: Callable[[Item], Value],
    items: Sequence[Item],
    executor: Executor | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> list[Value]:
    """Values of `run_all`, where one failure is the failure of all.

    Raises
    ------
    TaskError
        For the first computation that failed, after all others are done.
    """
    return [outcome.value_or_raise() for outcome in run_all(function, items, executor, progress)]


def as_finished(
    function: Callable[[Item], Value], items: Sequence[Item], executor: Executor | None = None
) -> Iterator[Outcome[Value]]:
    """Give the outcomes of `run_all` one by one, as they are finished.

    When the caller stops early, computations that have not begun are cancelled; Ctrl-C ends the
    processes of a ``ProcessPoolExecutor``, which takes no more work then. Where a
    ``ProcessPoolExecutor`` breaks because a computation kills its process, those left are done on
    processes of their own, and only the one that kills is a failure.
    """
    if executor is None:
        for index, item in enumerate(items):
            try:
                outcome = Outcome(index, function(item))
            except Exception as error:
                outcome = Outcome(index, None, _said(error))
            yield outcome
        return
    futures: dict[Any, int] = {}
    lost: list[int] = []
    try:
        with _ended_by_ctrl_c([executor]):
            for index, item in enumerate(items):
                futures[_submitted(executor, function, item)] = index
            waiting = set(futures)
            while waiting:
                ended, waiting = wait(waiting, return_when=FIRST_COMPLETED)
                for future in sorted(ended, key=futures.__getitem__):
                    if isinstance(executor, ProcessPoolExecutor) and _broken(future):
                        lost.append(futures[future])
                    else:
                        yield _outcome(futures[future], future)
    finally:
        for future in futures:
            future.cancel()
    if lost:
        assert isinstance(executor, ProcessPoolExecutor)
        yield from _on_own_processes(executor, function, items, sorted(lost))


def _on_own_processes(
    pool: ProcessPoolExecutor,
    function: Callable[[Item], Value],
    items: Sequence[Item],
    indices: Sequence[int],
) -> Iterator[Outcome[Value]]:
    """Outcomes of some items after their pool broke.

    Each process has a pool of its own and one item at a time, so that its end tells which item
    killed it. After `HOPELESS` ends in a row the items left are given up: then it is not they, as
    where the main module cannot be imported.
    """
    waiting = iter(indices)
    pools: list[ProcessPoolExecutor] = []
    running: dict[Future[Value], tuple[int, ProcessPoolExecutor]] = {}

    def begin(own: ProcessPoolExecutor) -> None:
        index = next(waiting, None)
        if index is not None:
            running[own.submit(function, items[index])] = index, own

    ends = 0
    try:
        with _ended_by_ctrl_c(pools):
            for _ in range(min(_processes(pool), len(indices))):
                pools.append(_pool_of_one(pool))
                begin(pools[-1])
            while running:
                for future in wait(running, return_when=FIRST_COMPLETED).done:
                    index, own = running.pop(future)
                    ends = ends + 1 if _broken(future) else 0
                    yield _outcome(index, future)
                    if ends >= HOPELESS:
                        why = f"{HOPELESS} processes ended one after the other"
                        yield from (Outcome(i, None, f"BrokenProcessPool: {why}") for i in waiting)
                    if _broken(future):
                        own = _pool_of_one(pool)
                        pools.append(own)
                    begin(own)
    finally:
        for own in pools:
            own.shutdown(wait=False, cancel_futures=True)


@contextmanager
def _ended_by_ctrl_c(pools: Sequence[Executor | None]) -> Iterator[None]:
    """Within this Ctrl-C ends the processes of pools, also of those that are added."""
    try:
        yield
    except KeyboardInterrupt:
        for pool in pools:
            _end_processes(pool)
        raise


def _end_processes(executor: Executor | None) -> None:
    """End the processes of a pool at once, whatever they are at.

    After Ctrl-C, too, which a terminal sends to all of them: one that gets a second one while it
    waits for work ends with the lock of the pool's queue, and all others wait for that without end.
    One that ends while it writes leaves a part of its answer, for whose rest a thread of the pool
    would wait without end if this process did not close its own end for writing.
    """
    processes = list((getattr(executor, "_processes", None) or {}).values())
    answers = getattr(executor, "_result_queue", None)
    if isinstance(executor, ProcessPoolExecutor):
        executor.shutdown(wait=False, cancel_futures=True)
    with ignored_interruption():
        for process in processes:
            process.terminate()
        for process in processes:
            process.join()
        if answers is not None:
            answers._writer.close()


@contextmanager
def own_processes(jobs: int) -> Iterator[ProcessPoolExecutor | None]:
    """So many processes of this package's own, that end with the block; None for one."""
    if jobs <= 1:
        yield None
        return
    with process_pool(jobs) as pool:
        yield pool


@contextmanager
def process_pool(count: int) -> Iterator[ProcessPoolExecutor]:
    """So many processes that end with the block, whatever they are at."""
    pool = ProcessPoolExecutor(count, multiprocessing.get_context("spawn"), quiet_process)
    try:
        yield pool
    finally:
        _end_processes(pool)


def quiet_process() -> None:
    """Let this process end when the one that started it ends."""
    threading.Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    assert parent is not None
    parent.join()
    os._exit(1)


def _broken(future: Future[Value]) -> bool:
    return not future.cancelled() and isinstance(future.exception(), BrokenProcessPool)


def _processes(pool: ProcessPoolExecutor) -> int:
    return getattr(pool, "_max_workers", None) or os.cpu_count() or 1


def _pool_of_one(pool: ProcessPoolExecutor) -> ProcessPoolExecutor:
    """A pool of one process that starts as those of another pool."""
    return ProcessPoolExecutor(
        1,
        mp_context=getattr(pool, "_mp_context", None),
        initializer=getattr(pool, "_initializer", None),
        initargs=getattr(pool, "_initargs", ()),
    )


def _submitted(executor: Executor, function: Callable[[Item], Value], item: Item) -> Future[Value]:
    """A future; one that has failed where the executor takes no more, as a broken pool."""
    try:
        return executor.submit(function, item)
    except RuntimeError as error:
        future: Future[Value] = Future()
        future.set_exception(error)
        return future


def _outcome(index: int, future: Future[Value]) -> Outcome[Value]:
    try:
        return Outcome(index, future.result())
    except Exception as error:
        return Outcome(index, None, _said(error))


def _said(error: Exception) -> str:
    """Text of a failure; Ctrl-C, in whatever wrapping, is none and goes on to the caller."""
    if interrupted(error):
        raise KeyboardInterrupt from error
    return f"{type(error).__name__}: {error}"
