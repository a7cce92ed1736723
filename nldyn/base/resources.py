"""Find the example scenes and meshes, in a source checkout as in an installed wheel."""

from __future__ import annotations

from pathlib import Path

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
