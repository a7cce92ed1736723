"""Materials and sections of a deck, as the numbers of parts."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from fem.formats.abaqus.deck import Body, Deck, Label
from fem.formats.abaqus.keywords import Keyword, filled
from fem.formats.abaqus.sets import Resolver
from fem.mesh.element_types import family

_HARMLESS = """
    EXPANSION CONDUCTIVITY SPECIFICHEAT PLASTIC CREEP CYCLICHARDENING RATEDEPENDENT LATENTHEAT
    DAMAGEINITIATION DAMAGEEVOLUTION DAMAGESTABILIZATION FAILSTRESS FAILSTRAIN
    ELECTRICALCONDUCTIVITY JOULEHEATFRACTION INELASTICHEATFRACTION MAGNETICPERMEABILITY
    SHEARFAILURE TENSILEFAILURE
"""
HARMLESS = frozenset(_HARMLESS.split())
"""What a material may have that changes neither stiffness nor mass at rest."""
SECTIONS = ("SOLIDSECTION", "SHELLSECTION", "BEAMSECTION", "BEAMGENERALSECTION")
REFUSED = "refused"
"""The key of a description under which stands why the numbers are not taken."""


class NotTakenError(Exception):
    """Why a material or a section cannot be taken over."""


@dataclass
class _Given:
    """A section, the element set that it is given to with its labels, and what it says."""

    keyword: Keyword
    names: tuple[str, ...]
    labels: Sequence[Label]
    description: dict[str, object]


def described_parts(deck: Deck, resolver: Resolver) -> dict[str, dict[str, object]]:
    """Keys of a part of a scene by the name of the set that a section is given to.

    A description that holds "refused" says why the file's numbers cannot be taken.
    """
    materials = _materials(deck)
    given: list[_Given] = []
    for body in deck.bodies.values():
        for keyword in body.later():
            if keyword.name in SECTIONS and "ELSET" in keyword.parameters:
                given.append(_given(resolver, body, keyword, materials))
    found: dict[str, dict[str, object]] = {}
    for section in given:
        for name in section.names:
            if found.get(name, section.description) != section.description:
                section.description = {REFUSED: f"two sections are given to {name!r}"}
            found[name] = section.description
    return found | _overlapping(given)


def _given(
    resolver: Resolver, body: Body, keyword: Keyword, materials: Mapping[str, list[Keyword]]
) -> _Given:
    name = keyword.parameters["ELSET"]
    labels = resolver.labels("ELSET", body, name, keyword.place())
    try:
        description = _described(resolver.deck, body, keyword, labels, materials)
    except NotTakenError as reason:
        description = {REFUSED: f"{keyword.shown} in {keyword.place()} {reason}"}
    named = body.set_of("ELSET", name)
    spelled = named.name if named else name
    names = (spelled, f"{body.name}.{spelled}") if body.name else (spelled,)
    return _Given(keyword, names, labels, description)


def _overlapping(given: Iterable[_Given]) -> dict[str, dict[str, object]]:
    """Refusals for sets that share elements to which different sections are given."""
    found: dict[str, dict[str, object]] = {}
    first: dict[Label, _Given] = {}
    for section in given:
        met = (first.setdefault(label, section) for label in section.labels)
        others = [other for other in met if other.description != section.description]
        if others:
            one = others[0]
            count = sum(other is one for other in others)
            told = (
                f"{_shown(one)} and {_shown(section)} have {count} element(s) in common, which can"
                " have one section only"
            )
            for name in (*one.names, *section.names):
                found[name] = {REFUSED: told}
    return found


def _shown(section: _Given) -> str:
    return f"{section.keyword.shown} of {section.names[0]!r} in {section.keyword.place()}"


def _materials(deck: Deck) -> dict[str, list[Keyword]]:
    """The keywords of each material, with all that define it."""
    found: dict[str, list[Keyword]] = {}
    for keyword in deck.materials:
        if keyword.name == "MATERIAL":
            current = found.setdefault(keyword.parameters.get("NAME", "").upper(), [])
        current.append(keyword)
    return found


def _material(name: str, materials: Mapping[str, list[Keyword]]) -> dict[str, object]:
    """Young's modulus, Poisson's ratio and density of an isotropic material."""
    if name.upper() not in materials:
        raise NotTakenError(f"names the material {name!r}, which is not defined")
    _check_once(name, materials[name.upper()])
    numbers: dict[str, object] = {}
    for keyword in materials[name.upper()]:
        what = f"of material {name!r} with {keyword.shown} in {keyword.place()}"
        if keyword.name == "ELASTIC":
            if keyword.parameters.get("TYPE", "ISO").upper() not in ("ISO", "ISOTROPIC"):
                raise NotTakenError(f"is {what}, which is not isotropic")
            given = _constant(keyword, what)
            numbers["youngs_modulus"] = given[0]
            numbers["poissons_ratio"] = given[1] if len(given) > 1 else 0.0
        elif keyword.name == "DENSITY":
            numbers["density"] = _constant(keyword, what)[0]
        elif keyword.name not in ("MATERIAL", *HARMLESS):
            raise NotTakenError(f"is {what}, which is not taken over")
    for key in ("youngs_modulus", "density"):
        if key not in numbers:
            raise NotTakenError(f"is of material {name!r}, which has no {key}")
    return numbers


def _check_once(name: str, keywords: Iterable[Keyword]) -> None:
    """Refuse a material that is defined twice, or has two moduli or densities."""
    first: dict[str, Keyword] = {}
    for keyword in keywords:
        before = first.setdefault(keyword.name, keyword)
        if before is not keyword and keyword.name in ("MATERIAL", "ELASTIC", "DENSITY"):
            raise NotTakenError(
                f"is of material {name!r}, which has {keyword.shown} twice, in {before.place()} and"
                f" in {keyword.place()}"
            )


def _constant(keyword: Keyword, what: str) -> list[float]:
    if len(keyword.rows) != 1 or not keyword.numbers(0):
        raise NotTakenError(f"is {what}, which has {len(keyword.rows)} lines of numbers, not one")
    return keyword.numbers(0)


def _described(
    deck: Deck,
    body: Body,
    keyword: Keyword,
    labels: Iterable[Label],
    materials: Mapping[str, list[Keyword]],
) -> dict[str, object]:
    families = {
        family(deck.bodies[owner.upper()].element(label).type.name) for owner, label in labels
    }
    for section, change in deck.changed:
        if section is keyword:
            raise NotTakenError(f"has {change.shown} in {change.place()}, which is not taken over")
    if keyword.name.startswith("BEAM"):
        _check_plain_beams(deck)
    given = _TAKEN[keyword.name](body, keyword, families)
    if keyword.name == "BEAMGENERALSECTION":
        return given
    if "MATERIAL" not in keyword.parameters:
        raise NotTakenError("names no material")
    return {**_material(keyword.parameters["MATERIAL"], materials), **given}


def _only(keyword: Keyword, *known: str) -> None:
    unknown = sorted(set(keyword.parameters) - {"ELSET", "MATERIAL", *known})
    if unknown:
        raise NotTakenError(f"has the parameter {unknown[0]!r}, which is not taken over")


def _solid(body: Body, keyword: Keyword, families: set[str]) -> dict[str, object]:
    _only(keyword, "CONTROLS", "ORIENTATION")
    if families == {"solid"}:
        return {"kind": "solid"}
    thickness = keyword.numbers(0)[0] if keyword.rows and keyword.numbers(0) else 1.0
    if families == {"truss"}:
        return {"kind": "truss", "area": thickness}
    if families == {"plane solid"}:
        raise NotTakenError(
            f"is of plane solids: give 'plane' and 'thickness' ({thickness:g} in the file) in the"
            " scene"
        )
    raise NotTakenError("is of elements of several families, or of others than solids")


def _shell(body: Body, keyword: Keyword, families: set[str]) -> dict[str, object]:
    _only(keyword, "ORIENTATION", "SECTION INTEGRATION", "CONTROLS")
    if not keyword.rows or len(keyword.rows) > 1 or families != {"shell"}:
        raise NotTakenError("is not one thickness of shells")
    return {"kind": "shell", "thickness": keyword.numbers(0)[0]}


def _beam(body: Body, keyword: Keyword, families: set[str]) -> dict[str, object]:
    """Rectangles, circles and pipes; the first direction is the one of the first dimension."""
    _only(keyword, "SECTION", "SECTION INTEGRATION", "POISSON")
    if families != {"beam"}:
        raise NotTakenError("is of elements that are no beams")
    shape = keyword.parameters.get("SECTION", "").upper()
    size = keyword.numbers(0) if keyword.rows else []
    if shape == "RECT" and len(size) == 2:
        # along the first and the second axis; in a plane the second one lies in it
        first, second = size[::-1] if _is_plane(body) else size
        numbers: dict[str, object] = {"height": first, "width": second}
    elif shape == "CIRC" and len(size) == 1:
        numbers = {"diameter": 2.0 * size[0]}
    elif shape == "PIPE" and len(size) == 2:
        numbers = {"diameter": 2.0 * size[0], "bore": 2.0 * (size[0] - size[1])}
    else:
        said = f"has a section {shape!r} of {len(size)} numbers"
        raise NotTakenError(f"{said}, which is not taken over")
    return {"kind": "beam", "theory": _theory(body), **numbers, **_axis(body, keyword)}


ORIENTING = ("NORMALS OF *NODE", "*NORMAL", "ORIENTATION NODES OF BEAMS")


def _check_plain_beams(deck: Deck) -> None:
    """Refuse beams whose axes other keywords change."""
    for what in ORIENTING:
        if what in deck.left_out:
            said = f"is of beams in a file with {what.lower()}"
            raise NotTakenError(f"{said}, which are not taken over")


def _is_plane(body: Body) -> bool:
    """Whether all beams of a body are in a plane, in which their second axis lies."""
    beams = [e.type.name for _, e in body.elements() if family(e.type.name) == "beam"]
    return all(name.startswith(("B2", "PIPE2", "FRAME2")) for name in beams)


def _theory(body: Body) -> str:
    """Euler and Bernoulli's for the cubic beams, Timoshenko's for the others."""
    names = {e.type.name for _, e in body.elements() if family(e.type.name) == "beam"}
    cubic = {name for name in names if name[:3] in ("B23", "B33", "FRA")}
    if cubic and cubic != names:
        raise NotTakenError("is in a file with cubic beams (B23, B33) and others; say which theory")
    return "euler-bernoulli" if cubic else "timoshenko"


def _axis(body: Body, keyword: Keyword, row: int = 1) -> dict[str, object]:
    """The direction n1 of the section, which beams in space need."""
    given = keyword.numbers(row) if len(keyword.rows) > row else [0.0, 0.0, -1.0]
    if _is_plane(body):
        return {}
    if body.turned:
        raise NotTakenError("is of beams in an instance that is turned")
    return {"orientation": ([*given, 0.0, 0.0, 0.0])[:3]}


def _general(body: Body, keyword: Keyword, families: set[str]) -> dict[str, object]:
    """``*BEAM GENERAL SECTION, SECTION=GENERAL``: area, second moments, torsion; then E and G."""
    _only(keyword, "SECTION", "DENSITY", "POISSON")
    if keyword.parameters.get("SECTION", "GENERAL").upper() != "GENERAL" or families != {"beam"}:
        raise NotTakenError("is not a general section of beams")
    if len(keyword.rows) != 3:
        said = f"has {len(keyword.rows)} lines"
        raise NotTakenError(f"{said}, and must have area, direction and moduli")
    area, first, mixed, second, torsion = [*keyword.numbers(0), *[0.0] * 5][:5]
    youngs, shear = [*keyword.numbers(2), 0.0, 0.0][:2]
    density = keyword.number(keyword.parameters.get("DENSITY", ""), None)
    known = density > 0.0 and youngs > 0.0 and shear > 0.0
    if mixed or not known or len(filled(keyword.rows[0])) > 5:
        raise NotTakenError("has a product of inertia, or no density, or no moduli")
    if _is_plane(body):
        first, second = second, first
    theory = _theory(body)
    areas = {"shear_area": area, "shear_area_across": area} if theory == "timoshenko" else {}
    return {
        "kind": "beam",
        "youngs_modulus": youngs,
        "poissons_ratio": youngs / (2.0 * shear) - 1.0,
        "density": density,
        "area": area,
        "second_moment": second,
        "second_moment_across": first,
        "torsion_constant": torsion,
        "theory": theory,
        **areas,
        **_axis(body, keyword),
    }


_TAKEN = {
    "SOLIDSECTION": _solid,
    "SHELLSECTION": _shell,
    "BEAMSECTION": _beam,
    "BEAMGENERALSECTION": _general,
}
