"""Tables as CSV, and the page that shows them."""

from __future__ import annotations

import os
import platform
import sys
from collections.abc import Mapping, Sequence
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from nldyn.base.version import software_version
from nldyn.report.results import write_table

Row = Mapping[str, str]
PACKAGES = ("numpy", "scipy", "heyoka", "scikit-sundae")

NOTES = {
    "Targets": "The verdicts are computed from the tables below.",
    "Fastest engine": "Of all with derivatives, at the largest of the three errors.",
    "Speed at equal error": (
        "Milliseconds for one period with monodromy matrix and derivative by frequency, at the "
        "largest of the three errors, interpolated on the work-precision curves; and how many "
        "times as long that is as the flow map takes. Empty: the error is not reached."
    ),
    "Work and precision": "Every measured point. Errors are relative, in the energy norm.",
    "Modes of a solid": (
        "Ten modes of a bracket of tetrahedra of second order, clamped at one face, each row in a "
        "process of its own; `python -m bench.solids` measures it alone."
    ),
    "Number of modes": (
        "The same beam with more modes, one impact per period at 38 Hz, default options. Errors "
        "against the tightest options."
    ),
    "Impacts with many modes": (
        "A tube on two supports that knocks on both sides of a third one, at 5.2 Hz, a hundred "
        "periods after rest: the time of a period with monodromy matrix and derivative by "
        "frequency over its number of impacts, flights included."
    ),
    "Sample of the atlas": (
        "Some starts of each family of each model, with all branches that they lead to, and the "
        "time for all orbits of the atlas if each takes as long."
    ),
    "Searches in vain": "`solve_orbit` on the same tube, whose motion does not settle.",
    "Branches": (
        "Whole harmonic branches with all special points, warm. `error` is the largest relative "
        "difference of a special point's frequency to the same branch at the tightest options; "
        "`times a flow at each point` is the time over the number of points and that of one flow "
        "with monodromy matrix, the mean of every tenth point. "
        "AUTO-07p's times are from another 2-core machine; see tests/bench/data/README.md."
    ),
    "Special points": (
        "Of the 1-DOF branch against an independent shooting code that prints ten digits, and "
        "what AUTO-07p makes of them at its NTST."
    ),
    "Profile": "Share of each subject in the time of a branch, under a profiler.",
    "Grazing": "One period of the 1-DOF model with a touch of the given depth, default options.",
    "First call": "Seconds in a new process.",
    "Plain simulation at equal error": (
        "Forcing periods per second of processor time on one core, without derivatives, where the "
        "median error over a period is 1e-8, interpolated between settings; a fastest setting that "
        "is better counts as it is. Empty: the error is not reached."
    ),
    "Plain simulation": "The settings behind it, from coarse to the first below 1e-8.",
    "Plain simulation at the resonance": (
        "Of the 4-DOF model, forcing periods per second of processor time, default options."
    ),
    "Threads": (
        "Simulations on threads of one process, the fastest of three runs by the wall clock. "
        "Below one busy core per thread other programs had the rest; the last column compares "
        "periods per second of processor time, which shows what the threads cost each other."
    ),
}


def machine() -> str:
    """The machine and the versions in one sentence."""
    name = platform.processor() or platform.machine()
    info = Path("/proc/cpuinfo")
    if info.is_file():
        lines = [x for x in info.read_text("utf-8").splitlines() if x.startswith("model name")]
        name = lines[0].split(":", 1)[1].strip() if lines else name
    load = f", load {os.getloadavg()[0]:.1f} at the end" if hasattr(os, "getloadavg") else ""
    versions = [f"Python {sys.version.split()[0]}"]
    for package in PACKAGES:
        try:
            versions.append(f"{package} {version(package)}")
        except PackageNotFoundError:
            versions.append(f"no {package}")
    return (
        f"nldyn {software_version()} on {name} ({os.cpu_count()} cores{load}), one thread; "
        + ", ".join(versions)
        + "."
    )


def markdown(rows: Sequence[Row]) -> str:
    """A table in markdown."""
    if not rows:
        return "Nothing was measured."
    titles = list(rows[0])
    lines = ["| " + " | ".join(titles) + " |", "|" + " --- |" * len(titles)]
    lines += ["| " + " | ".join(row[title] for title in titles) + " |" for row in rows]
    return "\n".join(lines)


def write_page(
    tables: Mapping[str, Sequence[Row]], models: Sequence[str], seconds: float, folder: Path
) -> Path:
    """Write every table as CSV and all of them as ``page.md``.

    Parameters
    ----------
    tables : mapping of str to rows
        Tables by title, see `NOTES`.
    models : sequence of str
        Models with a diagram in the folder.
    seconds : float
        Time of the whole benchmark.
    folder : Path
        Where to write.
    """
    parts = ["# Speed against error", machine(), f"Measured in {seconds:.0f} s."]
    for title, rows in tables.items():
        columns = list(rows[0]) if rows else []
        file = folder / f"{title.lower().replace(' ', '_')}.csv"
        write_table(file, columns, ([row[c] for c in columns] for row in rows))
        parts += [f"## {title}", NOTES[title], markdown(rows)]
        if title == "Targets":
            parts += [f"![Speed against error of {m}](work_precision_{m}.png)" for m in models]
    page = folder / "page.md"
    page.write_text("\n\n".join(parts) + "\n", encoding="utf-8")
    return page
