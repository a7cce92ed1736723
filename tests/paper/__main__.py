"""``python -m paper [--out DIR] [--atlas]``: figures and claims, or all known branches."""

from __future__ import annotations

import argparse
from pathlib import Path

from nldyn.report.console import plain_errors, told_what_is_kept
from nldyn.runtime.interruption import answering


def main(words: list[str] | None = None) -> None:
    """Compute what is asked for; the same command goes on after Ctrl-C."""
    parser = argparse.ArgumentParser(prog="python -m paper")
    parser.add_argument("--out", type=Path, default=Path("results/paper"), metavar="DIR")
    parser.add_argument(
        "--atlas", action="store_true", help="all known branches instead, which takes hours"
    )
    parser.add_argument("--jobs", type=int, default=2, metavar="N", help="processes")
    parser.add_argument("--quiet", action="store_true", help="show no progress")
    chosen = parser.parse_args(words)
    if chosen.jobs < 1:
        parser.error(f"--jobs must be at least 1, got {chosen.jobs}")
    with plain_errors():
        import paper
        from paper.atlas import has_charts
        from paper.kept import has_values, unfinished_folder

        out = chosen.out
        if chosen.atlas:
            with told_what_is_kept(out, has_charts):
                paper.compute_atlas(out, chosen.jobs, quiet=chosen.quiet)
        else:
            with told_what_is_kept(unfinished_folder(out), has_values):
                paper.compute_paper(out, chosen.jobs, quiet=chosen.quiet)


if __name__ == "__main__":
    answering(main)
