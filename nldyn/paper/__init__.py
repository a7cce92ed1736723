"""Reproduce the figures and numbers of the paper, claim by claim."""

from __future__ import annotations

import shutil
import sys
import time
from pathlib import Path

__all__ = ["main"]


def main(out: str | Path, workers: int = 2) -> None:
    """Compute all models and write figures, the table of claims and a page.

    Parameters
    ----------
    out : str or Path
        Directory of results; it is written whole or not at all. What was computed is kept beside
        it until then, and the same call goes on from there.
    workers : int
        Number of processes.

    Raises
    ------
    OutputError
        If the directory cannot be written or holds something else.

    Examples
    --------
    >>> main("results/paper")        # doctest: +SKIP
    """
    from nldyn.paper.chaos import chaos_of, submit_sweeps, write_chaos_figure
    from nldyn.paper.claims import evaluate, verdict_counts, write_claims
    from nldyn.paper.figures import write_figures
    from nldyn.paper.jobs import joined, submit_diagrams
    from nldyn.paper.kept import kept_folder
    from nldyn.paper.page import write_page
    from nldyn.paper.workers import worker_processes
    from nldyn.runtime.interruption import ignored_interruption
    from nldyn.runtime.result_directory import check_directory, result_directory

    check_directory(out)
    folder_kept = kept_folder(out)
    start = time.perf_counter()
    with worker_processes(workers, folder_kept) as processes:
        with ignored_interruption():  # a terminal sends it to all processes
            diagrams = submit_diagrams(processes)
            sweeps = submit_sweeps(processes)
        chaos = chaos_of(processes.values(sweeps, "sweeps"), processes)
        results = joined(processes.values(diagrams, "diagrams"))
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
