"""Chaotic ranges: what is decided from Lyapunov exponents, and how it is shown."""

from __future__ import annotations

import numpy as np
import pytest
from fakes import FakeDiagram, resonance

import nldyn.paper.figures
from nldyn import FlowMap, System
from nldyn.attractors import Attractor
from nldyn.lyapunov import LyapunovSpectrum
from nldyn.paper.chaos import MODELS, POINTS, RANGE_HZ, Chaos, compute_chaos, write_chaos_figure
from nldyn.paper.claims import evaluate
from nldyn.paper.evidence import Finding
from nldyn.paper.figures import SHOWN, write_figures
from nldyn.sections import BruteForce, Column

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
    return Chaos({model: less if model.endswith("0.001") else more for model in MODELS})


def test_a_range_agrees_where_most_of_its_frequencies_are_chaotic(chaos):
    found = chaos.finding("two_dof_xi_0.01", "30-37 and 58-63")
    assert found.holds
    assert "30-37 Hz: 15 of 15 (median exponent 20 ± 0.8 1/s)" in found.text
    assert not chaos.finding("two_dof_xi_0.01", "30-37 and 59-70").holds
    assert "59-70 Hz: 7 of 23" in chaos.finding("two_dof_xi_0.01", "30-37 and 59-70").text


def test_damping_counts_flips_and_chaotic_frequencies(chaos):
    found = chaos.with_damping(Finding(holds=True, text="flips", note="counted; not decided"))
    assert found.holds
    assert "two_dof: chaotic at 24 of 145 frequencies at ξ = 0.01, at 76 at 0.001" in found.text
    assert not chaos.with_damping(Finding(holds=False, text="flips")).holds


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


def test_the_figure_shows_both_models_at_both_dampings(chaos, tmp_path):
    write_chaos_figure(chaos, tmp_path)
    text = (tmp_path / "chaos.svg").read_text(encoding="utf-8")
    assert (tmp_path / "chaos.png").stat().st_size > 10000
    assert "svg" in text


def test_all_models_are_swept_both_ways_on_processes():
    found = compute_chaos(workers=2, points=2)
    assert set(found.diagrams) == set(MODELS)
    for diagram in found.diagrams.values():
        places = [(column.direction, column.frequency_hz) for column in diagram.columns]
        assert places == [("up", 18.0), ("up", 90.0), ("down", 90.0), ("down", 18.0)]
