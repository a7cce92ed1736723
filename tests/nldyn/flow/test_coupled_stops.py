"""Stops that move each other at once: against matrix exponentials between all closed sets."""

import itertools
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy import linalg
from scipy.optimize import brentq
from sliding import off_differences

from nldyn import (
    ConstantForce,
    FlowMap,
    HarmonicForce,
    Parameter,
    RigidStop,
    Stop,
    System,
    continue_branch,
    save,
    solve_orbit,
)
from nldyn.io.branches import load_branches
from nldyn.system import rest

OMEGA, LOAD = 7.0, 20.0
TURN = np.array([0.0, 2.0 * np.pi])


def random_system(seed, count, modes=4):
    """Contacts with a full matrix of flexibility, of which every other one has a stiffness."""
    rng = np.random.default_rng(seed)
    names = [f"c{i}" for i in range(count)]
    rows = {name: rng.normal(size=modes) for name in [*names, "push"]}
    root = rng.normal(size=(count, count + 1))
    G = np.zeros((count + 1, count + 1))
    G[:count, :count] = 4e-3 * (root @ root.T + 0.1 * np.eye(count))
    stops = [
        RigidStop(name, 1.0, 0.02 * rng.uniform(0.5, 2.0), direction=int(rng.choice([-1, 1])))
        if i % 2 == 0
        else Stop(name, 300.0, 1.0, 0.02 * rng.uniform(0.5, 2.0))
        for i, name in enumerate(names)
    ]
    reduced = SimpleNamespace(
        frequencies_hz=np.sort(rng.uniform(0.5, 6.0, modes)),
        participation=rows,
        residual_flexibility=G,
    )
    system = System.from_reduced(
        reduced, modal_damping=0.03, stops=stops, excitation=[HarmonicForce("push", LOAD)]
    )
    return system, stops, G[:count, :count]


class Enumerated:
    """The same motion by the only set of closed contacts that agrees with itself, of all 2^n."""

    def __init__(self, system, stops, G):
        signs = np.array([stop.direction for stop in stops])
        self.C = np.array([s.direction * system.participation[s.at] for s in stops])
        self.gaps = np.array([stop.gap for stop in stops])
        own = [0.0 if isinstance(s, RigidStop) else 1.0 / s.stiffness for s in stops]
        self.A = np.outer(signs, signs) * G + np.diag(own)
        n, count = system.size, len(stops)
        self.n, self.free = n, np.zeros((2 * n + 3, 2 * n + 3))  # with a cosine, a sine and a one
        self.free[:n, n : 2 * n] = np.eye(n)
        self.free[n : 2 * n, :n] = -np.diag(system.natural_frequencies**2)
        self.free[n : 2 * n, n : 2 * n] = -system.total_damping
        self.free[n : 2 * n, 2 * n] = LOAD * system.participation["push"]
        self.free[2 * n, 2 * n + 1], self.free[2 * n + 1, 2 * n] = -OMEGA, OMEGA
        lengths = range(count + 1)
        self.sets = [list(s) for k in lengths for s in itertools.combinations(range(count), k)]

    def shown(self, closed):
        """Rows of what stays above zero while a set is closed: its forces, the others' gaps."""
        plain = np.zeros((len(self.gaps), 2 * self.n + 3))
        plain[:, : self.n], plain[:, -1] = self.C, -self.gaps
        forces = np.zeros_like(plain)
        forces[closed] = np.linalg.solve(self.A[np.ix_(closed, closed)], plain[closed])
        rows = self.A @ forces - plain
        rows[closed] = forces[closed]
        rates = self.free.copy()
        rates[self.n : 2 * self.n] -= self.C.T @ forces
        return rows, rates

    def chosen(self, x, rate):
        """The set of a state, a little later than now."""
        return max(self.sets, key=lambda s: (self.shown(s)[0] @ (x + 1e-7 * rate)).min())

    def run(self, start, turns):
        """The end of a motion, and the sets at its events."""
        x, t, end = np.concatenate([start, [1.0, 0.0, 1.0]]), 0.0, turns * 2.0 * np.pi / OMEGA
        closed, events = self.chosen(x, 0.0 * x), []
        while t < end:
            rows, rates = self.shown(closed)
            stride = min(0.01, end - t)
            steps = np.linspace(0.0, stride, 41)[1:]
            small, ahead = linalg.expm(steps[0] * rates), [x]
            for _ in steps:
                ahead.append(small @ ahead[-1])
            below = np.flatnonzero((np.array(ahead[1:]) @ rows.T).min(axis=1) < 0.0)
            if below.size:
                place = below[0]

                def least(s, x=ahead[place], rows=rows, rates=rates):
                    return float((rows @ linalg.expm(s * rates) @ x).min())

                more = brentq(least, 0.0, steps[0], xtol=1e-16) if least(0.0) > 0.0 else 1e-14
                x = linalg.expm(more * rates) @ ahead[place]
                t += more + (steps[place] - steps[0])
                closed = self.chosen(x, rates @ x)
                events.append(closed)
            else:
                x, t = ahead[-1], t + stride
        return x[: 2 * self.n], events


def at_random(seed):
    return np.random.default_rng(seed).normal(size=8) * np.repeat([0.02, 0.2], 4)


@pytest.mark.parametrize(("seed", "count"), [(1, 2), (2, 2), (3, 3), (4, 4), (5, 4)])
def test_motions_agree_with_exponentials_between_events(seed, count):
    system, stops, G = random_system(seed, count)
    flow, start = FlowMap(system), at_random(seed)
    found = flow.shoot(flow.to_state(start)[None], TURN, OMEGA)
    expected, events = Enumerated(system, stops, G).run(start, 1)
    assert max(map(len, events)) >= 2  # several are closed at once
    np.testing.assert_allclose(
        flow.to_modal(found.ends)[0], expected, atol=1e-10 * np.abs(expected).max()
    )


@pytest.mark.parametrize(("seed", "count"), [(1, 2), (3, 3), (4, 4)])
def test_derivatives_agree_with_differences(seed, count):
    """By the state, the frequency, a gap and the stiffness of each stop."""
    system = random_system(seed, count)[0]
    flow, phases = FlowMap(system), np.array([0.0, np.pi])
    z = flow.to_state(at_random(seed))[None]
    parameters = [Parameter(name, i) for name in ("gap", "stiffness") for i in range(count)]
    found = flow.shoot(z, phases, OMEGA, parameters=parameters)
    assert found.closings.sum() >= 2
    assert off_differences(flow, found, z, phases, OMEGA, 1e-7) < 1e-6
    for column, parameter in zip(found.d_parameters[0].T, parameters, strict=True):
        value = getattr(system.stops[parameter.index], parameter.name)
        ends = []
        for way in (1.0, -1.0):
            stops = list(system.stops)
            changed = {parameter.name: value * (1.0 + way * 1e-6)}
            stops[parameter.index] = replace(stops[parameter.index], **changed)
            other = FlowMap(system.with_elements(stops=stops))
            ends.append(other.shoot(z, phases, OMEGA).ends[0])
        slope = (ends[0] - ends[1]) / 2e-6
        np.testing.assert_allclose(value * column, slope, atol=1e-6 * np.abs(slope).max() + 1e-9)


@pytest.mark.parametrize("first", [0, 1])
def test_a_flat_landing_closes_what_its_complementarity_problem_does(first):
    """All gaps close in one instant; of two contacts the one pushes the other away at once."""
    names = ["stiff", "soft"] if first == 0 else ["soft", "stiff"]
    G = np.array([[1.0, 1.5], [1.5, 4.0]])[[first, 1 - first]][:, [first, 1 - first]] * 1e-3
    stops = [RigidStop(name, 1.0, 0.01) for name in names]
    reduced = SimpleNamespace(
        frequencies_hz=[0.0, 2.0, 3.0],
        participation={
            **dict.fromkeys(names, np.array([1.0, 0.0, 0.0])),
            "push": np.array([0.1, 0.5, 0.7]),
        },
        residual_flexibility=np.pad(G, (0, 1)),
    )
    system = System.from_reduced(
        reduced, stops=stops, excitation=[HarmonicForce("push", LOAD)], modal_damping=0.01
    )
    start = np.array([0.0, 0.0, 0.0, 1.0, 0.0, 0.0])
    flow = FlowMap(system)
    found = flow.shoot(flow.to_state(start)[None], TURN, OMEGA)
    expected, events = Enumerated(system, stops, G).run(start, 1)
    assert events[0] == [first]
    assert np.flatnonzero(found.closings).tolist() == [first]
    np.testing.assert_allclose(flow.to_modal(found.ends)[0], expected, atol=1e-10)


def test_an_orbit_tells_what_is_between_the_points_and_their_stops():
    """Forces of its record satisfy the complementarity, and extremes are those of a fine look."""
    system, stops, G = random_system(3, 3)
    orbit = solve_orbit(system, OMEGA / (2.0 * np.pi))
    own = np.diag([0.0 if isinstance(s, RigidStop) else 1.0 / s.stiffness for s in stops])
    signs = np.array([s.direction for s in stops])
    seen = orbit.history(4000)
    plain = np.array([system.stop_vector(s) @ seen.modal.T - s.gap for s in system.stops]).T
    left = plain - seen.force @ (np.outer(signs, signs) * G + own)
    assert seen.force.max() > 0.0 and seen.force.min() == 0.0
    np.testing.assert_allclose(left[seen.force > 0.0], 0.0, atol=1e-12)
    assert left[seen.force == 0.0].max() <= 0.0
    assert np.sum((seen.force > 0.0).sum(axis=1) >= 2) > 10
    phases, forces = orbit.trajectory.contact_quadrature()[0], orbit.trajectory.contacts_at_nodes[1]
    again = orbit.history_at(phases).force.T
    recorded = forces[orbit.trajectory.record.kind >= 0].transpose(1, 0, 2).reshape(again.shape)
    np.testing.assert_allclose(recorded, again, atol=1e-6 * again.max())
    for stop, peaks in enumerate(orbit.penetration_peaks):
        assert max(peaks.values) == pytest.approx(seen.penetration[:, stop].max(), rel=1e-4)


def test_rest_on_coupled_stops_is_that_of_their_complementarity_problem():
    system, stops, G = random_system(4, 4)
    force = ConstantForce("push", 300.0)
    q = rest(system.with_elements(excitation=[force]))
    model = Enumerated(system, stops, G)
    stiffness = np.diag(system.natural_frequencies**2)

    def wrong(closed):
        inverse = np.linalg.inv(model.A[np.ix_(closed, closed)])
        C, gaps = model.C[closed], model.gaps[closed]
        load = 300.0 * system.participation["push"] + C.T @ inverse @ gaps
        found = np.linalg.solve(stiffness + C.T @ inverse @ C, load)
        forces = np.zeros(len(stops))
        forces[closed] = inverse @ (C @ found - gaps)
        left = model.C @ found - model.gaps - model.A @ forces
        return max([*(-forces[closed]), *np.delete(left, closed)], default=-1.0), found

    least, expected = min((wrong(closed) for closed in model.sets), key=lambda each: each[0])
    assert least < 0.0
    np.testing.assert_allclose(q, expected, rtol=1e-8)


def test_a_file_keeps_what_stops_have_in_common(tmp_path):
    orbit = solve_orbit(random_system(1, 2)[0], OMEGA / (2.0 * np.pi))
    save(continue_branch(orbit, (1.113, 1.116)), tmp_path / "branch.h5")
    (again,) = load_branches(tmp_path / "branch.h5")
    np.testing.assert_array_equal(
        again.nodes[0].orbit.system.common_flexibility, orbit.system.common_flexibility
    )
