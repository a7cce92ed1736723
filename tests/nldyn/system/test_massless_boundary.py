"""Stops at points without mass: closed forms, other reductions, integration from event to event."""

import math
import re
import runpy
from pathlib import Path
from types import SimpleNamespace
from unittest.mock import MagicMock

import numpy as np
import pytest
from scipy import linalg, sparse
from sliding import Body, Contact

import cms
import fem
from nldyn import (
    ConstantForce,
    Damper,
    FlowMap,
    HarmonicForce,
    RigidStop,
    Stop,
    System,
    SystemModelError,
    impacts,
    simulate,
    solve_orbit,
)
from nldyn.base.resources import example
from nldyn.scene.build import build_system
from nldyn.scene.component import build_component
from nldyn.scene.read import load_scene
from nldyn.system import DryFriction, Friction, rest
from nldyn.system.equilibrium import closed_at_rest

ROOT = Path(__file__).parents[3]
GAP = 0.1


def free_bar(modes):
    """A bar of unit length, mass and wave speed with free ends: modes in closed form."""
    n = np.arange(1, modes)
    rows = np.append(1.0, np.sqrt(2.0) * (-1.0) ** n)
    left = 1.0 / 3.0 - np.sum(2.0 / (np.pi * n) ** 2)
    return SimpleNamespace(
        frequencies_hz=np.append(0.0, n / 2.0),
        participation={"end": rows},
        residual_flexibility=np.array([[left]]),
    )


def fallen(modes):
    """Time, momentum and force of a bar that flies into a rigid wall at unit speed; its energy."""
    system = System.from_reduced(free_bar(modes), stops=[RigidStop("end", 1.0, GAP)])
    start = np.zeros(2 * modes)
    start[modes] = 1.0
    motion = simulate(system, 1.0 / 2.6, 1, start=start)
    seen, omega = motion.history(5200), system.natural_frequencies
    energy = 0.5 * np.sum(motion.end[modes:] ** 2 + (omega * motion.end[:modes]) ** 2)
    return seen.time, seen.modal_velocity[:, 0], seen.force[:, 0], energy, motion


def test_a_bar_rebounds_from_a_rigid_wall_as_its_waves_say():
    """In closed form it touches for 2L/c under the force ρcAv, then flies back as it came.

    What is wrong with its momentum goes with the time between two modes, 1/k; no energy is lost,
    and it touches once.
    """
    off = {}
    for modes in (4, 16, 32):
        time, momentum, force, energy, motion = fallen(modes)
        known = np.clip(1.0 - (time - GAP), -1.0, 1.0)
        off[modes] = np.abs(momentum - known).max()
        closed = time[force > 0.0]
        assert closed[-1] - closed[0] == pytest.approx(2.0, abs=1.0 / modes)
        middle = (time > 0.5) & (time < 1.6)
        assert force[middle].mean() == pytest.approx(1.0, abs=0.5 / modes)
        assert energy == pytest.approx(0.5, rel=1e-9)
        assert impacts(motion).speed.size <= 2
        assert momentum[-1] == pytest.approx(-1.0, abs=0.3 / modes)
    assert off[4] < 0.12 and off[16] < off[4] / 4.0 and off[32] < off[4] / 6.0


@pytest.fixture(scope="module")
def cantilever():
    mesh = fem.frame_mesh(
        {"root": (0, 0), "middle": (0.2, 0), "tip": (0.3, 0)},
        [("beam", "root", "middle", 40), ("beam", "middle", "tip", 20)],
    )
    steel = fem.Material(2.1e11, 7800.0)
    return fem.assemble(
        fem.StructureModel(
            mesh,
            parts={"beam": fem.BeamPart(steel, fem.RectangularSection(0.02, 0.004))},
            supports=[fem.Support("root", ("x", "y", "rotation"))],
            interfaces={name: fem.Interface(name, "y") for name in ("middle", "tip")},
            plane=True,
        )
    )


def massless(component, modes):
    return cms.reduce(component, modes=modes, method="macneal", massless=["tip"])


def test_an_orbit_against_a_rigid_stop_converges_with_the_modes(cantilever):
    """To what plastic impacts of a model with residual mass converge to, too.

    Two models of one structure: no impact at all, and impacts on ever less mass.
    """
    plastic = cms.reduce(cantilever, modes=12)

    def largest(reduced, restitution):
        system = System.from_reduced(
            reduced,
            modal_damping=0.05,
            stops=[RigidStop("tip", restitution, 1e-4)],
            excitation=[HarmonicForce("middle", 1.0)],
        )
        orbit = solve_orbit(system, 50.0)
        assert np.abs(orbit.multipliers).max() < 1.0
        return orbit.history(4096).displacement["middle"].max()

    limit = largest(plastic, 0.0)
    off = [abs(largest(massless(cantilever, k), 1.0) / limit - 1.0) for k in (4, 8)]
    assert off[0] < 0.04 and off[1] < off[0] / 4.0  # a power of at least two


@pytest.mark.parametrize("stop", [RigidStop("tip", 1.0, 1e-4), Stop("tip", 2e3, 1.0, 1e-4)])
def test_a_beam_leans_on_its_stop_as_all_of_it_does(cantilever, stop):
    """Under a constant force, by the flexibilities of the whole mesh."""
    K = cantilever.stiffness.toarray()
    tip, middle = (cantilever.interfaces[name] for name in ("tip", "middle"))
    by_tip, by_middle = (np.linalg.solve(K, load) for load in (tip, middle))
    give = 1.0 / stop.stiffness if isinstance(stop, Stop) else 0.0
    held = (5.0 * tip @ by_middle - 1e-4) / (tip @ by_tip + give)
    system = System.from_reduced(
        massless(cantilever, 2), stops=[stop], excitation=[ConstantForce("middle", 5.0)]
    )
    q = rest(system)
    moved = system.participation["middle"] @ q
    assert moved == pytest.approx(5.0 * middle @ by_middle - held * middle @ by_tip, rel=1e-8)
    (found,) = system.stops
    assert found.force(system.participation["tip"] @ q - 1e-4) == pytest.approx(held, rel=1e-8)


def two_chains(across=7, along=6):
    """A chain that a wall stops, and one that slides along it; neither moves the other."""
    n = across + along
    K = np.zeros((n, n))
    for first, size, k in ((0, across, 40.0), (across, along, 25.0)):
        K[first : first + size, first : first + size] = k * (
            2.0 * np.eye(size) - np.eye(size, k=1) - np.eye(size, k=-1)
        )
        K[first + size - 1, first + size - 1] = k
    unit = np.eye(n)
    return cms.Matrices(
        K, np.eye(n), {"across": unit[across - 1], "along": unit[-1], "push": unit[2],
                       "pull": unit[across + 2]},
    )  # fmt: skip


def left(component, ends, modes):
    """What the lowest modes and the residual ones of the loads leave of a flexibility, densely.

    Of one interface, or between two.
    """
    K, M = (sparse.csc_array(each).toarray() for each in (component.stiffness, component.mass))
    _, shapes = linalg.eigh(K, M, subset_by_index=[0, modes - 1])
    loads = [v for name, v in component.interfaces.items() if name.startswith(("pu", "half"))]
    basis = np.column_stack([shapes, np.linalg.solve(K, np.array(loads).T)])
    b = component.interfaces[ends[0]] - sum(component.interfaces[end] for end in ends[1:])
    inner = np.linalg.solve(basis.T @ K @ basis, basis.T @ b)
    return b @ np.linalg.solve(K, b) - (basis.T @ b) @ inner


@pytest.fixture(params=["page", "scene"])
def two_beams(request, monkeypatch):
    """Two beams and their orbit at 100 Hz: of the gallery's page, or of the scene."""
    if request.param == "scene":
        scene = load_scene(example("two_beams.toml"))
        return build_component(scene), solve_orbit(build_system(scene), 100.0), "_"
    monkeypatch.setattr(
        "matplotlib.pyplot.subplots", lambda *_, **__: (MagicMock(), [MagicMock()] * 2)
    )
    page = runpy.run_path(str(ROOT / "docs/gallery/two_beams.py"))
    return page["beams"], page["orbit"], " "


def test_two_beams_come_back_as_integration_from_event_to_event_says(two_beams):
    """With what is left of the flexibilities by dense algebra, and beams as in closed form."""
    beams, orbit, gap = two_beams
    system = orbit.system
    rows = {name.replace(gap, " "): row for name, row in system.participation.items()}
    w, omega = system.natural_frequencies, 200.0 * math.pi
    lengths, heights = np.array([0.3, 0.29, 0.3, 0.29]), np.array([0.01, 0.01, 0.014, 0.014])
    known = 1.875104069**2 * math.sqrt(2.1e11 / 7800.0 / 12.0) * heights / lengths**2
    assert w[:4] == pytest.approx(known, rel=1e-5)
    across, along = (rows[f"tip a {axis}"] - rows[f"tip b {axis}"] for axis in "yz")
    ends = [[f"tip{gap}{name}{gap}{axis}" for name in "ab"] for axis in "yz"]
    give = [left(beams, pair, 8) for pair in ends]
    load = 2.0 * rows["half b y"] + 20.0 * rows["half b z"]
    body = Body(
        np.eye(w.size), np.diag(0.02 * w), np.diag(w**2), lambda t: load * np.cos(omega * t),
        [Contact(along, Friction(0.3), 0.0, across, 1.0 / give[0], 1.0, 1e-4, 1.0 / give[1])],
    )  # fmt: skip
    state = orbit.states([0.0])[0]
    start = np.append(state, along @ state[: w.size])  # open: what slides goes along
    back, events = body.followed(start, 0.01, 1e-4)
    assert events >= 3  # it closes, slides, and opens
    np.testing.assert_allclose(back, start, atol=1e-8 * np.abs(start).max())


@pytest.mark.parametrize("always", [False, True])
def test_friction_where_nothing_has_mass_agrees_with_integration_from_event_to_event(always):
    """Impacts with friction on a wall, or dry friction that acts all the time."""
    component = two_chains()
    reduced = cms.reduce(component, modes=6, method="macneal", massless=["across", "along"])
    omega, law = 1.9, Friction(0.4)
    acting = {"stops": [RigidStop("across", 1.0, 0.3, tangent="along", friction=law)]}
    if always:
        acting = {"dampers": [DryFriction("along", 1.2, law)]}
    system = System.from_reduced(
        reduced,
        modal_damping=0.02,
        excitation=[HarmonicForce("push", 4.0), HarmonicForce("pull", 3.0, 70.0)],
        **acting,
    )
    across, along, push, pull = (system.participation[name] for name in reduced.interfaces)
    normal, spring = (1.0 / left(component, [name], 6) for name in ("across", "along"))
    contact = Contact(along, law, 0.0, across, normal, 1.0, 0.3, spring)
    if always:
        contact = Contact(along, law, 1.2, spring=spring)
    w = system.natural_frequencies
    body = Body(
        np.eye(w.size), np.diag(0.04 * w), np.diag(w**2),
        lambda t: 4.0 * push * np.cos(omega * t) + 3.0 * pull * np.cos(omega * t + np.radians(70)),
        [contact],
    )  # fmt: skip
    start = np.zeros(2 * w.size + 1)
    start[w.size] = 1.0
    phases, flow = np.array([0.0, 24.0]), FlowMap(system)
    expected, events = body.followed(start, phases[1] / omega, 0.05)
    assert events > 8
    found = flow.to_start(flow.shoot(flow.to_state(start)[None], phases, omega).ends[0])
    np.testing.assert_allclose(found, expected, atol=1e-8 * np.abs(expected).max())


def test_both_sides_of_a_gap_are_never_closed_at_once():
    stops = [RigidStop("end", 1.0, 0.2), RigidStop("end", 1.0, 0.1, direction=-1)]
    system = System.from_reduced(free_bar(8), stops=stops)
    one, other = system.stops
    assert one.stiffness == other.stiffness
    with pytest.raises(SystemModelError, match="nothing tells their forces apart, as at 'end'"):
        System.from_reduced(free_bar(8), stops=[RigidStop("end", 1.0, g) for g in (0.1, 0.2)])


@pytest.mark.parametrize("modes", [2, 3, 8])
def test_both_ends_of_a_bar_bear_what_its_whole_length_does(modes):
    """Between springs of 5 EA/L that are 0.2 too near, exactly, with any number of modes."""
    n = np.arange(1, modes)
    common = -1.0 / 6.0 - np.sum(2.0 * (-1.0) ** n / (np.pi * n) ** 2)
    bar = free_bar(modes)
    own = bar.residual_flexibility[0, 0]
    bar.participation["start"] = np.append(1.0, np.full(modes - 1, np.sqrt(2.0)))
    bar.residual_flexibility = np.array([[own, common], [common, own]])
    stops = [Stop("end", 5.0, 1.0, -0.1), Stop("start", 5.0, 1.0, -0.1, direction=-1)]
    system = System.from_reduced(bar, stops=stops)
    forces = [force for _, _, force in closed_at_rest(system, rest(system))]
    np.testing.assert_allclose(forces, 0.2 / (1.0 + 2.0 / 5.0), rtol=1e-9)


@pytest.mark.parametrize(
    ("acting", "sentence"),
    [
        ({"excitation": [HarmonicForce("end", 1.0)]}, "excitation: 'end' has no mass"),
        ({"dampers": [Damper("end", 1.0)]}, "dampers: 'end' has no mass"),
        ({"stops": [RigidStop("end", 0.8)]}, "without an impact that could lose energy"),
        ({"stops": [Stop("end", 1e3)]}, "only a rigid stop or a linear one without a loss"),
        ({"stops": [Stop("end", 1e3, 1.0, dashpot=2.0)]}, "only a rigid stop or a linear one"),
    ],
)
def test_what_cannot_act_without_mass_is_refused(acting, sentence):
    with pytest.raises(SystemModelError, match=sentence):
        System.from_reduced(free_bar(4), **acting)


def test_joined_dual_components_are_refused():
    """What they have without mass is negative at the joint."""
    parts = {name: cms.reduce(two_chains(), modes=5, method="dual-craig-bampton") for name in "ab"}
    joined = cms.couple(parts, [cms.Joint(("a", "across"), ("b", "across"))])
    with pytest.raises(SystemModelError, match="negative flexibility without mass"):
        System.from_reduced(joined, stops=[RigidStop("a.across", 1.0)])


def test_the_example_of_the_page_runs(capsys):
    page = (ROOT / "docs/how-to/massless_boundary.md").read_text("utf-8")
    (code,) = re.findall(r"```python\n(.*?)```", page, flags=re.S)
    names = {}
    exec(code, names)
    said = capsys.readouterr().out.splitlines()
    beam, reduced = names["beam"], names["reduced"]
    tip = beam.interfaces["tip"]
    whole = tip @ np.linalg.solve(beam.stiffness.toarray(), tip)
    rows = reduced.participation["tip"] / (2.0 * math.pi * reduced.frequencies_hz)
    assert float(said[0]) == pytest.approx(1.0 / (whole - rows @ rows), rel=1e-5)
    assert said[1].endswith(", stable>")


def test_friction_of_a_rigid_stop_needs_both_directions_with_mass_or_none():
    reduced = cms.reduce(two_chains(), modes=6, method="macneal", massless=["across", "along"])
    stop = RigidStop("push", 1.0, tangent="along", friction=0.3)
    with pytest.raises(SystemModelError, match="acts along 'along', which has no mass"):
        System.from_reduced(reduced, stops=[stop])
    with pytest.raises(SystemModelError, match="friction needs both friction and tangent"):
        RigidStop("x", 1.0, friction=0.3)


def test_a_load_reaches_a_point_without_mass_by_the_modes():
    """The receptance of the whole model is that of the system; nothing acts at once."""
    component = two_chains()
    reduced = cms.reduce(component, modes=6, method="macneal", massless=["across", "along"])
    system = System.from_reduced(
        reduced, modal_damping=0.02, excitation=[HarmonicForce("push", 4.0)]
    )
    hz = 0.9
    orbit = solve_orbit(system, hz)
    seen = orbit.history(4000).displacement["across"]
    known = abs(reduced.receptance(hz, "across", "push", 0.02)) * 4.0
    assert np.abs(seen).max() == pytest.approx(float(known), rel=1e-5)
    assert math.isfinite(orbit.max_abs_displacement)
