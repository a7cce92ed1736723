"""Areas of contact share attachment modes: what their static deflection misses."""

import numpy as np
import pytest

import cms

N = 60


def chain(points=12):
    """A chain of masses on a foundation, pressed at some of its places."""
    rng = np.random.default_rng(5)
    stiffness = 2.0 * np.eye(N) - np.eye(N, k=1) - np.eye(N, k=-1) + 0.01 * np.eye(N)
    places = np.linspace(3, N - 4, points).astype(int)
    interfaces = {f"p{i}": np.eye(N)[place] for i, place in enumerate(places)}
    mass = np.diag(rng.uniform(0.5, 1.5, N))
    return cms.Matrices(stiffness, mass, interfaces | {"drive": np.eye(N)[5]})


def worst_error(component, reduced, area):
    """Largest share of the deflection under a load at the points that the model misses."""
    B = np.array([component.interfaces[name] for name in area.points]).T
    full = B.T @ np.linalg.solve(np.asarray(component.stiffness), B)
    rows = np.array([reduced.participation[name] for name in area.points])
    small = rows / (2.0 * np.pi * reduced.frequencies_hz) ** 2 @ rows.T
    own = np.diag(1.0 / np.asarray(area.stiffness))
    # generalised eigenvalues of what is missing beside the whole of structure and contact
    return float(np.linalg.eigvals(np.linalg.solve(own + small, full - small)).real.max())


@pytest.mark.parametrize("tolerance", [1e-1, 1e-2, 1e-4])
def test_the_tolerance_bounds_the_static_deflection_of_every_load(tolerance):
    component = chain()
    area = cms.Area([f"p{i}" for i in range(12)], np.linspace(0.002, 0.02, 12), tolerance=tolerance)
    reduced = cms.reduce(component, modes=4, areas={"bed": area})
    told = reduced.areas["bed"]
    assert told.static_error <= tolerance
    assert worst_error(component, reduced, area) <= told.static_error * (1.0 + 1e-9) + 1e-14
    assert reduced.size == 4 + told.modes + 1  # and that of the drive
    assert np.isclose(
        reduced.static_flexibility("drive"), full_flexibility(component, "drive"), rtol=1e-10
    )


def full_flexibility(component, name):
    b = component.interfaces[name]
    return b @ np.linalg.solve(np.asarray(component.stiffness), b)


def test_fewer_attachment_modes_are_told_with_their_error():
    component = chain()
    names, stiffness = [f"p{i}" for i in range(12)], np.full(12, 0.3)
    errors = []
    for count in range(6):
        area = cms.Area(names, stiffness, modes=count)
        reduced = cms.reduce(component, modes=3, areas={"bed": area})
        assert reduced.areas["bed"].modes == count
        errors.append(reduced.areas["bed"].static_error)
        assert worst_error(component, reduced, area) <= errors[-1] * (1.0 + 1e-9) + 1e-14
    assert errors == sorted(errors, reverse=True)


def test_all_attachment_modes_are_those_without_an_area():
    component = chain()
    area = cms.Area([f"p{i}" for i in range(12)], np.ones(12), tolerance=0.0)
    shared = cms.reduce(component, modes=4, areas={"bed": area})
    single = cms.reduce(component, modes=4)
    assert np.allclose(shared.frequencies_hz, single.frequencies_hz, rtol=1e-9)


def test_what_an_area_was_given_is_kept_in_its_file(tmp_path):
    area = cms.Area(["p0", "p1", "p2"], [1.0, 2.0, 3.0], modes=1)
    reduced = cms.reduce(chain(3), modes=2, areas={"bed": area})
    reduced.save(tmp_path / "model.npz")
    assert cms.ReducedModel.load(tmp_path / "model.npz").areas == reduced.areas


def test_what_makes_no_area_is_refused_in_a_sentence():
    for arguments, said in (
        ({"points": [], "stiffness": []}, "stiffness at each of its 0 points"),
        ({"points": ["p0"], "stiffness": [1.0, 2.0]}, "stiffness at each of its 1 points"),
        ({"points": ["p0"], "stiffness": [-1.0]}, "must be positive at each point"),
        ({"points": ["p0"], "stiffness": [1.0], "modes": -1}, "0 at least"),
        ({"points": ["p0"], "stiffness": [1.0], "tolerance": -1.0}, "0 at least"),
    ):
        with pytest.raises(cms.ReductionError, match=said):
            cms.Area(**arguments)
    with pytest.raises(cms.ReductionError, match="there is no interface 'q'"):
        cms.reduce(chain(3), modes=2, areas={"bed": cms.Area(["q"], [1.0])})
