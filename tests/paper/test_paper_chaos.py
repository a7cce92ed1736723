"""Chaotic ranges: what is decided from Lyapunov exponents, and how it is shown."""

from __future__ import annotations

import numpy as np
import pytest
from fakes import FakeDiagram, resonance

import nldyn.paper.chaos
import nldyn.paper.figures
from nldyn import FlowMap, System
from nldyn.longterm.attractors import Attractor
from nldyn.longterm.lifetimes import ChaosLifetime
from nldyn.longterm.lyapunov import LyapunovSpectrum
from nldyn.longterm.poincare import BruteForce, Column
from nldyn.paper.chaos import (
    MODELS,
    POINTS,
    RANGE_HZ,
    Chaos,
    chaos_of,
    chaotic_places,
    effort_at,
    submit_sweeps,
    write_chaos_figure,
)
from nldyn.paper.claims import evaluate
from nldyn.paper.evidence import Finding
from nldyn.paper.figures import SHOWN, write_figures
from nldyn.paper.workers import worker_processes

FLOW = FlowMap(System.from_modal([10.0], {"middle": [1.0]}, modal_damping=0.1))
EMPTY = np.empty(0)


def swept(*ranges: tuple[float, float]) -> BruteForce:
    """A diagram whose motions are chaotic in some ranges and quasi-periodic elsewhere."""
    columns = []
    for hz in np.linspace(*RANGE_HZ, POINTS):
        chaotic = any(low <= hz <= high for low, high in ranges)
        value = 20.0 if chaotic else 0.0
        exponents = LyapunovSpectrum(
            hz, np.array([value, -30.0]), np.array([0.8, 0.8]), -30.0 + value, 500, np.zeros(2)
        )
        kind = "chaotic" if chaotic else "quasi-periodic"
        attractor = Attractor(FLOW, hz, kind, np.zeros((1, 2)), exponents=exponents)
        columns.append(Column("up", attractor, EMPTY, EMPTY, EMPTY, EMPTY))
    return BruteForce("middle", tuple(columns))


@pytest.fixture(scope="module")
def chaos() -> Chaos:
    more = swept((30.0, 37.0), (58.0, 62.0))
    less = swept((25.0, 50.0), (58.0, 70.0))
    diagrams = {model: less if model.endswith("0.001") else more for model in MODELS}
    return Chaos(diagrams, {model: [lives_at(hz) for hz in LASTING] for model in MODELS})


LASTING = [*np.arange(30.0, 37.1, 0.5), *np.arange(58.0, 62.1, 0.5)]


def lives_at(hz: float, *ended: int) -> ChaosLifetime:
    return ChaosLifetime(hz, 5000, np.array([*ended, *([0] * (8 - len(ended)))]))


def test_a_range_agrees_where_chaos_lasts_at_most_of_its_frequencies(chaos):
    found = chaos.finding("two_dof_xi_0.01", "30-37 and 58-63")
    assert found.holds
    assert "30-37 Hz: 15 of 15 (median exponent 20 ± 0.8 1/s); it lasts at 15" in found.text
    assert not chaos.finding("two_dof_xi_0.01", "30-37 and 59-70").holds
    assert "59-70 Hz: 7 of 23" in chaos.finding("two_dof_xi_0.01", "30-37 and 59-70").text


def test_a_range_does_not_agree_where_chaos_is_a_transient(chaos):
    lives = [lives_at(hz, 250, 500, 1000, 250) for hz in LASTING[:8]]
    lives += [lives_at(hz, 2000) for hz in LASTING[8:]]
    passing = Chaos(chaos.diagrams, {model: lives for model in MODELS})
    found = passing.finding("two_dof_xi_0.01", "30-37 and 58-63")
    assert not found.holds
    # four settle after 250 + 500 + 1000 + 250 of 22 000 periods, one after 2000 of 37 000
    assert "it lasts at 7 of them (some motions settle at 15 frequencies, " in found.text
    assert "after 5500 to 37000 periods in the mean)" in found.text
    assert "58-63 Hz: 9 of 11" in found.text and "it lasts at 9 of them" in found.text


def test_lifetimes_are_asked_for_at_each_chaotic_frequency_longest_where_the_paper_says_chaos(
    chaos,
):
    places = list(chaotic_places(chaos.diagrams))
    four = [hz for model, hz in places if model == "four_dof_xi_0.01"]
    assert four == [*np.arange(30.0, 37.1, 0.5), *np.arange(58.0, 62.1, 0.5)]
    assert {model for model, _ in places} == set(MODELS)
    assert effort_at("four_dof_xi_0.01", 58.0) == effort_at("two_dof_xi_0.01", 66.0) == (4, 2500)
    assert effort_at("two_dof_xi_0.01", 58.0) == effort_at("four_dof_xi_0.001", 30.0) == (4, 1000)


def test_damping_counts_flips_and_chaotic_frequencies(chaos):
    found = chaos.with_damping(Finding(holds=True, text="flips", note="counted; not decided"))
    assert found.holds
    text = "two_dof: chaotic at 24 of 145 frequencies at ξ = 0.01, lasting at 24; at 76 of 145 "
    assert text + "frequencies at ξ = 0.001, lasting at 76" in found.text
    assert not chaos.with_damping(Finding(holds=False, text="flips")).holds


def test_transients_do_not_count_for_the_damping(chaos):
    ending = {model: [] for model in MODELS}
    for xi, many in (("0.01", 1), ("0.001", 53)):  # of 24 and of 76
        hz = np.linspace(20.0, 80.0, many)
        ending[f"two_dof_xi_{xi}"] = [lives_at(f, 250, 250, 750, 1000) for f in hz]
    ending["four_dof_xi_0.001"] = [lives_at(30.0, 250, 250, 250), lives_at(31.0, *([1250] * 8))]
    found = Chaos(chaos.diagrams, ending)
    assert found.transients("four_dof_xi_0.001") == set()  # three of eight, and none so soon
    assert found.damping() == (
        False,  # 23 and 23
        "two_dof: chaotic at 24 of 145 frequencies at ξ = 0.01, lasting at 23; at 76 of 145 "
        "frequencies at ξ = 0.001, lasting at 23; four_dof: chaotic at 24 of 145 frequencies at "
        "ξ = 0.01, lasting at 24; at 76 of 145 frequencies at ξ = 0.001, lasting at 76",
    )


def test_the_rows_on_chaotic_ranges_are_decided(chaos, monkeypatch):
    flips = Finding(holds=True, text="fewer")
    monkeypatch.setattr("nldyn.paper.claims.CHECKS", {"damping": lambda _: flips})
    verdicts = {row.id: row.verdict for row in evaluate({}, chaos)}
    assert verdicts["fig4.chaos"] == "differs"  # 59 to 66 Hz: 7 of 15
    assert verdicts["fig7.chaos"] == "agrees"
    assert verdicts["damping"] == "agrees"
    assert {row.id: row.verdict for row in evaluate({})}["fig4.chaos"] == "not decided"


def test_chaotic_ranges_are_shaded(chaos, tmp_path, monkeypatch):
    results = {job: FakeDiagram([resonance()]) for jobs in SHOWN.values() for job in jobs}
    axes = {}
    monkeypatch.setattr(nldyn.paper.figures, "orbits_at", lambda *_: [])
    monkeypatch.setattr(
        nldyn.paper.figures, "save_figure", lambda ax, stem: axes.update({stem.name: ax})
    )
    write_figures(results, tmp_path, chaos)
    assert {name for name, ax in axes.items() if ax.patches} == {
        "figure_4", "figure_5", "figure_7", "figure_8",
    }  # fmt: skip
    left = [patch.get_x() for patch in axes["figure_4"].patches]
    assert left == [pytest.approx(29.75), pytest.approx(57.75)]


def test_the_figure_shows_both_models_at_both_dampings(chaos, tmp_path, monkeypatch):
    lives = {model: [lives_at(hz, *([500] * 8)) for hz in (30.0, 60.0)] for model in MODELS}
    axes = []
    save = nldyn.paper.chaos.save_figure
    monkeypatch.setattr(
        nldyn.paper.chaos, "save_figure", lambda ax, stem: (axes.append(ax), save(ax, stem))
    )
    write_chaos_figure(Chaos(chaos.diagrams, lives), tmp_path)
    hollow = [line for line in axes[0].lines if line.get_markerfacecolor() == "white"]
    assert [line.get_xdata().tolist() for line in hollow] == [[30.0, 60.0]] * 2
    text = (tmp_path / "chaos.svg").read_text(encoding="utf-8")
    assert (tmp_path / "chaos.png").stat().st_size > 10000
    assert "svg" in text


@pytest.mark.slow  # 11 s; `make paper` does no less
def test_all_models_are_swept_both_ways_on_processes(tmp_path):
    with worker_processes(2, tmp_path) as workers:
        sweeps = submit_sweeps(workers, points=2)
        found = chaos_of(workers.values(sweeps, "sweeps"), workers)
    assert set(found.diagrams) == set(MODELS)
    for diagram in found.diagrams.values():
        places = [(column.direction, column.frequency_hz) for column in diagram.columns]
        assert places == [("up", 18.0), ("up", 90.0), ("down", 90.0), ("down", 18.0)]
    chaotic = set(chaotic_places(found.diagrams))
    assert chaotic == {(m, x.frequency_hz) for m, lives in found.lifetimes.items() for x in lives}
    assert all(life.count == 4 for lives in found.lifetimes.values() for life in lives)
