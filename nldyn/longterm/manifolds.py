"""Stable manifolds of saddles, which separate basins, and the saddles on the edge between two."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from functools import partial

import numpy as np

from nldyn.base.arrays import Real
from nldyn.base.errors import SystemModelError, check_types, check_whole, is_finite, shown
from nldyn.flow.flow_map import FlowMap
from nldyn.longterm.basins import Basins, StatePlane
from nldyn.longterm.neighbourhoods import UNDECIDED, Target, settle, target_of
from nldyn.orbits.orbit import Orbit, same_orbit, stroboscopic
from nldyn.orbits.starts import near_returns, orbit_near
from nldyn.runtime.executors import check_execution, values_of
from nldyn.runtime.progress import of_number, shows_progress

NEWTON_STEPS = 12
STEP_HALVINGS = 10
FIRST = 1e-5  # how far the first, straight piece reaches, as a share of the plane
HALVINGS = 30
LINGER = 64  # periods for which a motion from the edge is followed
MARGIN = 1.0  # how far beyond the plane a manifold is followed, in units of its sides
SOLVED, LONGEST_STEP = 1e-10, 0.2  # Newton's steps, in units of the plane


@shows_progress(of_number("pieces"))
def stable_manifold(
    orbit: Orbit,
    plane: StatePlane,
    *,
    resolution: float = 0.005,
    max_points: int = 20000,
    executor: Executor | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> list[Real]:
    """Stable manifold of a saddle of a system with one mode, in a plane of initial states.

    A short piece along the stable eigenvector is taken back in time, again and again: its inverse
    image under the map over the orbit's period is longer by the inverse of the stable multiplier,
    and errors across the manifold shrink. Inverse images come from Newton's method with the exact
    Jacobian. Where they lie too far apart, points are put between, which come all the way from
    the short piece: on the chord of two others they would be off the manifold.

    Parameters
    ----------
    orbit : Orbit
        With one multiplier outside the unit circle and one inside.
    plane : StatePlane
        Displacement and velocity, such as `StatePlane.at_interface` gives.
    resolution : float
        Largest distance of neighbouring points, in units of the sides of the plane.
    max_points : int
        Where to stop.
    executor : concurrent.futures.Executor, optional
        Where to compute, each piece by itself; here unless given.
    progress : callable, optional
        Called as ``progress(done, total)`` after each piece.

    Returns
    -------
    list of (k, 2) arrays
        Coordinates in the plane of the connected pieces, on both sides of each stroboscopic state
        of the orbit. A piece ends where it leaves the plane by more than a side.

    Raises
    ------
    SystemModelError
        If the system has more than one mode, or the orbit is no saddle, or for other input that
        makes no sense.

    Examples
    --------
    >>> from nldyn import StatePlane, Stop, System, Unbalance, solve_orbit
    >>> from nldyn.longterm import stable_manifold
    >>> system = System.from_matrices([[2.48]], [[16877.0]], {"middle": [1.0]},
    ...     modal_damping=0.0142, stops=[Stop("middle", stiffness=5.17e9)],
    ...     excitation=[Unbalance("middle", 4.92e-6)])
    >>> saddle = solve_orbit(system, frequency_hz=50.0)
    >>> plane = StatePlane.at_interface(system, (-2e-4, 0.0), (-0.05, 0.05))
    >>> len(stable_manifold(saddle, plane, max_points=100))
    2
    """
    check_types(orbit=(orbit, Orbit), plane=(plane, StatePlane))
    check_execution(executor, progress)
    flow = orbit.problem.flow
    if flow.system.size != 1:
        raise SystemModelError(
            f"stable_manifold needs one mode, whose saddles have a curve as stable manifold; the "
            f"system has {flow.system.size} (basin_edge finds where it cuts a plane)"
        )
    if not (is_finite(resolution) and 0.0 < resolution < 1.0):
        raise SystemModelError(f"resolution must lie between 0 and 1, got {shown(resolution)}")
    check_whole("max_points", max_points, 2)
    if plane.origin.size != 2:
        raise SystemModelError(
            f"plane: states have {plane.origin.size} entries but the orbit's system needs 2"
        )
    outside = int(np.sum(np.abs(orbit.multipliers) > 1.0))
    if outside != 1:
        raise SystemModelError(
            f"the orbit at {orbit.frequency_hz:g} Hz is no saddle: {outside} of its two "
            "multipliers lie outside the unit circle"
        )
    count = orbit.period if min(orbit.multipliers.real) > 0.0 else 2 * orbit.period
    budget = max_points // (2 * orbit.period)
    task = partial(_piece, flow, orbit.omega, count, plane, resolution, budget)
    sides = [(state, side) for state in stroboscopic(orbit) for side in (1.0, -1.0)]
    return values_of(task, sides, executor, progress)


def _piece(
    flow: FlowMap, omega: float, count: int, plane: StatePlane, resolution: float, budget: int,
    begin: tuple[Real, float],
) -> Real:  # fmt: skip
    """The piece of a stable manifold on one side of a saddle's state z."""
    state, side = begin
    inverse = _Inverse(flow, omega, count, plane)
    middle = inverse.to_plane(state)
    values, vectors = np.linalg.eig(inverse.jacobian(middle))
    stable = int(np.argmin(np.abs(values)))
    along = np.real(vectors[:, stable])
    along *= side * FIRST / float(np.linalg.norm(along))
    piece = _Preimages(inverse, middle, along, abs(float(np.real(values[stable]))))
    return inverse.to_user(_grown(piece, resolution, budget))


class _Inverse:
    """The map over some periods and its inverse, in coordinates from 0 to 1 within a plane."""

    def __init__(self, flow: FlowMap, omega: float, periods: int, plane: StatePlane) -> None:
        self.flow, self.omega, self.plane = flow, omega, plane
        self.phases = np.linspace(0.0, 2.0 * np.pi * periods, periods + 1)
        (x0, x1), (y0, y1) = plane.x_range, plane.y_range
        self.low = np.array([x0, y0])
        self.sides = np.array([x1 - x0, y1 - y0])
        modal = np.column_stack([plane.x * self.sides[0], plane.y * self.sides[1]])
        self.to_z = flow.to_state(modal.T).T
        self.offset = flow.to_state(plane.origin + plane.x * x0 + plane.y * y0)

    def to_plane(self, state: Real) -> Real:
        return np.asarray(np.linalg.solve(self.to_z, state - self.offset))

    def to_user(self, points: Real) -> Real:
        return np.asarray(self.low + points * self.sides)

    def image(self, point: Real) -> tuple[Real, Real] | None:
        """Image of a point and the Jacobian there; None where the flow map fails."""
        state = self.offset + self.to_z @ point
        found = self.flow.shoot(state[None], self.phases, self.omega, chained=True)
        if found.failure:
            return None
        jacobian = np.linalg.solve(self.to_z, found.monodromy @ self.to_z)
        return self.to_plane(found.ends[-1]), np.asarray(jacobian, dtype=float)

    def jacobian(self, point: Real) -> Real:
        found = self.image(point)
        assert found is not None
        return found[1]

    def __call__(self, point: Real, guess: Real) -> Real | None:
        """The point that is mapped to a given one, by Newton's method; None if none is found.

        Whole steps are fastest, but may go round in a circle: at a grazing contact the Jacobian
        turns within a short way. Then a step is halved until it brings the image nearer.
        """
        found = self._newton(point, guess, 1)
        return self._newton(point, guess, STEP_HALVINGS) if found is None else found

    def _newton(self, point: Real, guess: Real, tries: int) -> Real | None:
        here, there = guess, self.image(guess)
        for _ in range(NEWTON_STEPS):
            if there is None:
                return None
            image, jacobian = there
            step = np.linalg.solve(jacobian, point - image)
            size = float(np.linalg.norm(step))
            if not math.isfinite(size):
                return None
            if size < SOLVED:
                return np.asarray(here + step)
            step *= min(1.0, LONGEST_STEP / size)
            for _ in range(tries):
                there = self.image(here + step)
                if tries == 1 or (there and _distance(point, there[0]) < _distance(point, image)):
                    break
                step *= 0.5
            else:
                return None
            here = here + step
        return None


class _Preimages:
    """Points of a stable manifold, each an inverse image of one next to the saddle.

    Between the ends ``middle + along * shrink`` (share 0) and ``middle + along`` (share 1) lies a
    fundamental piece of the straight line that touches the manifold; its k-th inverse images, for
    all k, follow one another along the manifold.
    """

    def __init__(self, inverse: _Inverse, middle: Real, along: Real, shrink: float) -> None:
        self.inverse, self.middle, self.along, self.shrink = inverse, middle, along, shrink

    def first(self, share: float) -> Real:
        """The point next to the saddle."""
        return np.asarray(self.middle + self.along * self.shrink ** (1.0 - share))

    def chain(self, share: float, near: Sequence[Real]) -> list[Real] | None:
        """A point next to the saddle and its inverse images, as many as a chain near it has."""
        points = [self.first(share)]
        for guess in near[1:]:
            found = self.inverse(points[-1], guess)
            if found is None:
                return None
            points.append(found)
        return points


def _grown(piece: _Preimages, resolution: float, budget: int) -> Real:
    """Points along one side of a stable manifold, from the saddle on, until they are used up."""
    shares = [0.0, 0.5, 1.0]
    chains = [[piece.first(share)] for share in shares]
    points = [piece.middle, *(chain[0] for chain in chains)]
    while len(points) < budget:
        end = piece.chain(0.0, [*chains[0], points[-1]])
        if end is None:
            break
        kept, longer = [0.0], [end]
        wanted = list(zip(shares, chains, strict=True))[:0:-1]
        while wanted:
            share, chain = wanted[-1]
            found = piece.inverse(chain[-1], longer[-1][-1])
            if found is None or _distance(found, longer[-1][-1]) > resolution:
                added = None
                while added is None:
                    share = 0.5 * (kept[-1] + share)
                    if share - kept[-1] < 0.5**HALVINGS:
                        return np.array(points)
                    added = piece.chain(share, longer[-1][:-1])
                wanted.append((share, added))
                continue
            wanted.pop()
            kept.append(share)
            longer.append([*chain, found])
            points.append(found)
            if len(points) >= budget or np.any(np.abs(found - 0.5) > 0.5 + MARGIN):
                return np.array(points)
        shares, chains = kept, longer
    return np.array(points)


def _distance(a: Real, b: Real) -> float:
    return float(np.linalg.norm(a - b))


@shows_progress(of_number("points"))
def basin_edge(
    found: Basins,
    count: int = 200,
    *,
    seed: int = 20,
    width: float = 1e-12,
    executor: Executor | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> tuple[Real, list[Orbit]]:
    """Points on the boundary between basins, by bisection, and the saddles to which they lead.

    Between two neighbouring cells with different attractors lies a state that goes to neither: a
    point of the stable manifold of a saddle. Bisection finds it, and a motion from there lingers
    near the saddle, where Newton's method solves for it.

    Parameters
    ----------
    found : Basins
        What `nldyn.basins` gave, of a system with any number of modes.
    count : int
        Number of points, picked at random from the pairs of neighbouring cells.
    seed : int
        Of the choice.
    width : float
        Where bisection ends, in units of the distance of two cells.
    executor : concurrent.futures.Executor, optional
        Where to compute, each point by itself; here unless given.
    progress : callable, optional
        Called as ``progress(done, total)`` after each point.

    Returns
    -------
    points : (k, 2)
        Coordinates in the plane.
    saddles : list of Orbit
        Different unstable orbits met, if the motion lingered long enough to solve for one.

    Raises
    ------
    SystemModelError
        If there are no two basins, or for other input that makes no sense.
    TaskError
        If a computation ends in an error.
    """
    check_types(found=(found, Basins))
    check_execution(executor, progress)
    check_whole("basin_edge: count", count, 1)
    check_whole("basin_edge: seed", seed, 0)
    if not (is_finite(width) and 0.0 < width < 1.0):
        raise SystemModelError(f"basin_edge: width must lie between 0 and 1, got {shown(width)}")
    attractors = found.attractors
    pairs = _neighbours(found)
    if not len(pairs):
        raise SystemModelError("basin_edge: the plane shows no two basins")
    flow = attractors[0].flow
    omega = 2.0 * math.pi * found.frequency_hz
    targets = [target_of(attractor) for attractor in attractors]
    rng = np.random.default_rng(seed)
    picked = pairs[rng.choice(len(pairs), min(count, len(pairs)), replace=False)]
    modal = found.plane.states((found.labels.shape[0], found.labels.shape[1]))
    observe = attractors[0].flow.system.interfaces[0]
    longest = int(found.periods.max()) + 16
    pieces = [
        (flow.to_state(np.array([modal[i, j], modal[k, m]])), int(found.labels[i, j]))
        for (i, j), (k, m) in picked
    ]
    task = partial(_edge_point, flow, omega, targets, longest, width, observe)
    points: list[Real] = []
    saddles: list[Orbit] = []
    for middle, orbit in values_of(task, pieces, executor, progress):
        points.append(found.plane.coordinates(middle[None])[0][0])
        if orbit is not None and not any(same_orbit(orbit, other) for other in saddles):
            saddles.append(orbit)
    return np.array(points), saddles


def _edge_point(
    flow: FlowMap, omega: float, targets: Sequence[Target], longest: int, width: float,
    observe: str, piece: tuple[Real, int],
) -> tuple[Real, Orbit | None]:  # fmt: skip
    """Modal state between two states z of different basins, and the saddle it leads to."""
    ends, label = piece
    low, high = _bisected(flow, omega, targets, longest, ends, label, width)
    return flow.to_modal(0.5 * (low + high)), _lingering(flow, omega, targets, low, observe)


def _neighbours(found: Basins) -> np.ndarray:
    """Pairs (k, 2, 2) of neighbouring cells that lead to different attractors."""
    labels = found.labels
    pairs = []
    for di, dj in ((0, 1), (1, 0)):
        a = labels[: labels.shape[0] - di, : labels.shape[1] - dj]
        b = labels[di:, dj:]
        rows, columns = np.nonzero((a != b) & (a >= 0) & (b >= 0))
        first = np.column_stack([rows, columns])
        pairs.append(np.stack([first, first + np.array([di, dj])], axis=1))
    return np.concatenate(pairs)


def _bisected(
    flow: FlowMap, omega: float, targets: Sequence[Target], longest: int, ends: Real, label: int,
    width: float,
) -> tuple[Real, Real]:  # fmt: skip
    """Two states z as near to each other as wanted of which the first only leads to a target."""
    low, high = ends
    for _ in range(math.ceil(-math.log2(width))):
        middle = 0.5 * (low + high)
        if np.array_equal(middle, low) or np.array_equal(middle, high):
            break
        reached = settle(flow, omega, targets, longest, middle[None]).labels[0]
        low, high = (middle, high) if reached == label else (low, middle)
    return low, high


def _lingering(
    flow: FlowMap, omega: float, targets: Sequence[Target], state: Real, observe: str
) -> Orbit | None:
    """Unstable orbit near which a motion from the edge lingers before it reaches an attractor."""
    run = flow.strobe(state, omega, LINGER)
    if run.failure:
        return None
    reached = np.any([target.reached(run.ends) != UNDECIDED for target in targets], axis=0)
    before = run.ends[: int(np.argmax(reached)) if reached.any() else LINGER]
    for period in (1, 2, 3, 4):
        for start in near_returns(before, period, 3):
            orbit = orbit_near(flow, before[start], period, omega, observe)
            if orbit is not None and not orbit.stable:
                return orbit
    return None
