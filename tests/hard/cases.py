"""All hard cases, subject by subject."""

from __future__ import annotations

from hard import (
    chatter,
    continuation,
    damping,
    elements,
    grazing,
    modes,
    resonance,
    rigid,
    stiffness,
    unstable,
)
from hard.case import Case

CASES: tuple[Case, ...] = (
    *stiffness.CASES,
    *grazing.CASES,
    *damping.CASES,
    *unstable.CASES,
    *modes.CASES,
    *chatter.CASES,
    *resonance.CASES,
    *elements.CASES,
    *rigid.CASES,
    *continuation.CASES,
)
