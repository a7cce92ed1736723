"""A clamped portal frame, and its exact frequencies."""

from functools import cache

import dynamic_stiffness
import numpy as np
from dynamic_stiffness import Member, natural_frequency
from frames import BAR, CLAMP, EA, EI, RHO_A, bending_hz

import fem

WIDTH, HEIGHT = 1.2, 0.8
NODES = [(0, 0), (0, HEIGHT), (WIDTH, HEIGHT), (WIDTH, 0)]
MEMBERS = tuple(Member(i, i + 1, EA, EI, RHO_A) for i in range(3))
THINNER = 0.1
THIN_BAR = fem.BeamPart(BAR.material, fem.RectangularSection(width=0.03, height=THINNER * 0.02))
THIN_MEMBERS = tuple(
    Member(i, i + 1, THINNER * EA, THINNER**3 * EI, THINNER * RHO_A) for i in range(3)
)
FEET = [0, 1, 2, 9, 10, 11]


def portal(elements, turn=0.0, shift=(0.0, 0.0), part=BAR):
    c, s = np.cos(turn), np.sin(turn)
    points = {
        name: (c * x - s * y + shift[0], s * x + c * y + shift[1])
        for name, (x, y) in zip(("a", "b", "c", "d"), NODES, strict=True)
    }
    mesh = fem.frame_mesh(
        points,
        [
            ("post", "a", "b", elements),
            ("girder", "b", "c", elements),
            ("post", "c", "d", elements),
        ],
    )
    return fem.StructureModel(
        mesh,
        {"post": part, "girder": part},
        supports=[fem.Support("a", CLAMP), fem.Support("d", CLAMP)],
        plane=True,
    )


@cache
def exact_portal_frequencies(members=MEMBERS):
    """All zeros of the determinant below its first pole, the clamped girder at 4.73."""
    pole = bending_hz(4.730040744862704, WIDTH)
    pole *= np.sqrt(members[0].EI / members[0].mass_per_length / (EI / RHO_A))
    grid = np.linspace(0.02 * pole, 0.999 * pole, 400)
    free = np.setdiff1d(np.arange(12), FEET)

    def sign(f):
        D = dynamic_stiffness.frame_stiffness(NODES, members, 2 * np.pi * f)
        return np.linalg.slogdet(D[np.ix_(free, free)])[0]

    signs = np.array([sign(f) for f in grid])
    changes = np.flatnonzero(signs[1:] != signs[:-1])
    return [natural_frequency(NODES, members, FEET, grid[i], grid[i + 1]) for i in changes]
