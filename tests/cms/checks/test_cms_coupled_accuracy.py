"""Bands of coupled models hold what the full structure has."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import linalg

import cms

METHODS = ["rubin", "craig-bampton", "macneal", "truncation"]


def random_component(seed: int, size: int, held: bool = True) -> cms.Matrices:
    """A chain with random springs and masses, and interfaces at both ends."""
    rng = np.random.default_rng(seed)
    springs = rng.uniform(0.5, 2.0, size + 1)
    if not held:
        springs[[0, -1]] = 0.0
    K = np.diag(springs[:-1] + springs[1:]) - np.diag(springs[1:-1], 1) - np.diag(springs[1:-1], -1)
    M = np.diag(rng.uniform(0.5, 2.0, size))
    return cms.Matrices(K, M, {"left": np.eye(size)[0], "right": np.eye(size)[-1]})


def whole_structure(parts, joints):
    """Frequencies in Hz and a function for the receptance of the full components, joined."""
    names = list(parts)
    K, M = (
        linalg.block_diag(*[getattr(parts[n], kind) for n in names])
        for kind in ("stiffness", "mass")
    )
    loads = {}
    first = 0
    for name in names:
        for at, vector in parts[name].interfaces.items():
            loads[f"{name}.{at}"] = np.zeros(K.shape[0])
            loads[f"{name}.{at}"][first : first + vector.size] = vector
        first += parts[name].mass.shape[0]
    rigid = [np.zeros(K.shape[0])]
    for joint in joints:
        row = loads[".".join(joint.a)] - (loads[".".join(joint.b)] if joint.b else 0.0)
        if joint.stiffness is None:
            rigid.append(row)
        else:
            K = K + joint.stiffness * np.outer(row, row)
    free = linalg.null_space(np.array(rigid))
    K, M = free.T @ K @ free, free.T @ M @ free
    loads = {name: free.T @ vector for name, vector in loads.items()}

    def receptance(hz, at, excited):
        return loads[at] @ np.linalg.solve(K - (2 * np.pi * hz) ** 2 * M, loads[excited])

    squares = linalg.eigh(K, M, eigvals_only=True)
    return np.sqrt(np.maximum(squares, 0.0)) / (2 * np.pi), receptance


CASES = {
    "rigid": [cms.Joint(("a", "right"), ("b", "left"))],
    "spring": [cms.Joint(("a", "right"), ("b", "left"), stiffness=0.3)],
    "loop": [
        cms.Joint(("a", "right"), ("b", "left")),
        cms.Joint(("a", "left"), ("b", "right"), stiffness=5.0),
        cms.Joint(("b", "right"), stiffness=0.1),
    ],
}


def coupled(methods, seed, joints, held=True, modes=4):
    parts = {"a": random_component(seed, 20), "b": random_component(seed + 1, 25, held)}
    known = {
        name: cms.accuracy(part, cms.reduce(part, modes=modes, method=method))
        for (name, part), method in zip(parts.items(), methods, strict=True)
    }
    return cms.coupled_accuracy(known, joints), whole_structure(parts, joints)


@pytest.mark.parametrize("joints", CASES.values(), ids=CASES)
@pytest.mark.parametrize("methods", [(m, m) for m in METHODS] + [("rubin", "craig-bampton")])
def test_every_frequency_and_receptance_lies_in_its_band(methods, joints):
    for seed in range(2):
        bands, (exact, receptance) = coupled(methods, seed, joints)
        count = 5
        found = bands.frequency_bands_hz(count)
        assert np.all(found[:, 0] * (1 - 1e-12) <= exact[:count])
        assert np.all(exact[:count] <= found[:, 1] * (1 + 1e-12))
        for hz in np.linspace(0.3, 0.95, 4) * min(bands.next_hz, exact[5]):
            for pair in (("a.left", "a.left"), ("a.right", "b.right")):
                low, high = bands.receptance_band(hz, *pair)[0]
                true = receptance(hz, *pair)
                assert low - 1e-9 * abs(true) <= true <= high + 1e-9 * abs(true)


def test_bands_are_narrow_where_modes_are_many():
    """With Rubin's method 1e-6 and less for the lowest, below 1e-2 for the fourth."""
    bands, (exact, receptance) = coupled(("rubin", "rubin"), 7, CASES["rigid"], modes=8)
    found = bands.frequency_bands_hz(4)
    widths = (found[:, 1] - found[:, 0]) / exact[:4]
    assert widths[0] < 1e-6
    assert widths[3] < 1e-2
    low, high = bands.receptance_band(0.5 * exact[0], "a.right", "b.right")[0]
    assert high - low < 1e-5 * abs(receptance(0.5 * exact[0], "a.right", "b.right"))


def test_a_band_says_infinity_where_nothing_is_known():
    bands, _ = coupled(("rubin", "rubin"), 0, CASES["rigid"])
    low, high = bands.receptance_band(bands.next_hz * 1.01, "a.left", "a.left")[0]
    assert (low, high) == (-np.inf, np.inf)
    assert bands.counted(bands.next_hz * 1.01) == (0.0, np.inf)


@pytest.mark.parametrize("method", ["rubin", "macneal"])
def test_rigid_body_modes_of_a_floating_structure_are_certain(method):
    parts = {name: random_component(seed, 20, held=False) for seed, name in enumerate("ab")}
    joints = CASES["spring"]
    known = {n: cms.accuracy(p, cms.reduce(p, modes=4, method=method)) for n, p in parts.items()}
    bands = cms.coupled_accuracy(known, joints)
    exact, _ = whole_structure(parts, joints)
    found = bands.frequency_bands_hz(4)
    assert found[0].tolist() == [0.0, 0.0]
    assert np.all((found[1:, 0] <= exact[1:4]) & (exact[1:4] <= found[1:, 1]))


def test_a_joint_that_follows_from_others_is_refused():
    part = random_component(0, 10)
    twice = cms.Matrices(part.stiffness, part.mass, {**part.interfaces, "same": np.eye(10)[0]})
    known = cms.accuracy(twice, cms.reduce(twice, modes=3))
    joints = [cms.Joint(("a", "left")), cms.Joint(("a", "same"))]
    with pytest.raises(cms.ReductionError, match="no rigid joint follows from others"):
        cms.coupled_accuracy({"a": known}, joints)
    bands = cms.coupled_accuracy({"a": known}, joints[:1])
    with pytest.raises(cms.ReductionError, match="no interface 'a\\.top'"):
        bands.receptance_band(0.01, "a.top", "a.left")
