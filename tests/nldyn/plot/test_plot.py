"""What a diagram shows: stable and unstable parts, colours by period, marks."""

import sys
from dataclasses import replace
from pathlib import Path
from tempfile import mkdtemp

import matplotlib as mpl
import numpy as np
import pytest
from fakes import diagram, resonance
from hypothesis import given
from hypothesis import strategies as st

from nldyn.base.resources import example
from nldyn.branches.continuation import continue_branch
from nldyn.orbits.solve import solve_orbit
from nldyn.plot.curves import _scale_and_label
from nldyn.plot.diagram import (
    beside_stable,
    branch_curve,
    marked_points,
    plot_diagram,
    plot_orbit,
    save_diagram,
    stability_runs,
)
from nldyn.plot.words import unit_in
from nldyn.scene.build import build_system
from nldyn.scene.read import load_scene
from nldyn.system.chart import NAMES, UNITS
from nldyn.system.contact_area import contact_area
from nldyn.system.loads import HarmonicForce, Unbalance
from nldyn.system.parameters import OF_SPRINGS, Parameter
from nldyn.system.springs_dampers import Damper, PolynomialSpring, Spring
from nldyn.system.stop import Stop
from nldyn.system.system import System

OF_ROTATIONS = {
    "m": "rad",
    "N": "N m",
    "N/m": "N m/rad",
    "N s/m": "N m s/rad",
    "s/m": "s/rad",
    "m/s": "rad/s",
    "N/m$^p$": "N m/rad$^p$",
    "N/m$^p$ per m² or m": "N m/rad$^p$ per m² or m",
    "kg m": "kg m²",
} | {f"N/m^{power}": f"N m/rad^{power}" for power in range(1, 10)}


@given(st.lists(st.booleans(), max_size=30))
def test_runs_cover_the_branch_and_stable_ones_hold_stable_orbits_only(flags):
    runs = stability_runs(flags)
    drawn = np.zeros(max(len(flags) - 1, 0), dtype=int)
    for run in runs:
        assert 0 <= run.start < run.stop <= len(flags)
        assert not run.stable or all(flags[run.start : run.stop])
        drawn[run.start : run.stop - 1] += 1
    assert np.all(drawn == 1)
    assert {i for run in runs for i in range(run.start, run.stop)} == set(range(len(flags)))


def test_runs_alternate():
    runs = stability_runs([True, True, False, False, True])
    assert [(r.start, r.stop, r.stable) for r in runs] == [
        (0, 2, True),
        (1, 5, False),
        (4, 5, True),
    ]


def test_lines_are_split_where_stability_changes():
    ax = plot_diagram([resonance(unstable=(30.0, 40.0))], special_points=())
    solid, dotted, after = ax.lines
    assert solid.get_linestyle() == after.get_linestyle() == "-"
    assert dotted.get_linestyle() != "-"
    assert solid.get_xdata()[-1] == dotted.get_xdata()[0] == 30.0
    assert after.get_xdata()[0] == dotted.get_xdata()[-1] == 40.0


def test_special_points_lie_on_the_drawn_curve():
    branch = resonance(count=11)
    hz, y, stable = branch_curve(branch)
    assert hz.size == 11 + len(branch.special_points)
    assert np.all(np.diff(hz) >= 0)
    for special in branch.special_points:
        index = int(np.flatnonzero(hz == special.orbit.frequency_hz)[0])
        assert y[index] == special.orbit.max_abs_displacement
    assert stable[hz == 30.0].all() and not stable[(hz > 30.0) & (hz < 40.0)].any()


def test_diagram_names_units_and_marks():
    ax = plot_diagram(diagram(), yscale="log")
    assert ax.get_xlabel() == "excitation frequency (Hz)"
    assert ax.get_ylabel() == "largest displacement of middle (mm)"
    assert ax.get_yscale() == "log"
    texts = [text.get_text() for text in ax.get_legend().get_texts()]
    assert texts == [
        "harmonic",
        "1/2 subharmonic",
        "1/3 subharmonic",
        "stable",
        "unstable",
        "cyclic fold (LP)",
        "flip (PD)",
        "grazing (GR)",
    ]


def test_the_legend_tells_of_no_line_that_is_not_drawn():
    """A linear system with damping has stable orbits only; between fold and fold there are none."""
    linear = System.from_modal(
        [13.1], {"middle": [0.6]}, modal_damping=0.01, excitation=[Unbalance("middle", 5e-6)]
    )
    calm = continue_branch(solve_orbit(linear, frequency_hz=10.0), (9.0, 11.0))
    bent = resonance(count=11)
    between = [node for node in bent.nodes if 30.0 < node.orbit.frequency_hz < 40.0]
    unstable = replace(bent, nodes=tuple(between), special_points=())
    lines = {"stable": calm, "stable, unstable": bent, "unstable": unstable}
    for told, shown in lines.items():
        texts = [text.get_text() for text in plot_diagram(shown).get_legend().get_texts()]
        assert ", ".join(text for text in texts if "stable" in text) == told


def test_the_axis_names_the_interface_of_all_branches():
    system = System.from_modal(
        [13.1], {"middle": [0.6], "tip": [1.2]}, modal_damping=0.01,
        excitation=[Unbalance("middle", 5e-6)],
    )  # fmt: skip
    orbits = [solve_orbit(system, frequency_hz=10.0, observe=name) for name in ("middle", "tip")]
    branches = [continue_branch(orbit, (9.0, 11.0)) for orbit in orbits]
    labels = [plot_diagram(shown).get_ylabel() for shown in (branches[1], branches)]
    assert labels == ["largest displacement of tip (µm)", "largest displacement (µm)"]


def test_the_axis_names_direction_and_unit_and_the_legend_the_same_unit():
    """Gap and natural frequency are drawn where they lie within the axes, and change no limit."""
    stops = [Stop("tip", 1e6, gap=gap, exponent=1.0, direction=-1) for gap in (2e-6, 1.0)]
    system = System.from_modal(
        [13.1, 70.0], {"tip": [1.2, 0.5]}, modal_damping=0.01, stops=stops,
        excitation=[Unbalance("tip", 1e-6)],
    )  # fmt: skip
    branch = continue_branch(solve_orbit(system, frequency_hz=8.0), (8.0, 14.0))
    ax = plot_diagram(branch, direction="rotation_z")
    assert ax.get_ylabel() == "largest rotation of tip about z (µrad)"
    texts = [text.get_text() for text in ax.get_legend().get_texts()]
    assert texts[-2:] == ["gap of a stop, 2 µrad", "natural, no contact:\n13.1 Hz"]
    assert [line.get_ydata()[0] for line in ax.lines if len(set(line.get_ydata())) == 1] == [2.0]
    bare = plot_diagram(branch, direction="rotation_z", references=False)
    assert (ax.get_xlim(), ax.get_ylim()) == (bare.get_xlim(), bare.get_ylim())


def test_of_many_special_points_those_beside_stable_orbits_are_marked():
    shown = diagram().branches
    every = marked_points(shown, ("LP", "PD", "GR"))
    some = marked_points(shown, ("LP", "PD", "GR"), many=1)
    assert sum(map(len, every.values())) == sum(len(b.special_points) for b in shown)
    beside = [p for b in shown for p in b.special_points if beside_stable(b, p)]
    assert sorted(map(id, beside)) == sorted(id(p) for ps in some.values() for p in ps)


def test_axes_of_the_caller_are_used():
    ax = plot_diagram([resonance()], special_points=())
    assert plot_diagram([resonance()], ax, unit="µm", special_points=()) is ax
    assert len(ax.lines) == 6
    assert ax.get_ylabel() == "largest displacement of middle (µm)"
    with pytest.raises(ValueError, match="unit must be one of m, mm, µm, nm"):
        plot_diagram([resonance()], unit="inch")


@pytest.mark.parametrize(
    ("size", "unit"), [(2.0, "m"), (2e-3, "mm"), (2.3e-4, "µm"), (0.0, "m"), (1e-12, "nm")]
)
def test_unit(size, unit):
    assert unit_in("m", size)[1] == unit
    assert unit_in("rad", size)[1] == unit.removesuffix("m") + "rad"
    assert unit_in("m", size, "mm") == (1e-3, "mm")
    with pytest.raises(ValueError, match="unit must be one of m, mm, µm, nm, got 'mrad'"):
        unit_in("m", size, "mrad")


@pytest.mark.parametrize("name", NAMES)
def test_axes_of_curves_name_every_parameter_and_its_unit(name):
    spring = PolynomialSpring("tip", [1.0] * 9) if name in OF_SPRINGS else Spring("tip", 1.0)
    area = contact_area("edge", ["tip"], 1e6)
    system = System.from_modal(
        [10.0], {"tip": [1.0], "slide": [0.5]}, springs=[spring], dampers=[Damper("tip", 1.0)],
        stops=[Stop("tip", 1e6, tangent="slide", friction=0.1), *area],
        excitation=[HarmonicForce("tip", 1.0)],
    )  # fmt: skip
    _, label = _scale_and_label(Parameter(name), 1.0, system)
    unit = UNITS[name].replace("exponent", "$p$").replace("^$p$", "$^p$")
    assert label.endswith(f"({unit})") is (unit != "1")
    assert label.split(" (")[0]
    turning = replace(system, rotations=frozenset({"tip", "slide"}))
    _, told = _scale_and_label(Parameter(name), 1.0, turning)
    assert told == label.replace(f"({unit})", f"({OF_ROTATIONS.get(unit, unit)})")


def test_orbit_shows_displacement_impacts_and_force():
    system = build_system(load_scene(example("one_dof.toml")))
    orbit = solve_orbit(system, frequency_hz=25.3)
    upper, lower = plot_orbit(orbit)
    assert upper.get_ylabel() == "displacement of middle (µm)"
    assert upper.get_title() == "stable harmonic orbit at 25.3 Hz"
    assert lower.get_ylabel() == "contact force (N)"
    assert upper.get_legend().get_texts()[0].get_text() == "deepest contact"
    y = upper.lines[1].get_ydata()
    assert np.abs(y).max() == pytest.approx(1e6 * orbit.max_abs_displacement, rel=1e-4)
    force = lower.lines[0]
    impacts = upper.lines[2:]
    assert len(impacts) == orbit.impacts == 1
    hardest = force.get_xdata()[np.argmax(force.get_ydata())]
    assert impacts[0].get_xdata()[0] == pytest.approx(hardest, abs=2e-5)


def test_orbit_shows_the_stops_that_it_comes_near():
    stops = [Stop("a", 1e9, gap=gap, direction=d) for gap, d in ((1.0, 1), (1e-5, -1), (0.0, 1))]
    system = System.from_modal(
        [13.1], {"a": [0.6]}, modal_damping=0.02, stops=stops, excitation=[Unbalance("a", 5e-6)]
    )
    orbit = solve_orbit(system, frequency_hz=20.0)
    upper, _ = plot_orbit(orbit)
    (stop,) = [line for line in upper.lines if line.get_linestyle() == "-."]
    assert stop.get_ydata()[0] == pytest.approx(-10.0)  # µm
    assert [text.get_text() for text in upper.get_legend().get_texts()] == [
        "stop",
        "deepest contact",
    ]


def test_impacts_shorter_than_a_sample_are_marked():
    system = build_system(load_scene(example("one_dof.toml")))
    orbit = solve_orbit(system, frequency_hz=25.3)
    assert not orbit.history(23).force.any()
    for axes in plot_orbit(orbit, samples=23):
        (mark,) = [line for line in axes.lines if line.get_linestyle() == "--"]
        assert mark.get_xdata()[0] == orbit.impact_list[0].time


def test_a_picture_is_one_of_pyplot_where_that_is_in_use(monkeypatch):
    """So that plt.show() shows it, and a notebook; elsewhere none is left open."""
    monkeypatch.delitem(sys.modules, "matplotlib.pyplot", raising=False)
    alone = plot_diagram(diagram()).figure
    monkeypatch.undo()
    from matplotlib import pyplot

    before = pyplot.get_fignums()
    with mpl.rc_context({"backend": "agg"}):
        shown = plot_diagram(diagram()).figure
        assert pyplot.get_fignums()[-1] == shown.number and shown.number not in before
        pyplot.close(shown)
        save_diagram(diagram(), Path(mkdtemp()))
    assert not hasattr(alone, "number") and pyplot.get_fignums() == before
