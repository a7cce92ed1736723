"""The bracket of the benchmark: both ways to its modes agree."""

from __future__ import annotations

import pytest

from bench.solids import OURS, PEER, solid_times
from bench.targets import solid_targets


def test_both_ways_find_the_same_modes(monkeypatch):
    monkeypatch.setenv("PYTHONPATH", "tests")
    ours, peer = solid_times(0.025)
    assert (ours.what, peer.what) == (OURS, PEER)
    assert ours.size == peer.size > 5000
    assert ours.frequencies_hz == pytest.approx(peer.frequencies_hz, rel=1e-8)
    assert all(target.verdict in ("met", "missed") for target in solid_targets(ours, peer))
