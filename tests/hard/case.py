"""What a hard case is, and what became of it."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass


@dataclass(frozen=True)
class Measured:
    """The error of a case, and what else is worth telling.

    Parameters
    ----------
    error : float
        In the measure that the case names; nan counts as failed.
    note : str
        What stands behind the number.
    """

    error: float
    note: str = ""


@dataclass(frozen=True)
class Case:
    """One hard case.

    Parameters
    ----------
    subject : str
        Heading under which it stands.
    name : str
        What is computed.
    hard : str
        What is hard about it.
    reference : str
        What it is compared with, and where that comes from.
    bound : float
        Largest error with which it passes.
    bound_from : str
        Why the bound is what it is.
    run : callable
        Computes the case and gives its error.
    quick : bool
        Whether the tests run it, too.
    fault : str
        Why it is known to fail; empty where it passes.
    """

    subject: str
    name: str
    hard: str
    reference: str
    bound: float
    bound_from: str
    run: Callable[[], Measured]
    quick: bool = True
    fault: str = ""


@dataclass(frozen=True)
class Result:
    """What became of a case.

    Parameters
    ----------
    case : Case
        The case.
    measured : Measured
        Its error; nan with the reason as its note where it could not be computed.
    seconds : float
        Processor time.
    """

    case: Case
    measured: Measured
    seconds: float

    @property
    def passed(self) -> bool:
        """Whether the error is a number within the bound."""
        return math.isfinite(self.measured.error) and self.measured.error <= self.case.bound
