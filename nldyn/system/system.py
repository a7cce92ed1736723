"""A reduced model with its stops, dampers and excitation, in modal form."""

from __future__ import annotations

import copy
import itertools
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from types import MappingProxyType
from typing import Any, NamedTuple, Protocol, TypedDict, Unpack

import numpy as np
import scipy.linalg as sla
from numpy.typing import ArrayLike

from nldyn.base.arrays import TINY, Complex, Real
from nldyn.base.errors import SystemModelError, is_finite, must_be_symmetric, numbers, shown
from nldyn.system.coupled_stops import CoupledStops
from nldyn.system.friction import DryFriction, Friction, Slider
from nldyn.system.linear import (
    ForcedResponse,
    LinearPart,
    diagonalised,
    linear_part,
    without_rounding,
)
from nldyn.system.loads import BaseMotion, Excitation, HarmonicForce
from nldyn.system.massless_boundary import MasslessBoundary
from nldyn.system.ride import NO_RIDE, Ride, carried_apart, told_apart
from nldyn.system.rigid_stop import AnyStop, RigidStop
from nldyn.system.round_stop import Polar, RoundStop
from nldyn.system.spin import Spin, same_spin, skew
from nldyn.system.springs_dampers import (
    Bond,
    CubicDamper,
    Damper,
    PolynomialSpring,
    Spring,
    bonds_of,
)
from nldyn.system.stop import Stop
from nldyn.system.values import SAME_ENTRY, ZERO_ENTRY

AnySpring = Spring | PolynomialSpring
AnyDamper = Damper | CubicDamper | DryFriction
LARGEST_PARTICIPATION = 1e50  # its square is the mobility of a stop, and its fourth power occurs
NEGATIVE = 1e-10  # of a stiffness with a unit diagonal: an eigenvalue that is not rounding
NOT_HELD = "the structure is free to move in a way that no stop limits, and nothing tells its place"
_SIDES = ("at", "against", "direction")  # of a stop: its vector tells them
MOST_SIDES = 1024  # of stops to both sides, which are tried together
PARALLEL = 1e-12  # sine of the angle between modal vectors that are one motion
FEW = 8.0  # roundings of each mode in the largest ω²


class Clock(NamedTuple):
    """Where in time a piece of a simulation lies, in which forces of two frequencies act.

    Parameters
    ----------
    omega : float
        Excitation frequency in rad/s.
    start : float
        Time in s at which its phase was last zero.
    """

    omega: float
    start: float


class Elements(TypedDict, total=False):
    """What acts at the interfaces of a system; excitation on load vectors, too."""

    stops: Sequence[AnyStop]
    dampers: Sequence[AnyDamper]
    excitation: Sequence[Excitation]
    springs: Sequence[AnySpring]


class ReducedModelLike(Protocol):
    """What `System.from_reduced` needs: modal frequencies and participations."""

    @property
    def frequencies_hz(self) -> Real:
        """Modal frequencies in Hz, shape (n,)."""

    @property
    def participation(self) -> Mapping[str, Real]:
        """Displacement of each mass-normalised mode at each interface, shape (n,)."""


@dataclass(frozen=True, eq=False)
class System:
    r"""Modal equations :math:`\ddot q + D\dot q + \Omega^2 q = \sum p f(t) - \sum c F(\delta)`.

    Use `from_modal`, `from_matrices` or `from_reduced` to make one.

    Parameters
    ----------
    natural_frequencies : (n,) array
        Modal circular frequencies Ω in rad/s.
    damping : (n, n) array
        Modal damping matrix D in 1/s, without the point dampers.
    participation : mapping of str to (n,) array
        Displacement of each mass-normalised mode at each interface, 1/sqrt(kg).
    stops, dampers, excitation : tuples
        What acts at the interfaces; excitation on load vectors, too.
    loads : mapping of str to (n,) array
        Modal force of each load vector: of what acts on the whole structure, as weight does.
    springs : tuple
        What acts at the interfaces all the time. The modes are those of the structure without.
    circulatory : (n, n) array, optional
        Skew part of the modal stiffness, 1/s²; the damping may have a skew part, too.
    spin : Spin, optional
        What of both is in proportion to the speed of a shaft, in modal coordinates.
    rides : mapping of str to mapping
        Interfaces whose displacement is observed as an absolute one, see `with_absolute`.
    rotations : set of str
        Interfaces that turn: their displacement is an angle in rad, and what acts there a moment.
        Nothing is computed otherwise for it; tables and pictures have their units from it.
    common_flexibility : (k, k) array, optional
        How far a unit force at each of the k stops lets each other one move at once, in m/N, with
        zeros on the diagonal: stops without mass that give way together, see `CoupledStops`.

    Raises
    ------
    SystemModelError
        If shapes disagree, a value is not finite or out of range, an interface is unknown,
        or damping makes coupled modes inseparable.

    Examples
    --------
    >>> from nldyn import Stop, System, Unbalance
    >>> system = System.from_modal([13.1], {"middle": [0.635]}, modal_damping=0.0142,
    ...     stops=[Stop("middle", stiffness=5.17e9)], excitation=[Unbalance("middle", 4.92e-6)])
    >>> system.size
    1
    """

    natural_frequencies: Real
    damping: Real
    participation: Mapping[str, Real]
    stops: tuple[AnyStop, ...] = ()
    dampers: tuple[AnyDamper, ...] = ()
    excitation: tuple[Excitation, ...] = ()
    loads: Mapping[str, Real] = field(default_factory=dict)
    springs: tuple[AnySpring, ...] = ()
    circulatory: Real | None = None
    spin: Spin | None = None
    rides: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    rotations: frozenset[str] = frozenset()
    common_flexibility: Real | None = None

    def __repr__(self) -> str:
        """One line: modes, interfaces, and what acts."""
        sprung = bool(np.any(self.spring_stiffness))
        own = self.linear.frequencies_hz if sprung else self.frequencies_hz
        hz = ", ".join(f"{value:.6g}" for value in own[:4])
        more = ", ..." if self.size > 4 else ""
        names = ", ".join(map(repr, self.interfaces)) or "none"
        return (
            f"<System of {self.size} modes at {hz}{more} Hz{' with the springs' * sprung}; "
            f"interfaces {names}; "
            f"{len(self.stops)} stops, {len(self.dampers)} dampers, "
            + (f"{len(self.springs)} springs, " if self.springs else "")
            + f"{len(self.excitation)} excitations"
            + ("" if self.spin is None else f", spinning at {self.spin.hz:.6g} Hz")
            + ">"
        )

    def __post_init__(self) -> None:
        self._check_shapes()
        self._check_interfaces()
        self._check_sliders()
        _ = self.linear

    @classmethod
    def from_modal(
        cls,
        frequencies_hz: ArrayLike,
        participation: Mapping[str, ArrayLike],
        *,
        modal_damping: float | ArrayLike = 0.0,
        loads: Mapping[str, ArrayLike] = MappingProxyType({}),
        **acting: Unpack[Elements],
    ) -> System:
        """System from modal data typed in by hand.

        Parameters
        ----------
        frequencies_hz : (n,) array_like
            Modal frequencies in Hz.
        participation : mapping of str to (n,) array_like
            Displacement of each mass-normalised mode at each interface, 1/sqrt(kg).
        modal_damping : float or (n,) array_like
            Damping ratio of every mode.
        stops, dampers, excitation, springs : sequences
            What acts at the interfaces.
        loads : mapping of str to (n,) array_like
            Modal force of each load vector, see `System`.

        Raises
        ------
        SystemModelError
            See `System`.

        Examples
        --------
        >>> System.from_modal([10.0, 20.0], {"tip": [1.0, -1.0]}, modal_damping=0.01).size
        2
        """
        omega = 2.0 * np.pi * np.atleast_1d(numbers("frequencies_hz", frequencies_hz))
        return cls(
            omega,
            _modal_damping(omega, modal_damping),
            _vectors("participation", participation),
            loads=_vectors("loads", loads),
            **_listed(acting),
        )

    @classmethod
    def from_matrices(
        cls,
        mass: ArrayLike,
        stiffness: ArrayLike,
        interfaces: Mapping[str, ArrayLike],
        *,
        damping: ArrayLike | None = None,
        modal_damping: float | ArrayLike = 0.0,
        loads: Mapping[str, ArrayLike] = MappingProxyType({}),
        gyroscopic: ArrayLike | None = None,
        circulatory: ArrayLike | None = None,
        spin: Spin | None = None,
        **acting: Unpack[Elements],
    ) -> System:
        """System from mass, stiffness and damping matrices.

        Parameters
        ----------
        mass, stiffness : (n, n) array_like
            Symmetric; the mass positive definite, the stiffness positive semidefinite.
        interfaces : mapping of str to (n,) array_like
            Unit load vector of each interface.
        damping : (n, n) array_like, optional
            Symmetric damping matrix in N s/m, added to the modal damping.
        modal_damping : float or (n,) array_like
            Damping ratio of every mode.
        stops, dampers, excitation, springs : sequences
            What acts at the interfaces.
        loads : mapping of str to (n,) array_like
            Load vectors of what acts on the whole structure: M r for a weight or a motion of the
            base along r.
        gyroscopic : (n, n) array_like, optional
            Skew matrix in N s/m, added to the damping: that of a rotor at its speed.
        circulatory : (n, n) array_like, optional
            Skew matrix in N/m, added to the stiffness: the cross-coupling of bearings and seals.
            A stiffness K that is not symmetric is (K + Kᵀ)/2 and this, (K - Kᵀ)/2.
        spin : Spin, optional
            What of both is in proportion to the speed of a shaft; it adds to them.

        Raises
        ------
        SystemModelError
            If a matrix is not square, symmetric or skew, finite or definite, or the motion without
            contact grows; see also `System`.

        Examples
        --------
        >>> s = System.from_matrices([[2.48]], [[16877.0]], {"middle": [1.0]}, modal_damping=0.0142)
        >>> f"{s.frequencies_hz[0]:.4f}"
        '13.1293'
        """
        M = _symmetric("mass", mass)
        K = _symmetric("stiffness", stiffness)
        if K.shape != M.shape:
            raise SystemModelError(f"stiffness is {K.shape} but mass is {M.shape}")
        omega, modes = _natural_modes(K, M)
        D = _modal_damping(omega, modal_damping)
        if damping is not None:
            C = _symmetric("damping", damping)
            if C.shape != M.shape:
                raise SystemModelError(f"damping is {C.shape} but mass is {M.shape}")
            D = D + modes.T @ C @ modes
        G, N = (
            None if given is None else modes.T @ skew(name, given, omega.size) @ modes
            for name, given in (("gyroscopic", gyroscopic), ("circulatory", circulatory))
        )
        if G is not None:
            D = D + 0.5 * (G - G.T)
        participation, modal_loads = (
            {
                name: modes.T @ _load_vector(f"{what} '{name}'", vector, omega.size)
                for name, vector in _checked_names(f"{what}s", vectors).items()
            }
            for what, vectors in (("interface", interfaces), ("load", loads))
        )
        system = cls(
            omega,
            D,
            participation,
            loads=modal_loads,
            circulatory=N,
            **_listed(acting),
        )
        system._check_carried()
        return system._spun(None if spin is None else _of_size(spin, omega.size).on(modes))

    @classmethod
    def from_reduced(
        cls,
        reduced: ReducedModelLike,
        *,
        modal_damping: float | ArrayLike = 0.0,
        loads: Mapping[str, ArrayLike] = MappingProxyType({}),
        gyroscopic: ArrayLike | None = None,
        circulatory: ArrayLike | None = None,
        spin: Spin | None = None,
        **acting: Unpack[Elements],
    ) -> System:
        """System from a reduced model (anything with frequencies and participations).

        Parameters
        ----------
        reduced : object
            With `frequencies_hz` (n,) and `participation` {name: (n,)}; its `damping` (n, n) in 1/s
            is added to the modal damping, if it has one.
        modal_damping, stops, dampers, excitation, loads, springs
            As for `from_modal`; interfaces that are `load_vectors` of the reduced model are loads,
            too.
        gyroscopic, circulatory : (n, n) array_like, optional
            Skew matrices ``basis.T @ G @ basis`` in 1/s and 1/s², as for `from_matrices`; the
            model must be one that keeps modes which no interface sees (``unseen=True``).
        spin : Spin, optional
            As for `from_matrices`, with matrices on the same basis.

        Raises
        ------
        SystemModelError
            If it is no reduced model; if what acts on interfaces without mass is neither a rigid
            or linear stop nor dry friction; if nothing tells the forces of such stops apart, or
            friction has more than 5 % of the flexibility without mass in common with others; or if
            modes are left out that a skew matrix may couple. See also `System`.

        Notes
        -----
        Interfaces whose flexibility has no mass (`residual_flexibility`), as by
        ``cms.reduce(..., method="macneal", massless=[...])``, follow the forces there at once. A
        `RigidStop` at one is the linear `Stop` of that flexibility (several, with what they have in
        common, are `CoupledStops`), friction at it has the spring
        of that of its tangent, and the displacement there is that of the modes, without what gives
        way: see docs/how-to/massless_boundary.md.
        """
        if not (hasattr(reduced, "frequencies_hz") and hasattr(reduced, "participation")):
            raise SystemModelError(
                "reduced must be a reduced model, with frequencies_hz and participation, got "
                f"{shown(reduced)}"
            )
        massless = getattr(reduced, "residual_flexibility", None)
        elements = _listed(acting)
        common = None
        if massless is not None and np.any(massless):
            boundary = MasslessBoundary(tuple(reduced.participation), massless)
            stops = elements.get("stops", ())
            elements = boundary.acting(elements)
            common = boundary.common(stops)
        given = (gyroscopic, circulatory, spin)
        if getattr(reduced, "left_out_hz", ()) and any(one is not None for one in given):
            raise SystemModelError(
                "the reduced model leaves out modes that no interface sees, but which a gyroscopic "
                "or a circulatory matrix may couple with the others; reduce with unseen=True"
            )
        whole = set(getattr(reduced, "load_vectors", ()))
        rows = reduced.participation
        system = cls.from_modal(
            reduced.frequencies_hz,
            {name: row for name, row in rows.items() if name not in whole},
            modal_damping=modal_damping,
            loads={name: row for name, row in rows.items() if name in whole},
        )
        damping = getattr(reduced, "damping", None)
        if damping is not None:
            damping = _symmetric("damping", damping)
            if damping.shape != system.damping.shape:
                raise SystemModelError(f"damping is {damping.shape} for {system.size} modes")
        total = system.damping if damping is None else system.damping + damping
        if gyroscopic is not None:
            total = total + skew("gyroscopic", gyroscopic, system.size)
        return cls(
            system.natural_frequencies,
            total,
            system.participation,
            loads={**system.loads, **_vectors("loads", loads)},
            circulatory=(
                None if circulatory is None else skew("circulatory", circulatory, system.size)
            ),
            common_flexibility=common,
            **elements,
        )._spun(None if spin is None else _of_size(spin, system.size))

    @property
    def size(self) -> int:
        """Number of modes n."""
        return int(self.natural_frequencies.size)

    @property
    def state_size(self) -> int:
        """Number of coordinates of a state z: 2n, and two of each place behind a spring."""
        return 2 * (self.size + len(self.place_ends))

    @property
    def frequencies_hz(self) -> Real:
        """Modal frequencies in Hz, shape (n,), of the structure without its springs.

        Those with the linear springs are `linear.frequencies_hz`.
        """
        return self.natural_frequencies / (2.0 * np.pi)

    @property
    def interfaces(self) -> tuple[str, ...]:
        """Names of the interfaces, in the order given."""
        return tuple(self.participation)

    @cached_property
    def total_damping(self) -> Real:
        """Modal damping matrix with the point dampers, (n, n), 1/s."""
        linear = [d for d in self.dampers if isinstance(d, Damper)]
        return self._with(self.damping, [(d.at, d.against, d.coefficient) for d in linear])

    @cached_property
    def spring_stiffness(self) -> Real:
        """Modal stiffness of the linear springs, (n, n), 1/s²."""
        linear = [s for s in self.springs if isinstance(s, Spring)]
        none = np.zeros((self.size, self.size))
        return self._with(none, [(s.at, s.against, s.stiffness) for s in linear])

    def _with(self, start: Real, elements: Sequence[tuple[str, str | None, float]]) -> Real:
        """A modal matrix (n, n) with linear elements: both ends, and the coefficient."""
        matrix = np.array(start)
        for at, against, coefficient in elements:
            phi = self.vector_between(at, against)
            matrix += coefficient * np.outer(phi, phi)
        return matrix

    @cached_property
    def stiffness(self) -> Real:
        """Modal stiffness of the linear part, (n, n), 1/s²."""
        K = np.diag(self.natural_frequencies**2) + self.spring_stiffness
        return K if self.circulatory is None else K + self.circulatory

    @cached_property
    def bonds(self) -> tuple[Bond, ...]:
        """What acts nonlinearly all the time."""
        return bonds_of(self.springs, self.dampers)

    @cached_property
    def sliders(self) -> tuple[Slider, ...]:
        """What slides by dry friction: at the stops, then all the time."""
        at_stops = [
            Slider(
                stop.tangent,
                stop.tangent_against,
                stop.friction,
                number,
                tangential_stiffness=getattr(stop, "tangential_stiffness", None),
                across=getattr(stop, "across", None),
            )
            for number, stop in enumerate(self.stops)
            if not isinstance(stop, RoundStop)
            and isinstance(stop.friction, Friction)
            and stop.tangent is not None
        ]
        dry = [d for d in self.dampers if isinstance(d, DryFriction)]
        return (
            *at_stops,
            *(
                Slider(d.at, d.against, d.law, -1, d.normal_force, d.tangential_stiffness, d.across)
                for d in dry
            ),
        )

    @cached_property
    def rubbing(self) -> tuple[Slider, ...]:
        """All that friction may act on: the sliders, then what slides in round clearances.

        Of these all whose speed of sliding is known, though their friction be zero.
        """
        rings = [
            Slider(
                stop.at, stop.against, Friction(stop.friction, base_speed=-stop.sliding_speed), i
            )
            for i, stop in self.round_stops.items()
            if stop.surface_speed is not None
        ]
        return (*self.sliders, *rings)

    @cached_property
    def sprung(self) -> tuple[int, ...]:
        """Numbers of the sliders behind springs, whose places are coordinates of the state."""
        return tuple(i for i, s in enumerate(self.sliders) if s.tangential_stiffness is not None)

    @cached_property
    def place_sizes(self) -> Real:
        """Displacements at unit coordinates of the places of `place_ends`, in m."""
        return np.array([np.linalg.norm(self.vector_between(*ends)) for ends in self.place_ends])

    @cached_property
    def over_planes(self) -> tuple[int, ...]:
        """Numbers of the sliders that slide over a plane: they have two tangents."""
        return tuple(i for i, slider in enumerate(self.sliders) if slider.across is not None)

    @cached_property
    def place_ends(self) -> tuple[tuple[str, str | None], ...]:
        """Interfaces of the places in the state: of `sprung`, then along second tangents."""
        first = [(self.sliders[i].at, self.sliders[i].against) for i in self.sprung]
        across = [self.sliders[i].ends[1] for i in self.sprung if i in self.over_planes]
        return (*first, *across)

    @property
    def loses_by_speed(self) -> bool:
        """Whether a force of a stop or bond depends on the speed."""
        lossy = [stop.depends_on_speed for stop in self.stops]
        return bool(self.sliders) or any(lossy + [bond.depends_on_speed for bond in self.bonds])

    @cached_property
    def movers(self) -> int:
        """Number of the forces that move places over a plane: two of each one behind a spring."""
        return 2 * sum(i in self.sprung for i in self.over_planes)

    def unit(self, interface: str) -> str:
        """Unit of the displacement of an interface: m, or rad of a rotation."""
        return "rad" if interface in self.rotations else "m"

    def output(self, interface: str) -> int:
        """Number of the displacement of an interface among the outputs of a flow map.

        Before it come the penetrations of the stops, the displacements of sliders and bonds, and
        those along the second directions of round clearances and the second tangents of sliders,
        then `movers`.
        """
        acting = len(self.stops) + len(self.sliders) + len(self.bonds) + len(self.round_stops)
        acting += len(self.over_planes) + self.movers
        return acting + self.interfaces.index(interface)

    @property
    def free_modes(self) -> int:
        """Number of rigid-body motions that neither the structure nor a spring holds."""
        free = self.natural_frequencies == 0.0
        held = [self.vector_between(spring.at, spring.against)[free] for spring in self.springs]
        return int(free.sum()) - _rank(held, int(free.sum()))

    @property
    def left_free(self) -> bool:
        """Whether the stops, too, leave a rigid-body motion free."""
        free = self.natural_frequencies == 0.0
        held = [self.vector_between(*ends)[free] for ends in self._held_ends]
        return _rank(held, int(free.sum())) < int(free.sum())

    @property
    def _held_ends(self) -> Iterator[tuple[str, str | None]]:
        """What stops and springs hold."""
        for each in (*self.stops, *self.springs):
            if isinstance(each, RoundStop):
                yield from each.ends
            else:
                yield each.at, each.against

    @cached_property
    def conservative(self) -> bool:
        """Whether nothing takes energy out: no damping, and no stop whose force knows the speed."""
        damped = np.any(self.total_damping + self.total_damping.T)
        damped = damped or np.any(_or_zero(self.circulatory))
        rubs = any(stop.friction for stop in self.round_stops.values())
        return not (damped or rubs or self.loses_by_speed)

    @cached_property
    def jumps(self) -> bool:
        """Whether a force or a velocity jumps where a stop is hit, or a slider turns."""
        return bool(self.sliders) or any(stop.jumps for stop in self.stops)

    @cached_property
    def symmetric(self) -> bool:
        """Whether -x(t + T/2) is a motion if x(t) is one: each stop has one opposite to it.

        All excitation must change its sign after half its period T: it has odd harmonics only.
        """
        stops = [
            (self.stop_vector(s), [getattr(s, f.name) for f in fields(s) if f.name not in _SIDES])
            for s in self.stops
            if not isinstance(s, RoundStop)
        ]
        odd = not np.any(self.drive[self.orders % 2 == 0.0])
        return (
            odd
            and all(stop.concentric for stop in self.round_stops.values())
            and all(bond.odd for bond in self.bonds)
            and not self.carried
            and all(
                sum(same == law and np.array_equal(c, vector) for c, same in stops)
                == sum(same == law and np.array_equal(-c, vector) for c, same in stops)
                for vector, law in stops
            )
        )

    @cached_property
    def elastic_stops(self) -> dict[int, Stop | RoundStop]:
        """The stops that give way, by their places among all."""
        return {
            i: s
            for i, s in enumerate(self.stops)
            if isinstance(s, Stop | RoundStop) and not s.impulsive
        }

    @cached_property
    def areas(self) -> dict[str, tuple[int, ...]]:
        """The areas of contact by name, each with the places of its points among all stops."""
        found: dict[str, list[int]] = {}
        for place, stop in enumerate(self.stops):
            if isinstance(stop, Stop) and stop.area is not None:
                found.setdefault(stop.area, []).append(place)
        return {name: tuple(places) for name, places in found.items()}

    def area_stops(self, area: int | str) -> list[Stop]:
        """The stops of an area of contact, by its name or number."""
        places = self.areas[area] if isinstance(area, str) else list(self.areas.values())[area]
        return [stop for place in places if isinstance(stop := self.stops[place], Stop)]

    def with_area(self, number: int, name: str, value: float) -> System:
        """The system with another `gap`, `stiffness` or `friction` of an area of contact.

        The gaps of all its points are moved alike, the smallest one to the value.
        """
        stops = list(self.stops)
        points = self.area_stops(number)
        smallest = min(stop.gap for stop in points)
        for place, stop in zip(list(self.areas.values())[number], points, strict=True):
            change: dict[str, Any] = {"gap": value + (stop.gap - smallest)}
            if name == "stiffness":
                change = {"stiffness": value * stop.share}
            elif name == "friction":
                change = {"friction": stop.law_of_friction.with_coefficient(value)}
            stops[place] = replace(stop, **change)
        return self.with_elements(stops=stops)

    @cached_property
    def round_stops(self) -> dict[int, RoundStop]:
        """The round clearances, by their places among all stops."""
        return {i: stop for i, stop in enumerate(self.stops) if isinstance(stop, RoundStop)}

    @cached_property
    def rigid_stops(self) -> dict[int, RigidStop | RoundStop]:
        """The stops at which velocities jump, by their places among all."""
        return {
            i: s
            for i, s in enumerate(self.stops)
            if isinstance(s, RigidStop) or (isinstance(s, RoundStop) and s.impulsive)
        }

    @cached_property
    def coupled(self) -> CoupledStops:
        """The stops as those that move each other at once; mostly none does."""
        count = len(self.stops)
        stiffness = np.array([getattr(stop, "stiffness", math.inf) for stop in self.stops])
        common = self.common_flexibility
        return CoupledStops(np.zeros((count, count)) if common is None else common, stiffness)

    @cached_property
    def linear(self) -> LinearPart:
        """Independent pairs of coordinates of the linear part."""
        omega, modes, D = self.natural_frequencies, None, self.total_damping
        cross = self.circulatory
        if np.any(self.spring_stiffness):
            omega, modes = diagonalised(omega, self.spring_stiffness)
            D = without_rounding(modes.T @ D @ modes)
            cross = None if cross is None else modes.T @ cross @ modes
        squares = np.zeros(self.size)
        for stop in self.elastic_stops.values():
            deep = 0.0 if isinstance(stop, RoundStop) else max(-stop.gap, 0.0)
            if stop.exponent == 1.0 or deep > 0.0:
                slope = stop.exponent * stop.stiffness * deep ** (stop.exponent - 1.0)
                for c in self.stop_vectors(stop):
                    squares += slope * (c if modes is None else modes.T @ c) ** 2
        for bond in self.bonds:
            c = self.vector_between(bond.at, bond.against)
            slope = abs(bond.coefficients[0]) if bond.coefficients else 0.0
            squares += slope * (c if modes is None else modes.T @ c) ** 2
        part = linear_part(omega, D, np.sqrt(squares), cross)
        part = part if modes is None else part.of_modes(modes)
        return part.with_places(len(self.place_ends))

    def vector_between(self, at: str, against: str | None) -> Real:
        """Modal vector of the displacement at an interface, less that at another one, (n,)."""
        c = self.participation[at]
        return c if against is None else c - self.participation[against]

    def stop_vector(self, stop: AnyStop) -> Real:
        """Modal vector c with penetration ``c @ q - gap``, shape (n,).

        Of a round clearance that of its first direction.
        """
        return stop.direction * self.vector_between(stop.at, stop.against)

    def stop_vectors(self, stop: AnyStop) -> list[Real]:
        """Modal vectors (n,) along which a stop acts: one, of a round clearance two."""
        if isinstance(stop, RoundStop):
            return [self.vector_between(*ends) for ends in stop.ends]
        return [self.stop_vector(stop)]

    def round_polar(self, stop: RoundStop, states: Real) -> Polar:
        """Where a body is in a round clearance, at modal states (k, 2n)."""
        rows = np.array(self.stop_vectors(stop)).T
        return stop.polar(states[:, : self.size] @ rows, states[:, self.size :] @ rows)

    def depth_and_speed(self, stop: AnyStop, states: Real) -> tuple[Real, Real]:
        """Penetration of a stop (negative when open) and its rate at modal states (k, 2n)."""
        number = self.stops.index(stop) if self.common_flexibility is not None else -1
        if number >= 0 and self.coupled.involves(number):
            depths, speeds = self.depths_and_speeds(states)
            return depths[:, number], speeds[:, number]
        return self._alone(stop, states)

    def depths_and_speeds(self, states: Real) -> tuple[Real, Real]:
        """Penetrations (k, n) of all stops and their rates, as `depth_and_speed`."""
        each = [self._alone(stop, states) for stop in self.stops]
        if not each:
            return np.empty((len(states), 0)), np.empty((len(states), 0))
        depths, speeds = (np.column_stack(values) for values in zip(*each, strict=True))
        if self.common_flexibility is None:
            return depths, speeds
        maps = self.coupled.maps(depths)
        return tuple(np.einsum("kij,kj->ki", maps, values) for values in (depths, speeds))

    def _alone(self, stop: AnyStop, states: Real) -> tuple[Real, Real]:
        """Penetration of a stop that no other one moves at once, and its rate."""
        if isinstance(stop, RoundStop):
            at = self.round_polar(stop, states)
            return at.depth, at.rate
        v = self.stop_vector(stop)
        return states[:, : self.size] @ v - stop.gap, states[:, self.size :] @ v

    def load_vector(self, name: str) -> Real:
        """Modal force (n,) of a unit load at an interface, or on a load vector."""
        return self.participation[name] if name in self.participation else self.loads[name]

    def displacement_row(self, phi: Real) -> Real:
        """Row that gives the displacement ``phi @ q = row @ z``, of the length of z."""
        return np.asarray(phi @ self.linear.right[: self.size])

    def force_column(self, phi: Real) -> Real:
        """Column by which a unit force on ``phi`` drives z, of its length."""
        return np.asarray(self.linear.left[:, self.size :] @ phi)

    @cached_property
    def tones(self) -> tuple[HarmonicForce, ...]:
        """The forces that have a frequency of their own."""
        sources = self.excitation
        return tuple(s for s in sources if isinstance(s, HarmonicForce) and s.frequency_hz)

    def check_periodic(self) -> None:
        """Refuse forces that have a frequency of their own.

        Raises
        ------
        SystemModelError
            If there is one.
        """
        for tone in self.tones:
            raise SystemModelError(
                f"excitation at '{tone.at}' has a frequency of its own, {tone.frequency_hz:g} Hz, "
                "so that no motion has a period: simulate it (nldyn.simulate, sweep, "
                "lyapunov_exponents), or take a lower excitation frequency of which both are "
                "multiples, nearly (5 and 7 for a ratio of 1.4)"
            )

    @cached_property
    def _without_tones(self) -> System:
        others = (source for source in self.excitation if source not in self.tones)
        return self.with_elements(excitation=tuple(others))

    @cached_property
    def orders(self) -> Real:
        """Multiples of the excitation frequency at which something acts: 1, then the others."""
        self.check_periodic()
        others = {source.harmonic for source in self.excitation} - {1}
        return np.array([1.0, *sorted(others)])

    def forcing(self, clock: Clock | None = None) -> tuple[Real, Complex]:
        """`orders` and `drive`, with the forces of frequencies of their own if a clock is given.

        These have as orders what their frequencies are beside that of the clock.
        """
        if clock is None or not self.tones:
            return self.orders, self.drive
        orders, drive = self._without_tones.forcing()
        for tone in self.tones:
            assert tone.frequency_hz is not None
            pace = 2.0 * np.pi * tone.frequency_hz
            turned = math.remainder(tone.frequency_hz * clock.start, 1.0)
            column = self.force_column(self.load_vector(tone.at))
            row = np.zeros((1, *drive.shape[1:]), dtype=complex)
            row[0, 0] = tone.phasor * np.exp(2j * np.pi * turned) * column
            orders, drive = np.append(orders, pace / clock.omega), np.concatenate([drive, row])
        return orders, drive

    @cached_property
    def drive(self) -> Complex:
        """Excitation Σ Re(Σ_p ω^p drive[h, p] e^{i orders[h] ωt}) of z, shape (h, 3, 2n)."""
        return self.drive_of(self.excitation)

    def drive_of(self, excitation: Sequence[Excitation]) -> Complex:
        """The drive by some sources whose harmonics the system has, as `drive`."""
        drive = np.zeros((self.orders.size, 3, self.state_size), dtype=complex)
        for source in excitation:
            row = int(np.flatnonzero(self.orders == source.harmonic)[0])
            column = self.force_column(self.load_vector(source.at))
            drive[row, source.power] += source.harmonic**source.power * source.phasor * column
        return drive

    @property
    def driven(self) -> bool:
        """Whether something swings: any excitation but constant forces."""
        return bool(np.any(self.drive[self.orders > 0.0]))

    @property
    def carried(self) -> bool:
        """Whether something moves beneath its friction, such as a belt."""
        return any(any(slider.friction.base_speeds) for slider in self.sliders)

    def response(self, omega: float, clock: Clock | None = None) -> ForcedResponse:
        """Linear response at ω (rad/s), near or at a resonance, too; the clock as for `forcing`."""
        orders, drive = self.forcing(clock)
        return self.linear.response(orders, np.array([1.0, omega, omega * omega]) @ drive, omega)

    def steady(self, omega: float, phase: float = 0.0) -> Real:
        """State z (2n,) of the steady linear response at ω (rad/s) and a forcing phase.

        Raises
        ------
        SystemModelError
            If there is none: an undamped mode is excited exactly at its frequency, or a constant
            force acts on a body that only stops hold.
        """
        return self.response(omega).steady(omega, phase)

    def grows(self, omega: float) -> bool:
        """Whether no motion without contact is bounded at ω (rad/s), see `ForcedResponse`."""
        return self.response(omega).unbounded(omega) is not None

    def with_absolute(self, interface: str, factors: Mapping[str, float]) -> System:
        """The system with the absolute displacement of an interface, where a base moves.

        It is observed as an interface of its own, named "... absolute", that comes first: orbits
        and pictures report it unless asked for another one. Nothing can act there.

        Parameters
        ----------
        interface : str
            Interface whose displacement relative to the base is known.
        factors : mapping of str to float
            By the load vectors of moving bases: how far the interface moves with the structure as
            a rigid body when the base moves by one.

        Raises
        ------
        SystemModelError
            For an unknown interface or load vector, or a factor that is no finite number.

        Examples
        --------
        >>> from nldyn import BaseMotion, System
        >>> shaken = System.from_matrices(
        ...     [[2.0]], [[800.0]], {"mass": [1.0]}, loads={"table": [2.0]}, modal_damping=0.1,
        ...     excitation=[BaseMotion("table", 1e-3)],
        ... )
        >>> shaken.with_absolute("mass", {"table": 1.0}).interfaces
        ('mass absolute', 'mass')
        """
        if interface not in self.participation or interface in self.rides:
            known = ", ".join(name for name in self.interfaces if name not in self.rides)
            raise SystemModelError(f"unknown interface '{interface}'; there are: {known}")
        for load, factor in _checked_names("factors", factors).items():
            if load not in self.loads:
                known = ", ".join(self.loads) or "none"
                raise SystemModelError(f"'{load}' is not a load vector; there are: {known}")
            if not is_finite(factor):
                raise SystemModelError(f"factors: '{load}' must be finite, got {shown(factor)}")
        name = f"{interface} absolute"
        if name in self.participation or name in self.loads:
            raise SystemModelError(f"there is an interface '{name}' already")
        return replace(
            self,
            participation={name: self.participation[interface], **self.participation},
            rides={**self.rides, name: dict(factors)},
        )

    def ride(self, interface: str, omega: float) -> Ride:
        """What a moving base adds at ω (rad/s) to the displacement of an interface.

        Nothing, unless the interface was made by `with_absolute`.
        """
        factors = self.rides.get(interface)
        if not factors:
            return NO_RIDE
        bases = [
            (source, factors[source.at])
            for source in self.excitation
            if isinstance(source, BaseMotion) and source.at in factors
        ]
        return Ride.of(bases, omega)

    def displacement(
        self, interface: str, states: Real, phases: Real, omega: float
    ) -> tuple[Real, Real]:
        """Displacement and velocity (k,) of an interface at modal states (k, 2n).

        The forcing phases (k,) and ω (rad/s) tell how a base moves, if it does.
        """
        phi, ride = self.participation[interface], self.ride(interface, omega)
        u, v = states[:, : self.size] @ phi, states[:, self.size :] @ phi
        return u + ride.at(phases), v + ride.speed(phases, omega)

    def with_spin(self, hz: float) -> System:
        """The same rotor at another speed.

        Raises
        ------
        SystemModelError
            If it has no spin, or its motion without contact would grow.
        """
        if self.spin is None:
            raise SystemModelError("the system has no spin")
        return self._faster(replace(self.spin, hz=hz), hz - self.spin.hz)

    def _spun(self, spin: Spin | None) -> System:
        """The system with what the speed of a shaft adds."""
        return self if spin is None else self._faster(spin, spin.hz)

    def _faster(self, spin: Spin, turns: float) -> System:
        G, N = spin.added(turns, self.size)
        if self.circulatory is not None:
            N = self.circulatory + N
        return replace(
            self, damping=self.damping + G, circulatory=N if np.any(N) else None, spin=spin
        )

    def with_elements(self, **changed: Unpack[Elements]) -> System:
        """The same structure with elements whose numbers differ, at the same interfaces.

        Of the springs, polynomial ones may, of the dampers dry friction. The linear part is
        shared, which saves most of the work of making a system.
        """
        other = copy.copy(self)
        if changed.keys() - {"stops", "excitation", "springs", "dampers"}:
            raise TypeError("with_elements takes stops, excitation, springs and dampers")
        kept = {"linear", "total_damping", "spring_stiffness", "stiffness"}
        for derived in vars(self).keys() - {own.name for own in fields(self)} - kept:
            del vars(other)[derived]
        for name, elements in _listed(changed).items():
            object.__setattr__(other, name, elements)
        other._check_interfaces()
        return other

    def _check_carried(self) -> None:
        """Refuse what ties places that a base carries otherwise; the modes must be complete."""
        bases = [source for source in self.excitation if isinstance(source, BaseMotion)]
        loads = {base.at for base in bases}
        for table in ("stops", "sliders", "springs", "dampers"):
            for number, element in enumerate(getattr(self, table)):
                ends = getattr(element, "ends", [(element.at, element.against)])
                for at, against in ends:
                    if against is None:
                        continue
                    some, other = (
                        {load: float(self.loads[load] @ self.participation[end]) for load in loads}
                        for end in (at, against)
                    )
                    if carried_apart(bases, some, other):
                        what = f"{table}[{number}]"
                        if isinstance(element, Slider):
                            what = f"friction at '{element.at}'"
                        raise SystemModelError(told_apart(what, at, against))

    def with_slider(self, number: int, name: str, value: float) -> System:
        """The system with another number of one of its `sliders`.

        That is its `coefficient`, `normal_force` or `tangential_stiffness`, or the `base_speed` of
        what it slides on.
        """
        slider = self.sliders[number]
        change: dict[str, Any] = {name: value}
        if name == "coefficient":
            change = {"friction": slider.friction.with_coefficient(value)}
        elif name == "base_speed":
            change = {"friction": slider.friction.with_base_speed(value)}
        if slider.stop >= 0:
            stops = list(self.stops)
            pressing = stops[slider.stop]
            assert isinstance(pressing, Stop | RigidStop)
            stops[slider.stop] = replace(pressing, **change)
            return self.with_elements(stops=tuple(stops))
        dry = [i for i, damper in enumerate(self.dampers) if isinstance(damper, DryFriction)]
        place = dry[number - len(self.sliders)]  # they are the last of the sliders
        dampers = list(self.dampers)
        dampers[place] = replace(dampers[place], **change)
        return self.with_elements(dampers=tuple(dampers))

    def _check_shapes(self) -> None:
        n = self.natural_frequencies.size
        if self.natural_frequencies.ndim != 1:
            raise SystemModelError(
                f"frequencies_hz must be a list, got shape {self.natural_frequencies.shape}"
            )
        if n == 0:
            raise SystemModelError("a system needs at least one mode")
        if np.any(self.natural_frequencies < 0.0):
            raise SystemModelError("frequencies_hz must not be negative")
        if self.damping.shape != (n, n):
            raise SystemModelError(f"damping must be ({n}, {n}), got {self.damping.shape}")
        if self.circulatory is not None and self.circulatory.shape != (n, n):
            raise SystemModelError(f"circulatory must be ({n}, {n}), got {self.circulatory.shape}")
        for what, vectors in (("participation of", self.participation), ("load", self.loads)):
            for name, phi in vectors.items():
                _check_modal_vector(f"{what} '{name}'", phi, n)
        common, count = self.common_flexibility, len(self.stops)
        if common is not None and (common.shape != (count, count) or np.any(np.diag(common))):
            raise SystemModelError(
                f"common_flexibility must be ({count}, {count}) for {count} stops, with zeros on "
                f"its diagonal, got {common.shape}"
            )
        both = set(self.participation) & set(self.loads)
        if both:
            raise SystemModelError(f"'{min(both)}' names both an interface and a load vector")

    def _check_sliders(self) -> None:
        """Refuse sliders that hold one motion together: what each holds would not be told."""
        for at, against in self.place_ends:
            if not np.any(self.vector_between(at, against)):
                raise SystemModelError(
                    f"friction at '{at}' acts on no motion: none of the {self.size} modes "
                    "moves there"
                )
        rings = any(isinstance(stop, RoundStop) for stop in self.rigid_stops.values())
        for number in self.over_planes:
            slider, rigid = self.sliders[number], self.rigid_stops.get(self.sliders[number].stop)
            if self.rigid_stops and number not in self.sprung and (rings or rigid is None):
                raise SystemModelError(
                    f"friction at '{slider.at}' over a plane needs a tangential_stiffness beside "
                    "rigid stops that do not press on it: what their impacts make of the sliding "
                    "is not told"
                )
            if _one_motion(*(self.vector_between(*ends) for ends in slider.ends)):
                raise SystemModelError(
                    f"friction at '{slider.at}' acts over no plane with '{slider.ends[1][0]}': in "
                    f"the {self.size} modes both tangents are one motion, or none"
                )
            if isinstance(rigid, RigidStop):
                rows = [self.vector_between(*ends) for ends in slider.ends]
                if _rank([self.stop_vector(rigid), *rows], self.size) < 3:
                    raise SystemModelError(
                        f"friction at '{slider.at}' acts over no plane along the rigid stop at "
                        f"'{rigid.at}': in the {self.size} modes its normal is a motion of both "
                        "tangents, so that nothing tells what holds it"
                    )
        for stop in self.rigid_stops.values():
            if isinstance(stop, RoundStop):
                self._check_rigid_ring(stop)
                continue
            if stop.area is not None:
                raise SystemModelError(
                    f"contact area '{stop.area}' is rigid, but its points have mass: name it in "
                    "massless = [...] of method 'macneal', or give it a stiffness"
                )
            if not isinstance(stop.friction, Friction) or stop.tangent is None:
                continue
            if stop.friction.adhesion:
                raise SystemModelError(
                    f"friction of a rigid stop has one coefficient, at rest and sliding: at "
                    f"'{stop.at}' leave out at_rest and fading_speed, or give the stop a stiffness"
                )
            along = self.vector_between(stop.tangent, stop.tangent_against)
            if _one_motion(self.stop_vector(stop), along):
                raise SystemModelError(
                    f"friction at '{stop.tangent}' acts on no motion along the rigid stop at "
                    f"'{stop.at}': in the {self.size} modes both are one motion, or none"
                )
        for ring in self.round_stops.values():
            if ring.friction and _one_motion(*self.stop_vectors(ring)):
                x, y = ring.plane
                raise SystemModelError(
                    f"friction of the round clearance at '{x}', '{y}' acts on no motion all around:"
                    f" in the {self.size} modes both are one motion, or none"
                )
        if self.size > 1:  # in one mode all directions are one motion
            self._check_normals()
        for together in self._sliders_at_once() if self.sliders else ():
            rows = [self.vector_between(*ends) for slider in together for ends in slider.ends]
            if _rank(rows, self.size) < len(rows):
                names = ", ".join(f"'{s.at}'" for s in together)
                raise SystemModelError(
                    f"friction at {names} acts on motions that are not independent in {self.size} "
                    "modes, so that nothing tells what each holds where they stick: merge them, or "
                    "keep more modes"
                )

    def _check_normals(self) -> None:
        """Refuse tangents along the normal of their stop, and rings of one direction."""
        for slider in self.sliders:
            if slider.stop < 0 or isinstance(stop := self.stops[slider.stop], RoundStop):
                continue
            normal = self.stop_vector(stop)
            for at, against in slider.ends:
                along = self.vector_between(at, against)
                if np.any(along) and _one_motion(normal, along):
                    raise SystemModelError(
                        f"friction at '{at}' acts along the normal of the stop at '{stop.at}': in "
                        f"the {self.size} modes both are one motion"
                    )
        for ring in self.round_stops.values():
            if np.all(np.any(rows := self.stop_vectors(ring), axis=1)) and _one_motion(*rows):
                x, y = ring.plane
                raise SystemModelError(
                    f"the directions of the round clearance at '{x}', '{y}' must be perpendicular: "
                    f"in the {self.size} modes both are one motion"
                )

    def _check_rigid_ring(self, ring: RoundStop) -> None:
        """Refuse what holds the same motion as a rigid round clearance does."""
        rows = self.stop_vectors(ring)
        if _one_motion(*rows):
            x, y = ring.plane
            raise SystemModelError(
                f"the rigid round clearance at '{x}', '{y}' needs a motion all around: in the "
                f"{self.size} modes both are one motion, or none"
            )
        for other in self.sliders:
            along = self.vector_between(other.at, other.against)
            if other.tangential_stiffness is None and _rank([*rows, along], self.size) < 3:
                raise SystemModelError(
                    f"friction at '{other.at}' and the rigid round clearance at "
                    f"'{ring.plane[0]}' would hold one motion, so that nothing tells what each "
                    "takes: give the friction a tangential_stiffness, or the clearance a stiffness"
                )

    def _sliders_at_once(self) -> Iterator[list[Slider]]:
        """Sliders that may stick at once: of stops to both sides of a gap, those of one side.

        Those behind springs are left out: what each holds goes with its strain.
        """
        sides: dict[tuple[str, str | None], set[int]] = {}
        hard = [slider for slider in self.sliders if slider.tangential_stiffness is None]
        pressed = [(slider, self.stops[slider.stop]) for slider in hard if slider.stop >= 0]
        for _, stop in pressed:
            sides.setdefault((stop.at, stop.against), set()).add(stop.direction)
        dry = [slider for slider in hard if slider.stop < 0]
        for chosen in itertools.islice(itertools.product(*sides.values()), MOST_SIDES):
            side = dict(zip(sides, chosen, strict=True))
            yield dry + [
                slider
                for slider, stop in pressed
                if stop.gap < 0.0 or side[stop.at, stop.against] == stop.direction
            ]

    def _check_interfaces(self) -> None:
        known = ", ".join(self.participation) or "none"
        for turning in self.rotations:
            if turning not in self.participation:
                raise SystemModelError(f"rotations: unknown interface '{turning}'; known: {known}")
        for kind, elements, classes in (
            ("stop", self.stops, AnyStop),
            ("damper", self.dampers, AnyDamper),
            ("spring", self.springs, AnySpring),
            ("excitation", self.excitation, Excitation),
        ):
            for element in elements:
                if not isinstance(element, classes):
                    raise SystemModelError(f"{kind} cannot be {shown(element)}")
                for end, name in ends_of(element):
                    if kind == "excitation" and name in self.loads:
                        continue
                    if isinstance(element, BaseMotion):
                        given = ", ".join(self.loads) or "none"
                        fault = (
                            f"'{name}' is not a load vector M r, which a base needs (a single stop "
                            "that moves is three loads, see docs/how-to/loads.md)"
                        )
                        raise SystemModelError(f"excitation: {fault}; there are: {given}")
                    if name in self.rides:
                        raise SystemModelError(f"{kind} {end} '{name}', which is only observed")
                    if name not in self.participation:
                        raise SystemModelError(
                            f"{kind} {end} unknown interface '{name}'; there are: {known}"
                            + _told_of_loads(kind, self.loads)
                        )


def ends_of(element: Any) -> Iterator[tuple[str, str]]:
    """What the ends of an element are called, and the interfaces there."""
    tangents = ("tangent", "tangent_against", "second_tangent", "second_tangent_against")
    for end in ("at", "against", *tangents):
        name = getattr(element, end, None)
        if name is not None:
            yield end, name
    if isinstance(element, RoundStop):
        yield "at", element.plane[1]
        if element.against_plane is not None:
            yield "against", element.against_plane[1]


def _check_modal_vector(name: str, phi: Real, modes: int) -> None:
    if phi.shape != (modes,):
        raise SystemModelError(
            f"{name} has {phi.size} entries but there are {modes} modes"
            if phi.ndim == 1
            else f"{name} must be a list, got shape {phi.shape}"
        )
    if np.abs(phi).max() > LARGEST_PARTICIPATION:
        raise SystemModelError(
            f"{name} must be at most {LARGEST_PARTICIPATION:g} 1/kg^0.5, got {np.abs(phi).max():g}"
        )


def _told_of_loads(kind: str, loads: Mapping[str, Real]) -> str:
    return f"; load vectors: {', '.join(loads)}" if loads and kind == "excitation" else ""


def _listed(acting: Elements) -> dict[str, Any]:
    """Elements of each kind as a tuple."""
    listed: dict[str, Any] = {}
    for name, elements in acting.items():
        try:
            listed[name] = tuple(elements)  # type: ignore[arg-type]
        except TypeError:
            raise SystemModelError(f"{name} must be a list, got {shown(elements)}") from None
    return listed


def _vectors(name: str, vectors: Mapping[str, ArrayLike]) -> dict[str, Real]:
    named = _checked_names(name, vectors)
    return {key: np.atleast_1d(numbers(key, vector)) for key, vector in named.items()}


def _checked_names(name: str, vectors: Mapping[str, ArrayLike]) -> Mapping[str, ArrayLike]:
    if not isinstance(vectors, Mapping):
        raise SystemModelError(
            f"{name} must be a dictionary from names to numbers, got {shown(vectors)}"
        )
    return vectors


def _load_vector(name: str, values: ArrayLike, rows: int) -> Real:
    vector = np.atleast_1d(numbers(name, values))
    if vector.shape != (rows,):
        raise SystemModelError(
            f"{name} has {vector.size} entries but the matrices have {rows} rows"
        )
    return vector


def same_system(a: System, b: System) -> bool:
    """Whether two systems have the same numbers, interfaces and laws.

    Examples
    --------
    >>> twins = [System.from_modal([13.1], {"middle": [0.635]}) for _ in range(2)]
    >>> same_system(*twins), same_system(twins[0], System.from_modal([13.1], {"middle": [0.6]}))
    (True, False)
    """
    return a is b or (
        np.array_equal(a.natural_frequencies, b.natural_frequencies)
        and np.array_equal(a.damping, b.damping)
        and np.array_equal(_or_zero(a.circulatory), _or_zero(b.circulatory))
        and all(
            list(one) == list(other) and all(np.array_equal(one[name], other[name]) for name in one)
            for one, other in ((a.participation, b.participation), (a.loads, b.loads))
        )
        and (a.stops, a.dampers, a.excitation, a.springs)
        == (b.stops, b.dampers, b.excitation, b.springs)
        and same_spin(a.spin, b.spin)
        and a.rides == b.rides
        and set(a.rotations) == set(b.rotations)
    )


def _rank(rows: Sequence[Real], columns: int) -> int:
    return int(np.linalg.matrix_rank(np.array(rows))) if rows and columns else 0


def _one_motion(first: Real, second: Real) -> bool:
    """Whether two modal vectors are parallel to rounding, or one of them is zero."""
    sizes = float(np.linalg.norm(first)), float(np.linalg.norm(second))
    same = np.copysign(sizes[0], first @ second) * second
    return bool(np.linalg.norm(sizes[1] * first - same) <= PARALLEL * sizes[0] * sizes[1])


def _of_size(spin: Spin, size: int) -> Spin:
    """The spin, if its matrices have so many rows."""
    spin.added(0.0, size)
    return spin


def _or_zero(matrix: Real | None) -> Real:
    return np.zeros(0) if matrix is None else matrix


def _natural_modes(K: Real, M: Real) -> tuple[Real, Real]:
    """Natural frequencies ω (n,) and the modes (n, n) with unit modal masses."""
    try:
        squared, modes = sla.eigh(K, M)
    except sla.LinAlgError:
        raise SystemModelError("mass must be positive definite") from None
    if not np.all(np.isfinite(squared)):
        raise SystemModelError("mass is too small beside the stiffness to compute with")
    rounding = FEW * squared.size * np.finfo(float).eps * squared[-1]
    if squared[0] < -rounding and _negative(K):
        raise SystemModelError("stiffness must not be negative in any direction")
    return np.sqrt(np.maximum(squared, 0.0)), modes


def _negative(K: Real) -> bool:
    """Whether a stiffness, scaled to a unit diagonal, is negative in a direction."""
    diagonal = np.abs(np.diag(K))
    scale = 1.0 / np.sqrt(np.where(diagonal > 0.0, diagonal, max(diagonal.max(), TINY)))
    return bool(sla.eigvalsh(scale[:, None] * K * scale)[0] < -NEGATIVE)


def _symmetric(name: str, values: ArrayLike) -> Real:
    matrix = np.atleast_2d(numbers(name, values))
    if matrix.ndim != 2 or matrix.shape[0] != matrix.shape[1]:
        raise SystemModelError(f"{name} must be a square matrix, got shape {matrix.shape}")
    zero = ZERO_ENTRY * float(np.abs(matrix).max())
    if not np.allclose(matrix, matrix.T, rtol=SAME_ENTRY, atol=zero):
        raise SystemModelError(f"{name} {must_be_symmetric(name)}")
    return matrix


def _modal_damping(omega: Real, ratios: float | ArrayLike) -> Real:
    zeta = numbers("modal_damping", ratios)
    if zeta.ndim > 1 or zeta.size not in (1, omega.size):
        raise SystemModelError(
            f"modal_damping must be one number or one per mode ({omega.size}), got {zeta.size}"
        )
    if np.any(zeta < 0.0):
        raise SystemModelError("modal_damping must not be negative")
    return np.diag(2.0 * zeta * omega)
