"""Time histories for other programs: tables, MATLAB, universal files."""

from __future__ import annotations

import csv
import tempfile
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from scipy.io import savemat

from nldyn.base.arrays import SLACK
from nldyn.base.errors import SystemModelError, check_types
from nldyn.base.optional import optional
from nldyn.orbits.history import History
from nldyn.runtime.files import check_writable, write_whole
from nldyn.system.naming import moment_unit

SI_UNITS = {
    "type": 164,
    "units_code": 1,
    "units_description": "SI",
    "temp_mode": 1,
    "length": 1.0,
    "force": 1.0,
    "temp": 1.0,
    "temp_offset": 273.15,
}
TIME_RESPONSE, SCALAR = 1, 0  # kind of function and direction in dataset 58
TIME, DISPLACEMENT, REACTION = 17, 8, 9  # kinds of data in it
LABEL, LINE = 20, 80  # longest texts in it


def write_history(history: History, path: str | Path) -> None:
    """Write a time history for other programs, whole or not at all.

    The ending of the name chooses the format:

    - ``.csv``: the columns of `History.table` with all their digits.
    - ``.mat``: MATLAB's level 5; ``time_s`` (k, 1), ``displacement_m`` (k, n_interfaces) and the
      ``interfaces``, ``penetration_m`` and ``force_n`` (k, n_stops), ``modal`` and
      ``modal_velocity`` (k, n). Of rotations ``displacement_rad``, ``penetration_rad`` and
      ``force_n_m``; where only some are, ``displacement`` and so on, with ``displacement_units``.
    - ``.uff``: a universal file (ASCII) with a dataset 58 for the displacement of each interface,
      and for the penetration and the force of each stop; it keeps 12 digits of values and, as
      the format has it, six of times. It needs the extra ``uff``.

    Parameters
    ----------
    history : History
        Of an orbit or of a motion.
    path : str or Path
        The file.

    Raises
    ------
    SystemModelError
        For another ending, or if pyuff is not installed.
    OutputError
        If the file cannot be written.

    Examples
    --------
    >>> from nldyn import System, Unbalance, solve_orbit
    >>> from nldyn.io import write_history
    >>> system = System.from_modal([13.1], {"middle": [0.635]}, modal_damping=0.0142,
    ...     excitation=[Unbalance("middle", 4.92e-6)])
    >>> history = solve_orbit(system, frequency_hz=10.0).history()
    >>> import tempfile
    >>> from pathlib import Path
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write_history(history, Path(folder, "orbit.csv"))
    ...     text = Path(folder, "orbit.csv").read_text()
    >>> text.splitlines()[0]
    'time_s,displacement_m[middle],modal[0],modal_velocity[0]'
    """
    check_types(**{"write_history: history": (history, History)})
    target = check_writable(path)
    write = FORMATS.get(target.suffix.lower())
    if write is None:
        raise SystemModelError(
            f"write_history: '{target.name}' must end in one of {', '.join(FORMATS)}"
        )
    with tempfile.TemporaryDirectory() as folder:
        draft = Path(folder, "history").with_suffix(target.suffix.lower())
        write(history, draft)
        write_whole(target, draft.read_bytes())


def write_csv(history: History, path: Path) -> None:
    """The columns, with all their digits."""
    write_pieces([history], path)


def write_pieces(histories: Iterable[History], path: Path) -> None:
    """Pieces of a history one after the other as a CSV file; see `Motion.histories`."""
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        for number, history in enumerate(histories):
            columns = history.table()
            if number == 0:
                writer.writerow(columns)
            writer.writerows(np.column_stack([*columns.values()]).tolist())


def write_mat(history: History, path: Path) -> None:
    """The arrays, and the names of the interfaces as a cell array."""
    content = {
        "time_s": history.time[:, None],
        "interfaces": np.array([*history.displacement], dtype=object),
        **with_units("displacement", history.displacements, [*history.units.values()]),
        **with_units("penetration", history.penetration, history.stop_units),
        **with_units("force", history.force, [*map(moment_unit, history.stop_units)], "N"),
        "modal": history.modal,
        "modal_velocity": history.modal_velocity,
    }
    savemat(str(path), content, oned_as="row")


def with_units(name: str, values: Any, units: Sequence[str], usual: str = "m") -> dict[str, Any]:
    """An array whose name tells the unit of its columns, or with their units beside it.

    Examples
    --------
    >>> [list(with_units("force", None, units)) for units in (["N m"], ["N", "N m"])]
    [['force_n_m'], ['force', 'force_units']]
    """
    kinds = set(units) or {usual}
    if len(kinds) > 1:
        return {name: values, f"{name}_units": np.array(units, dtype=object)}
    return {f"{name}_{kinds.pop().lower().replace(' ', '_')}": values}


def write_uff(history: History, path: Path) -> None:
    """The datasets 164 (units) and 58 (functions) of a universal file."""
    pyuff = optional("pyuff", "a file that ends in .uff")
    made = [
        (f"displacement {name}", history.units[name], DISPLACEMENT, values, node)
        for node, (name, values) in enumerate(history.displacement.items(), 1)
    ]
    for stop, (depth, force, unit) in enumerate(
        zip(history.penetration.T, history.force.T, history.stop_units, strict=True), 1
    ):
        made.append((f"penetration stop {stop - 1}", unit, DISPLACEMENT, depth, stop))
        made.append((f"force stop {stop - 1}", moment_unit(unit), REACTION, force, stop))
    sets = [SI_UNITS, *(function(history.time, *one) for one in made)]
    pyuff.UFF(str(path)).write_sets(sets, "overwrite")


def function(time: Any, name: str, unit: str, kind: int, values: Any, node: int) -> dict[str, Any]:
    """A dataset 58: values at times, of a numbered interface or stop."""
    plain = name.encode("ascii", "replace").decode()
    step = (time[-1] - time[0]) / (time.size - 1)
    even = np.allclose(np.diff(time), step, rtol=SLACK, atol=0.0)
    return {
        "type": 58,
        "binary": 0,
        "func_type": TIME_RESPONSE,
        "id1": plain[:LINE],
        "rsp_node": node,
        "rsp_dir": SCALAR,
        "ref_node": 0,
        "ref_dir": SCALAR,
        "abscissa_spacing": int(even),
        "abscissa_spec_data_type": TIME,
        "abscissa_axis_lab": "time",
        "abscissa_axis_units_lab": "s",
        "ordinate_spec_data_type": kind,
        "ordinate_axis_lab": plain[:LABEL],
        "ordinate_axis_units_lab": unit,
        "orddenom_spec_data_type": 0,
        "z_axis_spec_data_type": 0,
        "x": time,
        "data": values,
    }


FORMATS: dict[str, Callable[[History, Path], None]] = {
    ".csv": write_csv,
    ".mat": write_mat,
    ".uff": write_uff,
}
