"""The command line: ``nldyn new``, ``run``, ``report``, ``check`` and others; see ``--help``.

Exit codes: 0 done, 2 something in the scene or on the command line is wrong, 3 a picture or an
animation needs something that is not installed, 130 stopped with Ctrl-C.
"""

from __future__ import annotations

import sys
import time
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import click

from nldyn.app.describe import (
    describe,
    describe_rest,
    describe_self_excited,
    describe_system,
    described_as_json,
    echo_parts,
    json_text,
    special_counts,
)
from nldyn.app.options import (
    any_path,
    count_option,
    drawn_modes_option,
    frequency_option,
    jobs_option,
    json_option,
    mesh_option,
    number_list,
    plane_state,
    quiet_option,
    replace_option,
    scene_argument,
    view_option,
)
from nldyn.app.writing import Told, Work, check_results, writes_results, written_by
from nldyn.base.exit_codes import BAD_INPUT, INTERRUPTED, NO_GRAPHICS, NOTHING_FOUND
from nldyn.report.console import plain_errors
from nldyn.runtime.interruption import STOPPED, interrupted

UNCUT = 10_000  # letters of a summary

if TYPE_CHECKING:
    from nldyn.longterm.basins import PlaneState
    from nldyn.scene.build import Structure
    from nldyn.scene.schema.scene import Scene


def print_version(context: click.Context, _: click.Parameter, wanted: bool) -> None:
    """Print the version and stop, if wanted."""
    if wanted:
        from nldyn.base.version import software_version

        click.echo(f"nldyn {software_version()}")
        context.exit()


class PlainGroup(click.Group):
    """Commands that tell a fault on their command line in one sentence, without their usage."""

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """List the commands with the first sentence of each, uncut."""
        rows = [(name, each.get_short_help_str(UNCUT)) for name, each in self.commands.items()]
        with formatter.section("Commands"):
            formatter.write_dl(sorted(rows))

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Read the options that stand before the command."""
        # without any argument the help is shown
        with plain_interrupt(), plain_usage(click.NoSuchOption):
            return super().parse_args(ctx, args)

    def invoke(self, ctx: click.Context) -> object:
        """Run the command that is asked for."""
        with plain_interrupt(), plain_usage(click.UsageError), plain_warnings():
            return super().invoke(ctx)


@contextmanager
def plain_usage(kind: type[click.UsageError]) -> Iterator[None]:
    """Tell a fault of the command line in one line on stderr, and exit."""
    try:
        yield
    except kind as error:
        fault = error.format_message().rstrip(".")
        click.echo(f"nldyn: {fault[:1].lower()}{fault[1:]}", err=True)
        sys.exit(BAD_INPUT)


@contextmanager
def plain_interrupt() -> Iterator[None]:
    """Tell Ctrl-C in one line on stderr, and exit; other errors may wrap it."""
    try:
        yield
    except (KeyboardInterrupt, Exception) as error:
        if not interrupted(error):
            raise
        click.echo(STOPPED, err=True)
        sys.exit(INTERRUPTED)


@contextmanager
def plain_warnings() -> Iterator[None]:
    """Tell warnings in one line on stderr, without the place in the program."""

    def show(message: Warning | str, *_: object, **__: object) -> None:
        click.echo(f"nldyn: warning: {message}", err=True)

    with warnings.catch_warnings():
        warnings.showwarning = show
        yield


@click.group(cls=PlainGroup, context_settings={"help_option_names": ["-h", "--help"]})
@click.option(
    "--version",
    is_flag=True,
    expose_value=False,
    is_eager=True,
    callback=print_version,
    help="Show the version and exit.",
)
def main() -> None:
    """Bifurcation diagrams of structures that hit a stop, from meshes, matrices or modal data."""


@main.command()
@writes_results(kept=True)
@click.option("--log", is_flag=True, help="Draw the displacement on a logarithmic axis.")
@json_option
@jobs_option
def run(work: Work, log: bool, as_json: bool, jobs: int) -> Told:
    """Compute the branches of a scene, and write tables, a diagram and a report.

    The report is one page for a browser, report.html. What DIR holds of the same scene, finished,
    is not computed again.
    """
    from fem.render.gl import missing_library
    from nldyn.io.checkpoint import CheckpointFile
    from nldyn.report.again import computed_before, drawn_of, read_summary
    from nldyn.report.results import write_results
    from nldyn.scene.run import parts_of_work, results_of, structure_of
    from nldyn.search.exploration import Exploration

    scene, out = work.scene, work.out
    assert work.unfinished is not None
    parts = parts_of_work(scene, work.line)
    structure = structure_of(scene, parts.part("model"))
    parts.end("model")
    before = None if work.replace else computed_before(out, scene, structure)
    given = scene, parts.part("branches"), CheckpointFile(work.unfinished), jobs, structure
    found = before or work.found(lambda: results_of(*given))
    missing = ""
    if before is None or log:
        work.line("report", 0.0, 1.0)
        yscale: Literal["linear", "log"] = "log" if log else "linear"
        drawn = drawn_of(scene, structure)
        missing = missing_library() if drawn else ""
        write_results(found, out, scene, drawn=None if missing else drawn, yscale=yscale)
    seconds = time.perf_counter() - work.start
    coverage = found.coverage_lines() if isinstance(found, Exploration) else []
    diagram = found.diagram if isinstance(found, Exploration) else found
    told = read_summary(out)
    if as_json:
        said = {
            "scene": str(scene.file),
            "out": str(out),
            "report": str(out / "report.html"),
            "seconds": seconds,
            "special_points": special_counts(diagram),
            "coverage": coverage,
            **told,
        }
        lines = [json_text(said)]
    else:
        lines = [*told.get("answer", []), *coverage, describe(diagram, seconds, out)]
        if before is not None:
            lines.append("all of it was computed before; '--replace' computes it anew")
    if not diagram.branches:
        return Told(lines, "no periodic orbit was found; the tables are empty", NOTHING_FOUND)
    return Told(lines, missing, NO_GRAPHICS)


@main.command()
@click.argument("name", required=False, metavar="[EXAMPLE]")
@click.argument("directory", required=False, type=any_path, metavar="[DIR]")
def new(name: str | None, directory: Path | None) -> None:
    """Copy an example scene with its mesh to begin from; without a name, list them.

    DIR is made if it does not exist; by default it has the name of the example.
    """
    with plain_errors():
        from nldyn.base.resources import copy_example, example_titles

        if name is None:
            titles = example_titles()
            width = max(map(len, titles))
            click.echo("\n".join(f"{each:<{width}}  {title}" for each, title in titles.items()))
            return
        scene = copy_example(name, directory)
        click.echo(f"written to {scene.parent}; go on with")
        click.echo(f"nldyn run {scene} --out {scene.parent / 'results'}")


@main.command()
@click.argument("directory", type=any_path, metavar="DIR")
@click.option(
    "--scene",
    type=any_path,
    metavar="SCENE.toml",
    help="What was computed, by default the copy in DIR; its mesh shows the structure.",
)
@mesh_option
@quiet_option
def report(
    directory: Path, scene: Path | None, mesh_folders: tuple[Path, ...], quiet: bool
) -> None:
    """Write the report of results anew, also of a run that has not ended.

    DIR is what 'nldyn run --out' was given. The report is one page for a browser, report.html.
    """
    with plain_errors():
        from nldyn.report.again import report_again
        from nldyn.runtime.progress import progress_line
        from nldyn.runtime.result_directory import OutputError, says_something_else
        from nldyn.scene.read import load_scene

        loaded = None if scene is None else load_scene(scene, mesh_folders)
        if loaded is not None and says_something_else(directory, loaded.text, ("title", "mesh")):
            raise OutputError(f"{scene}: says something else than {directory / 'scene.toml'}")
        with progress_line(quiet) as line:
            notes = report_again(directory, loaded, mesh_folders, line)
        for note in notes:
            click.echo(f"note: {note}")
        click.echo(f"written to {directory / 'report.html'}")


@main.command()
@scene_argument
@mesh_option
@json_option
def check(scene: Path, mesh_folders: tuple[Path, ...], as_json: bool) -> None:
    """Check a scene, and print the modes of its structure.

    Tells what was read of the mesh, the static flexibility of each interface, and the stops. It
    computes nothing and takes a second or two.
    """
    with plain_errors():
        from nldyn.base.errors import SystemModelError
        from nldyn.runtime.progress import messages_shown
        from nldyn.scene.build import build_structure, build_system
        from nldyn.scene.checks import (
            check_computable,
            check_held_to_follow,
            only_simulated,
            remarks,
        )
        from nldyn.scene.faults import told_as
        from nldyn.scene.followed import axis_of
        from nldyn.scene.read import load_scene

        loaded = load_scene(scene, mesh_folders)
        with messages_shown():
            structure = build_structure(loaded, chosen=False)
            component, reduced = structure.component, structure.reduced
            parts = structure.parts if component is None else {"": component}
            system = build_system(loaded, reduced)
            with told_as(loaded, (), SystemModelError):
                at_rest = describe_rest(system)

        def check_run() -> None:
            if not only_simulated(loaded):
                check_computable(loaded, scene)
                check_held_to_follow(loaded, system)
                if loaded.continuation is not None and loaded.continuation.parameter:
                    axis_of(loaded, system)

        if as_json:
            from nldyn.report.modes import mode_table

            check_run()
            table = mode_table(loaded, structure)
            count = sum(part.mass.shape[0] for part in parts.values()) or None
            click.echo(json_text({
                "scene": str(scene),
                "title": loaded.title,
                "degrees_of_freedom": count,
                "mass_kg": table.mass,
                "modes": table.as_json(),
                **described_as_json(system),
                "self_excited": loaded.self_excited,
                "at_rest": at_rest,
                "notes": remarks(loaded, system),
            }))  # fmt: skip
            return
        echo_parts(parts)
        described = describe_system(system, 0 if reduced is None else reduced.residual_modes)
        click.echo("\n".join([described, *at_rest, *describe_self_excited(loaded)]))
        check_run()
        if structure.candidates is not None and loaded.reduction is not None:
            click.echo(
                f"modes up to {structure.candidates.cutoff_hz:.4g} Hz may matter; of these, "
                f"'nldyn run' keeps as many as tolerance = {loaded.reduction.tolerance:g} needs"
            )
        for remark in remarks(loaded, system):
            click.echo(f"note: {remark}")
        use = " for 'nldyn simulate'" if only_simulated(loaded) else ""
        click.echo(f"{scene}: no fault found{use}")


@main.command()
@scene_argument
@click.option(
    "--out",
    type=any_path,
    metavar="DIR",
    help="Directory for the table, the picture and the page for a browser; else only a table.",
)
@mesh_option
@replace_option
@drawn_modes_option
@view_option
@click.option(
    "--against",
    type=any_path,
    metavar="SCENE.toml",
    help="Compare with the modes of another scene: another mesh, or more modes.",
)
@click.option("--animate", "animated", is_flag=True, help="Draw each mode as a GIF, too.")
@click.option("--open", "opened", is_flag=True, help="Open the page where there is a screen.")
@click.option(
    "--window/--no-window",
    default=None,
    help="Show the modes in a window that can be turned; by default at a terminal with a screen, "
    "without --out.",
)
@json_option
def modes(
    scene: Path,
    out: Path | None,
    mesh_folders: tuple[Path, ...],
    replace: bool,
    modes: list[int] | None,
    view: str,
    against: Path | None,
    animated: bool,
    opened: bool,
    window: bool | None,
    as_json: bool,
) -> None:
    """Tell and draw the modes of a scene: frequencies, effective masses, participation."""
    if opened and out is None:
        raise click.UsageError("'--open' needs '--out'")
    if animated and out is None:
        raise click.UsageError("'--animate' needs '--out'")
    with plain_errors():
        from nldyn.report.modes import check_modes, mode_table
        from nldyn.runtime.progress import messages_shown
        from nldyn.scene.build import build_structure
        from nldyn.scene.read import load_scene

        loaded = load_scene(scene, mesh_folders)
        other = None if against is None else load_scene(against, mesh_folders)
        if out is not None:
            check_results(out, loaded, replace)
        compared = None
        with messages_shown():
            structure = build_structure(loaded)
            if other is not None:
                from nldyn.report.comparison import compare_modes

                compared = compare_modes(loaded, structure, other, build_structure(other))
        table = mode_table(loaded, structure)
        check_modes(loaded, modes or (), len(table.frequencies_hz))
        missing = ""
        if out is not None:
            from nldyn.report.render import render_modes_of

            missing = render_modes_of(
                loaded, structure, out, modes=modes or (), view=view, against=compared,
                animated=animated,
            )  # fmt: skip
    if as_json:
        rows = [row for row in table.as_json() if not modes or row["mode"] in modes]
        told = {"scene": str(scene), "mass_kg": table.mass, "modes": rows}
        if compared is not None:
            told["against"] = [
                dict(zip(compared.columns(), row, strict=True)) for row in compared.rows()
            ]
        click.echo(json_text(told))
    else:
        click.echo(table.report(modes or ()))
        if compared is not None:
            click.echo(compared.report(tuple(modes or ())))
        if out is not None:
            click.echo(written_by(out, "modes"))
    if missing:
        click.echo(f"nldyn: {missing}", err=True)
        sys.exit(NO_GRAPHICS)
    if opened and out is not None:
        open_page(out / "mode_shapes.html")
    asked = sys.stdout.isatty() and out is None and not as_json and loaded.mesh is not None
    if window or (window is None and asked):
        show_window(loaded, structure, modes or [], view, wanted=bool(window))


def show_window(
    scene: Scene, structure: Structure, modes: list[int], view: str, *, wanted: bool
) -> None:
    """Show modes in a window until it is closed, or say where none can be opened, if wanted."""
    from fem.render.gl import has_screen
    from nldyn.report.render import modes_in_window

    if has_screen():
        with plain_errors():
            modes_in_window(scene, structure, modes, view).show()
    elif wanted:
        click.echo(
            "nldyn: no window can be opened here; '--out DIR' writes pictures and a page for a "
            "browser",
            err=True,
        )


def open_page(page: Path) -> None:
    """Open a page in the browser of the desktop, or say that there is none."""
    import webbrowser

    if not page.is_file():
        click.echo("nldyn: only a mesh can be drawn, so there is no page to open", err=True)
    elif not webbrowser.open(page.resolve().as_uri()):
        click.echo(
            f"nldyn: no browser can be opened here; {page} can be opened elsewhere", err=True
        )


@main.command()
@writes_results("backbone")
@count_option("--mode", 1, 100_000, 1, "Linear mode at which the family begins.", None)
@click.option(
    "--amplitude-m",
    type=click.FloatRange(1e-30, 1e30),
    required=True,
    metavar="M",
    help="Largest displacement in m at the observed interface, up to which it is followed.",
)
@click.option(
    "--forced",
    is_flag=True,
    help="Follow the phase resonance of the damped, forced structure beside it, too.",
)
def backbone(
    work: Work,
    mode: int,
    amplitude_m: float,
    forced: bool,
) -> Told:
    """Follow the free motions of a scene, without its damping and excitation, from a mode on.

    Writes backbone.csv and a picture of amplitude against frequency; with --forced also
    phase_resonance.csv, up to the strength of the scene's excitation.
    """
    from nldyn.report.backbone import write_backbone
    from nldyn.scene.backbone import backbone_of, phase_resonance_of

    found = backbone_of(work.scene, amplitude_m, mode)
    resonant = phase_resonance_of(work.scene, found) if forced else None
    title = work.scene.title
    write = partial(write_backbone, found, title=title, forced=resonant)
    return Told(_shown(found, resonant), write=write)


def one_frequency_or_run_up(
    to_hz: float | None, rate_hz_per_s: float | None, periods: int | None, exponents: bool, **_: Any
) -> None:
    """Refuse options of one frequency beside those of a run-up."""
    if (to_hz is None) != (rate_hz_per_s is None):
        raise click.UsageError("'--to-hz' and '--rate-hz-per-s' go together")
    if to_hz is not None and (periods is not None or exponents):
        raise click.UsageError("'--periods' and '--lyapunov' are for one frequency, not '--to-hz'")


@main.command()
@writes_results("simulation", check=one_frequency_or_run_up)
@frequency_option("Excitation frequency, at which a run-up begins.")
@count_option("--periods", 1, 100_000, None, "Excitation periods to record; 100 unless given.")
@count_option(
    "--transient", 0, 100_000_000, 0,
    "Excitation periods before the recording, or before the run-up.",
)  # fmt: skip
@click.option(
    "--to-hz",
    type=click.FloatRange(1e-6, 1e12),
    metavar="HZ",
    help="Run up or down to this frequency, instead of staying.",
)
@click.option(
    "--rate-hz-per-s",
    type=click.FloatRange(0.0, min_open=True),
    metavar="R",
    help="How fast it runs.",
)
@click.option(
    "--lyapunov", "exponents", is_flag=True, help="Tell the largest Lyapunov exponent, too."
)
def simulate(
    work: Work,
    frequency_hz: float,
    periods: int | None,
    transient: int,
    to_hz: float | None,
    rate_hz_per_s: float | None,
    exponents: bool,
) -> Told:
    """Simulate a scene in time from its [start], at one frequency or in a run-up or run-down.

    Writes motion.csv, the displacements and contact forces, impacts.csv, and a picture; of a
    run-up also peaks.csv. Forces may have frequencies of their own. Without a [start] the structure
    is undeformed and without speed at first.
    """
    from nldyn.longterm.impacts import impacts
    from nldyn.report.simulation import write_simulation
    from nldyn.scene.simulation import simulation_of

    scene = work.scene
    found = simulation_of(
        scene, frequency_hz, periods=periods or 100, transient=transient, exponents=exponents,
        to_hz=to_hz, rate_hz_per_s=rate_hz_per_s or 0.0,
        progress=work.line.counted("periods" if to_hz is None else "steps"),
    )  # fmt: skip
    hits = impacts(found.motion)
    along = scene.direction_at(found.motion.system.interfaces[0])
    write = partial(write_simulation, found.motion, hits, title=scene.title, direction=along)
    return Told(_shown(found.motion, hits, found.spectrum), write=write)


@main.command()
@writes_results("sweep")
@count_option(
    "--points", 2, 1_000_000, 100,
    "Values of what [continuation] changes, equally spaced over its range.",
)  # fmt: skip
@count_option(
    "--starts", 0, 1_000_000, 0,
    "Random initial states at each value, beside the attractor of the value before.",
)  # fmt: skip
@jobs_option
def sweep(work: Work, points: int, starts: int, jobs: int) -> Told:
    """Simulate what motions of a scene settle on, up and down the range of its [continuation].

    Over the frequency or another parameter, each time from the attractor of the value before.
    Writes sweep.csv, a motion each, and a picture.
    """
    from nldyn.report.sweep import write_sweep
    from nldyn.scene.sweep import sweep_of

    progress = work.line.counted("sweeps")
    found = sweep_of(work.scene, points=points, starts=starts, progress=progress, jobs=jobs)
    return Told(_shown(found), write=partial(write_sweep, found, title=work.scene.title))


def one_frequency_or_several_values(frequency_hz: float | None, over: int | None, **_: Any) -> None:
    """Refuse one frequency beside several values, and neither."""
    if (frequency_hz is None) == (over is None):
        raise click.UsageError("needs either '--frequency-hz' or '--over'")


@main.command()
@writes_results("basins", check=one_frequency_or_several_values)
@frequency_option("Excitation frequency.", required=False)
@count_option(
    "--over", 2, 10_000, None,
    "Instead: N values of what [continuation] changes, equally spaced over its range.",
)  # fmt: skip
@click.option(
    "--x",
    callback=plane_state,
    metavar="STATE:INTERFACE",
    help="What is on the horizontal axis, such as displacement:tip or velocity:tip; by default the "
    "displacement of the interface of the first stop, or of the first one.",
)
@click.option(
    "--y",
    callback=plane_state,
    metavar="STATE:INTERFACE",
    help="What is on the vertical axis; by default the velocity there.",
)
@click.option(
    "--x-range",
    nargs=2,
    type=float,
    metavar="MIN MAX",
    help="Its range in m or m/s; by default twice what the attractors do.",
)
@click.option("--y-range", nargs=2, type=float, metavar="MIN MAX", help="Likewise.")
@count_option("--cells", 2, 3000, 50, "Initial states along each axis.")
@count_option(
    "--longest", 64, 10_000_000, 2000,
    "Excitation periods after which a motion counts as undecided.",
)  # fmt: skip
@jobs_option
def basins(
    work: Work,
    frequency_hz: float | None,
    over: int | None,
    x: PlaneState | None,
    y: PlaneState | None,
    x_range: tuple[float, float] | None,
    y_range: tuple[float, float] | None,
    cells: int,
    longest: int,
    jobs: int,
) -> Told:
    """Find which initial states of a scene lead to which attractor, in a plane of two of them.

    All else begins undeformed, at forcing phase zero. Writes attractors.csv, with the share of
    each, basins.csv, each state with the number of its attractor (0 undecided, -1 behind a rigid
    stop), and a picture. Over several values the tables begin with the value, and the picture shows
    the shares.
    """
    from nldyn.report.basins import write_basins
    from nldyn.scene.basins import basins_of
    from nldyn.scene.messages import unknown_name

    scene = work.scene
    for option, state in (("--x", x), ("--y", y)):
        if state is not None and state[1] not in scene.interface_names:
            fault = unknown_name(state[1], scene.interface_names, "an interface")
            raise click.UsageError(f"{fault} ({option})")
    found = basins_of(
        scene, frequency_hz, over=over or 1, x=x, y=y, x_range=x_range, y_range=y_range,
        cells=cells, longest=longest, progress=work.line, jobs=jobs,
    )  # fmt: skip
    write = partial(write_basins, found, title=scene.title)
    return Told([*_shown(found), found.report()], write=write)


def _shown(*found: object) -> list[str]:
    """What was found, in a line each."""
    return [repr(each).strip("<>") for each in found if each is not None]


def period_of_an_orbit(period: int, frequency_hz: float | None, **_: Any) -> None:
    """Refuse a period of no orbit."""
    if period != 1 and frequency_hz is None:
        raise click.UsageError("'--period' needs '--frequency-hz'")


@main.command()
@writes_results(check=period_of_an_orbit)
@drawn_modes_option
@view_option
@frequency_option(
    "Draw the orbit at this excitation frequency; else the highest harmonic one.", required=False
)
@count_option("--period", 1, 100, 1, "Period of that orbit, in periods of the excitation.", None)
@click.option(
    "--video",
    type=click.Choice(["gif", "mp4"]),
    default="gif",
    show_default=True,
    help="Kind of animation; mp4 needs imageio-ffmpeg.",
)
@jobs_option
def render(
    work: Work,
    modes: list[int] | None,
    view: str,
    frequency_hz: float | None,
    period: int,
    video: str,
    jobs: int,
) -> Told:
    """Draw mode shapes, deepest contact and one period in motion of a scene.

    All that is of a mesh is drawn; components from matrices have no shape. Writes modes.csv,
    pictures, an animation, and the pages mode_shapes.html and deepest_contact.html for a browser.
    DIR may be that of a run.
    """
    from fem.render import RenderError
    from nldyn.report.render import render_scene

    try:
        made = render_scene(
            work.scene, work.out, frequency_hz=frequency_hz, period=period, video=video,
            modes=modes or (), view=view, progress=work.line, jobs=jobs,
        )  # fmt: skip
    except RenderError as error:
        return Told((), str(error), NO_GRAPHICS)
    drawn = "no [continuation], so no orbit is drawn"
    if made.orbit is not None:
        orbit = made.orbit
        drawn = (
            f"drawn: the {orbit.stability.verdict} orbit of period {orbit.period} at "
            f"{orbit.frequency_hz:.6g} Hz, with {orbit.impacts} impact{'s' * (orbit.impacts != 1)}"
        )
    return Told([drawn, written_by(work.out, "render")], made.missing, NO_GRAPHICS)


@main.command()
@writes_results("converge")
@click.option(
    "--modes",
    callback=number_list,
    metavar="LIST",
    help="Numbers of kept modes, such as 1-10,20; by default 1 to 10, 12, 16, 20, 30 and 40, "
    "as far as there are so many.",
)
@click.option(
    "--methods",
    default="rubin",
    show_default=True,
    metavar="LIST",
    help="Methods to compare: rubin, craig-bampton, guyan, truncation, macneal.",
)
@click.option(
    "--refinements",
    callback=number_list,
    metavar="LIST",
    help="Meshes to compare: cut every line into so many; by default 1.",
)
@click.option(
    "--meshes",
    metavar="LIST",
    help="Meshes to compare: files with the names of the scene's, from coarse to fine.",
)
@click.option(
    "--components",
    metavar="LIST",
    help="Joined components whose modes are varied, the others as in the scene; by default "
    "all that have a [reduction].",
)
@click.option(
    "--at",
    type=float,
    metavar="VALUE",
    help="Orbit to compare: its frequency in Hz, or value of what [continuation] changes.",
)
@click.option("--full", is_flag=True, help="Find this orbit in the full model, too (minutes).")
@jobs_option
def converge(
    work: Work,
    modes: list[int] | None,
    methods: str,
    refinements: list[int] | None,
    meshes: str | None,
    components: str | None,
    at: float | None,
    full: bool,
    jobs: int,
) -> Told:
    """Compute the harmonic branch with more and more modes, and compare.

    Also by several methods, or on several meshes.
    """
    from nldyn.report.convergence import write_study
    from nldyn.scene.convergence import convergence_study_of

    study = convergence_study_of(
        work.scene, modes=modes, methods=_names(methods), refinements=refinements or [1],
        meshes=_names(meshes), components=_names(components), at=at, full=full,
        progress=work.line, jobs=jobs,
    )  # fmt: skip
    write = partial(write_study, study, title=work.scene.title, text=work.scene.text)
    return Told([study.report()], write=write)


def _names(text: str | None) -> list[str]:
    """Names with commas between them."""
    return [] if text is None else [name.strip() for name in text.split(",")]
