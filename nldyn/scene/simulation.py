"""Simulations of a scene: at one frequency, and run-ups and run-downs."""

from __future__ import annotations

from dataclasses import dataclass

from nldyn.base.arrays import Real
from nldyn.base.errors import SystemModelError
from nldyn.longterm.initial_states import state_with
from nldyn.longterm.lyapunov import LyapunovSpectrum, lyapunov_exponents
from nldyn.longterm.simulation import Counted, Motion, simulate, sweep
from nldyn.scene.build import build_flow
from nldyn.scene.faults import told_as
from nldyn.scene.schema.scene import Scene
from nldyn.system.system import System


@dataclass(frozen=True)
class Simulation:
    """What `simulation_of` simulated.

    Parameters
    ----------
    motion : Motion
        The recorded motion.
    spectrum : LyapunovSpectrum or None
        Lyapunov exponents of the motion that its end leads to, if they were wanted.
    """

    motion: Motion
    spectrum: LyapunovSpectrum | None = None


def start_of(scene: Scene, system: System) -> Real | None:
    """The modal state (2n,) at which simulations of a scene begin, if it says one."""
    with told_as(scene, ("start",), SystemModelError):
        return None if scene.start is None else state_with(system, **scene.start.model_dump())


def simulation_of(
    scene: Scene,
    frequency_hz: float,
    *,
    periods: int = 100,
    transient: int = 0,
    exponents: bool = False,
    to_hz: float | None = None,
    rate_hz_per_s: float = 0.0,
    progress: Counted | None = None,
) -> Simulation:
    """Simulate a scene from its ``[start]``, at one frequency or through a range.

    Parameters
    ----------
    scene : Scene
        It needs no continuation, whose `rtol` counts if there is one; its forces may have
        frequencies of their own.
    frequency_hz : float
        Excitation frequency in Hz, at which a run-up or run-down begins.
    periods : int
        Excitation periods to record at this frequency.
    transient : int
        Periods before the recording, or before the run-up.
    exponents : bool
        Whether to compute the Lyapunov exponents at this frequency, too, from the end of the
        simulated motion on, see `nldyn.longterm.lyapunov_exponents`.
    to_hz : float, optional
        Frequency in Hz at which a run-up or run-down ends, in place of `periods`.
    rate_hz_per_s : float
        Its rate in Hz/s, positive either way.
    progress : callable, optional
        Called as ``progress(done, total)`` with the excitation periods, or the steps of a run-up.

    Raises
    ------
    SceneError
        As `build_system`, and for what `simulate` and `sweep` refuse.
    ConvergenceError
        As `simulate`.

    Examples
    --------
    >>> from nldyn.base.resources import example
    >>> from nldyn.scene.read import load_scene
    >>> simulation_of(load_scene(example("one_dof.toml")), 20.0, periods=200).motion
    <Motion of 10 s>
    """
    flow = build_flow(scene)
    start = start_of(scene, flow.system)
    with told_as(scene, (), SystemModelError):
        if to_hz is None:
            motion = simulate(
                flow, frequency_hz, periods, start=start, transient=transient, progress=progress
            )
        else:
            if transient:
                start = simulate(flow, frequency_hz, transient, start=start).end
            ends = frequency_hz, to_hz
            motion = sweep(flow, ends, rate_hz_per_s, start=start, progress=progress)
        if not exponents:
            return Simulation(motion)
        return Simulation(motion, lyapunov_exponents(flow, frequency_hz, start=motion.end))
