"""Searches beside known branches that are interrupted go on after the frequencies done."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import h5py
import pytest
from branches_alike import assert_same_branches, without

from nldyn import (
    CheckpointFile,
    ContinuationOptions,
    Diagram,
    SystemModelError,
    by_closed_walks,
    by_crossover,
    by_pseudo_orbits,
)
from nldyn.io.branches import load_branches

Search = Callable[..., Diagram]
WAYS: dict[str, Search] = {
    "closed walks": partial(by_closed_walks, states=50, tries=4, spacing=0.006, seed=1),
    "mixtures": partial(by_crossover, tries=4, spacing=0.006, seed=1),
    "pseudo-orbits": partial(by_pseudo_orbits, tries=2, spacing=0.006),
}


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


@pytest.fixture(params=WAYS)
def way(request):
    return request.param


@pytest.fixture
def interrupted(three, way, tmp_path):
    """A file of a search that was interrupted at its third frequency."""
    place = tmp_path / "found.h5"
    with pytest.raises(KeyboardInterrupt):
        WAYS[way](three, progress=Frequencies(way, 3), checkpoint=CheckpointFile(place))
    return place


def test_interrupted_it_gives_what_an_uninterrupted_one_gives(three, way, interrupted):
    whole, rest = Frequencies(way), Frequencies(way)
    wanted = WAYS[way](three, progress=whole)
    resumed = WAYS[way](three, progress=rest, checkpoint=CheckpointFile(interrupted))
    assert len(whole.tried) > 3
    assert rest.tried == whole.tried[2:]
    assert resumed.notes == wanted.notes
    nothing = Frequencies(way)
    again = WAYS[way](three, progress=nothing, checkpoint=CheckpointFile(interrupted))
    assert not nothing.tried
    assert again.notes == wanted.notes


def test_another_search_begins_anew(three, way, interrupted):
    """With other numbers, or beside other branches."""
    for known, numbers in (
        (three, {"tries": 5}),
        (three, {"max_period": 2}),
        (three, {"options": ContinuationOptions(max_points=30)}),
        (without(three, three.of_period(2)[0]), {}),
    ):
        tried = Frequencies(way, 1)
        with pytest.raises(KeyboardInterrupt):
            WAYS[way](known, progress=tried, checkpoint=CheckpointFile(interrupted), **numbers)
        fresh = Frequencies(way, 1)
        with pytest.raises(KeyboardInterrupt):
            WAYS[way](known, progress=fresh, **numbers)
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
    search = partial(WAYS[way], tries=30, spacing=0.012, **many)
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
        WAYS[way](three, progress=tried, checkpoint=CheckpointFile(interrupted))
    fresh = Frequencies(way, 1)
    with pytest.raises(KeyboardInterrupt):
        WAYS[way](three, progress=fresh)
    assert tried.tried == fresh.tried


def test_a_damaged_place_is_told_by_its_name(three, way, interrupted):
    with h5py.File(interrupted, "r+") as file:
        del file["search"].attrs["done"]
    with pytest.raises(SystemModelError, match=r"found\.h5: attribute '/search/done' is missing"):
        WAYS[way](three, checkpoint=CheckpointFile(interrupted))
