"""What all commands have in common that compute a scene and write results into a directory."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterable
from contextlib import nullcontext
from dataclasses import dataclass
from functools import wraps
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import click

from nldyn.app.options import mesh_option, out_option, quiet_option, replace_option, scene_argument
from nldyn.report.console import kept_at_interrupt, plain_errors

if TYPE_CHECKING:
    from nldyn.runtime.progress import ProgressLine
    from nldyn.scene.schema.scene import Scene

Found = TypeVar("Found")


@dataclass(frozen=True)
class Work:
    """What a command works on.

    Parameters
    ----------
    scene : Scene
        Read and checked.
    out : Path
        Directory of results, which can be written.
    replace : bool
        Whether results of another scene there go.
    line : ProgressLine
        Shows how far it is.
    unfinished : Path, optional
        File that keeps what is computed, of commands that go on.
    start : float
        Of `time.perf_counter`.
    """

    scene: Scene
    out: Path
    replace: bool
    line: ProgressLine
    unfinished: Path | None
    start: float

    def found(self, compute: Callable[[], Found]) -> Found:
        """What is computed; unfinished work of something else is refused or, if wanted, replaced.

        Raises
        ------
        KeptWorkError
            If it is refused.
        """
        from nldyn.base.errors import KeptWorkError

        try:
            return compute()
        except KeptWorkError as error:
            if not self.replace or self.unfinished is None:
                raise KeptWorkError(f"{error}, or begin anew with --replace") from error
            self.unfinished.unlink(missing_ok=True)
            return compute()


@dataclass(frozen=True)
class Told:
    """What a command says in the end: lines, and a fault with its exit code, if there is one.

    Its results are written into a folder by `write` unless they are written already.
    """

    lines: Iterable[str]
    fault: str = ""
    code: int = 0
    write: Callable[[Path], object] | None = None


def writes_results(
    kind: str = "", *, kept: bool = False, check: Callable[..., None] | None = None
) -> Callable[[Callable[..., Told]], Callable[..., None]]:
    """Make a command of a function of `Work` and of the options that are its own.

    Parameters
    ----------
    kind : str
        What `Told.write` writes: files of this kind that were there before are replaced.
    kept : bool
        Whether what is computed is kept if it does not reach the end.
    check : callable, optional
        Refuses options that do not go together, before anything is read.
    """

    def decorated(work_of: Callable[..., Told]) -> Callable[..., None]:
        @scene_argument
        @out_option
        @mesh_option
        @replace_option
        @quiet_option
        @wraps(work_of)
        def command(
            scene: Path, out: Path, mesh_folders: tuple[Path, ...], replace: bool, quiet: bool,
            **own: Any,
        ) -> None:  # fmt: skip
            if check is not None:
                check(**own)
            with plain_errors():
                from nldyn.runtime.progress import progress_line
                from nldyn.scene.read import load_scene

                start = time.perf_counter()
                loaded = load_scene(scene, mesh_folders)
                check_results(out, loaded, replace)
                keeping = kept_at_interrupt(out) if kept else nullcontext()
                with keeping as unfinished, progress_line(quiet) as line:
                    told = work_of(Work(loaded, out, replace, line, unfinished, start), **own)
                    lines = [*told.lines, *_written(told, out, kind, loaded.text)]
            click.echo("\n".join(lines))
            if told.fault:
                click.echo(f"nldyn: {told.fault}", err=True)
                sys.exit(told.code)

        return command

    return decorated


def _written(told: Told, out: Path, kind: str, text: str) -> list[str]:
    """Write what is still to be written, with the text of the scene, and tell the files."""
    from nldyn.runtime.result_directory import SCENE, result_directory

    if told.write is None:
        return []
    with result_directory(out, kind) as folder:
        told.write(folder)
        (folder / SCENE).write_text(text, encoding="utf-8")
    return [written_by(out, kind)]


def written_by(out: Path, kind: str) -> str:
    """Tell the files that a command wrote into a directory of results."""
    from nldyn.runtime.result_directory import written_files

    return f"written to {out}: {', '.join(written_files(out, kind))}"


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
