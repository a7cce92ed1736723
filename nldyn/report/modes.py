"""The modes of a scene: frequencies, effective masses, participation."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

import cms
from nldyn.base.arrays import Real
from nldyn.base.errors import SceneError
from nldyn.scene.build import Structure, build_structure, build_system
from nldyn.scene.schema.scene import Scene

AXES = ("x", "y", "z")
ROUNDING = 1e-12  # of the whole mass


@dataclass(frozen=True, eq=False)
class ModeTable:
    """Modes of a scene and what they take part in.

    Parameters
    ----------
    frequencies_hz : (r,) array
        In Hz.
    participation : dict of str to (r,) array
        Displacement of each interface in each mode, in 1/sqrt(kg).
    residual : int
        How many of the last modes are residual ones, which are no eigenmodes.
    effective_mass : (r, 2 or 3) array, optional
        Of a mesh: mass in kg that each mode moves along x, y and z when the supports are shaken;
        their sum over all modes of the mesh is the mass that moves.
    mass : float, optional
        Of a mesh: its whole mass in kg.
    """

    frequencies_hz: Real
    participation: Mapping[str, Real]
    residual: int = 0
    effective_mass: Real | None = None
    mass: float | None = None

    def __repr__(self) -> str:
        """One line: how many, and up to which frequency."""
        count = len(self.frequencies_hz)
        return f"<ModeTable: {count} modes up to {self.frequencies_hz.max():.6g} Hz>"

    def columns(self) -> list[str]:
        """Names of the columns, with units."""
        axes = 0 if self.effective_mass is None else self.effective_mass.shape[1]
        return [
            "mode",
            "frequency_hz",
            *(f"effective_mass_{axis}_kg" for axis in AXES[:axes]),
            *(f"participation_{name}" for name in self.participation),
        ]

    def rows(self) -> list[list[float]]:
        """One for each mode; the first number is that of the mode, from 1."""
        masses = [] if self.effective_mass is None else self.effective_mass.T.tolist()
        given = [self.frequencies_hz.tolist(), *masses]
        given += [values.tolist() for values in self.participation.values()]
        numbered = enumerate(zip(*given, strict=True), start=1)
        return [[number, *row] for number, row in numbered]

    def is_residual(self, mode: int) -> bool:
        """Whether a mode, counted from 1, is a residual one."""
        return mode > len(self.frequencies_hz) - self.residual

    def report(self, modes: Sequence[int] = ()) -> str:
        """The table as text, of the modes asked for (from 1) or of all."""
        plain = self
        if self.effective_mass is not None and self.mass:
            rounding = self.effective_mass < ROUNDING * self.mass
            plain = replace(self, effective_mass=np.where(rounding, 0.0, self.effective_mass))
        head = [name.replace("effective_mass_", "eff. mass ") for name in self.columns()]
        head = [name.replace("_kg", " (kg)").replace("_hz", " (Hz)") for name in head]
        head = [name.replace("participation_", "at ") for name in head]
        widths = [max(12, len(name) + 2) for name in head]
        widths[0] = 5
        lines = ["".join(f"{name:>{width}}" for name, width in zip(head, widths, strict=True))]
        for row in plain.rows():
            if modes and row[0] not in modes:
                continue
            cells = [f"{row[0]:>{widths[0]}.0f}", f"{row[1]:>{widths[1]}.6g}"]
            cells += [f"{v:>{w}.5g}" for v, w in zip(row[2:], widths[2:], strict=True)]
            mark = "  residual" if self.is_residual(int(row[0])) else ""
            lines.append("".join(cells) + mark)
        if plain.effective_mass is not None and plain.mass:
            total = plain.effective_mass.sum(axis=0)
            told = ", ".join(
                f"{axis} {value:.5g} kg" for axis, value in zip(AXES, total, strict=False)
            )
            count = len(plain.effective_mass)
            lines.append(
                f"effective mass of {count} modes: {told}; the mesh has {plain.mass:.5g} kg"
            )
        lines.append("'at' is the displacement of an interface in each mode, in 1/sqrt(kg)")
        return "\n".join(lines)

    def as_json(self) -> list[dict[str, Any]]:
        """The rows by the names of their columns, ready for JSON."""
        return [
            {
                **{
                    name: None if isinstance(value, float) and not math.isfinite(value) else value
                    for name, value in zip(self.columns(), row, strict=True)
                },
                "residual": self.is_residual(int(row[0])),
            }
            for row in self.rows()
        ]


def mode_table(scene: Scene, structure: Structure | None = None) -> ModeTable:
    """The modes of a scene.

    Parameters
    ----------
    scene : Scene
        Any scene.
    structure : Structure, optional
        What `build_structure` gave for it, if it is at hand.

    Returns
    -------
    ModeTable

    Raises
    ------
    SceneError
        As for `build_structure` and `build_system`.

    Examples
    --------
    >>> from nldyn.base.resources import example
    >>> from nldyn.scene.read import load_scene
    >>> mode_table(load_scene(example("one_dof.toml")))
    <ModeTable: 1 modes up to 13.1293 Hz>
    """
    structure = structure or build_structure(scene)
    reduced, component = structure.reduced, structure.component
    if reduced is None:
        system = build_system(scene)
        return ModeTable(system.frequencies_hz, system.participation)
    masses = total = None
    if component is not None and not isinstance(component, cms.Matrices):
        masses = (reduced.basis.T @ component.inertia) ** 2
        total = float(component.rigid_mass[0, 0])
    return ModeTable(
        reduced.frequencies_hz, reduced.participation, reduced.residual_modes, masses, total
    )


def check_modes(scene: Scene, modes: Sequence[int], count: int) -> None:
    """Refuse modes that are not there."""
    missing = [mode for mode in modes if not 1 <= mode <= count]
    if missing:
        raise SceneError(f"{scene.file}: has modes 1 to {count}, no mode {missing[0]}")
