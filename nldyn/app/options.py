"""Options that several commands have."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

if TYPE_CHECKING:
    from nldyn.longterm.basins import PlaneState


def usable_cores() -> int:
    """How many cores this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


any_path = click.Path(path_type=Path, readable=False)  # what is wrong with it is said later
scene_argument = click.argument("scene", type=any_path, metavar="SCENE.toml")
out_option = click.option(
    "--out",
    required=True,
    type=any_path,
    metavar="DIR",
    help="Directory for the results: new, empty, or of an earlier run.",
)
mesh_option = click.option(
    "--mesh-folder",
    "mesh_folders",
    multiple=True,
    type=any_path,
    metavar="DIR",
    help="Folder from which the mesh may come, beside those of the scene and the current one.",
)
replace_option = click.option(
    "--replace",
    is_flag=True,
    help="Compute anew, and replace what DIR holds of this scene or another one, finished or not.",
)
quiet_option = click.option("--quiet", is_flag=True, help="Show no progress.")
jobs_option = click.option(
    "--jobs",
    type=click.IntRange(1, 1000),
    default=usable_cores,
    show_default="all cores",
    metavar="N",
    help="Processes that share the work; the results do not depend on it.",
)


def count_option(
    name: str, least: int, most: int, default: int | None, help: str, metavar: str | None = "N"
) -> Callable[[Any], Any]:
    """An option that is a whole number."""
    return click.option(
        name, type=click.IntRange(least, most), default=default, metavar=metavar,
        show_default=default is not None, help=help,
    )  # fmt: skip


def number_list(
    _context: click.Context, _parameter: click.Parameter, value: str | None
) -> list[int] | None:
    """Read whole numbers with commas between them, or ranges like 1-10."""
    if value is None:
        return None
    found: set[int] = set()
    for piece in value.split(","):
        first, _dash, last = piece.strip().partition("-")
        if not first.isdecimal() or (last and not last.isdecimal()):
            raise click.BadParameter(f"'{value}' is not a list of whole numbers such as 1-10,20")
        if int(last or first) < int(first):
            raise click.BadParameter(f"'{value}': the range {piece.strip()} runs downwards")
        if int(last or first) - int(first) > 1000:
            raise click.BadParameter(f"'{value}' names more than 1000 numbers")
        found |= set(range(int(first), int(last or first) + 1))
    return sorted(found)


def plane_state(
    _context: click.Context, _parameter: click.Parameter, value: str | None
) -> PlaneState | None:
    """Read what is on an axis, such as displacement:tip."""
    if value is None:
        return None
    quantity, _, name = value.partition(":")
    if quantity not in ("displacement", "velocity") or not name:
        raise click.BadParameter(
            f"'{value}' is neither displacement:INTERFACE nor velocity:INTERFACE"
        )
    return quantity, name


def frequency_option(help: str, *, required: bool = True) -> Callable[[Any], Any]:
    """The option of an excitation frequency in Hz."""
    return click.option(
        "--frequency-hz", type=click.FloatRange(1e-6, 1e12), required=required, metavar="HZ",
        help=help,
    )  # fmt: skip


json_option = click.option(
    "--json", "as_json", is_flag=True, help="Print a summary as JSON instead of text."
)
view_option = click.option(
    "--view",
    type=click.Choice(["motion", "oblique", "front", "top", "side", "isometric"]),
    default="motion",
    show_default=True,
    help="From where the pictures are taken: where the motion is seen best, or with y up.",
)
drawn_modes_option = click.option(
    "--modes",
    callback=number_list,
    metavar="LIST",
    help="Modes to show, such as 1-4,7; all unless given.",
)
