"""What every engine is asked for: a `Job`."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from bench.models import Sensitivities
from nldyn.base.arrays import Real


class EngineError(RuntimeError):
    """An engine gave up."""


@dataclass(frozen=True)
class Job:
    """One period to be computed.

    Parameters
    ----------
    run : callable
        Does the work; this is timed.
    read : callable
        Takes what `run` gave to physical results; this is not.
    """

    run: Callable[[], Any]
    read: Callable[[Any], Sensitivities]


Prepared = Callable[[Real, float], Job]
