"""Published static benchmarks of shells.

R. H. MacNeal and R. L. Harder, A proposed standard set of problems to test finite element accuracy,
Finite Elements in Analysis and Design 1 (1985) 3-20; the thinnest twisted beam and the pinched
cylinder as in T. Belytschko et al., Stress projection for membrane and shear locking in shell
finite elements, Computer Methods in Applied Mechanics and Engineering 51 (1985) 221-258.
"""

import re
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from shells import (
    curved_beam,
    hemisphere,
    pinched_cylinder,
    roof,
    straight_beam,
    twisted_beam,
)

DOC = Path(__file__).resolve().parents[3] / "docs" / "reference" / "structures.md"

CASES = [
    ("Scordelis and Lo's roof", roof, (8, 16), 0.3024, (0.025, 0.005)),
    ("pinched cylinder with diaphragms", pinched_cylinder, (16, 32), 1.8248e-5, (0.085, 0.02)),
    ("hemisphere with a hole", hemisphere, (8, 16), 0.0940, (0.055, 0.015)),
    (
        "curved beam in its plane",
        curved_beam,
        ((6, 1), (12, 2)),
        0.08734,
        (0.11, 0.02),
    ),
    (
        "straight beam in its plane, six trapezoids",
        lambda kind, n: straight_beam(kind, n[1], "trapezoids"),
        ((6, 1), (24, 4)),
        0.1081,
        (0.25, 0.13),
    ),
    (
        "straight beam in its plane, six parallelograms",
        lambda kind, n: straight_beam(kind, n[1], "parallelograms"),
        ((6, 1), (24, 4)),
        0.1081,
        (0.45, 0.2),
    ),
    (
        "twisted beam, t = 0.32, along the width",
        lambda kind, n: twisted_beam(kind, n, 0.32)[0],
        ((12, 2), (24, 4)),
        5.424e-3,
        (0.01, 0.005),
    ),
    (
        "twisted beam, t = 0.32, across it",
        lambda kind, n: twisted_beam(kind, n, 0.32)[1],
        ((12, 2), (24, 4)),
        1.754e-3,
        (0.01, 0.005),
    ),
    (
        "twisted beam, t = 0.0032, along the width",
        lambda kind, n: twisted_beam(kind, n, 0.0032)[0],
        ((12, 2), (24, 4)),
        5256.0,
        (0.01, 0.01),
    ),
    (
        "twisted beam, t = 0.0032, across it",
        lambda kind, n: twisted_beam(kind, n, 0.0032)[1],
        ((12, 2), (24, 4)),
        1294.0,
        (0.01, 0.01),
    ),
]


@cache
def computed(build, kind, n):
    return build(kind, n)


@pytest.mark.parametrize("kind", ["quad", "triangle"])
@pytest.mark.parametrize("case", CASES, ids=lambda case: case[0])
def test_published_deflections_are_met(case, kind):
    _, build, meshes, published, tolerances = case
    errors = np.abs([computed(build, kind, n) / published - 1 for n in meshes])
    assert (errors < tolerances).all()


def rows():
    for name, build, meshes, published, _ in CASES:
        for n in meshes:
            cells = "{} x {}".format(*(n if isinstance(n, tuple) else (n, n)))
            found = [computed(build, kind, n) for kind in ("quad", "triangle")]
            errors = [100 * (value / published - 1) for value in found]
            yield f"| {name} | {cells} | {published:g} | {errors[0]:+.1f} | {errors[1]:+.1f} |"


def test_the_table_in_the_documentation_is_what_is_computed():
    text = DOC.read_text(encoding="utf-8")
    table = re.search(r"<!-- shells -->\n(.*?)<!-- end of shells -->", text, re.DOTALL)[1]
    assert table.strip().splitlines()[2:] == list(rows())
