"""What the tests send to processes and clusters: functions that can be pickled by name."""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from typing import TYPE_CHECKING

if TYPE_CHECKING:  # a process that needs neither loads nothing
    from nldyn import FlowMap, System


def square(value: float) -> float:
    if value == 3:
        raise ValueError("three is refused")
    return value**2


def die(value: int) -> int:
    if value == 1:
        os._exit(1)
    return value


def worker(value: int) -> tuple[int, int]:
    time.sleep(0.2)
    return value, os.getpid()


def frequencies(system: System) -> dict[str, float]:
    if system.stops[0].gap > 0.9e-3:
        raise ValueError("the gap is too large")
    return {"f1_hz": system.frequencies_hz[0], "gap": system.stops[0].gap}


def lossy_spring(depth: float, speed: float) -> tuple[float, float, float]:
    """A law of the user's own: 5e7 N/m, with a force that grows with the speed."""
    return 5e7 * depth * (1.0 + 0.1 * speed), 5e7 * (1.0 + 0.1 * speed), 5e6 * depth


def doubled(flow: FlowMap, number: int, look: Callable[[], None] | None = None) -> int:
    assert type(flow).__name__ == "FlowMap"
    return 2 * number


def die_elsewhere(flow: FlowMap, process: int, look: Callable[[], None] | None = None) -> str:
    if os.getpid() != process:
        os._exit(1)
    return "here"
