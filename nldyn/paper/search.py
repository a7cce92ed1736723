"""``python -m nldyn.paper.search DIRECTORY [MODEL ...]``: look for branches of the larger models.

Beside the branches of the starts that are known, those in the directory or else the ones that are
kept with the package, it finds others, writes the starts of all into the directory, and reports how
many may be missing. With ``--detour damping=0.5 "natural_frequency_hz[1]=0.99"`` at the end, say,
it does not simulate, but goes by way of a system with these factors, see `by_detour`; with
``--pseudo-orbits 3`` it puts pieces of known orbits together, with the seed 3, see
`by_pseudo_orbits`; with ``--crossover 3`` it mixes known orbits, see `by_crossover`; with
``--closed-walks 3`` it puts pieces of random motions together, see `by_closed_walks`; any of these
three at the frequencies and of the periods given: ``--range 18 20.5 --periods 3 3 --spacing 0.003
--tries 700``, say. The directory keeps what is found, and the same command goes on where it was
interrupted (but for following the starts, and for a detour, which keeps its branches only); once it
has ended, it looks for more beside what it has found, from other random states, with a seed if that
is another.
"""

from __future__ import annotations

import argparse
import hashlib
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from nldyn.base.errors import SystemModelError, check_whole
from nldyn.flow.flow_map import flow_of, same_flow
from nldyn.io.branches import load_diagram
from nldyn.io.checkpoint import CheckpointFile
from nldyn.io.store import save
from nldyn.orbits.homotopy import checked_factors
from nldyn.orbits.starts import MOST_COUNT
from nldyn.paper.atlas import CHARTS, LONG, Chart, chart_named
from nldyn.paper.jobs import scene_system
from nldyn.paper.starts import LONGEST, Start, follow_starts, read_starts, starts_path, write_starts
from nldyn.report.console import plain_errors, told_what_is_kept
from nldyn.runtime.files import write_whole
from nldyn.runtime.interruption import answering
from nldyn.runtime.progress import Progress, progress_line
from nldyn.search.by_pseudo_orbits import by_pseudo_orbits
from nldyn.search.diagram import Diagram
from nldyn.search.exploration import Exploration, ExploreOptions, check_spacing, check_walk_states
from nldyn.search.explore import explore
from nldyn.search.extend import range_within
from nldyn.search.homotopy import by_detour
from nldyn.search.mixtures import by_crossover
from nldyn.search.random_walks import by_closed_walks
from nldyn.system.parameters import Parameter

EFFORT = ExploreOptions(spacing=0.01, starts=1, settling=200, rounds=24, passing=24)
WAYS: dict[str, Callable[..., Diagram]] = {  # searches beside known branches, by their options
    "pseudo_orbits": by_pseudo_orbits,
    "crossover": by_crossover,
    "closed_walks": by_closed_walks,
}
MODELS = tuple(chart.name for chart in CHARTS)


def search(name: str, folder: Path, effort: ExploreOptions = EFFORT) -> Exploration:
    """Explore a model, and write the starts that it gives.

    The states at random differ between searches, also of those that begin beside the same starts.
    """
    chart = chart_named(name)
    with progress_line() as report:
        known, place, seed = known_branches(chart, folder, report)
        kept, ended = place.with_suffix(".searched.h5"), place.with_suffix(".searches.csv")
        before = ended.read_text(encoding="utf-8") if ended.exists() else "seed,new branches\n"
        effort = replace(effort, seed=seed + before.count("\n"))
        with told_what_is_kept(kept):
            found = explore(
                scene_system(chart.name), chart.range_hz, LONGEST, effort=effort, options=LONG,
                known=known, progress=report, checkpoint=CheckpointFile(kept),
            )  # fmt: skip
    write_found(found.diagram, chart, folder)
    line = f"{effort.seed},{len(found.diagram.branches) - found.stage.given}\n"
    write_whole(ended, (before + line).encode())
    kept.unlink(missing_ok=True)
    return found


def search_by_detour(name: str, folder: Path, factors: Mapping[str | Parameter, float]) -> Diagram:
    """Look for branches of a model with `by_detour`, and write the starts of all."""
    way = partial(by_detour, factors=factors, max_period=LONGEST)
    return _search_beside(name, folder, "detour", way)


def _search_beside(name: str, folder: Path, way: str, look: Callable[..., Diagram]) -> Diagram:
    """Look for branches of a model beside the known ones, and write the starts of all."""
    chart = chart_named(name)
    with progress_line() as report:
        known, place, _ = known_branches(chart, folder, report)
        kept = place.with_suffix(f".{way}.h5")
        with told_what_is_kept(kept):
            found = look(known, options=LONG, progress=report, checkpoint=CheckpointFile(kept))
    if len(found.branches) > len(known.branches) or not starts_path(name, folder).exists():
        write_found(found, chart, folder)
    kept.unlink(missing_ok=True)
    return found


def known_branches(chart: Chart, folder: Path, progress: Progress) -> tuple[Diagram, Path, int]:
    """Branches that the starts known lead to, their file, and a number made of these starts."""
    path = starts_path(chart.name, folder)
    starts = read_starts(chart.name, folder) if path.exists() else read_starts(chart.name)
    place, seed = branches_path(chart, folder, starts)
    if not place.exists():
        doubled = (LONGEST, LONG.max_points)
        system = scene_system(chart.name)
        known = follow_starts(system, starts, chart.range_hz, LONG, doubled, progress, whole=True)
        save(known, place)
    known = load_diagram(place)
    if not _is_of(known, chart):
        raise SystemModelError(f"{folder}: {place.stem}* are of another model; delete them")
    return known, place, seed


def write_found(found: Diagram, chart: Chart, folder: Path) -> None:
    """Write the starts of branches, and the branches for the next search."""
    write_starts(starts_path(chart.name, folder), found.branches)
    save(found, branches_path(chart, folder, read_starts(chart.name, folder))[0])


def branches_path(chart: Chart, folder: Path, starts: Sequence[Start]) -> tuple[Path, int]:
    """File of the branches through some starts, named after these, and a number made of them."""
    texts = [f"{s.period} {s.frequency_hz!r} {s.state.tolist()}" for s in starts]
    digest = hashlib.sha256("\n".join(texts).encode()).hexdigest()[:12]
    return folder / f"{chart.name}.{digest}.h5", int(digest, 16)


def _is_of(found: Diagram, chart: Chart) -> bool:
    """Whether branches are of the model as it is now."""
    flow = flow_of(scene_system(chart.name))
    return all(same_flow(branch.points[0].problem.flow, flow) for branch in found.branches)


def factor_of(text: str) -> tuple[str | Parameter, float]:
    """Name and factor of ``damping=0.5``, or parameter and factor of ``stiffness[1]=2``.

    Raises
    ------
    argparse.ArgumentTypeError
        If the text is neither.
    """
    parts = re.fullmatch(r"(\w+)(?:\[(-?\d+)\])?=(.+)", text)
    try:
        if parts is None:
            raise ValueError
        name, index, factor = parts.groups()
        return (Parameter(name, int(index)) if index else name), float(factor)
    except ValueError:
        raise argparse.ArgumentTypeError(
            f"{text!r} is not of the form NAME=FACTOR or NAME[INDEX]=FACTOR"
        ) from None


def seed_of(text: str) -> int:
    """Seed of random numbers.

    Raises
    ------
    argparse.ArgumentTypeError
        If the text is no whole number from zero on.
    """
    if not text.isdecimal():
        raise argparse.ArgumentTypeError(f"{text!r} is no whole number from zero on")
    return int(text)


def way_of(given: argparse.Namespace) -> str | None:
    """Which of the searches beside known branches is asked for, if any."""
    return next((way for way in WAYS if getattr(given, way) is not None), None)


def numbers_of(given: argparse.Namespace) -> dict[str, Any]:
    """Of a search beside known branches: its periods, and what else was given.

    Raises
    ------
    SystemModelError
        For what makes no sense.
    """
    shortest, longest = given.periods or (1, LONGEST)
    if not 1 <= shortest <= longest <= LONGEST:
        raise SystemModelError(
            f"--periods must be two, ascending, from 1 to {LONGEST}; got {shortest} {longest}"
        )
    numbers: dict[str, Any] = {"min_period": shortest, "max_period": longest}
    way = way_of(given)
    if way:
        numbers["seed"] = getattr(given, way)
    if given.range:
        numbers["range_hz"] = tuple(given.range)
    if given.spacing is not None:
        check_spacing("--spacing", given.spacing)
        numbers["spacing"] = given.spacing
    if given.tries is not None:
        check_whole("--tries", given.tries, 1, MOST_COUNT)
        numbers["tries"] = given.tries
    if given.states is not None:
        check_walk_states("--states", given.states, longest)
        numbers["states"] = given.states
    return numbers


def parser_of_command() -> argparse.ArgumentParser:
    """What the command understands."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("directory", type=Path)
    parser.add_argument("models", nargs="*", metavar="MODEL", help=f"of {', '.join(MODELS)}")
    way = parser.add_mutually_exclusive_group()
    way.add_argument(
        "--detour", type=factor_of, nargs="+", action="extend", metavar="NAME=FACTOR",
        help="what is changed there: damping, excitation, or a parameter such as 'stiffness[0]'; "
        "give it after the models",
    )  # fmt: skip
    way.add_argument(
        "--pseudo-orbits",
        type=seed_of,
        metavar="SEED",
        help="put pieces of known orbits together; another seed tries others",
    )
    way.add_argument(
        "--crossover",
        type=seed_of,
        metavar="SEED",
        help="mix known orbits; another seed tries others",
    )
    way.add_argument(
        "--closed-walks",
        type=seed_of,
        metavar="SEED",
        help="put pieces of random motions together; another seed tries others",
    )
    beside = parser.add_argument_group("of any of the last three")
    beside.add_argument(
        "--range", type=float, nargs=2, metavar=("LOW", "HIGH"), help="frequencies in Hz"
    )
    beside.add_argument(
        "--periods", type=int, nargs=2, metavar=("SHORTEST", "LONGEST"), help="1 3 if not given"
    )
    beside.add_argument("--spacing", type=float, help="relative distance of the frequencies")
    beside.add_argument("--tries", type=int, help="guesses of each period at each frequency")
    beside.add_argument("--states", type=int, help="of closed walks, at each frequency")
    return parser


def main() -> None:
    """Search the models named, or all."""
    parser = parser_of_command()
    given = parser.parse_args()
    factors = dict(given.detour or ())
    if given.detour and len(factors) < len(given.detour):
        parser.error("argument --detour: names something twice")
    unknown = set(given.models) - set(MODELS)
    if unknown:
        parser.error(f"unknown model {sorted(unknown)[0]!r} (there are: {', '.join(MODELS)})")
    names = given.models or MODELS
    for name in names if factors else ():
        try:
            checked_factors(scene_system(name), factors)
        except SystemModelError as error:
            parser.error(f"argument --detour: {name}: {error}")
    try:
        numbers = numbers_of(given)
        for name in names:
            range_within(chart_named(name).range_hz, numbers.get("range_hz"))
    except SystemModelError as error:
        parser.error(str(error))
    for option in ("range", "periods", "spacing", "tries"):
        if getattr(given, option) is not None and way_of(given) is None:
            ways = "--pseudo-orbits, --crossover and --closed-walks"
            parser.error(f"argument --{option}: goes only with {ways}")
    if given.states is not None and given.closed_walks is None:
        parser.error("argument --states: goes only with --closed-walks")
    try:
        given.directory.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        parser.error(f"{given.directory} cannot be made: {error.strerror}")
    for name in names:
        with plain_errors():
            print(f"{name}: {said(name, given, factors, numbers)}", flush=True)


def said(
    name: str,
    given: argparse.Namespace,
    factors: Mapping[str | Parameter, float],
    numbers: Mapping[str, Any],
) -> str:
    """What the search of a model has to say, once it is done."""
    folder, way = given.directory, way_of(given)
    if factors:
        found = search_by_detour(name, folder, factors)
    elif way:
        found = _search_beside(name, folder, way, partial(WAYS[way], **numbers))
    else:
        return search(name, folder).report()
    return "\n".join(found.notes)


if __name__ == "__main__":
    answering(main)
