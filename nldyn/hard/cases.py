"""All hard cases, subject by subject."""

from __future__ import annotations

from nldyn.hard import stiffness
from nldyn.hard.case import Case

CASES: tuple[Case, ...] = (*stiffness.CASES,)
