"""Many independent computations on any executor: threads, processes or a cluster."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Executor, Future, wait
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

from nldyn.interruption import interrupted

Item = TypeVar("Item")
Value = TypeVar("Value")


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
        dask.distributed, or any other; one after the other, here, unless given.
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
    outcomes: dict[int, Outcome[Value]] = {}
    for outcome in as_finished(function, items, executor):
        outcomes[outcome.index] = outcome
        if progress is not None:
            progress(len(outcomes), len(items))
    return [outcomes[index] for index in range(len(items))]


def as_finished(
    function: Callable[[Item], Value], items: Sequence[Item], executor: Executor | None = None
) -> Iterator[Outcome[Value]]:
    """Give the outcomes of `run_all` one by one, as they are finished.

    When the caller stops early, computations that have not begun are cancelled.
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
    try:
        for index, item in enumerate(items):
            futures[_submitted(executor, function, item)] = index
        waiting = set(futures)
        while waiting:
            ended, waiting = wait(waiting, return_when=FIRST_COMPLETED)
            for future in sorted(ended, key=futures.__getitem__):
                yield _outcome(futures[future], future)
    finally:
        for future in futures:
            future.cancel()


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
