"""Springs that act all the time, between interfaces or to the ground."""

from __future__ import annotations

from dataclasses import dataclass

from nldyn.system.elements import _finite, check_ends


@dataclass(frozen=True)
class Spring:
    """Linear spring from an interface to the ground, or to another interface.

    It becomes part of the linear structure, exactly. `modal_damping` stays that of the structure
    without it.

    Parameters
    ----------
    at : str
        Interface.
    stiffness : float
        In N/m; a negative one must leave the structure stable.
    against : str, optional
        Interface at the other end; the ground unless given.

    Raises
    ------
    SystemModelError
        For a stiffness that is no finite number, or one interface at both ends.

    Examples
    --------
    >>> from nldyn import System
    >>> chain = System.from_matrices([[1.0, 0.0], [0.0, 1.0]], [[1.0, 0.0], [0.0, 1.0]],
    ...     {"a": [1.0, 0.0], "b": [0.0, 1.0]}, springs=[Spring("a", 1.5, "b")])
    >>> chain.linear.frequencies_hz.round(6).tolist()  # 1/(2 pi) and 2/(2 pi)
    [0.159155, 0.31831]
    """

    at: str
    stiffness: float
    against: str | None = None

    def __post_init__(self) -> None:
        check_ends("spring", self.at, self.against)
        _finite(f"spring at '{self.at}'", "stiffness", self.stiffness)
