"""Friction over areas between two components: integration of the meshes, closed forms, energy."""

import math

import numpy as np
import pytest
from scipy import linalg

import fem
from nldyn import FlowMap, SceneError, solve_orbit
from nldyn.scene import build_reduced, build_system, load_scene
from nldyn.scene.build import build_parts
from nldyn.scene.contact import areas_found
from nldyn.system import Friction
from tests.sliding import Body, Contact

HEIGHT, LENGTH, BED, SPRING, CLOSE, ROUGH = 0.02, 0.3, 2e7, 1e7, 1e-5, 0.3
HZ, LOADS = 150.0, {"low": (300.0, 0.0), "high": (200.0, 70.0)}  # N, degrees

LEAF = """
[components.{name}.mesh]
file = "{name}.vtu"

[components.{name}.parts.{name}]
youngs_modulus = 2.1e11
density = 7800.0
width = 0.02
height = 0.02

[[components.{name}.supports]]
at = "root"
fixed = ["x", "y", "rotation"]

[components.{name}.interfaces.tip]
at = "tip"
direction = "y"

[components.{name}.reduction]
modes = {modes}

[[excitation]]
at = "{name}.tip"
kind = "harmonic"
amplitude = {load[0]}
phase_deg = {load[1]}
"""

RUBBING = """
[[contact_areas]]
at = "low.low"
against = "high.high"
direction = "y"
stiffness = 2e7
gap = -1e-5
points = {points}
surface = 0.01
surface_against = 0.01
friction = 0.3
along = "x"
tangential_stiffness = 1e7

[damping]
modal_ratio = 0.05

[continuation]
range_hz = [100.0, 200.0]
"""


def scene_of(folder, text):
    (folder / "scene.toml").write_text(text)
    return load_scene(folder / "scene.toml")


def leaves(folder, points=3, modes=(3, 6), change=("", "")):
    """Two cantilevers, of one line and of two, that lie on each other and are both shaken."""
    text = RUBBING.format(points=points)
    for name, y, lines, kept in (("low", 0.0, 1, modes[0]), ("high", HEIGHT, 2, modes[1])):
        ends = {"root": (0, y), "tip": (LENGTH, y)}
        mesh = fem.frame_mesh(ends, [(name, "root", "tip", lines)])
        fem.write_mesh(mesh, folder / f"{name}.vtu")
        text += LEAF.format(name=name, modes=kept, load=LOADS[name])
    assert change[0] in text
    return scene_of(folder, text.replace(*change))


def row_of(beam, entries):
    """A row over the free degrees of freedom, from its values at nodes and directions."""
    row = np.zeros(3 * beam.numbering.count)
    for (node, direction), value in entries.items():
        row[beam.numbering.dofs(np.array([node]))[0, direction]] += value
    return row[beam.free]


def hermite(beam, x, off):
    """How a place moves across and along, at a distance off the axis: by the cubics themselves."""
    at = beam.model.mesh.points[:, 0]
    a, b = next(
        (a, b) for a, b in beam.model.beams[next(iter(beam.model.beams))][1] if at[a] <= x <= at[b]
    )
    size = at[b] - at[a]
    s = (x - at[a]) / size
    moves = (1 - 3 * s**2 + 2 * s**3, size * (s - 2 * s**2 + s**3))
    moves += (3 * s**2 - 2 * s**3, size * (s**3 - s**2))
    turns = ((6 * s**2 - 6 * s) / size, 1 - 4 * s + 3 * s**2)
    turns += ((6 * s - 6 * s**2) / size, 3 * s**2 - 2 * s)
    bending = [(a, 1), (a, 5), (b, 1), (b, 5)]
    along = row_of(beam, {(a, 0): 1 - s, (b, 0): s})
    along -= off * row_of(beam, dict(zip(bending, turns, strict=True)))
    return row_of(beam, dict(zip(bending, moves, strict=True))), along


def body_of(low, high, places, weights):
    """Both beams as they are meshed, with a contact at each place; modal damping of each."""
    contacts = []
    for x, weight in zip(places, weights, strict=True):
        sides = hermite(low, x, 0.5 * HEIGHT), hermite(high, x, -0.5 * HEIGHT)
        normal, along = (np.concatenate([a, -b]) for a, b in zip(*sides, strict=True))
        contacts.append(
            Contact(along, Friction(ROUGH), 0.0, normal, BED * weight, 1.0, -CLOSE, SPRING * weight)
        )
    pairs = [(each.stiffness.toarray(), each.mass.toarray()) for each in (low, high)]
    drags = []
    for K, M in pairs:
        squares, shapes = linalg.eigh(K, M)
        drags.append(M @ shapes @ np.diag(0.1 * np.sqrt(squares)) @ shapes.T @ M)
    K, M = (linalg.block_diag(*each) for each in zip(*pairs, strict=True))
    pulls = []
    for beam in (low, high):
        tip = int(beam.model.mesh.points[:, 0].argmax())
        pulls.append(row_of(beam, {(tip, 1): 1.0}))
    waves = [(amplitude, math.radians(phase)) for amplitude, phase in LOADS.values()]

    def load(t):
        turn = 2.0 * math.pi * HZ * t
        return np.concatenate(
            [a * math.cos(turn + p) * row for (a, p), row in zip(waves, pulls, strict=True)]
        )

    return Body(M, linalg.block_diag(*drags), K, load, contacts)


@pytest.fixture(scope="module")
def rubbed(tmp_path_factory):
    """An orbit of the leaves in all their modes, their meshes, and where they touch."""
    scene = leaves(tmp_path_factory.mktemp("leaves"))
    reduced, parts = build_reduced(scene), build_parts(scene)
    (found,) = areas_found(scene)
    return solve_orbit(build_system(scene), HZ), reduced, parts, found


def test_two_meshes_that_rub_come_back_as_integration_from_event_to_event_says(rubbed):
    """Of all degrees of freedom, which are as many as the modes."""
    orbit, reduced, parts, found = rubbed
    n = orbit.system.size
    gauss = LENGTH * (0.5 + np.array([-0.5, 0.0, 0.5]) * math.sqrt(0.6))
    assert np.allclose(found.places[:, 0], gauss, rtol=1e-14)
    body = body_of(parts["low"], parts["high"], gauss, LENGTH * np.array([5, 8, 5]) / 18.0)
    flow = orbit.problem.flow
    start = flow.to_start(orbit.problem.nodes(orbit.point)[0])
    start = np.concatenate(
        [reduced.basis @ start[:n], reduced.basis @ start[n : 2 * n], start[2 * n :]]
    )
    end, events = body.followed(start, 1.0 / HZ, 5e-5)
    assert events > 10  # each closes, sticks, slides and opens
    for part in (slice(0, n), slice(n, 2 * n), slice(2 * n, None)):
        assert np.abs(end - start)[part].max() < 1e-9 * np.abs(start[part]).max()
    for measured, stuck in zip(orbit.friction, body.stuck, strict=True):
        assert measured.stuck > 0.05 and measured.stuck == pytest.approx(stuck * HZ, abs=1e-9)


def test_what_shakers_put_in_damping_and_friction_take_out(rubbed):
    orbit = rubbed[0]
    count, n = 20000, orbit.system.size
    phases = 2.0 * math.pi * np.arange(count) / count
    speeds = orbit.states(phases)[:, n:]
    power = -np.einsum("ti,ij,tj->t", speeds, orbit.system.damping, speeds)
    for name, (amplitude, phase) in LOADS.items():
        force = amplitude * np.cos(phases + math.radians(phase))
        power += force * (speeds @ orbit.system.participation[f"{name}.tip"])
    lost = sum(each.loss for each in orbit.friction)
    assert power.mean() / HZ == pytest.approx(lost, rel=1e-9)


def test_points_that_nothing_presses_in_turn_lose_what_jenkins_elements_do(tmp_path):
    """Leaves alike, shaken alike and pressed by opposite forces: 4 μN (X - μN/k) at each."""
    text = RUBBING.replace("gap = -1e-5\n", "").format(points=1)
    for name, y, way in (("low", 0.0, 1.0), ("high", HEIGHT, -1.0)):
        ends = {"root": (0, y), "tip": (LENGTH, y)}
        mesh = fem.frame_mesh(ends, [(name, "root", "tip", 2)])
        fem.write_mesh(mesh, tmp_path / f"{name}.vtu")
        text += LEAF.format(name=name, modes=2, load=(4000.0, 0.0))
        text += f'[[excitation]]\nat = "{name}.tip"\nkind = "constant"\nforce = {600.0 * way}\n'
    orbit = solve_orbit(build_system(scene_of(tmp_path, text)), HZ)
    system, (area,) = orbit.system, orbit.areas
    assert np.allclose(area.pressure, area.mean_pressure, rtol=1e-9)
    phases = 2.0 * math.pi * np.arange(4001) / 4000
    for stop, pressure, found in zip(system.stops, area.pressure, orbit.friction, strict=True):
        row = system.vector_between(stop.tangent, stop.tangent_against)
        moved = orbit.states(phases)[:, : system.size] @ row
        first = phases[np.abs(moved).argmax()]
        near = np.polynomial.Polynomial.fit(
            t := first + np.linspace(-0.02, 0.02, 9),
            orbit.states(t)[:, : system.size] @ row, 6, domain=[first - 0.02, first + 0.02],
        )  # fmt: skip
        size = np.abs(near(np.real(near.deriv().roots()))).max()
        grip = ROUGH * pressure * stop.share
        known = 4.0 * grip * (size - grip / stop.tangential_stiffness)
        assert found.loss == pytest.approx(known, rel=1e-8)


BLOCK = """
[components.{name}.mesh]
file = "{name}.vtu"
model = "structure"

[components.{name}.parts.{name}]
kind = "solid"
youngs_modulus = 1e7
density = 1000.0
poissons_ratio = 0.3

[[components.{name}.supports]]
at = "{held}"
fixed = ["x", "y", "z"]

[components.{name}.reduction]
modes = 3
"""

OVER_PLANE = """
[[contact_areas]]
at = "low.z1"
against = "high.z0"
direction = "z"
stiffness = 4e6
gap = -1e-3
friction = 0.2
along = {along}
second_along = {across}
tangential_stiffness = 2e6
attachment_modes = 3

[damping]
modal_ratio = 0.05

[continuation]
range_hz = [10.0, 30.0]
"""


def blocks(folder, **axes):
    """Two blocks of rubber of different meshes, pressed on each other and shaken aslant."""
    text = OVER_PLANE.format(**axes)
    for name, z, counts, held in (("low", 0.0, (1, 1, 1), "z0"), ("high", 0.1, (2, 1, 1), "z1")):
        mesh = fem.box_mesh(name, (0.1, 0.1, 0.1), counts, kind="hexahedron27")
        fem.write_mesh(
            mesh.with_points(mesh.points + np.array([0.0, 0.0, z])), folder / f"{name}.vtu"
        )
        text += BLOCK.format(name=name, held=held)
        text += f"[components.{name}.places.corner]\nat = [0.1, 0.1, 0.1]\n"
        text += f'[components.{name}.interfaces.z]\nat = "corner"\ndirection = "z"\n'
    for axis, amplitude, phase in (("x", 300.0, 0), ("y", 200.0, 60), ("z", 60.0, 20)):
        if axis != "z":
            text += f'[components.low.interfaces.{axis}]\nat = "corner"\ndirection = "{axis}"\n'
        text += f'[[excitation]]\nat = "low.{axis}"\nkind = "harmonic"\n'
        text += f"amplitude = {amplitude}\nphase_deg = {phase}\n"
    return scene_of(folder, text)


AT_CORNERS = "low.x", "low.y", "low.z", "high.z"


def test_over_a_plane_no_direction_is_another(tmp_path):
    """Axes that are turned by any angle are as good: the same motion from rest.

    That of places, since two modes have one frequency, whose shapes are any of a plane.
    """
    ends = []
    for along, across in (('"x"', '"y"'), ("[0.8, 0.6, 0.0]", "[-0.6, 0.8, 0.0]")):
        flow = FlowMap(build_system(blocks(tmp_path, along=along, across=across)))
        shapes = [flow.system.participation[name] for name in AT_CORNERS]
        start = flow.to_state(np.zeros((1, 2 * flow.system.size)))
        found = flow.shoot(start, np.array([0.0, 2.0 * np.pi]), 2.0 * np.pi * 20.0)
        assert not found.failure
        motion, places = np.split(flow.to_start(found.ends)[0], [2 * flow.system.size])
        moved, speeds = motion.reshape(2, -1) @ np.transpose(shapes)
        ends.append((moved, speeds, places.reshape(-1, 2)))
    for one, other in zip(ends[0][:2], ends[1][:2], strict=True):
        assert np.abs(one - other).max() < 1e-9 * np.abs(one).max()
    places = ends[0][2], ends[1][2]
    assert np.abs(places[0]).max() > 1e-5  # it has slid
    turned = places[1] @ np.array([[0.8, 0.6], [-0.6, 0.8]])
    assert np.abs(turned - places[0]).max() < 1e-9 * np.abs(places[0]).max()


def left_over(beam):
    """Flexibility at the tip beside two modes and the static solution of the load, densely."""
    K, M = beam.stiffness.toarray(), beam.mass.toarray()
    tip, load = beam.interfaces["tip"], beam.interfaces["load"]
    basis = np.column_stack([linalg.eigh(K, M)[1][:, :2], np.linalg.solve(K, load)])
    inner = np.linalg.solve(basis.T @ K @ basis, basis.T @ tip)
    return tip @ np.linalg.solve(K, tip) - (basis.T @ tip) @ inner


def test_a_rigid_stop_between_components_without_mass_gives_way_by_what_both_have_left(tmp_path):
    text = RUBBING[RUBBING.index("[damping]") :]
    text += '[[stops]]\nat = "low.tip"\nagainst = "high.tip"\nlaw = "rigid"\nrestitution = 1.0\n'
    for name, y, lines in (("low", 0.0, 2), ("high", HEIGHT, 3)):
        ends = {"root": (0, y), "tip": (LENGTH, y)}
        mesh = fem.frame_mesh(ends, [(name, "root", "tip", lines)])
        fem.write_mesh(mesh, tmp_path / f"{name}.vtu")
        leaf = LEAF.format(name=name, modes=2, load=LOADS[name])
        kept = 'modes = 2\nmethod = "macneal"\nmassless = ["tip"]'
        text += leaf.replace("modes = 2", kept).replace(f'at = "{name}.tip"', f'at = "{name}.load"')
        text += f"[components.{name}.places.load]\nat = [{LENGTH / lines}, {y}, 0.0]\n"
        text += f'[components.{name}.interfaces.load]\nat = "load"\ndirection = "y"\n'
    scene = scene_of(tmp_path, text)
    (stop,) = build_system(scene).stops
    give = sum(left_over(part) for part in build_parts(scene).values())
    assert stop.stiffness == pytest.approx(1.0 / give, rel=1e-9)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        (
            'along = "x"',
            'along = "y"',
            "'along' must be perpendicular to 'direction'",
        ),
        (
            'along = "x"',
            'along = "x"\nsecond_along = "x"',
            "'second_along' must be perpendicular to 'along'",
        ),
        ('friction = 0.3\nalong = "x"\n', "", "'tangential_stiffness', which needs 'friction'"),
        ("tangential_stiffness = 1e7", "tangential_stiffness = 0", "greater than 0"),
        ("friction = 0.3", "friction = -0.3", "must be at least 0"),
    ],
)
def test_what_makes_no_friction_of_an_area_is_refused(tmp_path, old, new, said):
    with pytest.raises(SceneError, match=said):
        build_system(leaves(tmp_path, change=(old, new)))
