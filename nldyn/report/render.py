"""Pictures of a scene's structure: its modes, its deepest contact, and one period in motion."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from fem.render.gl import missing_library
from nldyn.base.errors import ConvergenceError, SceneError, SystemModelError
from nldyn.plot.diagram import orbit_title
from nldyn.report.again import drawn_of
from nldyn.report.modes import check_modes, mode_table
from nldyn.report.orbit_content import shown_phases
from nldyn.report.results import write_table
from nldyn.report.stop_spheres import stop_sphere, stops_to_draw, with_stops_not_drawn
from nldyn.runtime.progress import Progress, Shares, silent
from nldyn.runtime.result_directory import result_directory
from nldyn.scene.build import Structure, build_structure, build_system
from nldyn.scene.checks import check_computable
from nldyn.scene.faults import told_as
from nldyn.scene.messages import scene_error
from nldyn.scene.simulation import start_of

if TYPE_CHECKING:
    import cms
    from fem.render.pictures import AnyComponent
    from nldyn.orbits.orbit import Impact, Orbit
    from nldyn.report.comparison import Comparison
    from nldyn.runtime.progress import Progress
    from nldyn.scene.schema.scene import Scene
    from nldyn.system.system import System

FRAMES = 60
WINDOW = (1280, 720)  # in pixels, of modes on a screen


@dataclass(frozen=True)
class Rendering:
    """What `render_scene` made.

    Parameters
    ----------
    directory : Path
        Where the files are.
    orbit : Orbit or None
        The orbit drawn; none if the scene has no ``[continuation]``.
    missing : str
        Empty, or what to install to get the pictures that could not be made.
    """

    directory: Path
    orbit: Orbit | None
    missing: str = ""


def render_scene(
    scene: Scene,
    directory: str | Path,
    *,
    frequency_hz: float | None = None,
    period: int = 1,
    video: str = "gif",
    modes: Sequence[int] = (),
    view: str = "motion",
    progress: Progress | None = None,
    jobs: int = 1,
) -> Rendering:
    """Draw the mode shapes, the deepest contact and the motion of what is of a mesh in a scene.

    Parameters
    ----------
    scene : Scene
        A scene with a ``[mesh]``, or a component with one. Without a ``[continuation]`` only its
        modes are drawn.
    directory : str or Path
        Gets ``modes.csv`` and ``mode_shapes.png``, and for the orbit ``orbit.png``,
        ``orbit.svg``, ``deepest_contact.png``, ``deepest_contact_stress.png`` and ``motion.gif``
        or ``.mp4``; also ``mode_shapes.html`` and ``deepest_contact.html``, to be turned in a
        browser. All of them or nothing.
    frequency_hz : float, optional
        Excitation frequency of the orbit in Hz; unless given, where the stable harmonic orbits
        have their largest displacement.
    period : int
        Period of the orbit in periods of the excitation, if a frequency is given.
    video : {"gif", "mp4"}
        Kind of animation.
    modes : sequence of int
        Modes to draw, from 1; all unless given.
    view : str
        From where the pictures are taken: one of `fem.render.VIEWS`, or "motion", from where what
        moves is seen best.
    progress : callable, optional
        Called as ``progress(what, frequency_hz, done)``; the frequency is 0 where none applies.
    jobs : int
        Processes that share the search for the orbit.

    Returns
    -------
    Rendering
        Without a graphics library, what needs none is written, and `missing` says what to
        install.

    Raises
    ------
    SceneError
        If the scene has no mesh, or there is no such orbit.
    OutputError
        If the directory cannot be written.
    fem.render.RenderError
        If the animation is to be an .mp4 and imageio-ffmpeg is not installed; before any work.

    Examples
    --------
    >>> import tempfile
    >>> from nldyn.base.resources import example
    >>> from nldyn.scene.read import load_scene
    >>> scene = load_scene(example("two_dof_xi_0.01.toml"))
    >>> made = render_scene(scene, tempfile.mkdtemp(), frequency_hz=23.0)   # doctest: +SKIP
    """
    from fem.render.pictures import check_video

    if not any(each.mesh for each in (scene, *scene.components.values())):
        raise scene_error(scene.file, ("mesh",), "is missing: only a mesh can be drawn")
    if scene.continuation is not None or frequency_hz is not None:
        check_computable(scene, scene.file)
    if scene.continuation is not None:
        check_video(Path(directory) / f"motion.{video}")
    shares = Shares(progress or silent, {"model": 1.0, "orbit": 5.0, "pictures": 10.0})
    shares.part("model")("model", 0.0, 0.0)
    structure = build_structure(scene)
    shares.end("model")
    table = mode_table(scene, structure)
    check_modes(scene, modes, len(table.frequencies_hz))
    orbit = None
    if scene.continuation is not None:
        tell = shares.part("orbit")
        system = build_system(scene, structure.reduced)
        orbit = orbit_to_draw(scene, system, frequency_hz, period, tell, jobs)
    shares.end("orbit")
    with result_directory(directory, "render") as folder:
        write_table(folder / "modes.csv", table.columns(), table.rows())
        (folder / "scene.toml").write_text(scene.text, encoding="utf-8")
        if orbit is not None:
            save_orbit(orbit, folder, scene.direction_at(orbit.observe))
        tell = shares.part("pictures")
        drawing = Drawing.of(scene, structure, folder, modes, view, tell)
        assert drawing is not None  # there is a mesh
        if missing := missing_library():
            return Rendering(Path(directory), orbit, missing)
        drawing.pages(orbit)
        pictures = drawing.deepest_contact, partial(drawing.motion, video=video)
        missing = drawing.draw(*(partial(each, orbit) for each in pictures if orbit is not None))
    return Rendering(Path(directory), orbit, missing)


def orbit_to_draw(
    scene: Scene,
    system: System,
    frequency_hz: float | None,
    period: int = 1,
    progress: Progress | None = None,
    jobs: int = 1,
) -> Orbit:
    """Find the orbit to draw: at a frequency, or where the stable harmonic orbits are largest.

    Where none is stable, the largest of all; where nothing excites the structure, the limit cycle.
    """
    from nldyn.orbits.limit_cycle import limit_cycle
    from nldyn.orbits.solve import solve_orbit
    from nldyn.search.diagram import diagram

    assert scene.continuation is not None
    if scene.self_excited and frequency_hz is None:
        with told_as(scene, (), SystemModelError, ConvergenceError):
            return limit_cycle(system, start_of(scene, system))
    frequency_hz = frequency_hz or scene.continuation.frequency_hz
    if frequency_hz is not None:
        try:
            return solve_orbit(system, frequency_hz=frequency_hz, period=period)
        except ConvergenceError as error:
            raise SceneError(f"{scene.file}: {error}") from error
    low, high = scene.continuation.limits
    found = diagram(system, (low, high), [1], search_points=4, progress=progress, jobs=jobs)
    orbits = [orbit for branch in found.branches for orbit in branch.points]
    if not orbits:
        raise SceneError(f"{scene.file}: no harmonic orbit is found from {low:g} to {high:g} Hz")
    return max(orbits, key=lambda orbit: (orbit.stable, orbit.max_abs_displacement))


def deepest_impact(scene: Scene, orbit: Orbit) -> Impact | None:
    """Give the deepest contact of an orbit, or of rigid stops the hardest, if it touches one.

    Stops that can be drawn come first: the others are penetrated by angles, not by lengths.
    """
    drawable = [hit for hit in orbit.impact_list if stop_sphere(scene, hit.stop) is not None]
    hits = drawable or orbit.impact_list
    return max(hits, key=lambda hit: (hit.penetration, hit.impulse or 0.0), default=None)


def deepest_phase(orbit: Orbit, impact: Impact | None) -> float:
    """Phase at a contact's deepest instant, or without one at the largest extreme."""
    if impact is not None:
        return float(orbit.omega * impact.time)
    extremes = orbit.observed_extremes
    return float(extremes.phases[np.argmax(np.abs(extremes.values))])


def deepest_state(orbit: Orbit, impact: Impact | None) -> NDArray[np.float64]:
    """Modal displacements at a contact's deepest instant, or without one at the largest extreme."""
    return orbit.states(np.array([deepest_phase(orbit, impact)]))[0, : orbit.system.size]


def what_is_drawn(orbit: Orbit, impact: Impact | None) -> str:
    """The title of the picture of an orbit's deepest contact."""
    return f"{most_of(impact)} of the {orbit_title(orbit, digits=5)}"


def most_of(impact: Impact | None) -> str:
    """What an orbit is drawn at."""
    if impact is None:
        return "largest deflection"
    return "hardest impact" if impact.force is None else "deepest contact"


def render_modes_of(
    scene: Scene,
    structure: Structure,
    directory: str | Path,
    *,
    modes: Sequence[int] = (),
    view: str = "motion",
    against: Comparison | None = None,
    animated: bool = False,
) -> str:
    """Write ``modes.csv``, ``mode_shapes.png`` and the page ``mode_shapes.html`` of a scene.

    With a comparison also ``mac.csv``, the map ``mac.png`` of it, and ``comparison.png``, which
    shows each mode beside the one of the other scene that is most like it; animated, a
    ``mode_1.gif`` and so on.

    Parameters
    ----------
    scene, structure
        A scene, and what `build_structure` gave for it; without a mesh only the table is written.
    directory : str or Path
        All of the files or none.
    modes : sequence of int
        Those to draw, from 1; all unless given.
    view : str
        From where the picture is taken, as for `render_scene`.
    against : Comparison, optional
        What `compare_modes` gave for this scene and another.
    animated : bool
        Draw each mode in motion, too.

    Returns
    -------
    str
        Empty, or what to install for the picture.

    Raises
    ------
    SceneError
        If there is no such mode.
    OutputError
        If the directory cannot be written.
    """
    table = mode_table(scene, structure)
    check_modes(scene, modes, len(table.frequencies_hz))
    with result_directory(directory, "modes") as folder:
        write_table(folder / "modes.csv", table.columns(), table.rows())
        (folder / "scene.toml").write_text(scene.text, encoding="utf-8")
        if against is not None:
            write_table(folder / "mac.csv", against.columns(), against.rows())
            save_mac(against, folder)
        drawing = Drawing.of(scene, structure, folder, modes, view)
        if drawing is None or (missing := missing_library()):
            return "" if drawing is None else missing
        drawing.mode_page()
        pictures = [] if against is None else [partial(drawing.draw_comparison, against)]
        return drawing.draw(*pictures, *([drawing.draw_moving_modes] if animated else []))


def modes_in_window(
    scene: Scene, structure: Structure, modes: Sequence[int] = (), view: str = "motion"
) -> Any:
    """The modes of a scene as a pyvista plotter, which opens a window by its ``show()``.

    The parameters are those of `render_modes_of`.

    Raises
    ------
    SceneError
        If the scene has no mesh.
    """
    from fem.render import render_modes

    drawing = Drawing.of(scene, structure, Path(), modes, view)
    if drawing is None:
        raise SceneError(f"{scene.file}: only a mesh can be drawn")
    shapes = drawing.reduced.basis[:, drawing.chosen]
    return render_modes(
        drawing.component, shapes, drawing.mode_titles, mirror=_mirror(scene), view=view,
        size=WINDOW,
    )  # fmt: skip


def save_mac(against: Comparison, folder: Path) -> None:
    """Draw how much alike all modes of two scenes are, as ``mac.png`` and ``.svg``."""
    from nldyn.plot.diagram import save_figure
    from nldyn.plot.mac import plot_mac

    hz, other_hz = against.frequencies_hz, against.other_hz
    ax = plot_mac(against.mac, frequencies_hz=hz, other_hz=other_hz)
    ax.set_xlabel(f"mode of {against.scene.file.name}")
    save_figure(ax, folder / "mac")


def save_orbit(orbit: Orbit, folder: Path, direction: str = "") -> None:
    """Draw displacement and contact force over time, as ``orbit.png`` and ``orbit.svg``."""
    from nldyn.plot.diagram import plot_orbit, save_figure

    save_figure(plot_orbit(orbit, direction=direction)[0], folder / "orbit")


@dataclass(frozen=True)
class Drawing:
    """The pages for a browser, and the pictures, which need a graphics library."""

    scene: Scene
    component: AnyComponent
    reduced: cms.ReducedModel
    folder: Path
    tell: Progress
    modes: tuple[int, ...] = ()
    view: str = "motion"

    @classmethod
    def of(
        cls,
        scene: Scene,
        structure: Structure,
        folder: Path,
        modes: Sequence[int],
        view: str,
        tell: Progress = silent,
    ) -> Drawing | None:
        """Of what of a structure is of a mesh, if anything is."""
        drawn = drawn_of(scene, structure)
        if drawn is None:
            return None
        return cls(scene, drawn.component, drawn.reduced, folder, tell, tuple(modes), view)

    def draw(self, *pictures: Callable[[], None]) -> str:
        """Draw the modes and more; say what to install if something is missing for it."""
        from fem.render import RenderError, gl_available

        available, advice = gl_available()
        if not available:
            return advice
        try:
            for picture in (self.draw_modes, *pictures):
                picture()
        except RenderError as error:
            return str(error)
        return ""

    @property
    def mode_titles(self) -> list[str]:
        """What each mode of the reduced model is called."""
        kept = self.reduced.size - self.reduced.residual_modes
        return [
            f"{'mode' if number < kept else 'residual mode'} {number + 1}: {hz:.1f} Hz"
            for number, hz in enumerate(self.reduced.frequencies_hz)
            if number in self.chosen
        ]

    def mode_page(self) -> None:
        """Write the modes as a page for a browser."""
        from fem.render import write_page

        write_page(
            self.component,
            self.reduced.basis[:, self.chosen],
            self.mode_titles,
            self.folder / "mode_shapes.html",
            heading=with_stops_not_drawn(self.scene.title or "Mode shapes", self.scene),
            mirror=_mirror(self.scene),
            stops=stops_to_draw(self.scene),
        )

    def pages(self, orbit: Orbit | None) -> None:
        """Write the modes, and the orbit at its deepest contact, as pages for a browser."""
        from fem.render import write_motion

        self.mode_page()
        if orbit is None:
            return
        impact = deepest_impact(self.scene, orbit)
        deepest = deepest_phase(orbit, impact)
        phases = shown_phases(orbit, FRAMES, deepest)
        states = orbit.states(phases)[:, : orbit.system.size]
        write_motion(
            self.component,
            self.reduced.expand(states.T).T,
            self.folder / "deepest_contact.html",
            times=phases / orbit.omega,
            period=orbit.duration,
            first=deepest / orbit.omega,
            title=with_stops_not_drawn(
                f"{orbit_title(orbit, digits=5)}, opened at its {most_of(impact)}", self.scene
            ),
            heading=self.scene.title or "Deepest contact",
            mirror=_mirror(self.scene),
            colour="stress",
            stops=stops_to_draw(self.scene),
        )

    @property
    def chosen(self) -> list[int]:
        """Indices of the modes to draw."""
        return [mode - 1 for mode in self.modes] or list(range(self.reduced.size))

    def draw_modes(self) -> None:
        """Draw a sheet with the modes of the reduced model."""
        from fem.render import render_modes

        self.tell("mode shapes", 0.0, 0.1)
        path = self.folder / "mode_shapes.png"
        render_modes(
            self.component,
            self.reduced.basis[:, self.chosen],
            self.mode_titles,
            path,
            mirror=_mirror(self.scene),
            stops=stops_to_draw(self.scene),
            view=self.view,
        )

    def draw_comparison(self, against: Comparison) -> None:
        """Draw the modes, and beside each the other's mode that is most like it."""
        import imageio.v3 as iio

        from fem.render import render_modes
        from fem.render.pictures import write_image

        other: Any = against.structure
        partners = [against.partners[number] for number in self.chosen]
        titles = [
            f"mode {partner + 1}: {against.other_hz[partner]:.1f} Hz, "
            f"MAC {against.mac[number, partner]:.3f}"
            for number, partner in zip(self.chosen, partners, strict=True)
        ]
        path = self.folder / "comparison.png"
        render_modes(
            other.component,
            (other.reduced.basis @ against.turn)[:, partners] * against.signs[self.chosen],
            titles,
            path,
            mirror=_mirror(against.scene),
            view=self.view,
        )
        left, right = iio.imread(self.folder / "mode_shapes.png"), iio.imread(path)
        write_image(path, np.concatenate([left, right], axis=1))

    def draw_moving_modes(self) -> None:
        """Animate one period of each mode, with 24 pictures."""
        from fem.render import animate

        turns = np.arange(24) / 24
        for number, title in zip(self.chosen, self.mode_titles, strict=True):
            hz = self.reduced.frequencies_hz[number]
            animate(
                self.component,
                np.outer(np.cos(2.0 * np.pi * turns), self.reduced.basis[:, number]),
                self.folder / f"mode_{number + 1}.gif",
                times=turns / hz if hz > 0.0 else turns,
                title=f"{title}, at a modal mass of 1 kg",
                mirror=_mirror(self.scene),
                view=self.view,
                fps=12.0,
                size=(760, 420),
            )

    def deepest_contact(self, orbit: Orbit) -> None:
        """Draw the structure at the instant of deepest contact: displacement, then stress."""
        from fem.render import render_shape

        self.tell("deepest contact", 0.0, 0.3)
        impact = deepest_impact(self.scene, orbit)
        state = self.reduced.expand(deepest_state(orbit, impact))
        stops = stops_to_draw(self.scene)
        for name, colour in (("contact", "displacement"), ("contact_stress", "stress")):
            render_shape(
                self.component,
                state,
                self.folder / f"deepest_{name}.png",
                title=with_stops_not_drawn(what_is_drawn(orbit, impact), self.scene),
                stops=stops,
                mirror=_mirror(self.scene),
                colour=colour,
                view=self.view,
            )

    def motion(self, orbit: Orbit, video: str) -> None:
        """Animate one period of the orbit."""
        from fem.render import animate

        self.tell("animation", 0.0, 0.5)
        history = orbit.history(FRAMES)
        animate(
            self.component,
            self.reduced.expand(history.modal[:-1].T).T,
            self.folder / f"motion.{video}",
            times=history.time[:-1],
            title=with_stops_not_drawn(
                f"one period of the {orbit_title(orbit, digits=5)}", self.scene
            ),
            stops=stops_to_draw(self.scene),
            mirror=_mirror(self.scene),
            view=self.view,
        )


def _mirror(scene: Scene) -> str | None:
    return scene.mesh.mirror if scene.mesh is not None else None
