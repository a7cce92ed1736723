"""A block that is pulled to and fro against a spring and friction, in closed form.

The pull is cos ωt, the stiffness and the mass are 1; friction is `share` as it slides and `rest` as
it rests. J. P. Den Hartog (1931), Trans. ASME 53, APM-53-9, 107-115; S. W. Shaw (1986), J. Sound
Vib. 108, 305-325.
"""

import math

import numpy as np
from scipy.optimize import brentq


def response(ratio):
    """Den Hartog's response and damping functions V and U."""
    angle = math.pi / ratio
    return 1.0 / (1.0 - ratio**2), math.sin(angle) / (ratio * (1.0 + math.cos(angle)))


class Swing:
    """Sliding for a `time` from rest at `top` to rest at `-top`, with friction `share`.

    It begins at the phase at which friction at rest no longer holds, by `drop` more than `share`.
    The speed at the end is zero for one such phase; for that of all sizes the place is right.
    """

    def __init__(self, ratio, time, drop):
        self.ratio, self.time, self.drop = ratio, time, drop
        size, turn = response(ratio)[0], ratio * time
        by_sine = math.cos(time) - math.cos(turn)
        by_cosine = ratio * math.sin(time) - math.sin(turn)
        least = drop * math.sin(time) / (size * ratio * math.hypot(by_sine, by_cosine))
        angle = math.atan2(by_cosine, by_sine)  # sin(phase + angle) is to be `least`
        both = [math.asin(least) - angle, math.pi - math.asin(least) - angle]
        self.phase = next(p % math.tau for p in both if 0.0 < p % math.tau < math.pi)
        self.c = drop + (1.0 - size) * math.cos(self.phase)
        self.d = ratio * size * math.sin(self.phase)
        self.share = -0.5 * (drop + math.cos(self.phase) + self.from_share(time))
        self.top = self.share + drop + math.cos(self.phase)

    def from_share(self, time):
        angle, size = self.phase + self.ratio * time, response(self.ratio)[0]
        return size * math.cos(angle) + self.c * math.cos(time) + self.d * math.sin(time)

    def speed(self, time):
        angle, size = self.phase + self.ratio * time, response(self.ratio)[0]
        turned = -self.ratio * size * np.sin(angle)
        return turned - self.c * np.sin(time) + self.d * np.cos(time)

    @property
    def rests(self):
        """Share of the time at rest."""
        return 1.0 - self.ratio * self.time / math.pi

    @property
    def slope(self):
        """Change of the place where it stops by that where it began, as the speed is zero there."""
        size, ratio, time = response(self.ratio)[0], self.ratio, self.time
        sine, cosine = math.sin(self.phase), math.cos(self.phase)
        by_phase = size * (
            -math.sin(self.phase + ratio * time)
            + sine * math.cos(time)
            + ratio * cosine * math.sin(time)
        )
        return math.cos(time) - by_phase / sine

    @property
    def possible(self):
        """Whether friction at rest holds it where it stops, and it does not stop before."""
        held = self.top + math.cos(self.phase + self.ratio * self.time)
        inside = np.linspace(0.0, self.time, 200)[1:-1]
        return abs(held) <= self.share + self.drop and bool((self.speed(inside) < 0.0).all())


def with_two_stops(ratio, share, rest=None):
    """The one motion with two stops a cycle."""
    drop = 0.0 if rest is None else rest - share

    def off(time):
        try:
            return Swing(ratio, time, drop).share - share
        except (ValueError, StopIteration):
            return math.nan

    times = np.linspace(0.0, math.pi / ratio, 500)[1:-1]
    gaps = [off(time) for time in times]
    found = [
        Swing(ratio, brentq(off, a, b, xtol=1e-15), drop)
        for a, b, before, behind in zip(times, times[1:], gaps, gaps[1:], strict=False)
        if before * behind <= 0.0
    ]
    (swing,) = [swing for swing in found if swing.possible]
    return swing
