"""Chaotic ranges: what is decided from Lyapunov exponents, and how it is shown."""

from __future__ import annotations

import math

import numpy as np
import pytest
from fakes import FakeDiagram, resonance

import paper.chaos
import paper.figures
from paper.chaos import (
    EDGES_HZ,
    MODELS,
    RANGE_HZ,
    Chaos,
    Settled,
    claimed_ranges,
    frequencies_hz,
    joined_chaos,
    piece_name,
    sweep_piece,
    tasks_of_chaos,
    write_chaos_figure,
)
from paper.claims import evaluate
from paper.evidence import Finding
from paper.figures import SHOWN, write_figures


def swept(model: str, *ranges: tuple[float, float], ended: tuple[int, ...] = (0, 0, 0, 0)):
    """Motions that are chaotic in some ranges and quasi-periodic elsewhere."""
    up, down = frequencies_hz(model)
    found = []
    for hz in up:
        if any(low <= hz <= high for low, high in ranges):
            found.append(Settled(hz, "up", "chaotic", 20.0, 0.8, ended if hz in down else ()))
        else:
            found.append(Settled(hz, "up", "quasi-periodic", 0.0, 0.8))
    return found


@pytest.fixture(scope="module")
def chaos() -> Chaos:
    more, less = ((30.0, 37.0), (58.0, 62.0)), ((25.0, 50.0), (58.0, 70.0))
    return Chaos({m: swept(m, *(less if m.endswith("0.001") else more)) for m in MODELS})


def test_a_range_agrees_where_chaos_lasts_at_most_of_its_frequencies(chaos):
    found = chaos.finding("two_dof_xi_0.01", "30-37")
    assert found.holds
    assert "30-37 Hz: 15 of 15 (median exponent 20 ± 0.8 1/s); it lasts at 15" in found.text
    assert "8 of the other frequencies from 18 to 90 Hz" in found.note  # 58 to 62 Hz
    both = chaos.finding("two_dof_xi_0.01", "30-37 and 59-66")
    assert not both.holds
    assert "59-66 Hz: 7 of 15" in both.text


def test_a_range_does_not_agree_where_chaos_is_a_transient(chaos):
    passing = swept("two_dof_xi_0.01", (30.0, 37.0), ended=(250, 500, 0, 250))
    found = Chaos({**chaos.swept, "two_dof_xi_0.01": passing}).finding("two_dof_xi_0.01", "30-37")
    assert not found.holds
    # three settle after 250 + 500 + 250 of 2000 periods followed: the mean is 2000 / 3
    assert "it lasts at 0 of them (some motions settle at 15 frequencies, after 670" in found.text


def test_half_of_the_motions_is_not_more_than_half():
    lasting = [
        Settled(30.0, "up", "chaotic", 20.0, 0.8, ended).lasts
        for ended in ((0, 0, 250, 0), (0, 0, 250, 250), (0, -1, 0, -1), ())
    ]
    assert lasting == [True, False, False, False]


def test_damping_counts_flips_and_chaotic_frequencies(chaos):
    found = chaos.with_damping(Finding(holds=True, text="flips", note="counted; not decided"))
    assert found.holds
    text = "two_dof: chaotic at 13 of 73 frequencies at ξ = 0.01, at 39 at ξ = 0.001"
    assert text in found.text
    assert not chaos.with_damping(Finding(holds=False, text="flips")).holds
    alike = Chaos({model: swept(model, (30.0, 37.0)) for model in MODELS})
    assert not alike.with_damping(Finding(holds=True, text="flips")).holds


def test_the_rows_on_chaotic_ranges_are_decided(chaos, monkeypatch):
    flips = Finding(holds=True, text="fewer")
    monkeypatch.setattr("paper.claims.CHECKS", {"damping": lambda _: flips})
    verdicts = {row.id: row.verdict for row in evaluate({}, chaos)}
    assert verdicts["fig4.chaos"] == "differs"  # 59 to 66 Hz: 7 of 15
    assert verdicts["fig7.chaos"] == "agrees"  # 30 to 38 Hz: 15 of 17, 58 to 63: 9 of 11
    assert verdicts["damping"] == "agrees"
    assert {row.id: row.verdict for row in evaluate({})}["fig4.chaos"] == "not decided"


def test_chaotic_ranges_are_shaded(chaos, tmp_path, monkeypatch):
    results = {job: FakeDiagram([resonance()]) for jobs in SHOWN.values() for job in jobs}
    axes = {}
    monkeypatch.setattr(paper.figures, "orbits_at", lambda *_: [])
    monkeypatch.setattr(paper.figures, "save_figure", lambda ax, stem: axes.update({stem.name: ax}))
    write_figures(results, tmp_path, chaos)
    assert {name for name, ax in axes.items() if ax.patches} == {
        "figure_4", "figure_5", "figure_7", "figure_8",
    }  # fmt: skip
    assert axes["figure_4"].get_legend().get_texts()[-1].get_text() == "a motion is chaotic"
    left = [patch.get_x() for patch in axes["figure_4"].patches]
    assert left == [pytest.approx(29.5), pytest.approx(57.5)]


def test_the_figure_shows_both_models_at_both_dampings(chaos, tmp_path, monkeypatch):
    axes = []
    save = paper.chaos.save_figure
    monkeypatch.setattr(
        paper.chaos, "save_figure", lambda ax, stem: (axes.append(ax), save(ax, stem))
    )
    write_chaos_figure(chaos, tmp_path)
    labels = axes[0].get_legend_handles_labels()[1]
    assert labels == ["ξ = 0.01", "ξ = 0.001"]
    text = (tmp_path / "chaos.svg").read_text(encoding="utf-8")
    assert (tmp_path / "chaos.png").stat().st_size > 10000
    assert "svg" in text


def test_no_piece_of_a_sweep_cuts_a_published_range():
    for model in MODELS:
        up, down = frequencies_hz(model)
        assert (up[0], up[-1]) == RANGE_HZ
        for low, high in claimed_ranges(model):
            inside = [hz for hz in down if low <= hz <= high]
            assert inside == np.arange(low, high + 0.1, 0.5).tolist()
            assert not any(low <= edge <= high for edge in EDGES_HZ)


def test_pieces_joined_are_the_sweeps_with_each_frequency_once():
    def piece(model, number):
        low, high = EDGES_HZ[number : number + 2]
        inside = [hz for hz in frequencies_hz(model)[0] if low < hz < high]
        return [
            {"frequency_hz": hz, "way": "up", "kind": "periodic", "exponent": -1.0, "error": 0.1,
             "ended": []} for hz in inside
        ]  # fmt: skip

    values = {piece_name(m, k): piece(m, k) for m in MODELS for k in range(len(EDGES_HZ) - 1)}
    assert set(values) == {task.name for task in tasks_of_chaos(None)}
    found = joined_chaos(values)
    for model in MODELS:
        assert [s.frequency_hz for s in found.swept[model]] == frequencies_hz(model)[0]


def test_a_piece_is_swept_both_ways_and_told_as_numbers(monkeypatch):
    """There is a stable orbit in the harmonic resonance peak."""
    monkeypatch.setattr(paper.chaos, "EDGES_HZ", (22.6, 23.4))
    monkeypatch.setattr(paper.chaos, "frequencies_hz", lambda model: ([23.0], [23.0]))
    found = sweep_piece("two_dof_xi_0.01", 0, lambda *_: None)
    assert [(s["frequency_hz"], s["way"], s["kind"]) for s in found] == [
        (23.0, "up", "periodic"), (23.0, "down", "periodic"),
    ]  # fmt: skip
    assert all(s["exponent"] < 0.0 < s["error"] and not s["ended"] for s in found)
    assert math.isfinite(found[0]["exponent"])
