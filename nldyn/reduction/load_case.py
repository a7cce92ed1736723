"""What acts on a component and what is asked of it, apart from how it is reduced."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from nldyn.base.errors import SystemModelError, check_frequency, check_range
from nldyn.system.loads import Excitation
from nldyn.system.parameters import Parameter
from nldyn.system.round_stop import RoundStop
from nldyn.system.stop import Stop
from nldyn.system.system import AnyDamper, AnySpring, System

if TYPE_CHECKING:
    import cms


@dataclass(frozen=True)
class LoadCase:
    """Stops, dampers and excitation of a component whose reduction is still open.

    Parameters
    ----------
    limits : (float, float)
        Excitation frequencies of interest in Hz, or values of the parameter.
    stops, dampers, excitation : tuples
        What acts at the interfaces.
    modal_damping : float
        Damping ratio of every mode, residual modes included.
    observe : str, optional
        Interface whose displacement is asked for; the first unless given.
    rayleigh : (float, float)
        alpha in 1/s and beta in s of the damping alpha M + beta K of the component.
    springs : tuple
        Springs at the interfaces.
    rotations : set of str
        The interfaces that turn: their displacements are in rad.
    parameter : str or Parameter, optional
        What changes, the excitation frequency unless given: see
        `nldyn.system.chart.checked_parameter`.
    frequency_hz : float, optional
        Excitation frequency in Hz, held where another parameter changes.

    Raises
    ------
    SystemModelError
        For a range that is no range, a frequency that is held where it changes, or without
        excitation.

    Examples
    --------
    >>> from nldyn import Unbalance
    >>> LoadCase((15.0, 90.0), excitation=(Unbalance("middle", 4.92e-6),)).modal_damping
    0.0
    """

    limits: tuple[float, float]
    stops: tuple[Stop | RoundStop, ...] = ()
    dampers: tuple[AnyDamper, ...] = ()
    excitation: tuple[Excitation, ...] = ()
    modal_damping: float = 0.0
    observe: str | None = None
    rayleigh: tuple[float, float] = (0.0, 0.0)
    springs: tuple[AnySpring, ...] = ()
    rotations: frozenset[str] = frozenset()
    parameter: str | Parameter | None = None
    frequency_hz: float | None = None

    def __post_init__(self) -> None:
        if self.parameter is None:
            check_range(self.limits, "limits")
            if self.frequency_hz is not None:
                raise SystemModelError(
                    "frequency_hz is held where another parameter changes: name the parameter, or "
                    "leave it out"
                )
        elif self.frequency_hz is None:
            name = getattr(self.parameter, "name", self.parameter)
            raise SystemModelError(f"parameter '{name}': needs frequency_hz, which is held")
        else:
            check_frequency("frequency_hz", self.frequency_hz)
        if not self.excitation:
            raise SystemModelError("the setting has no excitation: nothing moves the structure")

    @property
    def range_hz(self) -> tuple[float, float]:
        """Lowest and highest excitation frequency in Hz, which are one where it is held."""
        hz = self.frequency_hz
        return self.limits if hz is None else (hz, hz)

    def system(self, reduced: cms.ReducedModel) -> System:
        """The system that a reduced model makes of it, the observed interface first.

        Raises
        ------
        SystemModelError
            As `System.from_reduced`.
        """
        system = system_of_reduced(
            reduced,
            self.observe,
            self.rayleigh,
            modal_damping=self.modal_damping,
            stops=self.stops,
            dampers=self.dampers,
            excitation=self.excitation,
            springs=self.springs,
        )
        return replace(system, rotations=self.rotations)


def system_of_reduced(
    reduced: cms.ReducedModel, observe: str | None, rayleigh: tuple[float, float], **given: Any
) -> System:
    """The system of a reduced model, with what `System.from_reduced` is given.

    Raises
    ------
    SystemModelError
        As `System.from_reduced`.
    """
    if any(rayleigh):
        reduced = reduced.with_damping(rayleigh=rayleigh)
    return System.from_reduced(_with_first(reduced, observe) if observe else reduced, **given)


def _with_first(reduced: cms.ReducedModel, observed: str) -> cms.ReducedModel:
    """The reduced model with one interface before the others."""
    order = sorted(reduced.interfaces, key=lambda name: name != observed)
    changed = replace(reduced, participation={n: reduced.participation[n] for n in order})
    if reduced.residual_flexibility is None and reduced.residual_shapes is None:
        return changed
    places = [reduced.interfaces.index(name) for name in order]
    flexibility, shapes = reduced.residual_flexibility, reduced.residual_shapes
    return replace(
        changed,
        residual_flexibility=None if flexibility is None else flexibility[places][:, places],
        residual_shapes=None if shapes is None else shapes[:, places],
    )
