"""Which orbit the picture of contact shows."""

import numpy as np
import pytest

from nldyn import (
    HarmonicForce,
    Parameter,
    System,
    contact_area,
    continue_branch,
    solve_orbit,
)
from nldyn.report.answer import answer_lines
from nldyn.report.contact import contact_figure
from nldyn.report.offline import unpacked
from nldyn.report.results import tables_of, write_results
from nldyn.search.diagram import Diagram
from nldyn.system import DryFriction


def drawn(friction, gap):
    """Two points that a force presses against a plane, and does not move along it."""
    names = ("a", "b", "ta", "tb")
    system = System.from_modal(
        [1.0, 1.3, 1.7, 2.1], dict(zip(names, np.eye(4), strict=True)), modal_damping=0.1,
        stops=contact_area("pad", ["a", "b"], 50.0, gap=gap, friction=friction,
                           tangents=["ta", "tb"] if friction else None),
        excitation=[HarmonicForce("a", 30.0)],
    )  # fmt: skip
    branch = continue_branch(solve_orbit(system, 0.7), (0.69, 0.71))
    return branch, contact_figure(Diagram((branch,), (0.69, 0.71), "a"))


@pytest.mark.parametrize("friction", [None, 0.3])
def test_what_is_pressed_is_drawn_where_nothing_slides(friction):
    branch, figure = drawn(friction, 0.1)
    largest = max(orbit.areas[0].pressure.max() for orbit in branch.points)
    assert max(figure.axes[0].lines[0].get_ydata()) == pytest.approx(largest, rel=1e-9)


def test_nothing_is_drawn_where_nothing_touches():
    assert drawn(0.3, 9.0)[1] is None


def test_the_report_draws_it_once(tmp_path, monkeypatch):
    diagram, counted = Diagram((drawn(0.3, 0.1)[0],), (0.69, 0.71), "a"), []

    def counts(*given):
        counted.append(given)
        return contact_figure(*given)

    monkeypatch.setattr("nldyn.report.results.contact_figure", counts)
    folder = write_results(diagram, tmp_path / "out")
    assert len(counted) == 1 and (folder / "contact.png").is_file()
    assert unpacked((folder / "report.html").read_text(encoding="utf-8"))["contact"]


def test_along_a_parameter_its_title_and_the_answer_tell_the_value():
    rough = [DryFriction(name, 1.0, 0.1) for name in ("a", "b")]
    system = System.from_modal(
        [1.0, 1.3], {"a": [1.0, 0.0], "b": [0.5, 1.0]}, modal_damping=0.1, dampers=rough,
        excitation=[HarmonicForce("a", 30.0)],
    )  # fmt: skip
    limits, parameter = (0.1, 0.3), Parameter("friction", 1)
    branch = continue_branch(solve_orbit(system, 0.7), limits, parameter=parameter)
    diagram = Diagram((branch,), limits, "a", parameter=parameter)
    figure = contact_figure(diagram)
    assert figure.axes[0].get_title().endswith("at 0.7 Hz, friction of 'b' = 0.3")
    lines = answer_lines(diagram, tables_of(diagram)["special_points"])
    assert lines[0].endswith("at friction of 'b' = 0.1 (stable)")
