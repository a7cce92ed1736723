"""``python -m nldyn.paper.search DIRECTORY [MODEL ...]``: look for branches of the larger models.

Beside the branches of the starts that are known, those in the directory or else the ones that are
kept with the package, it finds others, writes the starts of all into the directory, and reports how
many may be missing. With ``--detour DAMPING EXCITATION`` it does not simulate, but goes by way of a
system with these factors, see `by_detour`. The directory keeps what is found, and the same command
goes on where it was interrupted (but for following the starts); once it has ended, it looks for
more beside what it has found.
"""

from __future__ import annotations

import argparse
import hashlib
from pathlib import Path

from nldyn.command import answering
from nldyn.detour_search import by_detour, check_factors
from nldyn.diagrams import Diagram, Progress
from nldyn.errors import SystemModelError
from nldyn.exploration import Exploration, ExploreOptions
from nldyn.paper.jobs import JOBS, LONG, Job
from nldyn.paper.starts import LONGEST, follow_starts, read_starts, starts_path, write_starts
from nldyn.progress import progress_line
from nldyn.store import load_diagram
from nldyn.survey import explore

EFFORT = ExploreOptions(spacing=0.01, starts=1, settling=200, rounds=24, passing=24)
MODELS = tuple(job.name for job in JOBS if job.doubled)


def search(name: str, folder: Path, effort: ExploreOptions = EFFORT) -> Exploration:
    """Explore a model, and write the starts that it gives."""
    job = next(job for job in JOBS if job.name == name)
    with progress_line() as report:
        known, place = known_branches(job, folder, report)
        found = explore(
            job.system(), job.range_hz, LONGEST, effort=effort, options=LONG, known=known,
            progress=report, checkpoint=place.with_suffix(".searched.h5"),
        )  # fmt: skip
    write_starts(starts_path(name, folder), found.diagram.branches)
    return found


def search_by_detour(name: str, folder: Path, damping: float, excitation: float) -> Diagram:
    """Look for branches of a model with `by_detour`, and write the starts of all."""
    job = next(job for job in JOBS if job.name == name)
    with progress_line() as report:
        known, place = known_branches(job, folder, report)
        found = by_detour(
            known, damping, excitation, max_period=LONGEST, options=LONG,
            progress=report, checkpoint=place.with_suffix(".detour.h5"),
        )  # fmt: skip
    write_starts(starts_path(name, folder), found.branches)
    return found


def known_branches(job: Job, folder: Path, progress: Progress) -> tuple[Diagram, Path]:
    """Branches that the starts known lead to, and their file, which is named after these starts."""
    path = starts_path(job.name, folder)
    starts = read_starts(job.name, folder) if path.exists() else read_starts(job.name)
    digest = hashlib.sha256(b"".join(start.state.tobytes() for start in starts)).hexdigest()
    path = folder / f"{job.name}.{digest[:12]}.h5"
    if not path.exists():
        doubled = (LONGEST, LONG.max_points)
        follow_starts(
            job.system(), starts, job.range_hz, LONG, doubled, progress, whole=True
        ).save(path)
    return load_diagram(path), path


def main() -> None:
    """Search the models named, or all."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("directory", type=Path)
    parser.add_argument("models", nargs="*", metavar="MODEL", help=f"of {', '.join(MODELS)}")
    parser.add_argument(
        "--detour", type=float, nargs=2, metavar=("DAMPING", "EXCITATION"), help="factors of these"
    )
    given = parser.parse_args()
    if given.detour is not None:
        try:
            check_factors(*given.detour)
        except SystemModelError as error:
            parser.error(str(error))
    unknown = set(given.models) - set(MODELS)
    if unknown:
        parser.error(f"unknown model {sorted(unknown)[0]!r} (there are: {', '.join(MODELS)})")
    try:
        given.directory.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        parser.error(f"{given.directory} cannot be made: {error.strerror}")
    for name in given.models or MODELS:
        if given.detour is None:
            said = search(name, given.directory).report()
        else:
            said = search_by_detour(name, given.directory, *given.detour).notes[-1]
        print(f"{name}: {said}", flush=True)


if __name__ == "__main__":
    answering(main)
