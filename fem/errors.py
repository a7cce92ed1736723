"""The one exception of the package."""


class ModelError(ValueError):
    """A mesh or model that cannot be used; the text is one sentence that names item and place."""


def quoted(names: object) -> str:
    """List names in quotes for an error text, or say that there are none.

    Examples
    --------
    >>> quoted(["beam", "leaf"])
    "'beam', 'leaf'"
    >>> quoted([])
    'none'
    """
    return ", ".join(repr(str(name)) for name in names) or "none"  # type: ignore[attr-defined]
