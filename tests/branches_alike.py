"""Whether two branches are the same to the last digit, and diagrams without one."""

from dataclasses import replace

import numpy as np

from nldyn import Branch, Diagram


def assert_same_points(some, others):
    """Points have the same unknowns, tangents, arclengths, multipliers, errors and motions."""
    assert len(some) == len(others)
    for a, b in zip(some, others, strict=True):
        for name in ("tangent", "arclength"):
            assert np.array_equal(getattr(a, name), getattr(b, name))
        for name in ("point", "jacobians", "error", "multipliers", "impacts", "observe", "period"):
            assert np.array_equal(getattr(a.orbit, name), getattr(b.orbit, name)), name
        assert a.orbit.max_abs_displacement == b.orbit.max_abs_displacement
        assert a.orbit.max_penetration == b.orbit.max_penetration


def assert_same_branches(a, b):
    """Branches have the same points, special points, notes and ends."""
    assert_same_points(a.nodes, b.nodes)
    assert_same_points(*([s.point for s in c.special_points] for c in (a, b)))
    assert_same_points(a.requested, b.requested)
    for name in ("kind", "frequency_error"):
        assert [getattr(s, name) for s in a.special_points] == [
            getattr(s, name) for s in b.special_points
        ]
    assert (a.period, a.stop_reasons, a.notes) == (b.period, b.stop_reasons, b.notes)


def without(known: Diagram, branch: Branch) -> Diagram:
    """A diagram of all branches but one."""
    return replace(known, branches=tuple(b for b in known.branches if b is not branch))
