"""Read the text of a scene."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from nldyn.base.errors import SceneError
from nldyn.scene.checks import check_scene
from nldyn.scene.faults import check_regular, lower_first, unreadable
from nldyn.scene.followed import followed_parameter
from nldyn.scene.messages import from_validation, scene_error
from nldyn.scene.schema.scene import Scene
from nldyn.scene.toml_faults import likely_missing

LARGEST_SCENE = 10_000_000  # bytes or letters
_WORD = r"""(?:(?<![\w-])[\w-]++|"(?:[^"\\\n]|\\.)*+"|'[^'\n]*+')"""
MANY_DOTS = re.compile(rf"(?:{_WORD}[ \t]*+\.[ \t]*+){{100}}")


def load_scene(path: str | Path, mesh_folders: Iterable[str | Path] = ()) -> Scene:
    """Read and check a scene file.

    Parameters
    ----------
    path : str or Path
        A TOML file; ``docs/reference/scene.md`` describes its keys. Its mesh is looked for relative
        to the folder of the file.
    mesh_folders : iterable of str or Path
        Folders from which its mesh may come, beside that of the scene and the current one.

    Returns
    -------
    Scene
        The checked scene; nothing is computed yet.

    Raises
    ------
    SceneError
        If the file cannot be read or a key in it is unknown, missing or out of range.

    Examples
    --------
    >>> from nldyn.base.resources import example
    >>> load_scene(example("one_dof.toml")).continuation.range_hz
    [5.0, 90.0]
    """
    file = Path(path)
    try:
        check_regular(file)
        with file.open("rb") as stream:
            content = stream.read(LARGEST_SCENE + 1)
    except (OSError, ValueError) as error:
        raise scene_error(file, (), unreadable(error)) from None
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError:
        raise scene_error(file, (), "is not a TOML file (its text is not UTF-8)") from None
    return parse_scene(text, file, mesh_folders)


def parse_scene(
    text: str, file: str | Path = "scene.toml", mesh_folders: Iterable[str | Path] = ()
) -> Scene:
    """Check the text of a scene.

    Parameters
    ----------
    text : str
        TOML.
    file : str or Path
        Name used in errors; its folder is where the mesh is looked for.
    mesh_folders : iterable of str or Path
        As for `load_scene`.

    Raises
    ------
    SceneError
        As for `load_scene`.

    Examples
    --------
    >>> parse_scene('''
    ... [modal]
    ... frequencies_hz = [13.1]
    ... participation.tip = [0.6]
    ... ''').interface_names
    ['tip']
    """
    file = Path(file)
    if len(text) > LARGEST_SCENE:
        raise scene_error(file, (), f"is larger than {LARGEST_SCENE // 10**6} MB; use a mesh")
    if MANY_DOTS.search(text):  # reading it would take the square of their number
        raise scene_error(file, (), "has a key of more than 100 words with dots between them")
    try:
        tables = tomllib.loads(text)
    except (ValueError, RecursionError) as error:
        likely = likely_missing(text, str(error))
        fault = f"is not valid TOML: {_toml_fault(str(error))}" + (f"; {likely}" if likely else "")
        raise scene_error(file, (), fault) from None
    return scene_from_tables(tables, file, text, mesh_folders)


def scene_from_tables(
    tables: dict[str, Any],
    file: str | Path,
    text: str = "",
    mesh_folders: Iterable[str | Path] = (),
) -> Scene:
    """Check the tables of a scene that have been read from a text or changed since.

    Raises
    ------
    SceneError
        As for `load_scene`.
    """
    file = Path(file)
    try:
        scene = Scene.model_validate(tables)
    except ValidationError as error:
        raise from_validation(file, Scene, error) from None
    scene._file, scene._text = file, text
    try:
        asked = (file.parent, Path(), *mesh_folders)
        scene._mesh_folders = tuple(Path(folder).resolve() for folder in asked)
    except (OSError, ValueError, RuntimeError) as error:  # the last one of links in a circle
        fault = lower_first(str(error))
        raise SceneError(f"a folder for meshes cannot be used: {fault}") from None
    check_scene(scene, file)
    followed_parameter(scene)
    return scene


def _toml_fault(text: str) -> str:
    """What the TOML reader says, told in the words of TOML where it uses Python's."""
    text = lower_first(text).replace("cannot overwrite a value", "a key or table is given twice")
    if "set_int_max_str_digits" in text:
        return "a whole number has thousands of digits"
    declared = re.match(r"cannot declare \((.*?),?\) twice", text)
    if declared is None:
        return text
    name = ".".join(re.findall(r"'(.*?)'", declared[1]))
    return f"the table [{name}] is given twice{text[declared.end() :]}"
