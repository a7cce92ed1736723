"""Sweeps of a scene: what motions settle on over the range of its continuation."""

from __future__ import annotations

from collections.abc import Callable

from nldyn.base.errors import SystemModelError
from nldyn.longterm.poincare import BruteForce, brute_force
from nldyn.runtime.executors import own_processes
from nldyn.scene.build import build_flow
from nldyn.scene.faults import told_as
from nldyn.scene.followed import axis_of
from nldyn.scene.schema.scene import Scene


def sweep_of(
    scene: Scene,
    *,
    points: int = 100,
    starts: int = 0,
    progress: Callable[[int, int], None] | None = None,
    jobs: int = 1,
) -> BruteForce:
    """What motions of a scene settle on, up and down the range of its continuation.

    Parameters
    ----------
    scene : Scene
        With a continuation, in the frequency or another parameter.
    points, starts, progress
        As for `nldyn.longterm.brute_force`.
    jobs : int
        Processes that share the work.

    Raises
    ------
    SceneError
        As `build_system`, and for what `nldyn.longterm.brute_force` refuses.

    Examples
    --------
    >>> from nldyn.base.resources import example
    >>> from nldyn.scene.read import load_scene
    >>> sweep_of(load_scene(example("over_the_gap.toml")), points=2)
    <BruteForce over gap: 4 motions at 2 values, periodic: 4>
    """
    flow = build_flow(scene)
    axis = axis_of(scene, flow.system)
    with told_as(scene, (), SystemModelError), own_processes(jobs) as executor:
        return brute_force(
            flow, axis.limits, parameter=axis.parameter, frequency_hz=axis.frequency_hz,
            points=points, starts=starts, executor=executor, progress=progress,
        )  # fmt: skip
