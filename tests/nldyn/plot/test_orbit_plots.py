"""Pictures of one orbit, and labels under the pointer."""

from dataclasses import replace

import numpy as np
import pytest
from matplotlib.backend_bases import MouseEvent
from matplotlib.figure import Figure

from nldyn import Stop, System, SystemModelError, Unbalance, harmonics, solve_orbit
from nldyn.plot.diagram import new_axes, plot_diagram
from nldyn.plot.hover import show_labels
from nldyn.plot.orbit import plot_contact_force, plot_history, plot_phase_portrait, plot_spectrum

PLOTS = (plot_history, plot_phase_portrait, plot_spectrum, plot_contact_force)


@pytest.fixture(scope="module")
def stable(one_dof):
    orbit = solve_orbit(one_dof, 25.3)
    assert orbit.stable and orbit.impacts == 1
    return orbit


@pytest.fixture(scope="module")
def unstable(one_dof):
    orbit = solve_orbit(one_dof, 60.0)
    assert not orbit.stable
    return orbit


@pytest.mark.parametrize("plot", PLOTS)
def test_title_says_what_the_orbit_is_and_given_axes_are_used(plot, stable, unstable):
    for orbit, word in ((stable, "stable"), (unstable, "unstable")):
        ax = new_axes()
        assert plot(orbit, ax) is ax
        assert ax.get_title() == f"{word} harmonic orbit at {orbit.frequency_hz:.6g} Hz"


@pytest.mark.parametrize("plot", PLOTS)
def test_legends_of_several_axes_do_not_cover_each_other(plot, stable):
    """Beside axes that are alone, within them else."""
    for count in (1, 2):
        figure = Figure(layout="constrained")
        ax = figure.subplots(1, count, squeeze=False)[0, 0]
        legend = plot(stable, ax).get_legend()
        figure.draw_without_rendering()
        within = legend.get_window_extent().x1 <= ax.get_window_extent().x1
        assert within == (count > 1)


@pytest.mark.parametrize("plot", [plot_history, plot_phase_portrait, plot_contact_force])
def test_unstable_orbits_are_dotted(plot, stable, unstable):
    for orbit in (stable, unstable):
        curve = max(plot(orbit).lines, key=lambda line: len(line.get_xdata()))
        assert (curve.get_linestyle() == "-") == orbit.stable


@pytest.mark.parametrize(
    ("plot", "x", "y"),
    [
        (plot_history, "time (s)", "rotation of middle (µrad)"),
        (plot_phase_portrait, "rotation of middle (µrad)", "velocity (mrad/s)"),
        (plot_spectrum, "frequency (Hz)", "amplitude of middle (µrad)"),
        (plot_contact_force, "time (s)", "contact moment (N m)"),
    ],
)
def test_rotations_are_drawn_in_rad_and_newton_metres(plot, x, y, stable):
    """The numbers stay as they are."""
    turning = replace(stable.system, rotations=frozenset({"middle"}))
    orbit = solve_orbit(turning, 25.3)
    ax, same = plot(orbit), plot(stable)
    assert f"{orbit.max_abs_displacement:.4g} rad at 'middle', 1 impact, " in repr(orbit)
    assert (ax.get_xlabel(), ax.get_ylabel()) == (x, y)
    for line, other in zip(ax.lines, same.lines, strict=True):
        np.testing.assert_array_equal(line.get_xydata(), other.get_xydata())


def test_history_reaches_the_largest_displacement(stable):
    ax = plot_history(stable)
    curve = max(ax.lines, key=lambda line: len(line.get_xdata()))
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("time (s)", "displacement of middle (µm)")
    assert np.abs(curve.get_ydata()).max() == pytest.approx(
        1e6 * stable.max_abs_displacement, rel=1e-5
    )
    assert curve.get_xdata()[[0, -1]] == pytest.approx([0.0, stable.duration])


def test_force_reaches_its_largest_value_however_short_the_contact():
    """Forty equal steps see nothing of a contact of 0.1 % of the period."""
    system = System.from_modal(
        [13.0],
        {"tip": [0.6]},
        modal_damping=0.02,
        stops=[Stop("tip", 1e15)],
        excitation=[Unbalance("tip", 5e-6)],
    )
    orbit = solve_orbit(system, 25.0)
    ax = plot_contact_force(orbit, samples=40)
    assert ax.get_ylabel() == "contact force (kN)"
    top = max(np.max(line.get_ydata()) for line in ax.lines)
    exact = max(impact.force for impact in orbit.impact_list)
    assert top == pytest.approx(1e-3 * exact, rel=1e-2)


def test_phase_portrait_is_closed_and_has_the_stop_in_its_place(one_dof):
    system = System.from_modal(
        [13.0, 30.0],
        {"tip": [0.6, 0.2]},
        modal_damping=0.02,
        stops=[Stop("tip", 1e9, gap=2e-4, direction=-1)],
        excitation=[Unbalance("tip", 5e-4)],
    )
    orbit = solve_orbit(system, 14.0)
    ax = plot_phase_portrait(orbit)
    curve = max(ax.lines, key=lambda line: len(line.get_xdata()))
    for values in (curve.get_xdata(), curve.get_ydata()):
        assert values[0] == pytest.approx(values[-1], abs=1e-6 * np.abs(values).max())
    (stop,) = [line for line in ax.lines if line.get_label() == "stop"]
    factor = {"displacement of tip (mm)": 1e-3, "displacement of tip (µm)": 1e-6}[ax.get_xlabel()]
    assert stop.get_xdata()[0] == pytest.approx(-2e-4 / factor)
    (starts,) = [line for line in ax.lines if line.get_marker() == "o"]
    assert len(starts.get_xdata()) == orbit.period


def test_spectrum_shows_the_lines(stable):
    ax = plot_spectrum(stable, orders=8)
    (marks,) = ax.lines
    lines = harmonics(stable, orders=8)
    assert (ax.get_xlabel(), ax.get_yscale()) == ("frequency (Hz)", "log")
    assert marks.get_xdata() == pytest.approx(lines.frequency_hz)
    assert 1e-6 * marks.get_ydata() == pytest.approx(lines.amplitude)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("plot", PLOTS)
@pytest.mark.parametrize("stops", [(), (Stop("tip", 1e9, gap=1e-3),)])
def test_rest_can_be_drawn(plot, stops):
    system = System.from_modal([13.0], {"tip": [0.6]}, modal_damping=0.02, stops=stops)
    plot(solve_orbit(system, 10.0)).figure.canvas.draw()


@pytest.mark.parametrize("plot", [plot_history, plot_phase_portrait, plot_spectrum])
def test_an_unknown_interface_is_refused(plot, stable):
    with pytest.raises(SystemModelError, match="unknown interface 'nose'"):
        plot(stable, interface="nose")


# --- labels --------------------------------------------------------------------------------------


def move(ax, x, y):
    """Move the pointer to data coordinates."""
    canvas = ax.figure.canvas
    canvas.draw()
    px, py = ax.transData.transform((x, y))
    event = MouseEvent("motion_notify_event", canvas, px, py)
    canvas.callbacks.process("motion_notify_event", event)


def test_label_of_the_place_under_the_pointer():
    ax = new_axes()
    ax.set(xlim=(0.0, 1.0), ylim=(0.0, 1.0))
    show_labels(ax, np.array([[0.2, 0.2], [0.7, 0.7], [0.7, 0.7]]), "place {}".format)
    move(ax, 0.7, 0.7)
    (note,) = ax.texts
    assert (note.get_visible(), note.get_text(), note.xy) == (True, "place 1", (0.7, 0.7))
    assert note.get_horizontalalignment() == "right"
    move(ax, 0.2, 0.2)
    assert note.get_text() == "place 0" and note.get_horizontalalignment() == "left"
    move(ax, 0.4, 0.4)
    assert not note.get_visible()


def test_special_points_and_orbits_of_a_diagram_tell_their_numbers(harmonic_branch):
    ax = plot_diagram([harmonic_branch])
    assert len(ax.texts) == 0
    flip = harmonic_branch.special_points[-1]
    assert flip.kind == "PD"
    move(ax, flip.frequency_hz, 1e6 * flip.orbit.max_abs_displacement)
    (note,) = ax.texts
    assert note.get_text().startswith("harmonic, flip (PD)\n33.65436 Hz, largest 7.516 µm\n")
    peak = int(np.argmax(harmonic_branch.max_abs_displacement))
    orbit = harmonic_branch.points[peak]
    move(ax, orbit.frequency_hz, 1e6 * orbit.max_abs_displacement)
    assert note.get_text().splitlines()[2] == (
        f"stable, largest multiplier {abs(orbit.largest_multiplier):.4g}, 1 impact"
    )


def test_a_diagram_without_labels_has_none(harmonic_branch):
    ax = plot_diagram([harmonic_branch], hover=False)
    flip = harmonic_branch.special_points[-1]
    move(ax, flip.frequency_hz, 1e6 * flip.orbit.max_abs_displacement)
    assert len(ax.texts) == 0
