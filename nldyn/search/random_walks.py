"""Guesses: closed walks among random states, which need resemble no known orbit."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from itertools import islice

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array
from scipy.spatial import KDTree

from nldyn.base.arrays import Real
from nldyn.branches.branch import Branch
from nldyn.flow.flow_map import FlowMap
from nldyn.orbits.axis import Section
from nldyn.orbits.newton import spread
from nldyn.orbits.shooting import SEGMENTS_PER_PERIOD, shooting_problem
from nldyn.orbits.starts import SHORT_STEPS, nearest_orbit, random_states, reach, simulate
from nldyn.search.collector import Collector
from nldyn.search.exploration import MOST_NUMBERS, check_walk_states
from nldyn.search.extend import (
    WINDOW,
    Guesses,
    Place,
    check_numbers,
    distance_from,
    orbits_near,
)

NEIGHBOURS = 20  # states near an image to which a walk may go on
MOTIONS = 10  # from rest and from random states, that help to tell where states may lie
MOTION_PERIODS = 10, 10  # before these, and of these
NARROWEST = 1e-3  # standard deviation added in each coordinate, over its own
LEAST = 1e-6  # and over the size of all
MOST_DRAWS = 100  # of as many states as are wanted
AT_ONCE = 32  # states from which walks are counted together


@dataclass(frozen=True)
class ClosedWalks:
    """A strategy of `extend_diagram`: to guess along closed walks among random states.

    At each frequency random states are carried over one excitation period. From each an edge goes
    to the twenty nearest to its image: a graph like that of the cell-to-cell mapping [Hsu 1987],
    with points for cells. A closed walk of n edges is a pseudo-orbit of period n, and in a
    hyperbolic set an orbit is near every one whose jumps are small [Bowen 1975]. Known orbits near
    the frequency, and ten motions of ten periods, only tell where states may lie: these have their
    mean and covariance, by which nearness is measured, and are no deeper in a stop than the deepest
    of them, or than a standard deviation beyond the mean. So an orbit need not resemble a known
    one, nor need a motion come near it; orbits are met the less often the less stable they are, and
    many modes need many states. That all branches given were met is no proof that there are no
    others, since their orbits have helped to place the states.

    Parameters
    ----------
    states : int
        How many random states at each frequency; fewer are found where hundreds of stops press.
    tries : int
        Most walks of each length at each frequency, one through each of so many states through
        which there is one.
    seed : int
        Of the random numbers; another one tries others.

    Raises
    ------
    SystemModelError
        For numbers that make no sense.

    Examples
    --------
    >>> ClosedWalks(states=1000, tries=50)
    ClosedWalks(states=1000, tries=50, seed=0)
    """

    states: int = 5000
    tries: int = 500
    seed: int = 0

    what = "closed walks"
    of_known = False

    def __post_init__(self) -> None:
        self.check(1)
        check_numbers(self, self.tries)

    def check(self, longest: int) -> None:
        """Raise unless walks so long can be counted among so many states."""
        check_walk_states("ClosedWalks: states", self.states, longest)

    def guesses(self, box: Collector, branches: Sequence[Branch], place: Place) -> Guesses:
        """No branch, and the orbit near each walk if that is in the range."""
        here, rng = place.here, place.rng
        flow, omega = here.flow, here.omega
        asked = partial(box.tell, self.what, here.value)
        asked()
        known = _known_states(here, branches, rng)
        if not len(known):  # every motion failed, and no orbit is known
            return
        graph = StateGraph.of(flow, omega, Cloud.of(flow, known), self.states, rng, asked)
        one_period = shooting_problem(flow, 1)
        for period in place.periods:
            for walk in islice(graph.closed_walks(period, rng), self.tries):
                asked()
                nodes = np.array([spread(one_period, graph.states[at], omega) for at in walk])
                nodes = here.to_base(nodes.reshape(period, SEGMENTS_PER_PERIOD, -1))
                orbit = nearest_orbit(here, nodes, box.observe, SHORT_STEPS)
                yield set(), box.within([orbit])


def _known_states(here: Section, branches: Sequence[Branch], rng: np.random.Generator) -> Real:
    """States (k, 2n) at phase zero of some motions at a value, and of known orbits near it."""
    flow, omega = here.flow, here.omega
    starts = random_states(flow, omega, MOTIONS, int(rng.integers(2**31)))
    runs = simulate(flow, omega, starts, *MOTION_PERIODS).runs
    reaching = [branch for branch in branches if distance_from(branch, here) <= WINDOW]
    orbits = [orbit for branch in reaching for orbit in orbits_near(branch, here)]
    known = [here.states_of(orbit) for orbit in orbits]
    return np.vstack([np.empty((0, flow.system.state_size)), *runs, *known])


@dataclass(frozen=True, eq=False)
class Cloud:
    """Where random states lie: they are normally distributed, but not deep in a stop.

    Parameters
    ----------
    mean : (2n,) array
        Of all.
    axes : (2n, 2n) array
        Lower Cholesky factor of their covariance, which is made a little wider, so that there is
        one whatever states are known.
    rows : (m, 2n) array
        Give the displacement into each stop from a state.
    deepest : (m,) array
        Largest of these that are wanted.
    """

    mean: Real
    axes: Real
    rows: Real
    deepest: Real

    @classmethod
    def of(cls, flow: FlowMap, states: Real) -> Cloud:
        """As some states (k, 2n) lie: their mean and covariance, no deeper in a stop than they.

        Or than a standard deviation beyond the mean, so that there is room whatever the stops.
        """
        size = float(np.abs(states).max()) or reach(flow.system) or 1.0
        mean, covariance = states.mean(axis=0), np.cov(states.T / size, bias=True)
        added = NARROWEST**2 * np.diag(covariance) + LEAST**2
        axes = np.asarray(np.linalg.cholesky(covariance + np.diag(added)), dtype=float)
        around = [flow.rows[rows] for rows in flow.round_rows.values()]  # on all sides
        rows = np.vstack([flow.rows[: len(flow.system.stops)], *around, *(-r for r in around)])
        beyond = rows @ mean + size * np.linalg.norm(rows @ axes, axis=1)
        return cls(mean, size * axes, rows, np.maximum((states @ rows.T).max(axis=0), beyond))

    def states(self, count: int, rng: np.random.Generator) -> Real:
        """Random states (count, 2n); fewer where hardly any is shallow enough at all stops."""
        found = np.empty((0, self.mean.size))
        for _ in range(MOST_DRAWS):
            if len(found) >= count:
                break
            more = self.mean + rng.standard_normal((count, self.mean.size)) @ self.axes.T
            allowed = np.all(more @ self.rows.T <= self.deepest, axis=1)
            found = np.vstack([found, more[allowed]])
        return found[:count]

    def scaled(self, states: Real) -> Real:
        """States (k, 2n) in the metric of the covariance."""
        return np.asarray(np.linalg.solve(self.axes, states.T).T)


@dataclass(frozen=True, eq=False)
class StateGraph:
    """Random states, and from each an edge to those nearest to its image one period later.

    Nearness is that of the metric of their covariance.

    Parameters
    ----------
    states : (m, 2n) array
        States z at phase zero.
    successors : (m, k) int array
        Indices of the states nearest to the image of each.
    """

    states: Real
    successors: NDArray[np.intp]

    @classmethod
    def of(
        cls,
        flow: FlowMap,
        omega: float,
        cloud: Cloud,
        count: int,
        rng: np.random.Generator,
        asked: Callable[[], None] = lambda: None,
    ) -> StateGraph:
        """Of so many random states at ω (rad/s); none of those that cannot be carried on."""
        kept, images = [], []
        for state in cloud.states(count, rng):
            asked()
            found = flow.strobe(state, omega, 1)
            if not found.failure:
                kept.append(state)
                images.append(found.ends[0].copy())  # the whole has matrices, too
        if not kept:
            return cls(np.empty((0, cloud.mean.size)), np.empty((0, 0), dtype=np.intp))
        states = np.array(kept)
        tree = KDTree(cloud.scaled(states))
        nearest = range(1, min(NEIGHBOURS, len(states)) + 1)
        successors = tree.query(cloud.scaled(np.array(images)), nearest)[1]
        return cls(states, np.asarray(successors))

    @cached_property
    def edges(self) -> csr_array:
        """Matrix (m, m) with a one for each edge."""
        count, out = self.successors.shape
        places = self.successors.ravel(), np.arange(0, count * out + 1, out)
        return csr_array((np.ones(count * out), *places), shape=(count, count))

    def closed_walks(self, length: int, rng: np.random.Generator) -> Iterator[list[int]]:
        """A closed walk of so many edges through one state after the other, if there is one.

        The states come in random order, and each closed walk through one is as likely as another:
        the step to a state has a weight in proportion to the number of walks from there back to
        the start, which powers of the matrix of the edges give. Only their ratios matter; a walk
        may be overlooked where other states have 1e300 times as many back to its start.
        """
        count = len(self.states)
        order = rng.permutation(count)
        at_once = max(1, min(AT_ONCE, MOST_NUMBERS // max(1, count * length)))
        for first in range(0, count, at_once):
            starts = order[first : first + at_once]
            back = np.zeros((length + 1, count, starts.size))  # walks of each length to each start
            back[0, starts, np.arange(starts.size)] = 1.0
            for steps in range(1, length + 1):
                ways = self.edges @ back[steps - 1]
                back[steps] = ways / np.maximum(ways.max(axis=0), np.finfo(float).tiny)
            for column, start in enumerate(starts.tolist()):
                if back[length, start, column]:
                    yield self._walk(start, back[:length, :, column], rng)

    def _walk(self, start: int, back: Real, rng: np.random.Generator) -> list[int]:
        """States of a walk from one back to it, given the weights (length, m) of all on the way."""
        walk = [start]
        for weights in back[:0:-1]:
            onward = self.successors[walk[-1]]
            chances = weights[onward]
            walk.append(int(rng.choice(onward, p=chances / chances.sum())))
        return walk
