"""Find the example scenes and meshes, in a source checkout as in an installed wheel."""

from __future__ import annotations

import re
import shutil
import tomllib
from difflib import get_close_matches
from pathlib import Path

from nldyn.base.errors import SceneError

BESIDE = re.compile(r'"\.\./\.\./meshes/([\w.-]+)"')  # how example scenes name their meshes
PACKAGE = Path(__file__).resolve().parents[1]  # nldyn/


def data_directory() -> Path:
    """Give the folder that holds ``docs/examples`` and ``meshes``.

    Returns
    -------
    Path
        The package's own data folder if it was installed from a wheel, else the checkout.

    Raises
    ------
    FileNotFoundError
        If neither holds the examples.

    Examples
    --------
    >>> (data_directory() / "docs" / "examples").is_dir()
    True
    """
    for folder in (PACKAGE / "_data", PACKAGE.parent):
        if (folder / "docs" / "examples").is_dir():
            return folder
    raise FileNotFoundError("the example scenes of nldyn are not installed beside it")


def examples() -> list[str]:
    """Give the names of the example scenes.

    Examples
    --------
    >>> "one_dof.toml" in examples()
    True
    """
    return sorted(path.name for path in (data_directory() / "docs" / "examples").glob("*.toml"))


def example(name: str) -> Path:
    """Give the path of an example scene.

    Parameters
    ----------
    name : str
        One of `examples`.

    Raises
    ------
    FileNotFoundError
        If there is no such example; the message lists them.

    Examples
    --------
    >>> example("one_dof.toml").name
    'one_dof.toml'
    """
    return _existing(data_directory() / "docs" / "examples" / name, "*.toml")


def example_titles() -> dict[str, str]:
    """Give the names of the example scenes, without their ending, and their titles.

    Examples
    --------
    >>> example_titles()["one_dof"]
    '1-DOF model'
    """
    texts = {name: example(name).read_text(encoding="utf-8") for name in examples()}
    return {
        name.removesuffix(".toml"): str(tomllib.loads(text).get("title", ""))
        for name, text in texts.items()
    }


def copy_example(name: str, directory: str | Path | None = None) -> Path:
    """Copy an example scene into a folder, with its mesh beside it.

    Parameters
    ----------
    name : str
        One of `examples`, with or without its ending.
    directory : str or Path, optional
        Where to, made if it does not exist; by default a new folder with the name of the example.

    Returns
    -------
    Path
        The scene; it names its mesh as the file beside it.

    Raises
    ------
    SceneError
        If there is no such example, or a file would be overwritten or cannot be written.

    Examples
    --------
    >>> import tempfile
    >>> scene = copy_example("two_dof_xi_0.01", tempfile.mkdtemp())
    >>> sorted(path.name for path in scene.parent.iterdir())
    ['half_beam.msh', 'two_dof_xi_0.01.toml']
    """
    stem = name.removesuffix(".toml")
    if f"{stem}.toml" not in examples():
        known = [each.removesuffix(".toml") for each in examples()]
        longer = [each for each in known if stem and each.startswith(stem.lower())]
        guess = longer or get_close_matches(stem.lower(), known, n=1)
        hint = f"did you mean {guess[0]!r}? There" if guess else "there"
        raise SceneError(f"there is no example {stem!r}; {hint} are {', '.join(known)}")
    source = example(f"{stem}.toml")
    text = source.read_text(encoding="utf-8")
    folder = Path(stem if directory is None else directory)
    target = folder / source.name
    meshes = {mesh(found): folder / found for found in BESIDE.findall(text)}
    try:
        for path in (target, *meshes.values()):
            if path.exists():
                raise SceneError(f"{path}: is there already; choose another folder")
        folder.mkdir(parents=True, exist_ok=True)
        for path, copy in meshes.items():
            shutil.copyfile(path, copy)
        target.write_text(BESIDE.sub(r'"\1"', text), encoding="utf-8")
    except OSError as error:
        fault = (error.strerror or str(error)).lower()
        raise SceneError(f"{folder}: cannot be written to: {fault}") from None
    return target


def mesh(name: str) -> Path:
    """Give the path of a mesh that comes with the package.

    Parameters
    ----------
    name : str
        For example ``half_beam.msh``.

    Raises
    ------
    FileNotFoundError
        If there is no such mesh; the message lists them.

    Examples
    --------
    >>> mesh("half_beam.msh").name
    'half_beam.msh'
    """
    return _existing(data_directory() / "meshes" / name, "*beam.*")


def _existing(path: Path, pattern: str) -> Path:
    if not path.is_file():
        names = ", ".join(sorted(entry.name for entry in path.parent.glob(pattern)))
        raise FileNotFoundError(f"there is no {path.name}; there are {names}")
    return path
