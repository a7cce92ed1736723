"""The whole benchmark: measure, compare, draw, write."""

from __future__ import annotations

import csv
import math
import time
from collections.abc import Sequence
from importlib import resources
from pathlib import Path

from bench import studies, throughput
from bench.engines import ENGINES, NLDYN
from bench.figures import draw_model
from bench.measure import Sample, measure_engine, setting_label
from bench.models import MODELS, load_flip
from bench.page import Row, write_page
from bench.solids import solid_times
from bench.studies import BranchTime
from bench.targets import (
    all_targets,
    atlas_target,
    fastest_rows,
    impact_target,
    ratio_rows,
    resonance_target,
    search_targets,
    solid_targets,
    throughput_targets,
)
from nldyn.flow.options import FlowOptions
from nldyn.runtime.result_directory import check_directory, result_directory

WANTED = (1e-4, 1e-6, 1e-8, 1e-10)


def run(folder: Path, models: Sequence[str] = MODELS, *, first_call: bool = True) -> Path:
    """Run the benchmark and write its page, tables and diagrams.

    Parameters
    ----------
    folder : Path
        Where to write; it is written whole or not at all.
    models : sequence of str
        Some of `MODELS`.
    first_call : bool
        Whether to time the first call of a process.

    Returns
    -------
    Path
        The page.

    Raises
    ------
    OutputError
        If the folder cannot be written or holds something else.
    """
    check_directory(folder)
    start = time.perf_counter()
    samples = [s for model in models for s in measure_model(model)]
    tell("number of modes, grazing")
    modes = studies.time_modes()
    grazing = studies.grazing_errors()
    branches = []
    profiles = {}
    for task in studies.BRANCHES:
        tell(f"branch of {task.model}")
        branches.append(studies.time_branch(task))
        profiles[task.model] = studies.profile_branch(task)
    tell("impacts with many modes, searches in vain")
    impacts = studies.impact_times()
    searches = studies.vain_searches()
    tell("modes of a solid")
    solids = solid_times()
    tell("sample of the atlas")
    atlas = studies.atlas_times()
    tell("plain simulation, threads")
    resonance = throughput.resonance_rates()
    plain = [r for model in models if model in throughput.MODELS for r in throughput.measure(model)]
    scaling = throughput.scaling()
    tell("first call")
    first = studies.first_call() if first_call else None
    default = setting_label(FlowOptions())
    targets = all_targets(samples, default, branches, modes, grazing, profiles["one_dof"], first)
    targets += throughput_targets(plain)
    targets += [
        resonance_target(resonance),
        impact_target(impacts),
        *search_targets(searches),
        atlas_target(atlas),
        *solid_targets(*solids),
    ]
    rivals = [e.name for e in ENGINES if e.has_monodromy]
    tables: dict[str, Sequence[Row]] = {
        "Targets": [vars(t) for t in targets],
        "Fastest engine": fastest_rows(samples, models, WANTED),
        "Speed at equal error": ratio_rows(samples, models, rivals, WANTED),
        "Number of modes": [
            {
                "modes": str(m.modes),
                "ms": f"{1e3 * m.seconds:.3g}",
                "times the first": f"{m.seconds / modes[0].seconds:.3g}",
                "contacts": str(m.closings),
                "error": f"{m.error:.1e}",
            }
            for m in modes
        ],
        "Impacts with many modes": [
            {
                "modes": str(i.modes),
                "ms for an impact": f"{1e3 * i.seconds:.3g}",
                "times the first": f"{i.seconds / impacts[0].seconds:.3g}",
                "impacts in ten periods": str(i.closings),
            }
            for i in impacts
        ],
        "Searches in vain": [
            {"modes": str(s.modes), "seconds": f"{s.seconds:.1f}", "says": s.said} for s in searches
        ],
        "Sample of the atlas": [
            {
                "model": a.model,
                "orbits followed": str(a.orbits),
                "ms an orbit": f"{1e3 * a.seconds / a.orbits:.1f}",
                "min for all": f"{a.minutes:.0f}",
            }
            for a in atlas
        ],
        "Modes of a solid": [
            {
                "degrees of freedom": str(s.size),
                "what": s.what,
                "processor, s": f"{s.seconds:.0f}",
                "peak memory, GB": f"{s.gigabytes:.2f}",
                "lowest, Hz": f"{s.frequencies_hz[0]:.6g}",
                "highest, Hz": f"{s.frequencies_hz[-1]:.6g}",
            }
            for s in solids
        ],
        "Branches": [*map(branch_row, branches), *auto_times()],
        "Special points": special_point_rows(branches[0]),
        "Profile": [
            {"branch": model, "subject": subject, "share": f"{share:.1%}"}
            for model, shares in profiles.items()
            for subject, share in shares.items()
        ],
        "Grazing": [
            {
                "depth / amplitude": f"{g.depth:.0e}",
                "ms": f"{1e3 * g.seconds:.3g}",
                "state": f"{g.state:.1e}",
                "monodromy": f"{g.monodromy:.1e}",
            }
            for g in grazing
        ],
        "Plain simulation at equal error": throughput.equal_error_table(plain),
        "Plain simulation": throughput.settings_table(plain),
        "Plain simulation at the resonance": [
            {"Hz": f"{hz:g}", "periods per second": f"{rate:.0f}"} for hz, rate in resonance.items()
        ],
        "Threads": throughput.scaling_table(scaling),
        "First call": [
            {"what": what.replace("_", " "), "seconds": f"{seconds:.2f}"}
            for what, seconds in (vars(first) if first else {}).items()
        ],
        "Work and precision": [sample_row(s) for s in samples],
    }
    with result_directory(folder, "bench") as new:
        for model in models:
            extra = auto_flip_points() if model == "one_dof" else {}
            draw_model(samples, model, new, extra)
        page = write_page(tables, models, time.perf_counter() - start, new)
    return folder / page.name


def measure_model(model: str) -> list[Sample]:
    """All engines on one model."""
    flip = load_flip(model)
    found = []
    for engine in ENGINES:
        tell(f"{model}: {engine.name}")
        found += list(measure_engine(engine, flip))
    return found


def tell(what: str) -> None:
    """Say what is being measured."""
    print(what, flush=True)


def sample_row(sample: Sample) -> Row:
    """A measured point as a row of a table."""
    row = {"model": sample.model, "engine": sample.engine, "setting": sample.setting}
    row["ms"] = f"{1e3 * sample.seconds:.4g}" if sample.repeats else ""
    row["repeats"] = str(sample.repeats)
    for error in ("state", "monodromy", "d_omega", "flip"):
        value = getattr(sample, error)
        row[error] = "" if value != value else f"{value:.1e}"
    row["note"] = sample.note.replace("|", "/")
    return row


def branch_row(run: BranchTime) -> Row:
    """A timed branch as a row of a table."""
    low, high = run.task.range_hz
    return {
        "model": run.task.model,
        "engine": NLDYN,
        "range in Hz": f"{low:g}-{high:g}",
        "points": str(run.points),
        "seconds": f"{run.seconds:.2f}",
        "times a flow at each point": f"{run.flows:.2f}",
        "special points": str(run.special),
        "unmatched": str(run.unmatched),
        "error": f"{run.error:.1e}",
    }


def auto_times() -> list[Row]:
    """AUTO-07p's branches as rows of the same table."""
    text = resources.files("bench").joinpath("data/auto_times.csv").read_text("utf-8")
    return [
        {
            "model": row["model"],
            "engine": f"AUTO-07p, NTST {row['ntst']}",
            "range in Hz": row["range_hz"],
            "points": row["points"],
            "seconds": row["seconds"],
            "times a flow at each point": "",
            "special points": "",
            "unmatched": "",
            "error": "",
        }
        for row in csv.DictReader(text.splitlines())
    ]


def auto_flip_points() -> dict[str, list[tuple[float, float]]]:
    """AUTO-07p on the flip of the 1-DOF model: error, and time per point of its branch."""
    exact = load_flip("one_dof").omega / (2.0 * math.pi)
    points = [p for p in studies.published_special_points() if p[0] == "PD"]
    _, _, found = min(points, key=lambda p: abs(p[1] - exact))
    seconds = {
        row["engine"].split()[-1]: float(row["seconds"]) / float(row["points"])
        for row in auto_times()
        if row["model"] == "one_dof"
    }
    curve = [
        (abs(hz / exact - 1.0), seconds[ntst]) for ntst, hz in found.items() if ntst in seconds
    ]
    return {"AUTO-07p (another machine)": curve}


def special_point_rows(run: BranchTime) -> list[Row]:
    """Special points of the 1-DOF branch beside the published ones and AUTO's."""
    rows: list[Row] = []
    for kind, published, auto in studies.published_special_points():
        here = [hz for k, hz in run.located if k == kind]
        ours = min(here, key=lambda hz: abs(hz - published), default=float("nan"))
        row = {"kind": kind, "shooting code": f"{published:.9f} Hz"}
        row["nldyn"] = f"{ours / published - 1.0:.0e}"
        for ntst in ("200", "400", "800", "1600"):
            value = auto.get(ntst)
            row[f"AUTO {ntst}"] = f"{value / published - 1.0:.0e}" if value else "missed"
        rows.append(row)
    return rows
