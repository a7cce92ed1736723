"""Families of element types: what a file that names its elements says that they are."""

from __future__ import annotations

import re
from collections.abc import Mapping
from functools import cache

from fem.base.arrays import IntArray
from fem.base.errors import ModelError, quoted

FAMILIES: tuple[tuple[str, str], ...] = (
    (r"CROD|CONROD|CTUBE", "truss"),
    (r"CBAR|CBEAM", "beam"),
    (r"CQUAD[48R]|CTRIA[36R]", "shell"),
    (r"CTETRA|CPYRAM?|CPENTA|CHEXA", "solid"),
    (r"(T2D|T3D)\d.*", "truss"),
    (r"(B2|B3|PIPE|FRAME).*", "beam"),
    (r"(S\d|STRI).*", "shell"),
    (r"M3D.*", "membrane"),
    (r"(CPS|CPE).*", "plane solid"),
    (r"C3D.*", "solid"),
)
"""Patterns of the names of elements of Nastran, Abaqus and CalculiX, and their families."""

FITTING: Mapping[str, frozenset[str]] = {
    "BeamPart": frozenset({"beam"}),
    "TrussPart": frozenset({"truss"}),
    "ShellPart": frozenset({"shell"}),
    "SolidPart": frozenset({"plane solid", "solid"}),
}
"""The families of elements that a part of a model may hold, by the name of its class."""


@cache
def family(element_type: str) -> str:
    """The family of an element type; an empty text for one that no family is known of.

    Examples
    --------
    >>> family("T3D2"), family("S8R"), family("CPS8")
    ('truss', 'shell', 'plane solid')
    """
    found = (name for pattern, name in FAMILIES if re.fullmatch(pattern, element_type.upper()))
    return next(found, "")


def integration(element_type: str) -> str | None:
    """How Abaqus and CalculiX integrate a solid of a type; None for a type of neither.

    Examples
    --------
    >>> integration("C3D20RH"), integration("CPS8"), integration("CHEXA")
    ('reduced', 'full', None)
    """
    found = re.fullmatch(r"(?:C3D|CPS|CPE)\d+([A-Z]*)", element_type.upper())
    if found is None:
        return None
    return "reduced" if "R" in found[1] else "full"


def check_family(owner: str, part: object, kinds: Mapping[str, int]) -> None:
    """Refuse a part whose cells the file says to be of another family.

    Parameters
    ----------
    owner
        The part, for the error text.
    part
        A part of a model.
    kinds
        How many of its cells are of each element type.

    Raises
    ------
    ModelError
        Which names the type and how many there are.

    Examples
    --------
    >>> check_family("rod", object(), {"T3D2": 4})
    """
    fitting = FITTING.get(type(part).__name__)
    if fitting is None:
        return
    for name, count in kinds.items():
        told = family(name)
        if count and told and told not in fitting:
            raise ModelError(
                f"{owner} is a {type(part).__name__}, but {count} of its elements are of type"
                f" {name} ({told}) in the file; a {type(part).__name__} has elements of family"
                f" {quoted(sorted(fitting))}"
            )


def counted(types: Mapping[str, IntArray], elements: IntArray) -> dict[str, int]:
    """How many of some elements are of each type.

    Examples
    --------
    >>> import numpy as np
    >>> counted({"B31": np.array([0, 1, 2])}, np.array([2, 3]))
    {'B31': 1}
    """
    members = set(elements.tolist())
    return {name: len(members.intersection(found.tolist())) for name, found in types.items()}
