"""Areas of contact whose points have no mass: against the whole mesh, and more modes."""

import math

import numpy as np
import pytest
from scipy.optimize import nnls

import cms
import fem
from nldyn import (
    ConstantForce,
    HarmonicForce,
    Parameter,
    System,
    SystemModelError,
    contact_area,
    solve_orbit,
)
from nldyn.system import rest
from nldyn.system.equilibrium import closed_at_rest
from nldyn.system.parameters import check_exact

STEEL = fem.Material(2.1e11, 7800.0)
COUNT, FINER, LENGTH, PUSH = 6, 4, 0.3, -0.1


@pytest.fixture(scope="module")
def strip():
    """A clamped strip above a cylinder: places of six points along its edge, each an element's."""
    mesh = fem.frame_mesh(
        {"root": (0, 0), "tip": (LENGTH, 0)}, [("strip", "root", "tip", COUNT * FINER)]
    )
    component = fem.assemble(
        fem.StructureModel(
            mesh,
            parts={"strip": fem.BeamPart(STEEL, fem.RectangularSection(0.02, 0.001))},
            supports=[fem.Support("root", ("x", "y", "rotation"))],
            interfaces={"tip": fem.Interface("tip", "y")},
            plane=True,
        )
    )
    points = fem.contact_points(component, "strip", "-y", points=1)
    chosen = np.arange(FINER // 2, COUNT * FINER, FINER)
    names = [f"bed {i}" for i in chosen]
    places = points.places[chosen, 0]
    area = cms.Area(names, np.ones(COUNT))
    rows = {name: points.vectors()[i] for name, i in zip(names, chosen, strict=True)}
    return component.with_interfaces(rows, areas={"bed": area}), names, places


def landing(strip, modes, stiffness, *excitation, gap=2e-5):
    component, names, places = strip
    reduced = cms.reduce(component, modes=modes, method="macneal", massless=["bed"])
    stops = contact_area(
        "bed", names, stiffness, weights=np.full(COUNT, LENGTH / COUNT),
        gap=gap + places**2 / 200.0,
    )  # fmt: skip
    return System.from_reduced(reduced, modal_damping=0.2, stops=stops, excitation=excitation)


@pytest.mark.parametrize("stiffness", [math.inf, 1e4])
def test_a_strip_leans_on_its_bed_as_the_whole_mesh_does(strip, stiffness):
    """Under a force at its tip; its forces by non-negative least squares of the whole mesh."""
    component, names, places = strip
    system = landing(strip, 3, stiffness, ConstantForce("tip", PUSH))
    K = component.stiffness.toarray()
    C = np.array([component.interfaces[name] for name in names])
    tip = component.interfaces["tip"]
    give = C @ np.linalg.solve(K, C.T) + np.eye(COUNT) * COUNT / LENGTH / stiffness
    free = PUSH * C @ np.linalg.solve(K, tip) - 2e-5 - places**2 / 200.0
    root = np.linalg.cholesky(give).T
    forces = nnls(root, np.linalg.solve(root.T, free))[0]
    found = np.zeros(COUNT)
    for place, _, force in closed_at_rest(system, rest(system)):
        found[place] = force
    assert np.count_nonzero(forces) >= 2
    np.testing.assert_allclose(found, forces, atol=1e-7 * forces.max())
    moved = tip @ np.linalg.solve(K, PUSH * tip - C.T @ forces)
    assert system.participation["tip"] @ rest(system) == pytest.approx(moved, rel=1e-8)


def lowest(strip, modes, stiffness):
    orbit = solve_orbit(landing(strip, modes, stiffness, HarmonicForce("tip", 0.1)), 12.0)
    return orbit, -orbit.history(4000).displacement["tip"].min()


def test_a_landing_converges_with_the_modes(strip):
    """Slowly on a rigid bed, whose points bounce with every mode; fast on one that gives way."""
    limit = lowest(strip, 16, math.inf)[1]
    off = [abs(lowest(strip, modes, math.inf)[1] / limit - 1.0) for modes in (4, 8)]
    assert max(off) < 1e-2
    limit = lowest(strip, 12, 3e5)[1]
    off = [abs(lowest(strip, modes, 3e5)[1] / limit - 1.0) for modes in (3, 6)]
    assert off[0] < 1e-3 and off[1] < off[0] / 10.0


def test_the_mean_of_all_forces_is_balanced_by_the_clamped_end(strip):
    """Over a period of a linear structure the mean deflection is that under the mean forces."""
    orbit = lowest(strip, 4, math.inf)[0]
    component, names, _ = strip
    seen = orbit.history(20000)
    weights = np.full(20001, 1.0)
    weights[[0, -1]] = 0.5
    mean = weights @ seen.force / weights.sum()
    C = np.array([component.interfaces[name] for name in names])
    tip = component.interfaces["tip"]
    moved = -tip @ np.linalg.solve(component.stiffness.toarray(), C.T @ mean)
    assert weights @ seen.displacement["tip"] / weights.sum() == pytest.approx(moved, rel=1e-4)
    assert mean.sum() > 0.0 and orbit.areas[0].touched > 0.5


def test_rigid_areas_with_mass_and_a_stiffness_in_series_are_refused(strip):
    component, names, _ = strip
    stops = contact_area("bed", names, math.inf)
    with pytest.raises(SystemModelError, match="'bed' is rigid, but its points have mass"):
        System.from_reduced(cms.reduce(component, modes=8), stops=stops)
    with pytest.raises(SystemModelError, match="rigid contact has no exponent"):
        contact_area("bed", names, math.inf, exponent=1.5)
    with pytest.raises(SystemModelError, match="dashpot, pulls"):
        contact_area("bed", names, math.inf, pulls=False)
    system = landing(strip, 4, 1e4)
    with pytest.raises(SystemModelError, match="in series with what gives way at once"):
        check_exact(system, Parameter("area_stiffness"))
