"""Why a branch or a curve ends."""

from __future__ import annotations

import re
from enum import Enum


class Ending(Enum):
    """Why a continuation stopped, with the sentence that tells it.

    Examples
    --------
    >>> reason = Ending.MOST_POINTS.told(points=100)
    >>> reason, reason.ending is Ending.MOST_POINTS
    ('100 points', True)
    """

    NOT_FINISHED = "not finished"
    RANGE_END = "end of the frequency range"
    NO_ORBIT_AT_RANGE_END = "end of the range of {parameter}, where no orbit was found"
    AMPLITUDE_RANGE_END = "end of the range of amplitudes"
    BEGINS_AT = "begins at an amplitude of {place}"
    PARAMETER_RANGE_END = "end of the range of {parameter}"
    SCALES_TO_REST = "the orbits shrink in proportion to {parameter}, to rest where it is zero"
    HOPF = "the limit cycle shrinks to rest at {place}, a Hopf point"
    CLOSED_BRANCH = "closed branch"
    CLOSED_CURVE = "closed curve"
    JOINS = "joins the branch of period {period} at the flip at {place}"
    MEETS_HALF_PERIOD = (
        "meets the branch of period {period} beyond {place}, where no orbit of that period was "
        "found"
    )
    MEETS_HALF_PERIODS = "meets orbits of period {period}"
    MEETS_OPEN_END = "meets another branch where that was broken off"
    COMES_BACK = (
        "comes back to where it had been at {place}: on the way it left the branch for another one "
        "that lies too near"
    )
    BEGINS_AT_FLIP = "begins at the flip at {place}"
    FLIP = "a flip"
    RESONANCE = "becomes a curve of neutral saddles at a resonance"
    EXTREME_VANISHES = "the extreme that grazes meets another one, and both vanish"
    DISSOLVED = "the branch point dissolves, as the symmetry does that brings it about"
    CORNER = "a stop is grazed, where the curve has a corner that is not followed"
    OTHER_EXTREME = "another extreme gets as large as the one held, where that has a corner"
    GROWS = "grows without bound towards {place}, where an undamped mode resonates"
    LOST_IN_ROUNDING = (
        "the orbit at {place} is lost in rounding, which moves it by {share} of its size"
    )
    GRAZES_RIGID = "grazes a rigid stop at {place}, where a multiplier tends to infinity"
    TO_REST = (
        "one more impact grazes at each of ever closer {what}: near {place} they become a "
        "series without end, behind which the motion comes to rest"
    )
    JUST_STICKS = (
        "what slides at '{at}' just comes to rest at {place}: friction drops at once, so that "
        "motions beyond it are not alike"
    )
    JUST_SLIPS = (
        "what sticks at '{at}' is only just pulled loose at {place}, where a multiplier tends to "
        "infinity, since friction drops at once"
    )
    STICKS = (
        "what slides at '{at}' slides less and less, up to none at all: from near {place} on it "
        "sticks all the time"
    )
    BEGINS_TO_SLIDE = (
        "what sticks all the time at '{at}' begins to slide at {place}: it sticks in one of many "
        "places, and from there on in others or none"
    )
    FAILS = "what lies beyond {place} could not be computed: {obstacle}"
    MOST_POINTS = "{points} points"
    SHORT_STEP = "step below {step}: {obstacle}"
    OTHER = "{sentence}"  # of an earlier version

    def told(self, **values: object) -> StopReason:
        """The sentence, with what fills its gaps."""
        reason = str.__new__(StopReason, self.value.format(**values))
        reason.ending, reason.values = self, {name: str(value) for name, value in values.items()}
        return reason


def _pattern(ending: Ending) -> re.Pattern[str]:
    parts = re.split(r"\{(\w+)\}", ending.value)
    parts[::2] = map(re.escape, parts[::2])
    parts[1::2] = [f"(?P<{name}>.*?)" for name in parts[1::2]]
    return re.compile("".join(parts), re.DOTALL)


_PATTERNS = {  # the first one that fits is it
    ending: _pattern(ending) for ending in Ending
}


class StopReason(str):
    """The sentence that tells why a branch or a curve ends.

    Attributes
    ----------
    ending : Ending
        Which one it is.
    values : dict of str to str
        What fills its gaps.

    Examples
    --------
    >>> StopReason("step below 1e-05: Newton's method did not converge").values["step"]
    '1e-05'
    """

    ending: Ending
    values: dict[str, str]

    def __new__(cls, sentence: str) -> StopReason:
        """Read a sentence, as files hold it."""
        self = super().__new__(cls, sentence)
        for ending, pattern in _PATTERNS.items():
            if match := pattern.fullmatch(sentence):
                self.ending, self.values = ending, match.groupdict()
                break
        return self

    @property
    def broken_off(self) -> bool:
        """Whether the branch goes on behind its end."""
        return self.ending in BROKEN_OFF

    @property
    def closes(self) -> bool:
        """Whether the branch or curve ends where it began."""
        return self.ending in (Ending.CLOSED_BRANCH, Ending.CLOSED_CURVE)


BROKEN_OFF = (
    Ending.SHORT_STEP, Ending.MOST_POINTS, Ending.FAILS, Ending.GROWS, Ending.LOST_IN_ROUNDING,
)  # fmt: skip
StopReasons = tuple[StopReason, StopReason]


def has_ending(reasons: StopReasons, ending: Ending) -> bool:
    """Whether one of the reasons is of this kind."""
    return any(reason.ending is ending for reason in reasons)
