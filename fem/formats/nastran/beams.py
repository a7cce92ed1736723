"""Beams: CBAR and CBEAM with their properties, orientations, offsets and pins."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from fem.base.arrays import FloatArray
from fem.base.errors import ModelError
from fem.formats.nastran.cards import Card
from fem.formats.nastran.gathered import Gathered
from fem.formats.nastran.materials import Isotropic, Materials
from fem.formats.nastran.sections import BeamNumbers, beam_numbers
from fem.model.parts import BeamPart, Material
from fem.model.sections import LinearSection, Section

PROPERTIES = {"CBAR": ("PBAR", "PBARL"), "CBEAM": ("PBEAM", "PBEAML", "PBCOMP")}
DEFAULTS = {"CBAR": "BAROR", "CBEAM": "BEAMOR"}
RIGID = 1e8  # shear area over area of a beam without shear deformation in one of two directions
LEAST = 1e-12  # of the polar moment: I1, I2 or J of a beam that resists nothing there
LIKELY = (-0.9, 0.499)
"""Poisson's ratios that a material may have; else the section carries the shear modulus."""


@dataclass
class _Lines:
    """The elements of one property, in the order of their cells."""

    card: Card
    spans: list[FloatArray] = field(default_factory=list)
    heights: list[FloatArray] = field(default_factory=list)
    offsets: list[FloatArray] = field(default_factory=list)
    pins: list[tuple[tuple[int, ...], ...]] = field(default_factory=list)


def read_beams(gathered: Gathered, materials: Materials) -> None:
    """Read all beams, and the parts that their properties make of them."""
    deck = gathered.deck
    for name, sorts in PROPERTIES.items():
        owners = deck.by_number(*sorts)
        found: dict[str, _Lines] = {}
        for card in deck.of(name):
            gathered.add_element(card)
            _fill(card, deck.of(DEFAULTS[name]))
            number = card.whole(1, card.whole(0))
            group = f"{owners[number].name if number in owners else sorts[0]} {number}"
            grids = [card.whole(2), card.whole(3)]
            gathered.add_cell(card, "line", grids, group)
            gathered.turns.update(grids)
            _read_line(gathered, card, found.setdefault(group, _Lines(card)))
        for group, lines in found.items():
            gathered.described[group] = _described(gathered, group, lines, owners, materials)


def _fill(card: Card, defaults: list[Card]) -> None:
    """Blank fields of a beam from BAROR or BEAMOR."""
    card.fields += [""] * (16 - len(card.fields))
    for other in defaults:
        for at in (1, 7):
            card.fields[at] = card.fields[at] or other.text(at)
        if not any(card.text(at) for at in (4, 5, 6)):
            card.fields[4:7] = [other.text(at) for at in (4, 5, 6)]


def _read_line(gathered: Gathered, card: Card, lines: _Lines) -> None:
    deck = gathered.deck
    grids = [card.whole(2), card.whole(3)]
    ends = [deck.place(grid, card) for grid in grids]
    systems = (re.sub(r"^[012]$", "", card.text(7)) or "GGG").ljust(3, "G")  # 1 and 2: old form
    if not re.fullmatch(r"[GB][GO][GO]", systems):
        raise card.fail(f"{systems!r} in field 9 is not three letters out of G, O and B")
    offsets = []
    for end, first in ((0, 10), (1, 13)):
        given = np.array(card.reals(first, 3))
        if systems[1 + end] == "O" and given.any():
            raise card.fail("offsets along the element (O in field 9) are not read; give them as G")
        offsets.append(given @ deck.axes(grids[end]))
    span = ends[1] + offsets[1] - ends[0] - offsets[0]
    if not np.linalg.norm(span) > 0.0:
        raise card.fail("has no length")
    lines.spans.append(span)
    lines.heights.append(_height(gathered, card, span, systems[0]))
    lines.offsets.append(np.array(offsets))
    pins = tuple(
        tuple(c - 1 for c in card.components(at)) if card.text(at) not in ("", "0") else ()
        for at in (8, 9)
    )
    if any(len(directions) == 6 for directions in pins):
        raise card.fail("its pins (PA or PB) free all six directions of an end: it joins nothing")
    lines.pins.append(pins)
    if any(card.text(at) for at in (16, 17)):
        deck.leave_out("warping at the ends of CBEAM", card.place, "beams warp freely")


def _height(gathered: Gathered, card: Card, span: FloatArray, system: str) -> FloatArray:
    """The unit vector across the beam in plane 1."""
    deck, first = gathered.deck, card.whole(2)
    if card.text(4) and not card.is_real(4) and not (card.text(5) or card.text(6)):
        v = deck.place(card.whole(4), card) - deck.place(first, card)
    else:
        v = np.array(card.reals(4, 3))
        if system == "G":
            v = v @ deck.axes(first)
    x = span / np.linalg.norm(span)
    across = v - x * (v @ x)
    if not np.linalg.norm(across) > 1e-6 * np.linalg.norm(v):
        raise card.fail("its orientation is missing or lies along it")
    return np.asarray(across / np.linalg.norm(across))


def _described(
    gathered: Gathered,
    group: str,
    lines: _Lines,
    owners: Mapping[int, Card],
    materials: Materials,
) -> dict[str, object]:
    number = int(group.split()[1])
    if number not in owners:
        return {"refused": f"{group} of {lines.card.name} in {lines.card.place} is not defined"}
    own = owners[number]
    try:
        numbers = beam_numbers(gathered.deck, own, materials.factor)
        law = materials.isotropic(own.whole(1), own)
        return {"made": _part(own, numbers, law, lines)}
    except ModelError as error:
        return {"refused": str(error)}


def _part(card: Card, numbers: BeamNumbers, law: Isotropic, lines: _Lines) -> BeamPart:
    E, G = law.youngs_modulus, law.shear_modulus
    nu, factor = E / (2.0 * G) - 1.0 if G > 0.0 else np.inf, 1.0
    if not LIKELY[0] < nu < LIKELY[1]:
        nu, factor = 0.3, G * 2.6 / E
    start, angle = _section(card, numbers, 0, factor)
    end, _ = _section(card, numbers, 1, factor)
    sheared = any(numbers.shear) and G > 0.0
    heights, offsets = [], []
    turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    for span, y, w in zip(lines.spans, lines.heights, lines.offsets, strict=True):
        z = np.cross(span / np.linalg.norm(span), y)
        heights.append(turn[0] @ np.stack([y, z]))
        offsets.append(w)
    return BeamPart(
        Material(E, law.density, nu),
        start if start == end else LinearSection(start, end),
        "timoshenko" if sheared else "euler-bernoulli",
        orientation=_once(np.array(heights)),
        end_offsets=_once(np.array(offsets)) if np.any(offsets) else None,
        released=_pins(lines.pins),
        neutral_axis=tuple((turn @ np.mean(numbers.axis, axis=0)).tolist()),
    )


def _section(card: Card, numbers: BeamNumbers, end: int, factor: float) -> tuple[Section, float]:
    """The section at one end, and how far its principal axes are turned from plane 1."""
    area, first, second, mixed, torsion = numbers.ends[end]
    angle = 0.0
    if mixed:
        angle = 0.5 * np.arctan2(2.0 * mixed, first - second)
        mean, half = (first + second) / 2.0, np.hypot((first - second) / 2.0, mixed)
        first, second = mean + half, mean - half
    polar = first + second
    numbered = (first, second, factor * torsion)
    first, second, torsion = (value or LEAST * polar for value in numbered)
    named = {"A": area, "I1": first, "I2": second, "J": torsion}
    wrong = [name for name, value in named.items() if not value > 0.0]
    if wrong:
        raise card.fail(f"its {' and '.join(wrong)} must be positive for a beam; write it as CROD")
    areas: tuple[float | None, float | None] = (None, None)
    if any(numbers.shear) and factor:
        up, across = (factor * area * (k or RIGID) for k in numbers.shear)
        areas = up, across
    added = numbers.added[end], numbers.inertia[end]
    return Section(area, first, second, torsion, *areas, *added), angle


def _once(values: FloatArray) -> Any:
    """Values of all lines, or those of the first if they are all alike."""
    size = max(float(np.abs(values).max()), 1e-300)
    alike = np.abs(values - values[0]).max() <= 1e-12 * size
    return (values[0] if alike else values).tolist()


def _pins(pins: list[tuple[tuple[int, ...], ...]]) -> Any:
    if not any(any(ends) for ends in pins):
        return None
    return pins[0] if all(ends == pins[0] for ends in pins) else tuple(pins)
