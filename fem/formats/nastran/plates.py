"""What PSHELL, PCOMP and PCOMPG say of a plate."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fem.base.arrays import FloatArray
from fem.formats.nastran.cards import Card
from fem.formats.nastran.materials import Isotropic, Materials
from fem.model.parts import SHEAR_FACTOR, Material
from fem.model.plates import NO_SHEAR, Layer, PlateSection, layered

SAME = 1e-6  # relative: ratios that are those of a plate of one material


@dataclass(frozen=True)
class Sheet:
    """Material and thickness, and the section if one isotropic material does not say it all.

    Parameters
    ----------
    directed
        Whether the directions of the section matter.
    """

    material: Material
    thickness: float
    section: PlateSection | None = None
    directed: bool = False


def sheet(card: Card, materials: Materials, thickness: float | None) -> Sheet:
    """A PSHELL, for elements with a thickness of their own or that of the card."""
    t = card.real(2) if thickness is None else thickness
    if not t > 0.0:
        raise card.fail(f"its thickness is {t:g} and must be positive")
    numbers = [card.whole(at, 0) for at in (1, 3, 5, 10)]
    if min(numbers) < 0:
        raise card.fail("plane strain (MID2 = -1) is not read; give plane solids")
    laws = [materials.plane(n, card) if n else None for n in numbers]
    membrane, bending, shear, coupling = laws
    first = membrane or bending
    if first is None:
        raise card.fail("has neither MID1 nor MID2")
    bent, sheared = card.real(4, 1.0), card.real(6, SHEAR_FACTOR)
    added = materials.factor * card.real(7)
    if (
        isinstance(membrane, Isotropic)
        and membrane.consistent
        and membrane == bending == shear
        and coupling is None
        and abs(bent - 1.0) < SAME
        and abs(sheared / SHEAR_FACTOR - 1.0) < 1e-3
    ):
        density = membrane.density + added / t
        return Sheet(Material(membrane.youngs_modulus, density, membrane.poissons_ratio), t)
    A = t * membrane.plane_law if membrane else np.zeros((3, 3))
    D = bent * t**3 / 12.0 * bending.plane_law if bending else np.zeros((3, 3))
    # its curvatures count against ours
    B = -(t**2) * coupling.plane_law if coupling else np.zeros((3, 3))
    if bending is None:
        S = np.zeros((2, 2))
    elif shear is None:
        S = NO_SHEAR * SHEAR_FACTOR * t * bending.plane_law[2, 2] * np.eye(2)
    else:
        S = sheared * t * shear.shear_law
    return _sheet(A, B, D, S, first.density * t + added, first.density * t**3 / 12.0, t)


def _sheet(
    A: FloatArray,
    B: FloatArray,
    D: FloatArray,
    S: FloatArray,
    mass: float,
    inertia: float,
    thickness: float,
) -> Sheet:
    section = PlateSection(A.tolist(), B.tolist(), D.tolist(), S.tolist(), mass, inertia)
    return Sheet(_likeness(A, D, mass, thickness), thickness, section, _directed(A, B, D, S))


def _directed(A: FloatArray, B: FloatArray, D: FloatArray, S: FloatArray) -> bool:
    """Whether one of the matrices changes when the axes are turned."""
    section = PlateSection(A.tolist(), B.tolist(), D.tolist(), S.tolist(), 0.0)
    turned = section.turned(0.7)
    pairs = [(section.law, turned.law), (np.array(section.shear), np.array(turned.shear))]
    return any(np.abs(a - b).max() > SAME * np.abs(a).max() for a, b in pairs)


def _likeness(A: FloatArray, D: FloatArray, mass: float, t: float) -> Material:
    """An isotropic material that is as stiff along x, for pictures and checks."""
    law = A / t if A[0, 0] > 0.0 else 12.0 * D / t**3
    nu = float(np.clip(law[0, 1] / np.sqrt(law[0, 0] * law[1, 1]), -0.9, 0.49))
    return Material(float(law[0, 0] * (1.0 - nu**2)), mass / t, nu)


def composite(card: Card, materials: Materials) -> Sheet:
    """A PCOMP or PCOMPG: layers from the bottom to the top."""
    layers = _layers(card, materials)
    materials.deck.tell_of_damping(card, 6)
    lamination = card.text(7)
    if lamination == "SYM":
        layers = [*layers, *layers[::-1]]
    elif lamination not in ("", "NO"):
        raise card.fail(f"the lamination {lamination!r} is not read; give all layers, or SYM")
    bottom = card.real(1) if card.text(1) else None
    section = layered(layers, bottom, materials.factor * card.real(2))
    total = sum(layer.thickness for layer in layers)
    A, B, D, S = (
        np.array(m) for m in (section.membrane, section.coupling, section.bending, section.shear)
    )
    return _sheet(A, B, D, S, section.mass, section.inertia, total)


def _layers(card: Card, materials: Materials) -> list[Layer]:
    """Blank materials and thicknesses are those of the layer before."""
    step, first = (4, 8) if card.name == "PCOMP" else (8, 9)
    found: list[Layer] = []
    number, thickness = 0, 0.0
    for at in range(first, len(card.fields), step):
        if not any(card.text(at + i) for i in range(3)):
            continue
        number, thickness = card.whole(at, number), card.real(at + 1, thickness)
        if not thickness > 0.0:
            raise card.fail(f"layer {len(found) + 1} has the thickness {thickness:g}")
        law = materials.plane(number, card)
        shear = law.shear_law
        if materials.cards[number].name == "MAT2":
            shear = np.zeros((2, 2))  # that of a layer says nothing of transverse shear
        found.append(
            Layer(law.plane_law.tolist(), shear.tolist(), law.density, thickness, card.real(at + 2))
        )
    if not found:
        raise card.fail("has no layers")
    return found
