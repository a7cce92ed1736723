"""All kernels compiled beforehand, by a small computation that needs them."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from nldyn.branches.continuation import continue_branch
from nldyn.flow.kernels.newton import newton
from nldyn.longterm.lyapunov import lyapunov_exponents
from nldyn.longterm.simulation import simulate
from nldyn.orbits.solve import solve_orbit
from nldyn.runtime.compilation import compilations
from nldyn.system.elements import Stop, Unbalance
from nldyn.system.system import System


@dataclass(frozen=True)
class Warmth:
    """What `warm` did.

    Parameters
    ----------
    seconds : float
        Time spent compiling; zero where all was compiled already.
    folder : Path
        Where the code is kept.
    """

    seconds: float
    folder: Path


def warm() -> Warmth:
    """Compile the kernels that orbits, branches, special points and simulations need."""
    before = compilations.seconds()
    system = System.from_matrices(
        [[2.48]],
        [[16877.0]],
        {"middle": [1.0]},
        modal_damping=0.0142,
        stops=[Stop("middle", stiffness=5.17e9)],
        excitation=[Unbalance("middle", 4.92e-6)],
    )
    branch = continue_branch(solve_orbit(system, frequency_hz=33.5), (33.5, 33.8))
    for orbit in branch.points:
        _ = orbit.max_abs_displacement, orbit.liouville_error
    simulate(system, frequency_hz=33.5, periods=2)
    lyapunov_exponents(system, frequency_hz=33.5, periods=32)
    cache = getattr(newton, "_cache", None)
    return Warmth(compilations.seconds() - before, Path(getattr(cache, "cache_path", "")))
