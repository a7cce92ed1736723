"""Strategies for scenes with legal values of any size that take seconds to compute."""

from __future__ import annotations

import copy
import tomllib
from typing import Any

from hypothesis import strategies as st
from scene_mutations import FRAME, MATRICES, MODAL, STRUCTURE, document, spoil, tweak

BASES = [tomllib.loads(text) for text in (MODAL, MATRICES, FRAME, STRUCTURE)]
FASTEST = 1e3  # vibration on a nearly linear stop, over the excitation: each one takes time
SMALL = {"search_points": 1, "max_step": 0.2, "rtol": 1e-5}


def power(low: float, high: float) -> st.SearchStrategy[float]:
    """Numbers whose logarithm is uniform."""
    return st.floats(low, high).map(lambda exponent: float(f"{10.0**exponent:.6g}"))


GAPS = st.one_of(
    st.sampled_from((0.0, 0.0, 1e-3, -1e-3)),
    power(-9.0, 0.0),
    power(-15.0, 6.0),
    power(-9.0, -3.0).map(lambda gap: -gap),
)
SHARES = st.one_of(st.sampled_from((1.0, -1.0, 0.5)), st.floats(-2.0, 2.0), power(-2.0, 1.0))
RATIOS = st.one_of(st.sampled_from((0.0, 0.01, 0.05, 0.3)), power(-9.0, -0.01))


@st.composite
def random_scene(draw: Any) -> str:
    """A scene of one to three modes with up to three stops; its range lies about one mode."""
    count = draw(st.integers(1, 3))
    first = draw(st.one_of(st.just(10.0), power(-3.0, 6.0)))
    ratios = [1.0, *(draw(st.sampled_from((1.0, 1.3, 2.0, 7.0))) for _ in range(count - 1))]
    hz = [first]
    for ratio in ratios[1:]:
        hz.append(hz[-1] * ratio)
    if draw(st.integers(0, 9)) == 0:
        hz[0] = 0.0
    names = ["a", "b"][: draw(st.integers(1, 2))]
    shares = {name: [draw(SHARES) for _ in hz] for name in names}
    for values in shares.values():
        if not any(values):
            values[0] = 1.0
    middle = draw(st.sampled_from([f for f in hz if f] or [10.0])) * draw(power(-0.5, 0.7))
    tree: dict[str, Any] = {
        "modal": {"frequencies_hz": hz, "participation": shares},
        "damping": {"modal_ratio": [draw(RATIOS) for _ in hz]},
        "stops": [draw(random_stop(names)) for _ in range(draw(st.integers(0, 3)))],
        "excitation": [draw(random_excitation(names, (6.28 * middle) ** 2))],
        "continuation": {
            **SMALL,
            "range_hz": [middle, middle * draw(st.sampled_from((1.02, 1.1, 1.3)))],
            "periods": draw(st.sampled_from(([1], [1], [1, 2], [3]))),
        },
    }
    for stop in tree["stops"]:
        if stop.get("law") == "linear" or stop.get("exponent", 1.5) < 1.5:
            size = sum(share**2 for values in shares.values() for share in values)
            stop["stiffness"] = min(stop["stiffness"], (FASTEST * 6.28 * middle) ** 2 / size)
    if draw(st.integers(0, 3)) == 0:
        damper = {"at": draw(st.sampled_from(names)), "coefficient": draw(power(-6.0, 6.0))}
        tree["dampers"] = [damper]
    return document(tree)


@st.composite
def random_stop(draw: Any, names: list[str]) -> dict[str, Any]:
    """A stop at one of some interfaces, perhaps against another one."""
    stop: dict[str, Any] = {"at": draw(st.sampled_from(names)), "gap": draw(GAPS)}
    stop["stiffness"] = draw(st.one_of(st.sampled_from((1e6, 1e9)), power(2.0, 12.0)))
    if draw(st.booleans()):
        stop["direction"] = -1
    kind = draw(st.integers(0, 4))
    if kind == 0:
        stop["law"] = "linear"
    elif kind == 1:
        stop["exponent"] = draw(st.sampled_from((1.0, 1.2, 2.0, 3.0, 4.0)))
    elif kind == 2:
        stop["dissipation"] = draw(power(-3.0, 3.0))
    if len(names) > 1 and draw(st.integers(0, 3)) == 0:
        stop["against"] = names[1] if stop["at"] == names[0] else names[0]
    return stop


@st.composite
def random_excitation(draw: Any, names: list[str], squared: float) -> dict[str, Any]:
    """A harmonic force or an unbalance that moves 1 kg, at a squared frequency, by any length."""
    size = draw(st.one_of(st.just(1e-3), power(-9.0, -2.0), power(-20.0, 2.0)))
    at = draw(st.sampled_from(names))
    if draw(st.booleans()):
        return {"at": at, "kind": "harmonic", "amplitude": size * squared}
    return {"at": at, "kind": "unbalance", "mass_times_radius": size}


@st.composite
def altered_scene(draw: Any) -> str:
    """A scene of the fuzzer with one to three other values, legal or not, and small effort."""
    tree = copy.deepcopy(draw(st.sampled_from(BASES)))
    tree.pop("explore", None)
    tree.pop("subharmonics", None)
    tree["continuation"] = {"range_hz": draw(st.sampled_from(([12.0, 14.0], [20.0, 23.0])))}
    change = draw(st.sampled_from((tweak, tweak, spoil)))
    for _ in range(draw(st.integers(1, 3))):
        change(draw, tree)
    if isinstance(tree.get("continuation"), dict):
        tree["continuation"] |= SMALL | {"periods": [1]}
    return document(tree)
