"""What a run says on stderr where it cannot go on."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from nldyn.base.exit_codes import BAD_INPUT, INTERRUPTED, NO_GRAPHICS, NOTHING_FOUND
from nldyn.base.extras import how_to_install
from nldyn.runtime.interruption import interrupted


@contextmanager
def plain_errors() -> Iterator[None]:
    """Tell the user's errors in one line on stderr, without a traceback, and exit."""
    from nldyn.base.errors import ConvergenceError, SceneError, SystemModelError
    from nldyn.runtime.result_directory import OutputError
    from nldyn.scene.messages import printable

    try:
        yield
    except (SceneError, SystemModelError, OutputError) as error:
        print(f"nldyn: {printable(str(error))}", file=sys.stderr)
        sys.exit(BAD_INPUT)
    except ConvergenceError as error:
        print(f"nldyn: {printable(str(error))}", file=sys.stderr)
        sys.exit(NOTHING_FOUND)
    except ModuleNotFoundError as error:
        told = how_to_install(error.name or "", "what this command draws")
        if not told:
            raise
        print(f"nldyn: {told}", file=sys.stderr)
        sys.exit(NO_GRAPHICS)
    except MemoryError:
        print("nldyn: the memory does not suffice for this", file=sys.stderr)
        sys.exit(BAD_INPUT)


@contextmanager
def kept_at_interrupt(out: Path) -> Iterator[Path]:
    """Give the file that keeps what is computed, and name it if the end is not reached."""
    from nldyn.runtime.unfinished import unfinished_file

    with unfinished_file(out) as unfinished, told_what_is_kept(unfinished):
        yield unfinished


@contextmanager
def told_what_is_kept(
    unfinished: Path, holds_work: Callable[[Path], bool] = Path.exists
) -> Iterator[None]:
    """Name the place of unfinished work where an error of the output or Ctrl-C ends it."""
    from nldyn.runtime.result_directory import OutputError

    try:
        yield
    except OutputError as error:
        if not holds_work(unfinished):
            raise
        fault = f"{error}; {unfinished} keeps what was computed, and the same command goes on"
        raise OutputError(f"{fault} from there") from error
    except (KeyboardInterrupt, Exception) as error:
        if not (interrupted(error) and holds_work(unfinished)):
            raise
        print(
            f"nldyn: stopped by Ctrl-C; {unfinished} keeps what was computed, and the same "
            "command goes on from there",
            file=sys.stderr,
        )
        sys.exit(INTERRUPTED)
