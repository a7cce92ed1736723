"""What a search beside known branches has tried, and how far it has come."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Tally:
    """What a search beside known branches has tried.

    Parameters
    ----------
    question : str
        Which search it is: its way, its numbers, and the branches it began with.
    given : int
        How many branches were known of the periods and frequencies wanted.
    known : int
        How many branches there were when the last of the frequencies done had been searched.
    done : int
        Frequencies that are done.
    tried, came : int
        How many guesses there were at these, and how many led to an orbit.
    met : frozenset of int
        Branches known that guesses led to which were made of others of them.
    """

    question: str
    given: int
    known: int
    done: int = 0
    tried: int = 0
    came: int = 0
    met: frozenset[int] = frozenset()
