"""What the figures of the paper show and say."""

import pytest
from fakes import FakeDiagram, resonance

import paper.figures
from paper.evidence import nearest_unstable
from paper.figures import CAPTIONS, SHOWN, title, write_figures
from paper.page import write_page


@pytest.fixture
def results():
    found = {job: FakeDiagram([resonance()]) for jobs in SHOWN.values() for job in jobs}
    found["two_dof_xi_0.001"] = FakeDiagram([resonance()], limits=(18.0, 90.0))
    found["two_dof.sub14"] = FakeDiagram([resonance(14, 55.0, 58.0, 20)])
    return found


@pytest.fixture
def drawn(results, tmp_path, monkeypatch):
    """Axes of every diagram by the name of its file."""
    axes = {}
    monkeypatch.setattr(paper.figures, "orbits_at", lambda *_: [])
    monkeypatch.setattr(paper.figures, "save_figure", lambda ax, stem: axes.update({stem.name: ax}))
    write_figures(results, tmp_path)
    return axes


def test_figure_5_has_the_branch_of_period_14(drawn):
    labels = [text.get_text() for text in drawn["figure_5"].get_legend().get_texts()]
    assert "1/14 subharmonic" in labels


def test_figures_and_page_say_what_range_was_computed(results, drawn, tmp_path):
    assert drawn["figure_2"].get_title().endswith("computed from 5 to 90 Hz")
    write_page([], results, 1.0, tmp_path)
    page = (tmp_path / "index.html").read_text(encoding="utf-8")
    assert all(title(name, results) in page for name in CAPTIONS)
    assert page.count("Dashed lines: f₂/2 to f₂/5 with f₂ = 125.1 Hz") == 2


def test_the_orbit_nearest_to_that_of_the_paper_is_unstable():
    """The fakes are unstable from 30 to 40 Hz, with one impact."""
    diagram = FakeDiagram([resonance()])
    nearest = nearest_unstable(diagram, 1, 22.5)
    unstable = [o.frequency_hz for o in diagram.branches[0].points if not o.stable]
    assert nearest.frequency_hz == min(unstable)
    assert nearest_unstable(diagram, 3, 22.5) is None


@pytest.mark.parametrize("name", ["figure_4", "figure_5"])
def test_dashed_lines_are_named_at_their_frequency(drawn, name):
    named = {text.get_text().strip()[:4]: text.get_position()[0] for text in drawn[name].texts}
    assert named == {f"f₂/{n}": pytest.approx(125.1 / n) for n in (2, 3, 4, 5)}
    assert not drawn["figure_7"].texts


def test_inset_of_figure_7_keeps_clear_of_the_axis(drawn):
    ax = drawn["figure_7"]
    ax.figure.canvas.draw()
    (inset,) = ax.child_axes
    axis = ax.get_window_extent().x0
    assert all(t.get_window_extent().x0 > axis for t in inset.get_yticklabels() if t.get_visible())
