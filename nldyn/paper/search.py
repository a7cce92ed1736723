"""``python -m nldyn.paper.search DIRECTORY [MODEL ...]``: look for branches of the larger models.

It writes the starts that `nldyn.paper.starts` reads, and reports how many branches may be missing.
The directory keeps what is found, and the same command goes on where it was interrupted.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from nldyn.command import answering
from nldyn.exploration import Exploration, ExploreOptions, explore
from nldyn.paper.jobs import JOBS, LONG
from nldyn.paper.starts import LONGEST, starts_path, write_starts
from nldyn.progress import progress_line

EFFORT = ExploreOptions(spacing=0.01, starts=6, rounds=24)
MODELS = tuple(job.name for job in JOBS if job.doubled)


def search(name: str, folder: Path, effort: ExploreOptions = EFFORT) -> Exploration:
    """Explore a model, and write the starts that it gives."""
    job = next(job for job in JOBS if job.name == name)
    with progress_line() as report:
        found = explore(
            job.system(), job.range_hz, LONGEST, effort=effort, options=LONG,
            progress=report, checkpoint=folder / f"{name}.h5",
        )  # fmt: skip
    write_starts(starts_path(name, folder), found.diagram.branches)
    return found


def main() -> None:
    """Search the models named, or all."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("directory", type=Path)
    parser.add_argument("models", nargs="*", metavar="MODEL", help=f"of {', '.join(MODELS)}")
    given = parser.parse_args()
    unknown = set(given.models) - set(MODELS)
    if unknown:
        parser.error(f"unknown model {sorted(unknown)[0]!r} (there are: {', '.join(MODELS)})")
    given.directory.mkdir(parents=True, exist_ok=True)
    for name in given.models or MODELS:
        print(f"{name}: {search(name, given.directory).report()}", flush=True)


if __name__ == "__main__":
    answering(main)
