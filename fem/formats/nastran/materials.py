"""Materials of a deck: isotropic ones, and those of plates and solids with directions."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from fem.base.arrays import FloatArray
from fem.formats.nastran.cards import Card
from fem.formats.nastran.deck import Deck

SAME = 1e-3  # relative: moduli that are those of one isotropic material
EXPANSION = "thermal expansion is not used: stiffness and mass are those of the cold structure"
CONTRADICTING = 0.01
"""Relative difference between G and E / (2 (1 + NU)) from which Nastran warns."""
DAMPINGS = {"MAT1": 7, "MAT2": 12, "MAT8": 16}
"""Where the coefficient of structural damping (GE) stands."""
EXPANSIONS = {"MAT1": (5,), "MAT2": (8, 9, 10), "MAT8": (8, 9)}


@dataclass(frozen=True)
class Isotropic:
    """Young's and the shear modulus, Poisson's ratio and the density of MAT1.

    Where the three contradict each other, E and nu are those of solids and of the membranes and
    the bending of plates, and G that of transverse shear and torsion.
    """

    youngs_modulus: float
    shear_modulus: float
    poissons_ratio: float
    density: float

    @property
    def consistent(self) -> bool:
        """Whether the shear modulus is that of an isotropic material."""
        own = self.youngs_modulus / (2.0 * (1.0 + self.poissons_ratio))
        return abs(self.shear_modulus - own) <= SAME * own

    @property
    def plane_law(self) -> FloatArray:
        """Stiffness (3, 3) in plane stress, of E and nu."""
        E, nu = self.youngs_modulus, self.poissons_ratio
        law = np.array([[1.0, nu, 0.0], [nu, 1.0, 0.0], [0.0, 0.0, (1.0 - nu) / 2.0]])
        return np.asarray(E / (1.0 - nu**2) * law, dtype=np.float64)

    @property
    def shear_law(self) -> FloatArray:
        """Stiffness (2, 2) against transverse shear."""
        return self.shear_modulus * np.eye(2)


@dataclass(frozen=True)
class Plane:
    """Stiffness (3, 3) in plane stress and against transverse shear (2, 2), and the density."""

    plane_law: FloatArray
    shear_law: FloatArray
    density: float


@dataclass
class Materials:
    """The materials of a deck, by their numbers."""

    deck: Deck
    cards: Mapping[int, Card]
    factor: float = 1.0

    def isotropic(self, number: int, card: Card) -> Isotropic:
        """A MAT1, for the card that names it."""
        own = self._card(number, card)
        if own.name != "MAT1":
            raise card.fail(f"needs a MAT1, but material {number} is {own.name} in {own.place}")
        return self._isotropic(own)

    def _isotropic(self, card: Card) -> Isotropic:
        self._tell_of_unused(card)
        E, G, nu = (card.real(at) if card.text(at) else None for at in (1, 2, 3))
        if E is None and G is None:
            raise card.fail("has neither E nor G")
        if nu is None:  # of three numbers one follows from two; alone, the other two are 0
            nu = E / (2.0 * G) - 1.0 if E and G else 0.0
            E, G = E or 0.0, G or 0.0
        elif E is None:
            assert G is not None
            E = 2.0 * (1.0 + nu) * G
        elif G is None:
            G = E / (2.0 * (1.0 + nu))
        if not E > 0.0:
            raise card.fail(f"its Young's modulus is {E:g} and must be positive")
        self._tell_of_ratio(card, E, G, nu)
        return Isotropic(E, G, nu, self.factor * card.real(4))

    def _tell_of_ratio(self, card: Card, E: float, G: float, nu: float) -> None:
        """Note that E, G and nu contradict, or that no material has the ratio of E and G."""
        told = f"{self.deck.source}: {card.place}: MAT1 {card.whole(0)}"
        note = ""
        if G > 0.0 and abs(1.0 - E / (2.0 * (1.0 + nu) * G)) > CONTRADICTING:
            note = (
                f"{told}: E, G and NU contradict each other; E and NU are those of solids and of"
                " membranes and bending of shells, E and G those of bars and of transverse shear"
            )
        elif card.text(1) and card.text(2) and not -1.0 < nu <= 0.5:
            note = (
                f"{told}: its E and G make Poisson's ratio {nu:.6g}; bars take G = {G:g} as it is,"
                " unless NU should stand in field 5"
            )
        if note and note not in self.deck.notes:
            self.deck.notes.append(note)

    def _resisting_shear(self, card: Card) -> Isotropic:
        law = self._isotropic(card)
        if not law.shear_modulus > 0.0:
            raise card.fail("its G is 0 (Nastran takes G and NU as 0 if both are blank); give NU")
        nu = law.poissons_ratio
        if not -1.0 < nu < 0.5:
            raise card.fail(
                f"its Poisson's ratio is {nu:.6g}, not between -1 and 0.5"
                + ("" if card.text(3) else ", by its E and G; does NU stand in the field of G?")
            )
        return law

    def plane(self, number: int, card: Card) -> Isotropic | Plane:
        """The material of a plate: MAT1, MAT2 or MAT8."""
        own = self._card(number, card)
        if own.name == "MAT1":
            return self._resisting_shear(own)
        self._tell_of_unused(own)
        if own.name == "MAT2":
            g11, g12, g13, g22, g23, g33 = own.reals(1, 6)
            law = np.array([[g11, g12, g13], [g12, g22, g23], [g13, g23, g33]])
            # as MID3 of PSHELL its first four numbers are those of transverse shear
            return Plane(law, np.array([[g11, g12], [g12, g22]]), self.factor * own.real(7))
        if own.name == "MAT8":
            return self._orthotropic(own)
        raise card.fail(f"needs a MAT1, MAT2 or MAT8, but material {number} is {own.name}")

    def _orthotropic(self, card: Card) -> Plane:
        E1, E2, nu, G = card.reals(1, 4)
        if not (E1 > 0.0 and E2 > 0.0 and G > 0.0 and nu**2 * E2 < E1):
            raise card.fail("needs positive E1, E2 and G12 and a Poisson's ratio that fits them")
        factor = 1.0 / (1.0 - nu**2 * E2 / E1)
        law = np.array(
            [[E1 * factor, nu * E2 * factor, 0.0], [nu * E2 * factor, E2 * factor, 0.0], [0, 0, G]]
        )
        return Plane(law, np.diag(card.reals(5, 2)), self.factor * card.real(7))

    def solid(self, number: int, card: Card) -> Isotropic:
        """The material of a solid: MAT1."""
        own = self._card(number, card)
        if own.name == "MAT9":
            raise own.fail(
                "solids of it are not read; give a MAT1, or the part with its material in the scene"
            )
        if own.name != "MAT1":
            raise card.fail(f"needs a MAT1, but material {number} is {own.name} in {own.place}")
        return self._resisting_shear(own)

    def _card(self, number: int, card: Card) -> Card:
        if number not in self.cards:
            raise card.fail(f"names the material {number}, which is not defined")
        return self.cards[number]

    def _tell_of_unused(self, card: Card) -> None:
        self.deck.tell_of_damping(card, DAMPINGS[card.name])
        if any(card.text(at) and card.real(at) for at in EXPANSIONS[card.name]):
            what = f"thermal expansion of {card.name} {card.whole(0)}"
            if what not in self.deck.left:
                self.deck.leave_out(what, card.place, EXPANSION)
