"""Tell faults of files and of lower layers as faults of a scene."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from nldyn.base.errors import KeptWorkError, SceneError
from nldyn.scene.messages import KeyPath, scene_error, tables_at
from nldyn.scene.schema.scene import Scene


@contextmanager
def told_as(scene: Scene, key: KeyPath, *kinds: type[Exception], hint: str = "") -> Iterator[None]:
    """Tell an error of a lower layer as one of this scene's."""
    try:
        yield
    except KeptWorkError:  # the scene has no part in it
        raise
    except kinds as error:
        text = str(error).rstrip(".") + hint
        word, _, rest = text.partition(" ")
        if key and any(word in table.model_fields for table in tables_at(Scene, key)):
            raise scene_error(scene.file, (*key, word), rest) from error
        if word in Scene.model_fields:  # another table
            raise scene_error(scene.file, (word,), rest) from error
        raise scene_error(scene.file, key, text, sep=": ") from error


@contextmanager
def within_component(scene: Scene, name: str) -> Iterator[None]:
    """Tell a fault of the scene of one component as one of the whole scene's."""
    try:
        yield
    except SceneError as error:
        if not name:
            raise
        fault = str(error).removeprefix(f"{scene.file}: ")
        raise scene_error(scene.file, ("components", name), fault, sep=": ") from error


def check_regular(path: Path) -> None:
    """Refuse what is no file: opening a pipe would wait without end, and a device has no end."""
    if path.exists() and not (path.is_file() or path.is_dir()):
        raise ValueError("it is not a regular file")


def unreadable(error: OSError | ValueError | RuntimeError) -> str:
    """Say why a file cannot be opened."""
    if isinstance(error, FileNotFoundError):
        return "does not exist"
    if isinstance(error, IsADirectoryError):
        return "is a folder"
    return f"cannot be read: {lower_first(getattr(error, 'strerror', None) or str(error))}"


def lower_first(text: str) -> str:
    """A text that goes on a sentence."""
    return text[:1].lower() + text[1:]
