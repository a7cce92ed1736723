"""Parameter studies over the keys of a scene: grids, random samples, Latin hypercubes."""

from __future__ import annotations

import copy
import itertools
import json
import math
import tomllib
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Executor
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, get_args

import numpy as np
from pydantic import ValidationError
from scipy.stats import qmc

from nldyn.base.errors import (
    SceneError,
    SystemModelError,
    check_choice,
    check_types,
    check_whole,
    is_finite,
    shown,
)
from nldyn.base.version import software_version
from nldyn.runtime.executors import as_finished, check_execution
from nldyn.scene.build import build_system
from nldyn.scene.case_fingerprints import case_fingerprints
from nldyn.scene.read import load_scene, scene_from_tables
from nldyn.scene.schema.scene import Scene
from nldyn.system.system import System

if TYPE_CHECKING:
    import xarray

Design = Literal["grid", "random", "latin hypercube"]
Measure = Callable[[System], Mapping[str, float]]
Tables = dict[str, Any]

MOST_CASES = 10**6


def parameter_study(
    scene: Scene | str | Path,
    parameters: Mapping[str, Sequence[Any]],
    measure: Measure,
    *,
    design: Design = "grid",
    samples: int | None = None,
    seed: int = 20,
    keep: str | Path | None = None,
    keep_name: str | None = None,
    executor: Executor | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> xarray.Dataset:
    """Vary keys of a scene, measure each system, and give the results as one labelled array.

    Parameters
    ----------
    scene : Scene, str or Path
        The scene, or its file.
    parameters : mapping of str to sequence
        Keys such as ``"damping.modal_ratio"`` or ``"stops.0.gap"`` (tables in a list count from
        zero). For a grid all values of each; for samples the two ends of its range.
    measure : callable
        Takes a `System`, gives numbers by name. Processes and clusters need a function at the top
        of a module.
    design : {"grid", "random", "latin hypercube"}
        Every combination, or samples of the ranges: independent, or with each parameter's range
        covered evenly [McKay, Beckman and Conover 1979]. Samples of a key that takes whole numbers
        only are rounded to the nearest one, so that the ends of its range have half a share.
    samples : int, optional
        How many, of a design that is no grid.
    seed : int
        Of the samples.
    keep : str or Path, optional
        A file to which each case is appended as soon as it is done. The same study goes on with
        it where it was; cases that failed are tried again. A case counts as the same if its tables,
        the content of its mesh file and the measure are: the code of the measure and of functions
        of its own module that it calls, with the values that they use. Functions of other modules
        count by their names.
    keep_name : str, optional
        A name that stands for the measure in `keep`, in place of its code. Needed where a measure
        uses objects whose content cannot be compared; choose another one when it changes.
    executor : concurrent.futures.Executor, optional
        Where to compute; here unless given.
    progress : callable, optional
        Called as ``progress(done, total)`` after each case.

    Returns
    -------
    xarray.Dataset
        One variable for each number measured, nan where the case failed, and ``failure`` with the
        reason or an empty text. Its dimensions are the keys of a grid, or ``case``.

    Raises
    ------
    SceneError
        If a key does not fit the scene or a value is out of range: before anything is computed.
    SystemModelError
        For other input that makes no sense.

    Examples
    --------
    >>> from nldyn import parameter_study
    >>> from nldyn.base.resources import example
    >>> def first_frequency(system):
    ...     return {"f1_hz": system.frequencies_hz[0]}
    >>> found = parameter_study(example("one_dof.toml"),
    ...     {"matrices.stiffness": [[[16877.0]], [[20000.0]]]}, first_frequency)
    >>> found["f1_hz"].values.round(3).tolist()
    [13.129, 14.293]

    References
    ----------
    M. D. McKay, R. J. Beckman, W. J. Conover (1979), *Technometrics* 21, 239-245.
    """
    check_types(**{
        "study: scene": (scene, Scene, str, Path),
        "study: parameters": (parameters, Mapping),
        "study: measure": (measure, Callable),
        "study: design": (design, str),
        "study: keep": (keep, str, Path, None),
        "study: keep_name": (keep_name, str, None),
    })  # fmt: skip
    check_execution(executor, progress)
    scene = scene if isinstance(scene, Scene) else load_scene(scene)
    names = _checked_names(parameters)
    check_whole("study: seed", seed, 0)
    values = _design(parameters, design, samples, seed)
    values, cases = _cases(scene, names, values, rounded=design != "grid")
    label = f"{getattr(measure, '__module__', '')}.{getattr(measure, '__qualname__', measure)}"
    keys, done = [str(k) for k in range(len(cases))], {}
    if keep is not None:
        keys = case_fingerprints(cases, scene.file.parent, measure, keep_name)
        done = _read(keep)
        _check_writable(keep)
    folders = tuple(map(str, scene.mesh_folders))
    task = partial(_measured, str(scene.file), folders, measure)
    _measure_missing(task, keys, cases, done, ("failure", "case", *names), keep, executor, progress)
    return _dataset(
        scene, parameters, design, values, [done[key] for key in keys], label,
        {"design": design, "seed": seed},
    )  # fmt: skip


def _measure_missing(
    task: Callable[[Tables], dict[str, Any]],
    keys: Sequence[str],
    cases: Sequence[Tables],
    done: dict[str, Any],
    taken: Sequence[str],
    keep: str | Path | None,
    executor: Executor | None,
    progress: Callable[[int, int], None] | None,
) -> None:
    """Measure the cases that are not yet among those done, and keep each at once."""
    waiting = [k for k, key in enumerate(keys) if key not in done]
    finished = len(cases) - len(waiting)
    if progress is not None and finished:
        progress(finished, len(cases))
    for outcome in as_finished(task, [cases[k] for k in waiting], executor):
        entry = {"values": outcome.value or {}, "failure": outcome.failure}
        for name in taken:
            if name in entry["values"]:
                raise SystemModelError(f"study: a measured number must not be named '{name}'")
        key = keys[waiting[outcome.index]]
        done[key] = entry
        if keep is not None:
            _append(keep, {"case": key, **entry})
        finished += 1
        if progress is not None:
            progress(finished, len(cases))


def _checked_names(parameters: Mapping[str, Sequence[Any]]) -> list[str]:
    for name in parameters:
        check_types(**{"study: a key of parameters": (name, str)})
        if not all(name.split(".")):
            raise SystemModelError(f"study: a key of parameters has an empty part, got '{name}'")
    if not parameters:
        raise SystemModelError("study: name at least one parameter")
    return list(parameters)


def _cases(
    scene: Scene, names: Sequence[str], values: list[tuple[Any, ...]], *, rounded: bool
) -> tuple[list[tuple[Any, ...]], list[Tables]]:
    """The values of all cases, whole where their keys are, and the tables, checked as scenes."""
    base = tomllib.loads(scene.text)
    if rounded:
        whole = _whole_keys(scene, base, names, values[0])
        values = [
            tuple(round(v) if w else v for v, w in zip(row, whole, strict=True)) for row in values
        ]
    cases = [_with_values(scene, base, names, row) for row in values]
    for tables in cases:
        scene_from_tables(tables, scene.file, mesh_folders=scene.mesh_folders)
    return values, cases


def _measured(
    file: str, mesh_folders: tuple[str, ...], measure: Measure, tables: Tables
) -> dict[str, float]:
    found = measure(build_system(scene_from_tables(tables, file, mesh_folders=mesh_folders)))
    if not isinstance(found, Mapping):
        raise TypeError(f"measure must give numbers by name, got {shown(found)}")
    return {str(name): float(value) for name, value in found.items()}


def _design(
    parameters: Mapping[str, Sequence[Any]], design: str, samples: int | None, seed: int
) -> list[tuple[Any, ...]]:
    """Values of all parameters in each case."""
    for name, given in parameters.items():
        if isinstance(given, str) or not hasattr(given, "__len__") or not len(given):
            raise SystemModelError(f"study: '{name}' must list its values, got {shown(given)}")
    check_choice("study: design", design, get_args(Design))
    if design == "grid":
        if samples is not None:
            raise SystemModelError("study: a grid takes no samples")
        count = math.prod(len(given) for given in parameters.values())
        if count > MOST_CASES:
            raise SystemModelError(f"study: the grid has {count} cases, at most {MOST_CASES}")
        lists = [[_plain(value) for value in given] for given in parameters.values()]
        return list(itertools.product(*lists))
    check_whole("study: samples", samples, 1, MOST_CASES)
    assert samples is not None
    lows, highs = [], []
    for name, given in parameters.items():
        if len(given) != 2 or not all(is_finite(x) for x in given) or not given[0] < given[1]:
            raise SystemModelError(
                f"study: '{name}' needs the two ends of its range, ascending, got {shown(given)}"
            )
        lows.append(float(given[0]))
        highs.append(float(given[1]))
    rng = np.random.default_rng(seed)
    if design == "random":
        unit = rng.random((samples, len(lows)))
    else:
        unit = qmc.LatinHypercube(len(lows), seed=rng).random(samples)
    scaled = np.array(lows) + unit * (np.array(highs) - np.array(lows))
    return [tuple(row) for row in scaled.tolist()]


def _plain(value: Any) -> Any:
    """A value as it would stand in a scene, numbers of numpy as those of Python."""
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    return [_plain(entry) for entry in value] if isinstance(value, list | tuple) else value


def _whole_keys(
    scene: Scene, base: Tables, names: Sequence[str], row: Sequence[float]
) -> list[bool]:
    """Which of the sampled keys the scene takes as whole numbers only."""
    pairs = zip(names, row, strict=True)
    return [_refuses_fractions(_with_values(scene, base, [name], [value])) for name, value in pairs]


def _refuses_fractions(tables: Tables) -> bool:
    try:
        Scene.model_validate(tables)
    except ValidationError as error:
        return any(detail["type"] == "int_type" for detail in error.errors())
    return False


def _with_values(scene: Scene, base: Tables, names: Sequence[str], row: Sequence[Any]) -> Tables:
    """Tables of the scene with the values of one case."""
    tables = copy.deepcopy(base)
    for name, value in zip(names, row, strict=True):
        place: Any = tables
        *above, last = name.split(".")
        for part in above:
            place = _entered(scene, place, part, name)
        if isinstance(place, list):
            index = _index(scene, place, last, name)
            place[index] = value
        else:
            place[last] = value
    return tables


def _entered(scene: Scene, place: Any, part: str, name: str) -> Any:
    if isinstance(place, list):
        return place[_index(scene, place, part, name)]
    if not isinstance(place, dict) or not isinstance(place.get(part), dict | list):
        raise SceneError(f"{scene.file}: '{name}' names no key of the scene: no '{part}' there")
    return place[part]


def _index(scene: Scene, place: list[Any], part: str, name: str) -> int:
    if not part.isdigit() or int(part) >= len(place):
        raise SceneError(
            f"{scene.file}: '{name}' names no key of the scene: '{part}' is not one of "
            f"0 to {len(place) - 1}"
        )
    return int(part)


def _check_writable(keep: str | Path) -> None:
    try:
        Path(keep).open("ab").close()
    except OSError as error:
        raise SystemModelError(f"{keep}: cannot be written: {error}") from None


def _read(keep: str | Path) -> dict[str, dict[str, Any]]:
    """Cases of a file that succeeded; a last line that was cut off is left out."""
    try:
        lines = Path(keep).read_text(encoding="utf-8").splitlines()
    except FileNotFoundError:
        return {}
    except (OSError, UnicodeDecodeError) as error:
        raise SystemModelError(f"{keep}: cannot be read: {error}") from None
    return {
        entry["case"]: {"values": entry["values"], "failure": ""}
        for entry in _entries(lines, keep)
        if not entry["failure"]
    }


def _entries(lines: Sequence[str], keep: str | Path) -> Iterator[dict[str, Any]]:
    for number, line in enumerate(lines):
        try:
            entry = json.loads(line)
            _ = entry["case"], entry["values"], entry["failure"]
        except (json.JSONDecodeError, KeyError, TypeError):
            if number == len(lines) - 1:
                return
            raise SystemModelError(
                f"{keep}: line {number + 1} is not a case of a study; name another file"
            ) from None
        yield entry


def _append(keep: str | Path, entry: Mapping[str, Any]) -> None:
    """Append a case; a last line that was cut off gives way to it."""
    text = json.dumps(entry) + "\n"
    with Path(keep).open("a+b") as file:
        file.seek(0)
        whole = file.read()
        if not whole.endswith(b"\n"):
            file.truncate(whole.rfind(b"\n") + 1)
        file.write(text.encode())


def _dataset(
    scene: Scene,
    parameters: Mapping[str, Sequence[Any]],
    design: str,
    values: Sequence[tuple[Any, ...]],
    entries: Sequence[Mapping[str, Any]],
    label: str,
    attributes: Mapping[str, Any],
) -> xarray.Dataset:
    import xarray

    names = list(parameters)
    measured = sorted({name for entry in entries for name in entry["values"]})
    columns: dict[str, Any] = {
        name: np.array([entry["values"].get(name, math.nan) for entry in entries])
        for name in measured
    }
    columns["failure"] = np.array([entry["failure"] for entry in entries], dtype=object)
    if design == "grid":
        shape = tuple(len(parameters[name]) for name in names)
        data = {name: (names, column.reshape(shape)) for name, column in columns.items()}
        coordinates = {name: (name, _labels(parameters[name])) for name in names}
    else:
        data = {name: (["case"], column) for name, column in columns.items()}
        coordinates = {
            name: ("case", np.array([row[k] for row in values])) for k, name in enumerate(names)
        }
    return xarray.Dataset(
        data,
        coords=coordinates,
        attrs={
            "scene": str(scene.file),
            "measure": label,
            "software": f"nldyn {software_version()}",
            **attributes,
        },
    )


def _labels(given: Sequence[Any]) -> Any:
    """Values of a parameter as labels: as they are if they are numbers or texts, else in words."""
    if all(isinstance(value, int | float | str | np.number) for value in given):
        return np.array(given)
    return np.array([str(np.asarray(value).tolist()) for value in given])
