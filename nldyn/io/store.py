"""Results in files: one way to write them, and one to read them again."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from nldyn.base.errors import SystemModelError, shown
from nldyn.branches.branch import Branch
from nldyn.curves.backbone import Backbone
from nldyn.curves.curves import Curve
from nldyn.io import branches as branch_files
from nldyn.io import curves as curve_files
from nldyn.io.branches import (
    load_branches,
    load_diagram,
    load_exploration,
    save_branches,
    save_diagram,
    save_exploration,
)
from nldyn.io.curves import (
    is_self_excited,
    load_curves,
    load_self_excited,
    save_backbone,
    save_curves,
    save_self_excited,
)
from nldyn.io.flow import Laws
from nldyn.io.hdf5 import kind_of
from nldyn.orbits.orbit import Orbit
from nldyn.search.diagram import Diagram
from nldyn.search.exploration import Exploration

Result = Branch | Diagram | Exploration | Curve | Backbone


def save(result: Result | Sequence[Branch] | Sequence[Curve], path: str | Path) -> None:
    """Write a result to an HDF5 file that `load` reads, whole or not at all.

    Parameters
    ----------
    result : Branch, Diagram, Exploration, Curve or Backbone, or a list of branches or of curves
        What to write, to the last digit.
    path : str or Path
        The file.

    Raises
    ------
    OutputError
        If the file cannot be written.
    SystemModelError
        For anything else, and if the points of a branch are of different systems.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> from nldyn import System, Unbalance, continue_branch, load, solve_orbit
    >>> system = System.from_modal([13.1], {"middle": [0.635]}, modal_damping=0.0142,
    ...     excitation=[Unbalance("middle", 4.92e-6)])
    >>> branch = continue_branch(solve_orbit(system, frequency_hz=10.0), (9.0, 12.0))
    >>> path = Path(tempfile.mkdtemp()) / "resonance.h5"
    >>> save(branch, path)
    >>> load(path)[0].frequency_hz.tolist() == branch.frequency_hz.tolist()
    True
    """
    if isinstance(result, Exploration):
        save_exploration(path, result)
    elif isinstance(result, Diagram) and any(map(is_self_excited, result.branches)):
        save_self_excited(path, result.branches, result)
    elif isinstance(result, Diagram):
        save_diagram(path, result)
    elif isinstance(result, Branch):
        save([result], path)
    elif isinstance(result, Backbone):
        save_backbone(path, result)
    elif isinstance(result, Curve):
        save_curves(path, [result])
    elif _all(result, Branch) and any(map(is_self_excited, result)):  # type: ignore[arg-type]
        save_self_excited(path, result)  # type: ignore[arg-type]
    elif _all(result, Branch):
        save_branches(path, result)  # type: ignore[arg-type]
    elif _all(result, Curve):
        save_curves(path, result)  # type: ignore[arg-type]
    else:
        raise SystemModelError(
            "save: the result must be a branch, a diagram, an exploration, a curve, a backbone, or "
            f"a list of branches or of curves, got {shown(result)}"
        )


def _all(result: object, kind: type) -> bool:
    """Whether something is a list of things of a kind."""
    return (
        isinstance(result, list | tuple)
        and bool(result)
        and all(isinstance(each, kind) for each in result)
    )


def load(
    path: str | Path,
    *,
    laws: Laws | None = None,
    monitor: Callable[[Orbit], float] | None = None,
) -> Diagram | Exploration | list[Branch] | list[Curve | Branch | Backbone]:
    """Read what `save` wrote, or what a running computation keeps; the file knows its kind.

    Parameters
    ----------
    path : str or Path
        The file.
    laws : mapping of int to callable, optional
        Contact laws of the user's own by the number of their stop: a file holds numbers, no code.
    monitor : callable, optional
        The user's own function that was held constant along curves.

    Returns
    -------
    Diagram, Exploration, list of Branch or list of Curve, or of one Backbone
        With the numbers of what was saved; branches and curves go on as those could.

    Raises
    ------
    SystemModelError
        If the file is none of these, is damaged, or was written by a later version; if a law or
        the monitor is missing or is another one.

    Examples
    --------
    >>> load("nowhere.h5")
    Traceback (most recent call last):
        ...
    nldyn.base.errors.SystemModelError: nowhere.h5: there is no such file
    """
    format_, holds = kind_of(path)
    if format_ == curve_files.FORMAT and holds.intersection(branch_files.LIMITS):
        return load_self_excited(path, laws=laws)
    if format_ == curve_files.FORMAT:
        return load_curves(path, laws=laws, monitor=monitor)
    if format_ != branch_files.FORMAT:
        raise SystemModelError(f"{path}: is not a file of results of nldyn")
    if "exploration" in holds:
        return load_exploration(path, laws=laws)
    if holds.intersection(branch_files.LIMITS):
        return load_diagram(path, laws=laws)
    return load_branches(path, laws=laws)
