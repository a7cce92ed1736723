"""Other processes that compute what a computation will ask for, before it asks.

The computation itself goes its way step by step and takes results that it finds ready; what is
computed ahead in vain costs time of other processors and changes nothing. So the results are the
same, bit for bit, with any number of processes.
"""

from __future__ import annotations

import io
import pickle
from collections.abc import Callable, Hashable, Iterator, Sequence
from concurrent.futures import Executor, Future, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from typing import Any, TypeVar

from nldyn.runtime.executors import process_pool
from nldyn.runtime.interruption import ignored_interruption, interrupted
from nldyn.runtime.threads import one_thread

Value = TypeVar("Value")

LOOK = 0.1  # s, between two looks at a result that is waited for


@dataclass
class Task:
    """A function of what all have in common and of other arguments, whose value may be asked for.

    Parameters
    ----------
    key : hashable
        What it is asked for by.
    function, arguments
        At the top of a module, called as ``function(shared, *arguments)``, and where it is called
        in this process perhaps with ``look``, to be called now and then.
    group : hashable, optional
        Of several of one group, one at a time is worth while: what it gives may tell that the
        others are not needed. Parts of one have the same ``member`` of the group.
    """

    key: Hashable
    function: Callable[..., Any]
    arguments: tuple[Any, ...]
    group: Hashable = None
    member: Hashable = None
    future: Future[bytes] | None = None


@dataclass
class Ahead:
    """What is computed ahead; without an executor nothing is.

    Parameters
    ----------
    shared : object
        First argument of all functions, such as a flow map; it is sent once.
    executor : Executor, optional
        Where.
    places : int
        How many tasks it has at a time.

    Examples
    --------
    >>> Ahead([1, 2, 3]).value("size", len)
    3
    """

    shared: Any
    executor: Executor | None = None
    places: int = 0
    waiting: list[Task] = field(default_factory=list)
    begun: dict[Hashable, Task] = field(default_factory=dict)
    busy: dict[Hashable, Hashable] = field(default_factory=dict)  # member of a group at work
    ready: dict[Hashable, tuple[Task, Any]] = field(default_factory=dict)  # computed here
    taken: list[Future[bytes]] = field(default_factory=list)  # waited for, or useless by now

    @cached_property
    def _sent(self) -> bytes:
        return pickle.dumps(self.shared, pickle.HIGHEST_PROTOCOL)

    def __repr__(self) -> str:
        return f"<Ahead: {len(self.waiting)} tasks wait, {len(self.begun)} begun>"

    def offer(
        self,
        key: Hashable,
        function: Callable[..., Any],
        *arguments: Any,
        group: Hashable = None,
        member: Hashable = None,
        first: bool = False,
    ) -> None:
        """Let a value be computed elsewhere when there is room, the ``first`` ones before."""
        if self.executor is None or self._is_offered(key):
            return
        task = Task(key, function, arguments, group, member)
        self.waiting.insert(0 if first else len(self.waiting), task)
        self.look()

    def _is_offered(self, key: Hashable) -> bool:
        return self.is_begun(key) or any(task.key == key for task in self.waiting)

    def look(self) -> None:
        """Begin what there is room for; to be called now and then."""
        if not self.waiting:
            return
        self.taken = [future for future in self.taken if not future.done()]
        futures = [task.future for task in self.begun.values() if task.future] + self.taken
        running = sum(not future.done() for future in futures)
        for task in list(self.waiting):
            if running >= self.places or self.executor is None:
                return
            if not self._is_free(task):
                continue
            self.waiting.remove(task)
            self._begin(task)
            running += 1

    def _is_free(self, task: Task) -> bool:
        """Whether no other member of its group is at work; from now on it is the one, if so."""
        if task.group is None:
            return True
        return self.busy.setdefault(task.group, task.member) == task.member

    def _begin(self, task: Task) -> None:
        assert self.executor is not None
        try:
            # pickled here and now: a pool's thread would meet objects that are being changed
            sent = _dumped((task.function, task.arguments), self.shared)
            with ignored_interruption():  # nor by the processes that this starts
                task.future = self.executor.submit(_computed, self._sent, sent)
        except RuntimeError:  # it takes no more: all else is computed here
            self.executor = None
            return
        self.begun[task.key] = task

    def value(
        self,
        key: Hashable,
        function: Callable[..., Value],
        *arguments: Any,
        meanwhile: Callable[[], None] | None = None,
    ) -> Value:
        """The value of a task, from elsewhere if it is begun there, else computed here."""
        self.waiting = [task for task in self.waiting if task.key != key]
        if key in self.ready:
            value: Value = self.ready.pop(key)[1]
            return value
        task = self.begun.pop(key, None)
        if task is not None and task.future is not None:
            self.taken.append(task.future)
            found = self._received(task.future, meanwhile)
            if found is not None:
                value = found[0]
                return value
        return function(self.shared, *arguments)

    def forget(self, key: Hashable) -> None:
        """Nobody will ask for a task, or it is computed here after all."""
        self.drop(lambda task: task.key == key)

    def is_begun(self, key: Hashable) -> bool:
        """Whether a task is begun elsewhere, or its value is there."""
        return key in self.begun or key in self.ready

    def _received(
        self, future: Future[bytes], meanwhile: Callable[[], None] | None
    ) -> tuple[Any] | None:
        """The value that comes from elsewhere; None if nothing comes, as from a killed process.

        Until it comes, others that wait are computed here.
        """
        while not wait([future], timeout=LOOK).done:
            self.look()
            if meanwhile is not None:
                meanwhile()
            if other := next(filter(self._is_free, self.waiting), None):
                self._prepare(other)
        self.look()
        try:
            return (_loaded(future.result(), self.shared),)
        except BrokenProcessPool:
            self.executor = None
            return None

    def _prepare(self, task: Task) -> None:
        """Compute a task here that may be asked for; an error is told only if it is."""
        self.waiting.remove(task)
        try:
            value = task.function(self.shared, *task.arguments, look=self.look)
        except Exception as error:
            if interrupted(error):
                raise
        else:
            self.ready[task.key] = task, value

    def values(
        self,
        keys: Sequence[Hashable],
        function: Callable[..., Value],
        arguments: Sequence[tuple[Any, ...]],
        each: Callable[[int, Value], None],
    ) -> list[Value]:
        """Values of one function for several arguments; ``each`` is called with how many are done,
        and the last of them.

        The first is computed here.
        """
        if not keys:
            return []
        found: dict[Hashable, Value] = {keys[0]: function(self.shared, *arguments[0])}
        each(1, found[keys[0]])
        rest = list(zip(keys, arguments, strict=True))[1:]
        for key, given in rest:
            self.offer(key, function, *given)
        for key, given in rest:  # first those that nobody has begun
            self.look()
            if not self.is_begun(key):
                found[key] = self.value(key, function, *given)
                each(len(found), found[key])
        for key, given in rest:
            if key not in found:
                found[key] = self.value(key, function, *given)
                each(len(found), found[key])
        return [found[key] for key in keys]

    def drop(self, unneeded: Callable[[Task], bool]) -> None:
        """Forget tasks that nobody will ask for."""
        self.waiting = [task for task in self.waiting if not unneeded(task)]
        for task, _ in list(self.ready.values()):
            if unneeded(task):
                del self.ready[task.key]
        for task in list(self.begun.values()):
            if unneeded(task) and task.future is not None:
                if not task.future.cancel():
                    self.taken.append(task.future)
                del self.begun[task.key]

    def take(self, group: Hashable, member: Hashable) -> None:
        """Count a member of a group as the one at work."""
        self.busy[group] = member

    def release(self, group: Hashable) -> None:
        """Count a group's member at work as done."""
        self.busy.pop(group, None)


class _Sender(pickle.Pickler):
    """Pickles everything but what is shared, which the receiver has."""

    def __init__(self, file: io.BytesIO, shared: Any) -> None:
        super().__init__(file, pickle.HIGHEST_PROTOCOL)
        self.shared = shared

    def persistent_id(self, obj: Any) -> str | None:
        return "shared" if obj is self.shared else None


class _Receiver(pickle.Unpickler):
    """Reads what a `_Sender` of an own process wrote."""

    def __init__(self, file: io.BytesIO, shared: Any) -> None:
        super().__init__(file)
        self.shared = shared

    def persistent_load(self, pid: Any) -> Any:
        return self.shared


def _loaded(content: bytes, shared: Any) -> Any:
    return _Receiver(io.BytesIO(content), shared).load()


def _dumped(value: Any, shared: Any) -> bytes:
    file = io.BytesIO()
    _Sender(file, shared).dump(value)
    return file.getvalue()


@one_thread()
def _computed(shared: bytes, task: bytes) -> bytes:
    """Compute the value of a task, in another process."""
    own = _unpacked(shared)
    function, arguments = _loaded(task, own)
    return _dumped(function(own, *arguments), own)


@lru_cache(maxsize=4)
def _unpacked(content: bytes) -> Any:
    return pickle.loads(content)


@contextmanager
def computing_ahead(
    shared: Any, jobs: int = 1, executor: Executor | None = None
) -> Iterator[Ahead]:
    """An `Ahead` on an executor, or with so many processes, this one included.

    Whatever is not asked for is ended with the block.
    """
    if executor is not None:
        yield Ahead(shared, executor, max(jobs - 1, 1) if jobs > 1 else _places(executor))
    elif jobs == 1 or not _can_be_sent(shared):
        yield Ahead(shared)
    else:
        with process_pool(jobs - 1) as pool:
            yield Ahead(shared, pool, jobs - 1)


def _places(executor: Executor) -> int:
    workers = getattr(executor, "_max_workers", None)
    return workers if isinstance(workers, int) else 1


def _can_be_sent(shared: Any) -> bool:
    """Whether it can go to another process: a law from a notebook cannot."""
    try:
        pickle.dumps(shared)
    except Exception as error:
        if interrupted(error):
            raise
        return False
    return True
