"""How much work a diagram will be, as far as one can tell while it is computed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

# What follows a search, in units of the search at one frequency, found with the examples: it takes
# as long to follow the branches of so many orbits that were found, or of flips, some of which
# belong to the same branch.
ONE_ORBIT = {1: 0.25}
ONE_LONGER_ORBIT = 0.5
ONE_FLIP = 0.55
ONE_SEED = 2.0
LIKELY_ORBITS = 1.5  # of each period at each frequency
LIKELY_FLIPS = 2.0  # for each frequency


@dataclass
class Outlook:
    """The parts of the work on a diagram: how many things there are, or likely are, in each.

    Parameters
    ----------
    periods : sequence of int
        Those wanted.
    places : int
        Frequencies searched.
    seeds : int
        Further searches.

    Examples
    --------
    >>> outlook = Outlook([1], 12)
    >>> outlook.reach("search", 12)
    >>> outlook.orbits(1, 12)
    >>> outlook.done
    0.8
    """

    periods: Sequence[int] = ()
    places: int = 0
    seeds: int = 0
    weights: dict[str, float] = field(default_factory=dict)
    counts: dict[str, float] = field(default_factory=dict)
    reached: dict[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self._weigh("search", 1.0, self.places)
        self._weigh("seeds", ONE_SEED, self.seeds)
        for period in self.periods:
            self._weigh(f"1/{period}", _one_orbit(period), LIKELY_ORBITS * self.places)
            if 2 * period in self.periods:
                self._weigh(f"flips to 1/{2 * period}", ONE_FLIP, LIKELY_FLIPS * self.places)

    def _weigh(self, part: str, weight: float, count: float) -> None:
        self.weights[part], self.counts[part] = weight, count
        self.reached[part] = 0

    @property
    def done(self) -> float:
        """Share of the work that is done."""
        total = sum(self.weights[part] * self.counts[part] for part in self.weights)
        done = sum(self.weights[part] * self.reached[part] for part in self.weights)
        return done / total if total else 0.0

    def orbits(self, period: int, count: int) -> None:
        """So many orbits of a period are found, in a first search or a second one."""
        part = f"1/{period}"
        first = not self.reached[part]
        self.counts[part] = count if first else self.counts[part] + count

    def orbit_done(self, period: int) -> tuple[str, int]:
        """The part of an orbit's branch that is followed, and how many are by now."""
        part = f"1/{period}"
        return part, int(self.reached[part]) + 1

    def flips(self, period: int, count: int) -> str:
        """So many flips lead to a period; the part that they are."""
        part = f"flips to 1/{period}"
        self._weigh(part, ONE_FLIP, count)
        return part

    def reach(self, part: str, count: int) -> None:
        """So much of a part is done."""
        self.counts[part] = max(self.counts.setdefault(part, count), count)
        self.weights.setdefault(part, 1.0)
        self.reached[part] = count


def _one_orbit(period: int) -> float:
    return ONE_ORBIT.get(period, ONE_LONGER_ORBIT)
