"""Every change of stability between two neighbouring points of a branch has a special point."""

from itertools import pairwise

import numpy as np
import pytest

from nldyn import Branch, HarmonicForce, Stop, System, continue_branch, solve_orbit
from nldyn.bifurcations.normal_forms import switch_at_branch_point
from nldyn.bifurcations.period_doubling import switch_at_flip
from nldyn.orbits.critical_functions import number_outside

BESIDE = 1e-5  # of a multiplier to the unit circle: either side of it


def random_system(seed: int, modes: int, exponent: float) -> System:
    """One or two stops with a gap, touching, or preloaded, at random places; all at random."""
    r = np.random.default_rng(seed)
    hz = np.sort(r.uniform(5.0, 30.0, modes))
    damping = 10.0 ** r.uniform(-2.7, -1.3, modes)
    places = {name: r.normal(size=modes).tolist() for name in "ab"}
    soft = (2.0 * np.pi * hz[0]) ** 2

    def stop(name: str, direction: int) -> Stop:
        stiffness = soft * 10.0 ** r.uniform(0.5, 3.0)
        if exponent > 1.0:
            stiffness *= 30.0
        gap = float(r.choice([1.0, 1.0, 0.0, -0.3]) * 1e-3 * r.uniform(0.3, 1.0))
        return Stop(name, float(stiffness), exponent, gap, direction=direction)

    stops = [stop("a", 1)] + ([stop("b", -1)] if r.integers(2) else [])
    force = HarmonicForce("b", float(10.0 ** r.uniform(-0.5, 1.0)))
    return System.from_modal(
        hz.tolist(), places, modal_damping=damping.tolist(), stops=stops, excitation=[force]
    )


def unexplained(branch: Branch) -> list[tuple[float, float]]:
    """Neighbouring points with other numbers of multipliers outside, and no point between.

    Where a branch joins the one that it comes from, a multiplier is 1 but for the frequency's
    interpolation.
    """
    joined = [
        end
        for end, why in zip((branch.nodes[0], branch.nodes[-1]), branch.stop_reasons, strict=True)
        if why.startswith("joins")
    ]
    places = [s.point.arclength for s in branch.special_points]
    found = []
    for a, b in pairwise(branch.nodes):
        fewest, most = zip(
            *(number_outside(p.orbit.multipliers, BESIDE) for p in (a, b)), strict=True
        )
        slack = 1e-3 * (b.arclength - a.arclength) + 1e-12
        between = any(a.arclength - slack <= s <= b.arclength + slack for s in places)
        if max(fewest) > min(most) and not between and not any(e in (a, b) for e in joined):
            found.append((a.orbit.frequency_hz, b.orbit.frequency_hz))
    return found


def family(system: System, most: int) -> list[Branch]:
    """The harmonic branch and those that begin at its first flips and branch points."""
    hz = float(system.natural_frequencies[0]) / (2.0 * np.pi)
    span = (0.4 * hz, 2.2 * hz)
    branches = [continue_branch(solve_orbit(system, 1.9 * hz), span)]
    for special in [s for s in branches[0].special_points if s.kind in ("PD", "BP")][:most]:
        if special.kind == "PD":
            starts = [switch_at_flip(special)]
        else:
            starts = list(switch_at_branch_point(special))
        branches += [continue_branch(start.orbit, span) for start in starts]
    return branches


CASES = [(modes, p, seed) for modes in (1, 2) for p in (1.0, 1.5) for seed in range(5)]
QUICK = [(1, 1.5, 0, 3), (2, 1.0, 0, 1)]


@pytest.mark.parametrize(
    ("modes", "exponent", "seed", "most"),
    [*QUICK, *(pytest.param(*case, 3, marks=pytest.mark.slow) for case in CASES)],
)
def test_changes_of_stability_have_special_points(modes, exponent, seed, most):
    for branch in family(random_system(seed, modes, exponent), most):
        assert branch.notes == ()
        assert unexplained(branch) == []
        assert not any(why.startswith("step below") for why in branch.stop_reasons)
