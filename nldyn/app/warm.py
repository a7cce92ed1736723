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
from nldyn.system.loads import Unbalance
from nldyn.system.stop import Stop
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
    system = System.from_modal(  # with pairs of multipliers, which one coordinate does not have
        [13.118, 125.3],
        {"middle": [0.634, 0.681]},
        modal_damping=0.0142,
        stops=[Stop("middle", stiffness=5.17e9)],
        excitation=[Unbalance("middle", 4.92e-6)],
    )
    branch = continue_branch(solve_orbit(system, frequency_hz=30.0), (29.5, 30.5))
    for orbit in branch.points:
        _ = orbit.max_abs_displacement, orbit.liouville_error
    simulate(system, frequency_hz=30.0, periods=2)
    lyapunov_exponents(system, frequency_hz=30.0, periods=32)
    cache = getattr(newton, "_cache", None)
    return Warmth(compilations.seconds() - before, Path(getattr(cache, "cache_path", "")))
