"""Work done ahead by other processes changes nothing in what is found."""

import multiprocessing
import os
from concurrent.futures import Future, ThreadPoolExecutor

import pytest
from branches_alike import assert_same_branches
from cluster_tasks import die_elsewhere, doubled, lossy_spring
from problems import make_one_dof

from nldyn import (
    ExploreOptions,
    FlowMap,
    Stop,
    System,
    SystemModelError,
    Unbalance,
    diagram,
    explore,
)
from nldyn.io import CheckpointFile
from nldyn.orbits import OrbitSearchOptions
from nldyn.runtime.prefetch import Ahead, computing_ahead

WANTED = {
    "limits": (30.0, 60.0),
    "periods": [1, 2],
    "search_points": 3,
    "search": OrbitSearchOptions(starts=4),
}


def assert_same_diagrams(a, b):
    assert a.notes == b.notes
    assert [branch.name for branch in a.branches] == [branch.name for branch in b.branches]
    for one, other in zip(a.branches, b.branches, strict=True):
        assert_same_branches(one, other)


@pytest.fixture(scope="module")
def alone():
    return diagram(make_one_dof(), **WANTED)


def test_two_processes_find_what_one_finds(alone):
    assert {branch.period for branch in alone.branches} == {1, 2}
    assert_same_diagrams(diagram(make_one_dof(), **WANTED, jobs=2), alone)
    assert not multiprocessing.active_children()


def test_an_executor_finds_the_same(alone):
    with ThreadPoolExecutor(2) as executor:
        assert_same_diagrams(diagram(make_one_dof(), **WANTED, executor=executor), alone)


@pytest.mark.slow
def test_an_interrupted_run_goes_on_with_another_number_of_processes(alone, tmp_path, monkeypatch):
    monkeypatch.setattr("nldyn.runtime.keeper.PAUSE", 0.0)
    path = tmp_path / "kept.h5"

    def stop(what, *_):
        if what == "1/2" and path.exists():  # a branch is kept
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        diagram(make_one_dof(), **WANTED, jobs=2, progress=stop, checkpoint=CheckpointFile(path))
    assert not multiprocessing.active_children() and path.exists()
    assert_same_diagrams(diagram(make_one_dof(), **WANTED, checkpoint=CheckpointFile(path)), alone)


def test_explore_finds_the_same_with_two_processes():
    effort = ExploreOptions(spacing=0.15, starts=2)
    found, other = (
        explore(make_one_dof(), (24.0, 30.0), 2, effort=effort, jobs=jobs) for jobs in (1, 2)
    )
    assert_same_diagrams(found.diagram, other.diagram)
    assert found.report() == other.report()


def test_a_law_that_cannot_be_sent_is_computed_here():
    def own(depth, speed):
        return lossy_spring(depth, speed)

    system = System.from_modal(
        [13.0], {"middle": [0.6]}, modal_damping=0.02,
        stops=[Stop("middle", 5e7, 1.0, law=own)], excitation=[Unbalance("middle", 5e-6)],
    )  # fmt: skip
    with computing_ahead(FlowMap(system), 2) as ahead:
        assert ahead.executor is None


@pytest.mark.parametrize("jobs", [0, 1.5, "two", True])
def test_jobs_is_a_whole_number(jobs):
    with pytest.raises(SystemModelError, match="jobs must be a whole number"):
        diagram(make_one_dof(), (24.0, 27.0), [1], jobs=jobs)


def test_a_killed_process_costs_nothing_but_time(one_dof):
    flow = FlowMap(one_dof)
    with computing_ahead(flow, 2) as ahead:
        ahead.offer("deadly", die_elsewhere, os.getpid())
        assert ahead.is_begun("deadly")
        assert ahead.value("deadly", die_elsewhere, os.getpid()) == "here"
        assert ahead.executor is None
        ahead.offer("next", doubled, 3)
        assert ahead.value("next", doubled, 3) == 6


class Later:
    """An executor that does its work when it is told to."""

    _max_workers = 2

    def __init__(self):
        self.tasks = []

    def submit(self, function, *arguments):
        future = Future()
        self.tasks.append((future, function, arguments))
        return future

    def work(self):
        for future, function, arguments in self.tasks:
            if not future.done() and future.set_running_or_notify_cancel():
                future.set_result(function(*arguments))


@pytest.fixture
def ahead(one_dof):
    return Ahead(FlowMap(one_dof), Later(), 2)


def begun(ahead):
    return [key for key in "abcd" if ahead.is_begun(key)]


def test_of_a_group_one_member_is_computed_at_a_time(ahead):
    for key, member in (("a", 1), ("b", 2), ("c", 1)):
        ahead.offer(key, doubled, 1, group="period 1", member=member)
    assert begun(ahead) == ["a", "c"]
    ahead.executor.work()
    ahead.look()
    assert begun(ahead) == ["a", "c"]  # what they give may make b useless
    ahead.release("period 1")
    ahead.look()
    assert begun(ahead) == ["a", "b", "c"]


def test_no_more_is_begun_than_there_is_room_for(ahead):
    for key in "abc":
        ahead.offer(key, doubled, 1)
    ahead.offer("d", doubled, 1, first=True)
    assert begun(ahead) == ["a", "b"]
    ahead.drop(lambda task: task.key == "a")  # that one was not running yet
    ahead.look()
    assert begun(ahead) == ["b", "d"]


def test_what_waits_is_computed_here_while_another_is_waited_for(ahead):
    for key, number in (("a", 1), ("b", 2), ("c", 3)):
        ahead.offer(key, doubled, number)
    looks = []

    def meanwhile():
        looks.append(ahead.is_begun("c"))
        if len(looks) > 1:
            ahead.executor.work()

    assert ahead.value("a", doubled, 1, meanwhile=meanwhile) == 2
    assert looks == [False, True] and ahead.ready["c"][1] == 6
    assert ahead.value("c", doubled, 3) == 6


def test_an_error_is_told_only_where_its_value_is_asked_for(ahead):
    ahead.offer("a", doubled, 1)
    ahead.offer("b", doubled, 2)
    ahead.offer("c", doubled, None)  # computed here, in vain, while a is waited for

    def meanwhile():
        if not ahead.waiting:
            ahead.executor.work()

    assert ahead.value("a", doubled, 1, meanwhile=meanwhile) == 2
    assert not ahead.is_begun("c")
    with pytest.raises(TypeError):
        ahead.value("c", doubled, None)


def test_values_come_in_order_and_the_first_is_computed_here(ahead):
    told = []

    def each(count, value):
        told.append((count, value))
        ahead.executor.work()

    found = ahead.values(list("abcd"), doubled, [(1,), (2,), (3,), (4,)], each)
    assert found == [2, 4, 6, 8]
    assert told[0] == (1, 2) and [count for count, _ in told] == [1, 2, 3, 4]
