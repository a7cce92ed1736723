"""Searches beside known branches that are interrupted go on after the frequencies done."""

from __future__ import annotations

import re
from dataclasses import replace
from functools import partial

import h5py
import numpy as np
import pytest
from branches_alike import assert_same_branches, without

from nldyn import ContinuationOptions, SystemModelError, extend_diagram, save
from nldyn.branches.checkpoint import Checkpoint
from nldyn.io import CheckpointFile
from nldyn.io.branches import load_branches, save_branches
from nldyn.search import ClosedWalks, Mixtures, PseudoOrbits
from nldyn.search.collector import Collector

WAYS = {
    "closed walks": ClosedWalks(states=50, tries=4, seed=1),
    "mixtures": Mixtures(tries=4, seed=1),
    "pseudo-orbits": PseudoOrbits(tries=2),
}
search = partial(extend_diagram, spacing=0.006)


class Frequencies:
    """Those that a search tries, in Hz; it is interrupted at the one of a number."""

    def __init__(self, way: str, last: int | None = None) -> None:
        self.way, self.last = way, last
        self.tried: list[float] = []

    def __call__(self, what: str, frequency_hz: float, done: float) -> None:
        if what == self.way and frequency_hz not in self.tried:
            self.tried.append(frequency_hz)
            if len(self.tried) == self.last:
                raise KeyboardInterrupt


@pytest.fixture(
    params=[way if way == "mixtures" else pytest.param(way, marks=pytest.mark.slow) for way in WAYS]
)
def way(request):
    return request.param


@pytest.fixture
def interrupted(three, way, tmp_path):
    """A file of a search that was interrupted at its third frequency."""
    place = tmp_path / "found.h5"
    with pytest.raises(KeyboardInterrupt):
        search(three, WAYS[way], progress=Frequencies(way, 3), checkpoint=CheckpointFile(place))
    return place


def test_interrupted_it_gives_what_an_uninterrupted_one_gives(three, way, interrupted):
    whole, rest = Frequencies(way), Frequencies(way)
    wanted = search(three, WAYS[way], progress=whole)
    resumed = search(three, WAYS[way], progress=rest, checkpoint=CheckpointFile(interrupted))
    assert len(whole.tried) > 3
    assert rest.tried == whole.tried[2:]
    assert resumed.notes == wanted.notes
    nothing = Frequencies(way)
    again = search(three, WAYS[way], progress=nothing, checkpoint=CheckpointFile(interrupted))
    assert not nothing.tried
    assert again.notes == wanted.notes


def test_another_search_begins_anew(three, way, interrupted):
    """With other numbers, or beside other branches."""
    strategy = WAYS[way]
    for known, other, numbers in (
        (three, replace(strategy, tries=5), {}),
        (three, strategy, {"max_period": 2}),
        (three, strategy, {"options": ContinuationOptions(max_points=30)}),
        (without(three, three.of_period(2)[0]), strategy, {}),
    ):
        tried = Frequencies(way, 1)
        place = CheckpointFile(interrupted)
        with pytest.raises(KeyboardInterrupt):
            search(known, other, progress=tried, checkpoint=place, **numbers)
        fresh = Frequencies(way, 1)
        with pytest.raises(KeyboardInterrupt):
            search(known, other, progress=fresh, **numbers)
        assert tried.tried == fresh.tried


@pytest.mark.parametrize(
    "way",
    [
        "mixtures",
        *(
            pytest.param(other, marks=pytest.mark.slow)
            for other in ("closed walks", "pseudo-orbits")
        ),
    ],
)
def test_what_it_has_found_is_not_lost_and_changes_nothing_where_it_goes_on(three, way, tmp_path):
    """Interrupted just after a branch was found: its orbits are used from the next frequency on."""
    (left_out,) = three.of_period(2)
    known, place = without(three, left_out), tmp_path / "found.h5"
    many = {"states": 400} if way == "closed walks" else {}
    strategy = replace(WAYS[way], tries=30, **many)
    search = partial(extend_diagram, strategy=strategy, spacing=0.012)
    whole = Frequencies(way)
    wanted = search(known, progress=whole)
    tried: list[float] = []

    def interrupt(what: str, frequency_hz: float, done: float) -> None:
        if what == way:
            tried.append(frequency_hz)
            if place.exists() and load_branches(place):
                raise KeyboardInterrupt

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("nldyn.runtime.keeper.PAUSE", 0.0)
        patch.setattr("nldyn.runtime.keeper.SHARE", 0.0)
        with pytest.raises(KeyboardInterrupt):
            search(known, progress=interrupt, checkpoint=CheckpointFile(place))
    rest = Frequencies(way)
    found = search(known, progress=rest, checkpoint=CheckpointFile(place))
    assert rest.tried == whole.tried[whole.tried.index(tried[-1]) :]
    assert found.notes == wanted.notes
    for branch, same in zip(found.branches, wanted.branches, strict=True):
        assert_same_branches(branch, same)
    assert any(branch.period == 2 for branch in found.branches[2:])


def test_a_search_of_an_earlier_version_begins_anew(three, way, interrupted):
    """Its file does not tell how many branches there were when a frequency was begun."""
    with h5py.File(interrupted, "r+") as file:
        del file["search"].attrs["known"]
    tried = Frequencies(way, 1)
    with pytest.raises(KeyboardInterrupt):
        search(three, WAYS[way], progress=tried, checkpoint=CheckpointFile(interrupted))
    fresh = Frequencies(way, 1)
    with pytest.raises(KeyboardInterrupt):
        search(three, WAYS[way], progress=fresh)
    assert tried.tried == fresh.tried


def test_a_damaged_place_is_told_by_its_name(three, way, interrupted):
    with h5py.File(interrupted, "r+") as file:
        del file["search"].attrs["done"]
    with pytest.raises(SystemModelError, match=r"found\.h5: attribute '/search/done' is missing"):
        search(three, WAYS[way], checkpoint=CheckpointFile(interrupted))


@pytest.fixture
def all_repeated(monkeypatch):
    """Every branch that is followed turns out to repeat a known one."""
    monkeypatch.setattr(Collector, "_repeats", lambda box, branch: True)


def test_a_branch_that_repeats_a_known_one_is_not_kept(three, all_repeated, tmp_path):
    known, place = without(three, three.of_period(2)[0]), tmp_path / "found.h5"
    done = search(known, Mixtures(tries=30), spacing=0.1, checkpoint=CheckpointFile(place))
    assert int(re.match(r"\d+", done.notes[-1])[0]) > 0
    assert done.branches == known.branches
    assert load_branches(place) == []


def test_a_branch_of_the_file_that_turns_out_to_be_known_is_not_added(
    three, all_repeated, tmp_path
):
    (second,), place = three.of_period(2), tmp_path / "found.h5"
    save_branches(place, [second])
    known = without(three, second)
    done = search(known, Mixtures(tries=1), spacing=0.5, checkpoint=CheckpointFile(place))
    assert done.branches == known.branches


def test_what_a_file_holds_stays_there_also_with_another_strategy(three, tmp_path):
    (second,), place = three.of_period(2), tmp_path / "found.h5"
    save_branches(place, [second])
    known = without(three, second)
    for strategy in (Mixtures(tries=1), PseudoOrbits(tries=1)):
        found = search(known, strategy, spacing=0.5, checkpoint=CheckpointFile(place))
        for branch in (found.branches[-1], load_branches(place)[0]):
            assert np.array_equal(branch.frequency_hz, second.frequency_hz)
    save(found, place)
    with pytest.raises(SystemModelError, match="holds a diagram or exploration"):
        search(known, Mixtures(tries=1), checkpoint=CheckpointFile(place))


@pytest.mark.parametrize("at", ["test", "work"])
def test_no_branch_of_a_file_is_lost_to_an_interrupt(at):
    kept: list[str] = []
    given = ["known", "tested", "later"]

    def write(branches):
        kept[:] = branches

    held: list[str] = []
    checkpoint = Checkpoint(lambda some: write([*held, *some]), earlier=given, held=held)

    def is_known(branch: str) -> bool:
        if branch == "tested" and at == "test":
            raise KeyboardInterrupt
        return branch == "known"

    with pytest.raises(KeyboardInterrupt), checkpoint:
        for _ in checkpoint.new_branches(is_known):
            raise KeyboardInterrupt
    checkpoint.write()
    assert sorted(kept) == sorted(given)
