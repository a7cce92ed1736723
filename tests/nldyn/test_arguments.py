"""Arguments of a wrong kind are refused in one sentence that names them, before any work."""

from __future__ import annotations

import math
from types import SimpleNamespace

import numpy as np
import pytest
from problems import make_one_dof

from nldyn import (
    ContinuationOptions,
    ConvergenceError,
    Damper,
    ExploreOptions,
    FlowMap,
    FlowOptions,
    Parameter,
    Stop,
    System,
    SystemModelError,
    Unbalance,
    cascade,
    continue_branch,
    continue_constant,
    continue_special,
    describe_special,
    diagram,
    explore,
    find_orbits,
    harmonics,
    index_sum,
    normal_form,
    save,
    solve_orbit,
)
from nldyn.bifurcations.normal_forms import switch_at_branch_point
from nldyn.bifurcations.period_doubling import switch_at_flip
from nldyn.branches.arclength import Stepper
from nldyn.branches.cascades import cascades_in
from nldyn.curves import refine_special
from nldyn.io.curves import load_curves
from nldyn.plot.curves import plot_curves
from nldyn.plot.diagram import plot_diagram
from nldyn.plot.orbit import plot_contact_force, plot_history, plot_phase_portrait, plot_spectrum

JUNK = (None, "nonsense", [], {"a": 1}, math.nan, -1.0, 10**400, object())
PAIR, WINDOW = ("frequency_hz", "gap"), ((20.0, 30.0), (-1e-6, 1e-6))


def refused(call, *junk) -> list[str]:
    """What is said to each piece of junk; anything but a SystemModelError comes through."""
    said = []
    for value in junk or JUNK:
        with pytest.raises(SystemModelError) as told:
            call(value)
        said.append(str(told.value))
    return said


def check_named(said, *names):
    for sentence in said:
        assert "\n" not in sentence
        assert any(name in sentence for name in names), sentence


@pytest.fixture(scope="module")
def orbit(one_dof):
    return solve_orbit(one_dof, 26.0)


@pytest.fixture(scope="module")
def flip(harmonic_branch):
    return next(s for s in harmonic_branch.special_points if s.kind == "PD")


@pytest.mark.parametrize(
    ("function", "arguments"),
    [
        (switch_at_flip, ()),
        (switch_at_branch_point, ()),
        (describe_special, ()),
        (normal_form, ()),
        (cascade, ()),
        (refine_special, ()),
        (continue_special, (PAIR, WINDOW)),
    ],
    ids=lambda x: getattr(x, "__name__", ""),
)
def test_what_is_no_special_point_is_refused(function, arguments):
    halves = (SimpleNamespace(kind="PD"), SimpleNamespace(kind="PD", orbit=3))
    said = refused(lambda junk: function(junk, *arguments), *JUNK, *halves)
    name = "describe_special" if function is normal_form else function.__name__
    check_named(said, f"{name} needs a special point, got")


@pytest.mark.parametrize(
    "plot", [plot_history, plot_phase_portrait, plot_spectrum, plot_contact_force, harmonics]
)
def test_what_is_no_orbit_cannot_be_drawn(plot, orbit):
    check_named(refused(plot), "orbit must be an Orbit, got")
    if plot is not harmonics:
        axes = [junk for junk in JUNK if junk is not None]
        check_named(refused(lambda junk: plot(orbit, junk), *axes), "ax must be an Axes or None")
    if plot is not plot_contact_force:
        said = refused(lambda junk: plot(orbit, interface=junk), [], 3, math.nan)
        check_named(said, "interface must be a str or None")
    word = "orders" if plot in (plot_spectrum, harmonics) else "samples"
    said = refused(lambda junk: plot(orbit, **{word: junk}))
    check_named(said, f"{word} must be a whole number")


@pytest.mark.parametrize("name", ["orbit", "parameters", "ranges", "options", "progress"])
@pytest.mark.parametrize("call", ["in", "special", "constant"])
def test_arguments_of_curves_are_named(name, call, orbit, flip):
    if call == "in":
        good = {"start": orbit, "limits": (-1e-6, 1e-6), "parameter": "gap"}
        function = continue_branch
        own = {"orbit": "start", "parameters": "parameter", "ranges": "limits"}
        name = own.get(name, name)
    else:
        good = {"orbit": orbit, "parameters": PAIR, "ranges": WINDOW, "monitor": "peak_force"}
        function = continue_constant
    if call == "special":
        good = {"special": flip, "parameters": PAIR, "ranges": WINDOW}
        function = continue_special
        name = {"orbit": "special"}.get(name, name)
    junk = [x for x in JUNK if not (x is None and name in ("options", "progress", "parameter"))]
    said = refused(lambda junk: function(**{**good, name: junk}), *junk)
    words = {
        "parameter": ("unknown parameter",),
        "limits": ("the range of gap must be", "needs limits, the range"),
        "special": ("special point",),
        "parameters": ("parameters must be", "needs two parameters"),
        "ranges": ("ranges must be", "as many ranges"),
    }
    check_named(said, *words.get(name, (f"{name} must be",)))


@pytest.mark.parametrize("name", ["monitor", "value"])
def test_what_cannot_be_held_is_named(name, orbit):
    good = {"monitor": "peak_force", "value": None}
    junk = [x for x in JUNK if not (x is None and name == "value")]
    said = refused(
        lambda junk: continue_constant(
            orbit, parameters=PAIR, ranges=WINDOW, **{**good, name: junk}
        ),
        *junk,
    )
    check_named(said, "monitor", "peak_force to be held must be")


@pytest.mark.parametrize("entry", [None, [], math.nan, object(), "mass", Parameter("mass")])
def test_entries_of_lists_of_parameters_are_named(entry, orbit):
    said = refused(lambda junk: continue_special_or_constant(orbit, (junk, "gap")), entry)
    check_named(said, "unknown parameter")


def continue_special_or_constant(orbit, parameters):
    return continue_constant(orbit, "peak_force", parameters, WINDOW)


def test_numbers_of_a_parameter_are_checked():
    check_named(refused(Parameter, None, [], 3, math.nan), "Parameter: name must be a str")
    said = refused(lambda junk: Parameter("gap", junk), None, "0", [], math.nan, -2, 1.5, True)
    check_named(said, "Parameter: index must be a whole number")


@pytest.mark.parametrize("name", ["start", "limits", "at", "options", "progress", "name"])
def test_arguments_of_a_continuation_are_named(name, orbit):
    good = {"start": orbit, "limits": (25.0, 27.0)}
    junk = {
        "options": [x for x in JUNK if x is not None],
        "progress": [x for x in JUNK if x is not None],
        "name": [x for x in JUNK if x != "nonsense"],
        "at": ["nonsense", math.nan, -1.0, [None], [math.nan], [-26.0], ["26"], [99.0], 26.0],
    }.get(name, JUNK)
    said = refused(lambda value: continue_branch(**{**good, name: value}), *junk)
    check_named(said, "range" if name == "limits" else name)


def test_sizes_of_steps_off_a_branch_are_checked(flip):
    check_named(refused(lambda junk: switch_at_flip(flip, junk)), "amplitude must be a positive")
    check_named(refused(lambda junk: cascade(flip, junk)), "cascade: depth must be a whole number")
    check_named(refused(lambda junk: refine_special(flip, junk)), "unknown parameter")
    said = refused(lambda junk: refine_special(flip, max_iterations=junk))
    check_named(said, "max_iterations must be a whole number")
    said = refused(
        lambda junk: describe_special(flip, junk), None, 3, math.nan, object(), [3], ["LP"]
    )
    check_named(said, "others")


def test_a_point_of_a_curve_does_not_know_the_branch(flip):
    """Its orbit is enough for a flip, but not for what needs the branch's direction."""
    mark = refine_special(flip)
    assert switch_at_flip(mark).orbit.period == 2
    with pytest.raises(SystemModelError, match="a special point of a branch, which knows"):
        describe_special(SimpleNamespace(kind="GR", orbit=mark.orbit, frequency_hz=1.0))


def test_what_is_no_branch_or_curve_cannot_be_drawn(harmonic_branch, orbit):
    junk = [x for x in JUNK if x != []]
    check_named(refused(plot_diagram, *junk), "diagram must be a list of branches")
    check_named(refused(cascades_in, *junk), "branches must be a list of branches")
    check_named(refused(plot_curves), "plot_curves needs")
    few = ContinuationOptions(max_points=2)
    curve = continue_constant(orbit, "peak_force", PAIR, WINDOW, options=few)
    check_named(refused(lambda x: plot_curves([curve, x])), "plot_curves needs")
    axes = [x for x in JUNK if x is not None]
    said = refused(lambda x: plot_diagram([harmonic_branch], x), *axes)
    check_named(said, "ax must be an Axes or None")
    for name in ("yscale", "unit"):
        said = refused(lambda x, name=name: plot_diagram([harmonic_branch], **{name: x}), *axes)
        check_named(said, f"{name} must be one of")
    said = refused(lambda x: plot_diagram([harmonic_branch], special_points=x), 3, ["XX"], [3])
    check_named(said, "special_points must be")
    check_named(
        refused(lambda x: curve.at("frequency_hz", x), *junk[:-3]), "value must be a finite number"
    )
    check_named(refused(lambda x: curve.at(x, 26.0)), "the curve has no parameter")


@pytest.mark.parametrize("name", ["rtol", "tail"])
def test_flow_options_refuse_what_is_no_share(name):
    junk = [value for value in JUNK if not (name == "tail" and value is None)]
    check_named(refused(lambda value: FlowOptions(**{name: value}), *junk), name)


def test_flow_map_names_what_it_cannot_use(one_dof):
    phases = np.array([0.0, 1.0])
    flow, state = FlowMap(one_dof), np.zeros((1, 2))
    check_named(refused(FlowMap), "system")
    check_named(refused(lambda value: FlowMap(one_dof, value), "tight", 1e-9, []), "options")
    for run in (flow.shoot, flow.trajectory):
        check_named(refused(lambda value, run=run: run(value, phases, 100.0), *JUNK, 1j), "nodes")
        check_named(refused(lambda value, run=run: run(state, value, 100.0)), "phases")
        check_named(refused(lambda value, run=run: run(state, phases, value)), "omega")
    wrong = [value for value in JUNK if value not in (None, [])]
    check_named(
        refused(lambda value: flow.shoot(state, phases, 100.0, parameters=value), *wrong, ["gap"]),
        "parameters",
    )


def test_searches_name_a_system_that_is_none(one_dof):
    for search in (
        lambda value: solve_orbit(value, 20.0),
        lambda value: explore(value, (20.0, 21.0)),
        lambda value: find_orbits(value, 20.0, period=1),
    ):
        check_named(refused(search), "system")


def test_other_arguments_of_a_wrong_kind_are_named(one_dof, orbit, harmonic_branch, tmp_path):
    junk = [x for x in JUNK if x is not None]
    check_named(refused(harmonic_branch.contains), "orbit must be an Orbit")
    no_lists = [x for x in junk if x != []]
    check_named(refused(lambda x: index_sum(x, 26.0), *no_lists), "branches must be a list")
    check_named(refused(lambda x: orbit.penetration(x, [0.0]), 1, *JUNK), "penetration: stop must")
    calls = {
        "periods": lambda x: diagram(one_dof, (20.0, 30.0), x),
        "effort": lambda x: explore(one_dof, (20.0, 30.0), effort=x),
        "open_ends": lambda x: continue_branch(orbit, (25.0, 27.0), open_ends=x),
    }
    for name, call in calls.items():
        check_named(refused(call, 3, math.nan, object()), f"{name} must be")
    check_named(
        refused(lambda x: diagram(one_dof, (20.0, 30.0), [], seeds=[x])), "seeds: each must be"
    )
    for name in ("search_points", "doublings"):

        def call(x, name=name):
            return diagram(one_dof, (20.0, 30.0), [1], **{name: x})

        said = refused(call, -1, 1.5, 10**12, math.nan)
        check_named(said, f"{name} must be")
    for kind, name in ((Stop, "stop"), (Unbalance, "excitation"), (Damper, "damper")):
        said = refused(lambda x, kind=kind: kind(x, 1e9), 3, [], math.nan)
        check_named(said, f"{name}: at must be a str")
    curve = tmp_path / "curve.h5"
    few = ContinuationOptions(max_points=2)
    save(continue_constant(orbit, "peak_force", PAIR, WINDOW, options=few), curve)
    for name in ("laws", "monitor"):
        said = refused(lambda x, name=name: load_curves(curve, **{name: x}), 3, "text", [1])
        check_named(said, f"{name} must be")
    check_named(refused(lambda x: Stepper(x, (25.0, 27.0), ContinuationOptions())), "start must be")
    check_named(refused(lambda x: one_dof.with_elements(stops=x), 3, [3]), "stop")


def test_ranges_in_which_there_are_no_systems_are_refused(orbit):
    for name, limits in (
        ("exponent", (0.5, 2.0)), ("stiffness", (-1.0, 1e10)), ("modal_damping", (-0.1, 0.1)),
        ("mass_times_radius", (-1.0, 1e-5)), ("exponent", (1.0, 9.0)),
    ):  # fmt: skip
        check_named(
            refused(lambda x, n=name: continue_branch(orbit, x, parameter=n), limits),
            f"range of {name}",
        )


def test_places_of_which_the_branches_do_not_tell_are_refused(harmonic_branch, flip):
    check_named(refused(lambda x: index_sum([harmonic_branch], x), 2.0, 200.0), "was followed from")
    check_named(refused(lambda x: index_sum(x, 26.0), []), "branches must not be empty")
    outside = refused(lambda x: cascade(flip, 2, limits=x), (1.0, 2.0))
    check_named(outside, "lies outside the range of frequency_hz")


@pytest.mark.parametrize("name", ["period", "segments"])
def test_sizes_beyond_any_use_are_refused_before_any_work(one_dof, name):
    said = refused(lambda x: solve_orbit(one_dof, 20.0, **{name: x}), 10**6, 10**12)
    check_named(said, f"{name} must be a whole number from 1 to")
    spacings = refused(lambda x: ExploreOptions(spacing=x), 1e-18, 0.0, 1.0)
    check_named(spacings, "spacing must be at least")


def test_an_orbit_of_a_shorter_period_is_not_told_as_one_of_the_period_asked_for(one_dof):
    """At 20 Hz motions from rest settle on the harmonic orbit."""
    with pytest.raises(ConvergenceError, match=r"no orbit of period 2 found at 20 Hz: .*period 1"):
        solve_orbit(one_dof, 20.0, period=2)


def test_an_orbit_run_through_twice_is_not_continued(flip):
    window = (0.95 * flip.frequency_hz, 1.05 * flip.frequency_hz)
    born = continue_branch(switch_at_flip(flip).orbit, window)
    end = born.nodes[0 if born.stop_reasons[0].startswith("joins") else -1].orbit
    for call in (
        lambda: continue_branch(end, window),
        lambda: continue_branch(end, (-1e-6, 1e-6), parameter="gap"),
    ):
        with pytest.raises(SystemModelError, match="is one of period 1, run through 2 times"):
            call()


@pytest.mark.parametrize("largest", [1e2, 1e10, 1e13])
def test_a_stiffness_that_is_negative_in_a_direction_is_refused(largest):
    with pytest.raises(SystemModelError, match="stiffness must not be negative in any direction"):
        System.from_matrices(np.eye(2), np.diag([largest, -1.0]), {"m": [0.0, 1.0]})


def test_a_free_body_in_its_own_modes_is_not_taken_for_a_negative_stiffness():
    """The rigid mode's entry of Phi^T K Phi is rounding, of either sign."""
    for n in range(3, 40):
        chain = 1e7 * (2.0 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1))
        chain[0, 0] = chain[-1, -1] = 1e7
        modes = np.linalg.eigh(chain)[1]
        modal = modes.T @ chain @ modes
        system = System.from_matrices(np.eye(n), 0.5 * (modal + modal.T), {"m": modes[0]})
        assert system.frequencies_hz[0] < 1e-3


def test_element_that_a_system_does_not_have_is_told_apart_from_none_at_all():
    orbit = solve_orbit(make_one_dof(), 40.0)
    for name, index, told in (
        ("coefficient", 0, "there is no damper 0; the system has none"),
        ("gap", 3, "there is no stop 3; there are 1, counted from 0"),
    ):
        with pytest.raises(SystemModelError, match=told):
            continue_branch(orbit, (1.0, 2.0), parameter=Parameter(name, index))
    with pytest.raises(SystemModelError, match="an orbit needs limits, the range of its"):
        continue_branch(orbit, None)
