"""How much work a diagram will be, as far as one can tell while it is computed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

SEARCH, CONTACT = "search", "search for contact"

# What follows a search, in units of the search at one frequency, found with the examples: so long
# it takes to follow the branch of an orbit that was found, or of a flip; many have the same one.
ONE_HARMONIC_ORBIT, ONE_ORBIT, ONE_DOUBLED_ORBIT = 0.4, 0.9, 0.1
ONE_FLIP = 0.55
ONE_SEED = 2.0
LIKELY_ORBITS = 1.0  # of each period at each frequency
FLIPS_OF_ORBIT = 2.0  # for each orbit of the doubled period


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
    again : float
        How much longer than the search another one is, which looks for orbits with contact unless
        one is found before.

    Examples
    --------
    >>> outlook = Outlook([1], 10)
    >>> outlook.reach("search", 10)
    >>> outlook.found(1, 10)
    >>> outlook.done == 10 / (10 + 10 * ONE_HARMONIC_ORBIT)
    True
    """

    periods: Sequence[int] = ()
    places: int = 0
    seeds: int = 0
    again: float = 0.0
    weights: dict[str, float] = field(default_factory=dict)
    counts: dict[str, float] = field(default_factory=dict)
    reached: dict[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self._weigh(SEARCH, 1.0, self.places)
        self._weigh(CONTACT, self.again, self.places)
        self._weigh("seeds", ONE_SEED, self.seeds)
        for period in self.periods:
            self._weigh(f"1/{period}", self._one_orbit(period), 0.0)
            self.found(period, LIKELY_ORBITS * self.places)

    def _weigh(self, part: str, weight: float, count: float) -> None:
        self.weights[part], self.counts[part] = weight, count
        self.reached[part] = 0

    @property
    def done(self) -> float:
        """Share of the work that is done."""
        total = sum(self.weights[part] * self.counts[part] for part in self.weights)
        done = sum(self.weights[part] * self.reached[part] for part in self.weights)
        return done / total if total else 0.0

    def found(self, period: int, count: float) -> None:
        """So many orbits of a period are found in all, or likely will be."""
        self.counts[f"1/{period}"] = max(count, self.reached[f"1/{period}"])
        if period in self.doubled:
            self._weigh(f"flips to 1/{period}", ONE_FLIP, FLIPS_OF_ORBIT * count)

    @property
    def doubled(self) -> list[int]:
        """The periods whose branches are followed from flips of other ones, too."""
        return [p for p in self.periods if p % 2 == 0 and p // 2 in self.periods]

    def orbit_done(self, period: int) -> tuple[str, int]:
        """The part of an orbit's branch that is followed, and how many are by now."""
        part = f"1/{period}"
        return part, int(self.reached[part]) + 1

    def flips(self, period: int, count: int) -> str:
        """So many flips lead to a period; the part that they are."""
        part = f"flips to 1/{period}"
        self.weights[part], self.counts[part] = ONE_FLIP, count
        self.reached[part] = min(self.reached.get(part, 0.0), count)
        return part

    def searched(self, part: str, frequencies: Sequence[float], done: int) -> None:
        """So many of the frequencies are searched; lower ones, with more contacts, take longer."""
        times = [hz**-0.5 for hz in frequencies]
        self.reach(part, self.places * sum(times[:done]) / sum(times))

    def touched(self) -> None:
        """An orbit with contact is found, so that there is no search for one."""
        self.counts[CONTACT] = self.reached[CONTACT]

    def reach(self, part: str, count: float) -> None:
        """So much of a part is done."""
        self.counts[part] = max(self.counts.setdefault(part, count), count)
        self.weights.setdefault(part, 1.0)
        self.reached[part] = count

    def _one_orbit(self, period: int) -> float:
        if period == 1:
            return ONE_HARMONIC_ORBIT
        return ONE_DOUBLED_ORBIT if period in self.doubled else ONE_ORBIT
