"""Nodes: given one by one, or generated between, along and from others."""

from __future__ import annotations

import math

import numpy as np

from fem.base.arrays import FloatArray
from fem.formats.abaqus.deck import Deck, Member, Scope
from fem.formats.abaqus.keywords import Keyword, filled
from fem.formats.abaqus.sets import labels_now


def read_nodes(deck: Deck, scope: Scope, keyword: Keyword) -> None:
    """``*NODE``: a number and three coordinates a row, Cartesian or cylindrical."""
    keyword.only("NSET", "INPUT", "SYSTEM")
    system = keyword.parameters.get("SYSTEM", "R").upper()[:1]
    if system not in ("R", "C"):
        raise keyword.fail(f"coordinates in SYSTEM={system} are not read; give Cartesian ones")
    labels = []
    plain = system == "R" and scope.system is None
    for row, words in enumerate(keyword.rows):
        if len(words) > 7 and len(filled(words)) > 7:
            raise keyword.fail("has more than a number, coordinates and a normal", row)
        if any(words[4:]):
            deck.leave_out("normals of *NODE", keyword.place(row), "the scene orients beams")
        label = keyword.whole(words[0], row)
        if plain and label not in scope.nodes and len(words) > 3:
            x, y, z = (keyword.number(word, row) for word in words[1:4])
            scope.nodes[label] = (x, y, z)
            labels.append(label)
            continue
        place = np.array([keyword.number(word, row) for word in [*words[1:4], "", "", ""][:3]])
        if system == "C":
            angle = math.radians(place[1])
            place = np.array([place[0] * math.cos(angle), place[0] * math.sin(angle), place[2]])
        if scope.system is not None:
            origin, axes = scope.system
            place = origin + axes @ place
        scope.add_node(keyword, row, label, place)
        labels.append(label)
    _grow(scope, keyword, labels)


def _grow(scope: Scope, keyword: Keyword, labels: list[int], key: str = "NSET") -> None:
    if key in keyword.parameters:
        members = [Member(label, "", keyword.place()) for label in labels]
        scope.grow("NSET", keyword.name_of(key), members)


def read_system(deck: Deck, scope: Scope, keyword: Keyword) -> None:
    """``*SYSTEM``: an origin, a point on the local x axis, one in the local x-y plane."""
    keyword.only()
    given = [value for row in range(len(keyword.rows)) for value in keyword.numbers(row)]
    if not given:
        scope.system = None
        return
    if len(keyword.rows[0]) and len(given) not in (1, 2, 3, 4, 5, 6, 9):
        raise keyword.fail(f"needs up to nine coordinates of three points, not {len(given)}")
    count = 3 if len(given) <= 3 else 6 if len(given) <= 6 else 9
    points = np.array(given + [0.0] * (count - len(given))).reshape(-1, 3)
    scope.system = points[0], _axes(keyword, points)


def _axes(keyword: Keyword, points: FloatArray) -> FloatArray:
    """Local axes as columns."""
    if len(points) == 1:
        return np.eye(3)
    along = points[1] - points[0]
    if len(points) == 2:  # the z axis stays, the x axis is projected
        along = np.array([along[0], along[1], 0.0])
        third = np.array([0.0, 0.0, 1.0])
    else:
        third = np.cross(along, points[2] - points[0])
    if not (np.linalg.norm(along) > 0.0 and np.linalg.norm(third) > 0.0):
        raise keyword.fail("its points do not determine axes")
    x, z = along / np.linalg.norm(along), third / np.linalg.norm(third)
    return np.column_stack([x, np.cross(z, x), z])


def _place(scope: Scope, keyword: Keyword, row: int | None, label: int) -> FloatArray:
    if label not in scope.nodes:
        raise keyword.fail(f"node {label} is not defined before it", row)
    return np.array(scope.nodes[label])


def read_ngen(deck: Deck, scope: Scope, keyword: Keyword) -> None:
    """``*NGEN``: nodes at equal distances between two."""
    keyword.only("NSET", "SYSTEM")  # LINE=P and LINE=C, along a parabola or a circle, are not read
    if keyword.parameters.get("SYSTEM", "RC").upper() not in ("RC", "R"):
        raise keyword.fail("nodes in cylindrical or spherical steps are not read")
    labels = []
    for row, words in enumerate(keyword.rows):
        given = [keyword.whole(word, row) for word in filled(words)]
        if len(given) not in (2, 3):
            raise keyword.fail("needs the first node, the last one and a step", row)
        first, last, step = [*given, 1][:3]
        ends = [_place(scope, keyword, row, label) for label in (first, last)]
        made = list(_steps(deck, keyword, row, first, last, step))
        for label in made:
            if label not in (first, last):
                share = (label - first) / (last - first)
                scope.add_node(keyword, row, label, ends[0] + share * (ends[1] - ends[0]))
        labels += made
    _grow(scope, keyword, labels)


def _steps(deck: Deck, keyword: Keyword, row: int, first: int, last: int, step: int) -> range:
    said = f"cannot run from {first} to {last} by {step}"
    if step < 1 or (last - first) % step:
        raise keyword.fail(said, row)
    sign = 1 if last >= first else -1
    deck.count_generated(keyword, row, abs(last - first) // step, said)
    return range(first, last + sign, sign * step)


def read_nfill(deck: Deck, scope: Scope, keyword: Keyword) -> None:
    """``*NFILL``: nodes at equal distances between the nodes of two sets."""
    keyword.only("NSET", "BIAS")
    if keyword.number(keyword.parameters.get("BIAS", "1"), None) != 1.0:
        raise keyword.fail("unequal distances (BIAS) are not read")
    labels: list[int] = []
    for row, words in enumerate(keyword.rows):
        given = filled(words)
        if len(given) not in (3, 4):
            raise keyword.fail("needs two sets, the number of intervals and a step", row)
        first, last = (labels_now(scope, "NSET", keyword, row, word) for word in given[:2])
        count, step = (keyword.whole(word, row) for word in [*given[2:], "1"][:2])
        if len(first) != len(last) or count < 1:
            raise keyword.fail(f"{len(first)} nodes cannot be filled up to {len(last)}", row)
        deck.count_generated(keyword, row, len(first) * count, "makes more nodes than a mesh has")
        for start, stop in zip(first, last, strict=True):
            ends = [_place(scope, keyword, row, label) for label in (start, stop)]
            for k in range(1, count):
                place = ends[0] + k / count * (ends[1] - ends[0])
                scope.add_node(keyword, row, start + k * step, place)
                labels.append(start + k * step)
        labels += [*first, *last]
    _grow(scope, keyword, labels)


def read_ncopy(deck: Deck, scope: Scope, keyword: Keyword) -> None:
    """``*NCOPY, SHIFT``: nodes of a set shifted and turned, once or several times."""
    keyword.only("CHANGE NUMBER", "OLD SET", "NEW SET", "SHIFT", "MULTIPLE")
    if "SHIFT" not in keyword.parameters or len(keyword.rows) > 2:
        raise keyword.fail("copies other than by SHIFT are not read")
    old = labels_now(scope, "NSET", keyword, None, keyword.name_of("OLD SET"))
    step = keyword.whole(keyword.name_of("CHANGE NUMBER"), None)
    times = keyword.whole(keyword.parameters.get("MULTIPLE") or "1", None)
    deck.count_generated(keyword, None, len(old) * times, "makes more nodes than a mesh has")
    shift = np.array([*keyword.numbers(0), 0.0, 0.0, 0.0][:3]) if keyword.rows else np.zeros(3)
    turn, centre = turning(keyword, 1) if len(keyword.rows) > 1 else (np.eye(3), np.zeros(3))
    places = {label: _place(scope, keyword, None, label) for label in old}
    labels = []
    for k in range(1, times + 1):
        for label, place in places.items():
            places[label] = centre + turn @ (place + shift - centre)
            scope.add_node(keyword, None, label + k * step, places[label])
            labels.append(label + k * step)
    _grow(scope, keyword, labels, "NEW SET")


def turning(keyword: Keyword, row: int) -> tuple[FloatArray, FloatArray]:
    """Rotation matrix and a point of the axis from two points and an angle in degrees."""
    given = keyword.numbers(row)
    if not given or (len(given) < 7 and not any(given)):
        return np.eye(3), np.zeros(3)
    if len(given) != 7:
        raise keyword.fail("needs two points of the axis and an angle in degrees", row)
    first, second = np.array(given[:3]), np.array(given[3:6])
    length = float(np.linalg.norm(second - first))
    if length == 0.0:
        if given[6] == 0.0:
            return np.eye(3), first
        raise keyword.fail("the two points of the axis are one", row)
    x, y, z = (second - first) / length
    angle = math.radians(given[6])
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    rotation = np.eye(3) + math.sin(angle) * cross + (1 - math.cos(angle)) * cross @ cross
    return rotation, first
