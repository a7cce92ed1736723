"""``python -m bench [--out DIR]``: measure speed against error on one thread."""

from __future__ import annotations

import argparse
import os
import sys
from pathlib import Path

from nldyn.runtime.interruption import answering

THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")


def on_one_thread() -> None:
    """Start again with one thread: the libraries read these variables when they are loaded."""
    if any(os.environ.get(name) != "1" for name in THREADS):
        os.environ.update(dict.fromkeys(THREADS, "1"))
        os.execv(sys.executable, [sys.executable, "-m", "bench", *sys.argv[1:]])


def main() -> None:
    """Run the benchmark."""
    parser = argparse.ArgumentParser(prog="python -m bench")
    parser.add_argument("--out", type=Path, default=Path("results/bench"), metavar="DIR")
    out = parser.parse_args().out
    on_one_thread()
    from bench.run import run
    from nldyn.runtime.result_directory import OutputError

    try:
        print(f"written to {run(out)}")
    except OutputError as error:
        parser.error(str(error))


if __name__ == "__main__":
    answering(main)
