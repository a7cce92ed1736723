"""Reproduce the figures and numbers of the paper, claim by claim."""

from __future__ import annotations

import shutil
import sys
import time
from pathlib import Path

__all__ = ["compute_atlas", "compute_paper"]


def compute_paper(out: str | Path, workers: int = 2, *, quiet: bool = False) -> None:
    """Compute what the paper shows, and write figures, the table of claims and a page.

    Parameters
    ----------
    out : str or Path
        Directory of results; it is written whole or not at all. What was computed is kept beside
        it until then, and the same call goes on from there.
    workers : int
        Number of processes.
    quiet : bool
        Show no progress.

    Raises
    ------
    OutputError
        If the directory cannot be written or holds something else.

    Examples
    --------
    >>> compute_paper("results/paper")        # doctest: +SKIP
    """
    from nldyn.runtime.interruption import ignored_interruption
    from nldyn.runtime.result_directory import check_directory, result_directory
    from paper.chaos import (
        joined_chaos,
        tasks_of_chaos,
        write_chaos_figure,
    )
    from paper.claims import evaluate, verdict_counts, write_claims
    from paper.figures import write_figures
    from paper.jobs import JOBS, diagrams_of, tasks_of
    from paper.kept import kept_folder
    from paper.page import write_page
    from paper.workers import worker_processes

    check_directory(out)
    folder_kept = kept_folder(out)
    start = time.perf_counter()
    with worker_processes(workers, quiet) as processes:
        with ignored_interruption():  # a terminal sends it to all processes
            tasks = (*tasks_of(JOBS, folder_kept), *tasks_of_chaos(folder_kept))
        values = processes.values(tasks)
    results, chaos = diagrams_of(values), joined_chaos(values)
    with result_directory(out, "paper") as folder:
        rows = evaluate(results, chaos)
        write_claims(rows, folder / "claims.csv")
        write_figures(results, folder, chaos)
        write_chaos_figure(chaos, folder)
        write_page(rows, results, time.perf_counter() - start, folder)
    shutil.rmtree(folder_kept.parent, ignore_errors=True)
    seconds = time.perf_counter() - start
    counts = verdict_counts(rows)
    print(f"{len(rows)} claims: {counts}; {seconds:.0f} s; written to {out}", file=sys.stderr)


def compute_atlas(out: str | Path, workers: int = 2, *, quiet: bool = False) -> None:
    """Follow all branches that are known of the larger models, which takes hours.

    Parameters
    ----------
    out : str or Path
        Directory of results. Each start's branches are a file in it once they are followed; the
        same call goes on with the starts left.
    workers : int
        Number of processes.
    quiet : bool
        Show no progress.

    Raises
    ------
    OutputError
        If the directory cannot be written or holds something else.

    Examples
    --------
    >>> compute_atlas("results/atlas")        # doctest: +SKIP
    """
    from paper.atlas import atlas_folder, write_atlas
    from paper.workers import worker_processes

    folder = atlas_folder(out)
    with worker_processes(workers, quiet) as processes:
        write_atlas(folder, processes)
    print(f"written to {out}", file=sys.stderr)
