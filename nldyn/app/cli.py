"""The command line: ``nldyn new``, ``run``, ``report``, ``check`` and others; see ``--help``.

Exit codes: 0 done, 2 something in the scene or on the command line is wrong, 3 a picture or an
animation needs something that is not installed, 130 stopped with Ctrl-C.
"""

from __future__ import annotations

import json
import math
import os
import sys
import time
import warnings
from collections import Counter
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import click

from nldyn.base.exit_codes import BAD_INPUT, INTERRUPTED, NO_GRAPHICS, NOTHING_FOUND
from nldyn.report.console import kept_at_interrupt, plain_errors, told_what_is_kept
from nldyn.runtime.interruption import STOPPED, interrupted

if TYPE_CHECKING:
    from nldyn.base.arrays import Real
    from nldyn.scene.build import Structure
    from nldyn.scene.schema import Scene
    from nldyn.search.diagram import Diagram
    from nldyn.system.rigid_stop import AnyStop
    from nldyn.system.system import AnySpring, System


def usable_cores() -> int:
    """How many cores this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


any_path = click.Path(path_type=Path, readable=False)  # what is wrong with it is said later
scene_argument = click.argument("scene", type=any_path, metavar="SCENE.toml")
out_option = click.option(
    "--out",
    required=True,
    type=any_path,
    metavar="DIR",
    help="Directory for the results: new, empty, or of an earlier run.",
)
mesh_option = click.option(
    "--mesh-folder",
    "mesh_folders",
    multiple=True,
    type=any_path,
    metavar="DIR",
    help="Folder from which the mesh may come, beside those of the scene and the current one.",
)
replace_option = click.option(
    "--replace", is_flag=True, help="Replace results of another scene in DIR."
)
quiet_option = click.option("--quiet", is_flag=True, help="Show no progress.")
jobs_option = click.option(
    "--jobs",
    type=click.IntRange(1, 1000),
    default=usable_cores,
    show_default="all cores",
    metavar="N",
    help="Processes that share the work; the results do not depend on it.",
)


def number_list(
    _context: click.Context, _parameter: click.Parameter, value: str | None
) -> list[int] | None:
    """Read whole numbers with commas between them, or ranges like 1-10."""
    if value is None:
        return None
    found: set[int] = set()
    for piece in value.split(","):
        first, _dash, last = piece.strip().partition("-")
        if not first.isdecimal() or (last and not last.isdecimal()):
            raise click.BadParameter(f"'{value}' is not a list of whole numbers such as 1-10,20")
        if int(last or first) < int(first):
            raise click.BadParameter(f"'{value}': the range {piece.strip()} runs downwards")
        if int(last or first) - int(first) > 1000:
            raise click.BadParameter(f"'{value}' names more than 1000 numbers")
        found |= set(range(int(first), int(last or first) + 1))
    return sorted(found)


json_option = click.option(
    "--json", "as_json", is_flag=True, help="Print a summary as JSON instead of text."
)
view_option = click.option(
    "--view",
    type=click.Choice(["oblique", "front", "top", "side", "isometric"]),
    default="oblique",
    show_default=True,
    help="From where the pictures are taken; y is up.",
)
drawn_modes_option = click.option(
    "--modes",
    callback=number_list,
    metavar="LIST",
    help="Modes to show, such as 1-4,7; all unless given.",
)


def print_version(context: click.Context, _: click.Parameter, wanted: bool) -> None:
    """Print the version and stop, if wanted."""
    if wanted:
        from nldyn.base.version import software_version

        click.echo(f"nldyn {software_version()}")
        context.exit()


class PlainGroup(click.Group):
    """Commands that tell a fault on their command line in one sentence, without their usage."""

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
    """Tell Ctrl-C in one line on stderr, and exit; compiled code wraps it."""
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
    """Bifurcation diagrams of structures that hit a stop, from a mesh or from modal data."""


@main.command()
@scene_argument
@out_option
@mesh_option
@click.option("--log", is_flag=True, help="Draw the displacement on a logarithmic axis.")
@replace_option
@json_option
@quiet_option
@jobs_option
def run(
    scene: Path,
    out: Path,
    mesh_folders: tuple[Path, ...],
    log: bool,
    replace: bool,
    as_json: bool,
    quiet: bool,
    jobs: int,
) -> None:
    """Compute the branches of a scene, and write tables, a diagram and a report.

    The report is one page for a browser, report.html.
    """
    with plain_errors():
        from nldyn.runtime.progress import progress_line
        from nldyn.scene.read import load_scene

        start = time.perf_counter()
        loaded = load_scene(scene, mesh_folders)
        check_results(out, loaded, replace)
        from nldyn.io.checkpoint import CheckpointFile
        from nldyn.report.again import drawn_of
        from nldyn.report.results import write_results
        from nldyn.scene.run import compute, explore_scene, parts_of_work, structure_of

        with kept_at_interrupt(out) as unfinished:
            kept = CheckpointFile(unfinished)
            with progress_line(quiet) as line:
                parts = parts_of_work(loaded, line)
                structure = structure_of(loaded, parts.part("model"))
                parts.end("model")
                work = (loaded, parts.part("branches"), kept, jobs, structure)
                found = explore_scene(*work) if loaded.explore else None
                diagram = found.diagram if found else compute(*work)
                line("report", 0.0, 1.0)
                yscale: Literal["linear", "log"] = "log" if log else "linear"
                drawn = drawn_of(loaded, structure)
                write_results(found or diagram, out, loaded, drawn=drawn, yscale=yscale)
        seconds = time.perf_counter() - start
        if as_json:
            from nldyn.report.results import summary

            print_json(
                {
                    "scene": str(scene),
                    "out": str(out),
                    "report": str(out / "report.html"),
                    "seconds": seconds,
                    "special_points": special_counts(diagram),
                    "coverage": found.coverage_lines() if found else [],
                    **summary(diagram),
                }
            )
        else:
            if found:
                click.echo("\n".join(found.coverage_lines()))
            click.echo(describe(diagram, seconds, out))
        if not diagram.branches:
            click.echo("nldyn: no periodic orbit was found; the tables are empty", err=True)
            sys.exit(NOTHING_FOUND)


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
@quiet_option
def warm(quiet: bool) -> None:
    """Compile the kernels beforehand, which else the first run does: a minute or two."""
    with plain_errors():
        from nldyn.app.warm import warm as compile_all
        from nldyn.runtime.progress import progress_line

        with progress_line(quiet):
            done = compile_all()
    if done.seconds:
        click.echo(f"compiled in {done.seconds:.0f} s; kept in {done.folder}")
    else:
        click.echo(f"the kernels are compiled already; they are kept in {done.folder}")


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
    compiles nothing and takes a second or two.
    """
    with plain_errors():
        from nldyn.base.errors import SystemModelError
        from nldyn.runtime.progress import messages_shown
        from nldyn.scene.build import (
            build_any,
            build_candidates,
            build_parts,
            build_reduced,
            build_system,
            join,
        )
        from nldyn.scene.checks import check_computable, remarks
        from nldyn.scene.faults import told_as
        from nldyn.scene.read import load_scene

        loaded = load_scene(scene, mesh_folders)
        with messages_shown():
            reduced = candidates = None
            component = None if loaded.reduction is None else build_any(loaded)
            if loaded.reduction is not None and loaded.reduction.tolerance is not None:
                candidates = build_candidates(loaded, component)
                reduced = candidates.reduced()
            elif component is not None:
                reduced = build_reduced(loaded, component)
            parts = {"": component} if component is not None else build_parts(loaded)
            if loaded.components:
                reduced = join(loaded, parts)
            system = build_system(loaded, reduced)
            with told_as(loaded, (), SystemModelError):
                at_rest = describe_rest(system)
        highest_hz = float(system.frequencies_hz.max())
        if as_json:
            from nldyn.report.modes import mode_table
            from nldyn.scene.build import Structure

            check_computable(loaded, scene)
            table = mode_table(loaded, Structure(component, reduced))
            count = sum(part.mass.shape[0] for part in parts.values()) or None
            print_json({
                "scene": str(scene),
                "title": loaded.title,
                "degrees_of_freedom": count,
                "mass_kg": table.mass,
                "modes": table.as_json(),
                **described_as_json(system),
                "at_rest": at_rest,
                "notes": remarks(loaded, highest_hz),
            })  # fmt: skip
            return
        echo_parts(parts)
        described = describe_system(system, 0 if reduced is None else reduced.residual_modes)
        click.echo("\n".join([described, *at_rest]))
        check_computable(loaded, scene)
        if candidates is not None and loaded.reduction is not None:
            click.echo(
                f"modes up to {candidates.cutoff_hz:.4g} Hz may matter; of these, 'nldyn run' "
                f"keeps as many as tolerance = {loaded.reduction.tolerance:g} needs"
            )
        for remark in remarks(loaded, highest_hz):
            click.echo(f"note: {remark}")
        click.echo(f"{scene}: no fault found")


def described_as_json(system: System) -> dict[str, object]:
    """Static flexibilities and stops of a system."""
    return {
        "static_flexibility_m_per_n": {
            name: static_flexibility(system, name) for name in system.interfaces
        },
        "stops": [describe_stop(stop) for stop in system.stops],
    }


def echo_parts(parts: Mapping[str, Any]) -> None:
    """What was read of each component of a scene."""
    import cms
    import fem

    for name, part in parts.items():
        if name:
            click.echo(f"component '{name}':")
        if isinstance(part, cms.Matrices):
            click.echo(f"matrices of {part.mass.shape[0]} degrees of freedom")
        else:
            click.echo(fem.summary(part))


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
        from nldyn.report.render import render_modes_of
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
        print_json(told)
    else:
        click.echo(table.report(modes or ()))
        if compared is not None:
            click.echo(compared.report(tuple(modes or ())))
        if out is not None:
            click.echo(f"written to {out}: {written_by(out, 'modes')}")
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
@scene_argument
@out_option
@mesh_option
@replace_option
@click.option(
    "--mode",
    type=click.IntRange(1, 100_000),
    default=1,
    show_default=True,
    help="Linear mode at which the family begins.",
)
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
@quiet_option
def backbone(
    scene: Path,
    out: Path,
    mesh_folders: tuple[Path, ...],
    replace: bool,
    mode: int,
    amplitude_m: float,
    forced: bool,
    quiet: bool,
) -> None:
    """Follow the free motions of a scene, without its damping and excitation, from a mode on.

    Writes backbone.csv and a picture of amplitude against frequency; with --forced also
    phase_resonance.csv, up to the strength of the scene's excitation.
    """
    with plain_errors():
        from nldyn.runtime.progress import progress_line
        from nldyn.scene.read import load_scene

        loaded = load_scene(scene, mesh_folders)
        check_results(out, loaded, replace)
        from nldyn.report.backbone import write_backbone
        from nldyn.scene.backbone import backbone_of, phase_resonance_of

        with progress_line(quiet):
            found = backbone_of(loaded, amplitude_m, mode)
            resonant = phase_resonance_of(loaded, found) if forced else None
        write_backbone(found, out, loaded.text, loaded.title, resonant)
    click.echo(repr(found).strip("<>"))
    if resonant is not None:
        click.echo(repr(resonant).strip("<>"))
    click.echo(f"written to {out}: {written_by(out, 'backbone')}")


@main.command()
@scene_argument
@out_option
@mesh_option
@replace_option
@click.option(
    "--frequency-hz",
    type=click.FloatRange(1e-6, 1e12),
    required=True,
    metavar="HZ",
    help="Excitation frequency, at which a run-up begins.",
)
@click.option(
    "--periods",
    type=click.IntRange(1, 100_000),
    metavar="N",
    help="Excitation periods to record; 100 unless given.",
)
@click.option(
    "--transient",
    type=click.IntRange(0, 100_000_000),
    default=0,
    show_default=True,
    metavar="N",
    help="Excitation periods from rest before the recording, or before the run-up.",
)
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
@quiet_option
def simulate(
    scene: Path,
    out: Path,
    mesh_folders: tuple[Path, ...],
    replace: bool,
    frequency_hz: float,
    periods: int | None,
    transient: int,
    to_hz: float | None,
    rate_hz_per_s: float | None,
    exponents: bool,
    quiet: bool,
) -> None:
    """Simulate a scene in time from rest, at one frequency or in a run-up or run-down.

    Writes motion.csv, the displacements and contact forces, impacts.csv, and a picture; of a
    run-up also peaks.csv. Forces may have frequencies of their own.
    """
    if (to_hz is None) != (rate_hz_per_s is None):
        raise click.UsageError("'--to-hz' and '--rate-hz-per-s' go together")
    if to_hz is not None and (periods is not None or exponents):
        raise click.UsageError("'--periods' and '--lyapunov' are for one frequency, not '--to-hz'")
    with plain_errors():
        from nldyn.runtime.progress import progress_line
        from nldyn.scene.read import load_scene

        loaded = load_scene(scene, mesh_folders)
        check_results(out, loaded, replace)
        from nldyn.longterm.impacts import impacts
        from nldyn.report.simulation import write_simulation
        from nldyn.scene.simulation import simulation_of

        with progress_line(quiet):
            found = simulation_of(
                loaded, frequency_hz, periods=periods or 100, transient=transient,
                exponents=exponents, to_hz=to_hz, rate_hz_per_s=rate_hz_per_s or 0.0,
            )  # fmt: skip
        write_simulation(found.motion, out, loaded.text, loaded.title)
    for told in (found.motion, impacts(found.motion), found.spectrum):
        if told is not None:
            click.echo(repr(told).strip("<>"))
    click.echo(f"written to {out}: {written_by(out, 'simulation')}")


def written_by(out: Path, kind: str) -> str:
    """The files that a command wrote into a directory of results."""
    from nldyn.runtime.result_directory import written_files

    return ", ".join(written_files(out, kind))


def print_json(content: Mapping[str, object]) -> None:
    """Print JSON on stdout; numbers that are not finite become null."""

    def plain(value: object) -> object:
        if isinstance(value, float):
            return value if math.isfinite(value) else None
        if isinstance(value, Mapping):
            return {key: plain(each) for key, each in value.items()}
        return [plain(each) for each in value] if isinstance(value, list | tuple) else value

    click.echo(json.dumps(plain(content), indent=1, allow_nan=False))


@main.command()
@scene_argument
@out_option
@mesh_option
@replace_option
@drawn_modes_option
@view_option
@click.option(
    "--frequency-hz",
    type=click.FloatRange(1e-6, 1e12),
    metavar="HZ",
    help="Draw the orbit at this excitation frequency; else the highest harmonic one.",
)
@click.option(
    "--period",
    type=click.IntRange(1, 100),
    default=1,
    show_default=True,
    help="Period of that orbit, in periods of the excitation.",
)
@click.option(
    "--video",
    type=click.Choice(["gif", "mp4"]),
    default="gif",
    show_default=True,
    help="Kind of animation; mp4 needs imageio-ffmpeg.",
)
@quiet_option
@jobs_option
def render(
    scene: Path,
    out: Path,
    mesh_folders: tuple[Path, ...],
    replace: bool,
    modes: list[int] | None,
    view: str,
    frequency_hz: float | None,
    period: int,
    video: str,
    quiet: bool,
    jobs: int,
) -> None:
    """Draw mode shapes, deepest contact and one period in motion of a scene with a mesh.

    Writes modes.csv, pictures, an animation, and the pages mode_shapes.html and
    deepest_contact.html for a browser. DIR may be that of a run.
    """
    if period != 1 and frequency_hz is None:
        raise click.UsageError("'--period' needs '--frequency-hz'")
    with plain_errors():
        from nldyn.runtime.progress import progress_line
        from nldyn.scene.read import load_scene

        loaded = load_scene(scene, mesh_folders)
        check_results(out, loaded, replace)
        from fem.render import RenderError
        from nldyn.report.render import render_scene

        try:
            with progress_line(quiet) as report:
                made = render_scene(
                    loaded,
                    out,
                    frequency_hz=frequency_hz,
                    period=period,
                    video=video,
                    modes=modes or (),
                    view=view,
                    progress=report,
                    jobs=jobs,
                )
        except RenderError as error:
            click.echo(f"nldyn: {error}", err=True)
            sys.exit(NO_GRAPHICS)
    if made.orbit is None:
        click.echo("no [continuation], so no orbit is drawn")
    else:
        orbit = made.orbit
        click.echo(
            f"drawn: the {orbit.stability.verdict} orbit of period {orbit.period} at "
            f"{orbit.frequency_hz:.6g} Hz, with {orbit.impacts} impacts"
        )
    click.echo(f"written to {out}: {written_by(out, 'render')}")
    if made.missing:
        click.echo(f"nldyn: {made.missing}", err=True)
        sys.exit(NO_GRAPHICS)


@main.command()
@scene_argument
@out_option
@mesh_option
@replace_option
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
@click.option("--at-hz", type=click.FloatRange(1e-6, 1e12), metavar="HZ", help="Orbit to compare.")
@click.option("--full", is_flag=True, help="Find this orbit in the full model, too (minutes).")
@quiet_option
@jobs_option
def converge(
    scene: Path,
    out: Path,
    mesh_folders: tuple[Path, ...],
    replace: bool,
    modes: list[int] | None,
    methods: str,
    refinements: list[int] | None,
    meshes: str | None,
    at_hz: float | None,
    full: bool,
    quiet: bool,
    jobs: int,
) -> None:
    """Compute the harmonic branch with more and more modes, and compare.

    Also by several methods, or on several meshes.
    """
    with plain_errors():
        from nldyn.runtime.progress import progress_line
        from nldyn.scene.read import load_scene

        loaded = load_scene(scene, mesh_folders)
        check_results(out, loaded, replace)
        from nldyn.report.convergence import write_study
        from nldyn.scene.convergence import convergence_study_of

        with progress_line(quiet) as report:
            study = convergence_study_of(
                loaded,
                modes=modes,
                methods=[name.strip() for name in methods.split(",")],
                refinements=refinements or [1],
                meshes=[name.strip() for name in meshes.split(",")] if meshes else (),
                at_hz=at_hz,
                full=full,
                progress=report,
                jobs=jobs,
            )
        write_study(study, out, loaded.title, loaded.text)
        click.echo(study.report())
        page = out / "convergence.html"
        click.echo(f"written to {out}; {page} is a page for a browser")


@main.command()
@out_option
@click.option("--atlas", is_flag=True, help="All known branches instead, which takes hours.")
@click.option("--jobs", type=click.IntRange(min=1), default=2, show_default=True, help="Processes.")
@quiet_option
def paper(out: Path, atlas: bool, jobs: int, quiet: bool) -> None:
    """Reproduce the figures and numbers of the paper."""
    with plain_errors():
        import nldyn.paper
        from nldyn.paper.atlas import has_charts
        from nldyn.paper.kept import has_values, unfinished_folder

        if atlas:
            with told_what_is_kept(out, has_charts):
                nldyn.paper.compute_atlas(out, jobs, quiet=quiet)
        else:
            with told_what_is_kept(unfinished_folder(out), has_values):
                nldyn.paper.main(out, jobs, quiet=quiet)


def check_results(out: Path, scene: Scene, replace: bool) -> None:
    """Refuse a directory that cannot be written, or, unless wanted, with another scene's results.

    Titles and comments do not count.
    """
    from nldyn.runtime.result_directory import OutputError, check_directory, says_something_else

    check_directory(out)
    if not replace and says_something_else(out, scene.text):
        raise OutputError(
            f"{out}: holds the results of a scene that says something else; choose another "
            "directory, or replace them with --replace"
        )


def describe(diagram: Diagram, seconds: float, out: Path) -> str:
    """Say in a few lines what was computed."""
    branches = diagram.branches
    kinds = special_counts(diagram)
    found = ", ".join(f"{count} {kind}" for kind, count in kinds.items()) or "none"
    points = sum(len(branch.points) for branch in branches)
    lines = [
        f"{len(branches)} {'branch' if len(branches) == 1 else 'branches'} with {points} points "
        f"in {seconds:.1f} s",
        f"special points: {found}",
        *(f"note: {note}" for note in dict.fromkeys(diagram.notes)),
        f"written to {out}; {out / 'report.html'} is a page for a browser",
    ]
    return "\n".join(lines)


def special_counts(diagram: Diagram) -> dict[str, int]:
    """How many special points there are of each kind."""
    special = (point for branch in diagram.branches for point in branch.special_points)
    return dict(sorted(Counter(str(point.kind) for point in special).items()))


def describe_system(system: System, residual: int = 0) -> str:
    """Tabulate frequencies and participation of the modes, and the static flexibility.

    The last ``residual`` modes are marked as such.
    """
    import numpy as np

    names = list(system.interfaces)
    width = max(14, *(len(name) + 2 for name in names))
    lines = ["mode   frequency (Hz)   participation (1/sqrt(kg)) at"]
    lines.append(" " * 23 + "".join(f"{name:>{width}}" for name in names))
    for mode, hz in enumerate(system.frequencies_hz):
        values = "".join(f"{system.participation[name][mode]:>{width}.6g}" for name in names)
        mark = "  residual" if mode >= system.size - residual else ""
        lines.append(f"{mode + 1:>4}{hz:>19.6f}{values}{mark}")
    flexibility = "".join(f"{static_flexibility(system, name):>{width}.6g}" for name in names)
    lines.append(f"{'static flexibility m/N':<23}{flexibility}")
    lines += [describe_stop(stop) for stop in system.stops]
    lines += [describe_spring(spring) for spring in system.springs]
    if np.any(system.spring_stiffness):
        hz = ", ".join(f"{value:.6f}" for value in system.linear.frequencies_hz)
        lines.append(f"frequencies with the springs: {hz} Hz")
    return "\n".join(lines)


def describe_rest(system: System) -> list[str]:
    """Say where the structure rests, and what holds it, if that is not at zero."""
    from nldyn.system.equilibrium import closed_at_rest, rest_positions

    found = rest_positions(system)
    q, others = found[0], found[1:]
    if not q.any() and not others:
        return []
    places = _places(system, q)
    return [
        f"at rest: {places}",
        *(f"or at rest: {_places(system, other)}" for other in others),
        *(
            f"at rest the stop at '{system.stops[i].at}' is closed by {depth:.6g} m: {force:.6g} N"
            for i, depth, force in closed_at_rest(system, q)
        ),
    ]


def _places(system: System, q: Real) -> str:
    return ", ".join(
        f"{float(phi @ q):.6g} m at '{name}'" for name, phi in system.participation.items()
    )


def describe_stop(stop: AnyStop) -> str:
    """Say in a line where a stop is and what it does."""
    from nldyn.system.rigid_stop import RigidStop

    if isinstance(stop, RigidStop):
        return (
            f"rigid stop {_place(stop)}: restitution {stop.restitution_at(1.0):g}, "
            f"gap {stop.gap:g} m, direction {stop.direction:+d}"
        )
    unit = "N/m" if stop.exponent == 1.0 else f"N/m^{stop.exponent:g}"
    loss = f", dissipation {stop.dissipation:g} s/m" if stop.dissipation else ""
    loss += f", dashpot {stop.dashpot:g} N s/m" if stop.dashpot else ""
    loss += "" if stop.pulls else " (never pulls)"
    return (
        f"stop {_place(stop)}: {stop.stiffness:.6g} {unit}, gap {stop.gap:g} m, "
        f"direction {stop.direction:+d}{loss}"
    )


def describe_spring(spring: AnySpring) -> str:
    """Say in a line where a spring is and what it does."""
    where = f"at '{spring.at}'" + (f" against '{spring.against}'" if spring.against else "")
    values = getattr(spring, "coefficients", None) or (getattr(spring, "stiffness", 0.0),)
    terms = [f"{k:.6g} N/m" + (f"^{j}" if j > 1 else "") for j, k in enumerate(values, 1) if k]
    return f"spring {where}: {', '.join(terms) or '0 N/m'}"


def _place(stop: AnyStop) -> str:
    return f"at '{stop.at}'" + (f" against '{stop.against}'" if stop.against else "")


def static_flexibility(system: System, interface: str) -> float:
    """Displacement in m at an interface for a steady force of 1 N there; inf if nothing holds."""
    import numpy as np

    phi = system.participation[interface]
    if system.springs:
        displaced = np.linalg.lstsq(system.stiffness, phi, rcond=None)[0]
        left = np.linalg.norm(system.stiffness @ displaced - phi)
        return float(phi @ displaced) if left <= 1e-9 * np.linalg.norm(phi) else float("inf")
    shares, squares = phi**2, system.natural_frequencies**2
    if any(shares[squares == 0.0] > 1e-18 * shares.max()):  # a free motion that it sees
        return float("inf")
    return float(sum(shares[squares > 0.0] / squares[squares > 0.0]))
