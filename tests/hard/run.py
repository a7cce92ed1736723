"""The whole suite: compute every case, write the page."""

from __future__ import annotations

import math
import multiprocessing
import os
import time
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

from hard.case import Case, Measured, Result
from hard.cases import CASES
from hard.page import write_page
from nldyn.runtime.executors import as_finished
from nldyn.runtime.result_directory import check_directory, result_directory


def run(folder: Path, *, quick: bool = False, only: str = "", workers: int = 1) -> list[Result]:
    """Compute the cases and write their page and table.

    Parameters
    ----------
    folder : Path
        Where to write; it is written whole or not at all.
    quick : bool
        Only the cases that the tests run, too.
    only : str
        Only the cases of this subject; all unless given.
    workers : int
        Number of processes.

    Returns
    -------
    list of Result
        In the order of the cases.

    Raises
    ------
    ValueError
        If there is no such subject.
    OutputError
        If the folder cannot be written or holds something else.
    """
    subjects = dict.fromkeys(case.subject for case in CASES)
    if only not in ("", *subjects):
        raise ValueError(f"{only!r} is no subject of hard cases; there are {', '.join(subjects)}")
    check_directory(folder)
    start = time.perf_counter()
    chosen = [
        number
        for number, case in enumerate(CASES)
        if (case.quick or not quick) and only in ("", case.subject)
    ]
    results = compute(chosen, workers)
    with result_directory(folder, "hard") as new:
        write_page(results, time.perf_counter() - start, new)
    return results


def compute(numbers: Sequence[int], workers: int) -> list[Result]:
    """Results of the cases of some numbers; a case that kills its process fails alone."""
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # small matrices: threads only hinder
    context = multiprocessing.get_context("spawn")
    found: dict[int, Result] = {}
    with ProcessPoolExecutor(workers, context) as pool:
        for outcome in as_finished(measure_number, numbers, pool):
            number = numbers[outcome.index]
            lost = Result(CASES[number], Measured(math.nan, outcome.failure), math.nan)
            measured, seconds = outcome.value or (lost.measured, lost.seconds)
            found[number] = Result(CASES[number], measured, seconds)
            tell(found[number], len(found), len(numbers))
    return [found[number] for number in numbers]


def measure_number(number: int) -> tuple[Measured, float]:
    """Error and processor time of the case of a number (in a worker process)."""
    result = measure(CASES[number])
    return result.measured, result.seconds


def measure(case: Case) -> Result:
    """Compute a case; an exception is a result, too."""
    start = time.process_time()
    try:
        measured = case.run()
    except Exception as error:
        measured = Measured(math.nan, f"{type(error).__name__}: {error}")
    return Result(case, measured, time.process_time() - start)


def tell(result: Result, done: int, total: int) -> None:
    """Say what became of a case."""
    verdict = "passed" if result.passed else "FAILED"
    case, measured = result.case, result.measured
    why = "" if result.passed else f" ({measured.note})"
    print(
        f"{done}/{total} {verdict}: {case.subject}, {case.name}: {measured.error:.1e}, "
        f"bound {case.bound:.0e}, {result.seconds:.1f} s{why}",
        flush=True,
    )
