"""Ctrl-C behind other errors: compiled code and imports wrap it."""

from __future__ import annotations


def interrupted(error: BaseException | None) -> bool:
    """Whether Ctrl-C is behind an error.

    Examples
    --------
    >>> interrupted(KeyboardInterrupt()), interrupted(ValueError())
    (True, False)
    """
    if error is None or isinstance(error, KeyboardInterrupt):
        return error is not None
    return interrupted(error.__cause__ or error.__context__)
