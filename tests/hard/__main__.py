"""``python -m hard [--out DIR] [--quick] [--workers N]``: compute the hard cases."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from nldyn.runtime.interruption import answering


def main() -> None:
    """Run the suite; the exit code is 1 if a case fails that is not known to."""
    parser = argparse.ArgumentParser(prog="python -m hard")
    parser.add_argument("--out", type=Path, default=Path("results/hard"), metavar="DIR")
    parser.add_argument("--only", default="", metavar="SUBJECT", help="cases of one subject")
    parser.add_argument("--quick", action="store_true", help="only the cases that the tests run")
    parser.add_argument("--workers", type=int, default=1, metavar="N", help="processes")
    chosen = parser.parse_args()
    if chosen.workers < 1:
        parser.error(f"--workers must be at least 1, got {chosen.workers}")
    from hard.run import run
    from nldyn.runtime.result_directory import OutputError

    try:
        results = run(chosen.out, quick=chosen.quick, only=chosen.only, workers=chosen.workers)
    except (OutputError, ValueError) as error:
        parser.error(str(error))
    failed = [r for r in results if not r.passed]
    print(f"{len(results)} cases, {len(failed)} failed; written to {chosen.out / 'page.md'}")
    sys.exit(any(not r.case.fault for r in failed))


if __name__ == "__main__":
    answering(main)
