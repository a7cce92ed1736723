"""Families of free motions, against elliptic integrals and piecewise linear oscillators."""

import numpy as np
import pytest
from scipy.special import ellipk

from nldyn import (
    ConvergenceError,
    HarmonicForce,
    PolynomialSpring,
    RigidStop,
    RoundStop,
    Spring,
    Stop,
    System,
    SystemModelError,
    backbone,
    load,
    save,
)


def oscillator(**elements):
    return System.from_matrices([[1.0]], [[1.0]], {"x": [1.0]}, **elements)


def duffing_hz(amplitude, linear, cubic):
    """Frequency of u'' + a u + b u³ = 0 [Kovacic and Brennan 2011, table 4.1]."""
    total = linear + cubic * amplitude**2
    m = cubic * amplitude**2 / (2.0 * total)
    return np.sqrt(total) / (4.0 * ellipk(m))


@pytest.mark.parametrize(("cubic", "largest"), [(1.0, 10.0), (-1.0, 0.9)], ids=["hard", "soft"])
def test_duffings_backbone_is_an_elliptic_integral(cubic, largest):
    system = oscillator(springs=[PolynomialSpring("x", [0.0, 0.0, cubic])])
    found = backbone(system, amplitude_m=(1e-3, largest))
    assert found.reason == "end of the range of amplitudes"
    assert found.amplitude[0] == pytest.approx(1e-3, rel=1e-2)
    exact = duffing_hz(found.amplitude, 1.0, cubic)
    assert found.frequency_hz == pytest.approx(exact, rel=1e-9)
    size = found.amplitude
    assert found.energy == pytest.approx(0.5 * size**2 + 0.25 * cubic * size**4, rel=1e-8)
    assert found.stable.all()


def test_a_backbone_in_a_well_counts_from_its_bottom():
    """u'' - u + u³ = 0, at 1 - A on the near side: x₁ dn, of period 2 √2 K(m) / x₁."""
    wells = System.from_matrices(
        [[1.0]], [[0.0]], {"x": [1.0]}, springs=[PolynomialSpring("x", [-1.0, 0.0, 1.0])]
    )
    found = backbone(wells, amplitude_m=(1e-2, 0.9))
    assert abs(found.rest_m) == pytest.approx(1.0, rel=1e-12)
    assert found.reason == "end of the range of amplitudes"
    assert found.amplitude[[0, -1]] == pytest.approx([1e-2, 0.9], rel=1e-2)
    assert found.amplitude[-1] == pytest.approx(0.9, rel=1e-8)
    far = np.sqrt(2.0 - (1.0 - found.amplitude) ** 2)
    exact = far / (2.0 * np.sqrt(2.0) * ellipk(2.0 - 2.0 / far**2))
    assert found.frequency_hz == pytest.approx(exact, rel=1e-9)


def test_a_backbone_is_saved(tmp_path):
    system = oscillator(springs=[PolynomialSpring("x", [0.0, 0.0, 1.0])])
    found = backbone(system, amplitude_m=(0.1, 0.5))
    save(found, tmp_path / "backbone.h5")
    (again,) = load(tmp_path / "backbone.h5")
    assert repr(again) == repr(found)
    assert np.array_equal(again.frequency_hz, found.frequency_hz)
    assert again.energy == pytest.approx(found.energy, rel=1e-14)
    assert again.amplitude == pytest.approx(found.amplitude, rel=1e-12)


@pytest.mark.parametrize("few", [None, 12])
def test_a_saved_backbone_goes_on_to_the_last_bit(few, tmp_path):
    """Beyond its amplitude, and beyond its number of orbits; the gap is closed on the way."""
    system = oscillator(stops=[Stop.linear("x", 3.0, gap=0.5)])
    whole = backbone(system, amplitude_m=(0.05, 2.0))
    first = {"amplitude_m": (0.05, 1.0)} if few is None else {"amplitude_m": (0.05, 2.0)}
    save(backbone(system, **first, max_orbits=few or 500), tmp_path / "backbone.h5")
    (short,) = load(tmp_path / "backbone.h5")
    longer = short.extend(2.0, max_orbits=500)
    assert len(longer.orbits) > len(short.orbits) + 2
    assert longer.curve.stop_reasons == whole.curve.stop_reasons
    for a, b in zip(longer.curve.points, whole.curve.points, strict=True):
        assert np.array_equal(a.point, b.point) and np.array_equal(a.tangent, b.tangent)
    with pytest.raises(SystemModelError, match="reaches 2 m already"):
        longer.extend(1.5)


def test_a_bilinear_oscillator_has_one_frequency():
    found = backbone(oscillator(stops=[Stop.linear("x", 3.0)]), amplitude_m=(1e-4, 1.0))
    assert found.frequency_hz == pytest.approx(2.0 / (1.0 + 0.5) / (2.0 * np.pi), rel=1e-9)


def test_a_gap_leaves_the_frequency_alone_until_it_is_closed():
    system = oscillator(stops=[Stop.linear("x", 3.0, gap=0.5)])
    found = backbone(system, amplitude_m=(0.05, 2.0))
    open_gap = found.amplitude < 0.5
    assert open_gap.sum() > 3
    assert found.frequency_hz[open_gap] == pytest.approx(1.0 / (2.0 * np.pi), rel=1e-9)
    # to the free side a cos t; in contact u'' + 4 u = 1.5, entered at 0.5 with u'² = a² - 0.25
    low = np.array([-orbit.observed_extremes.values.min() for orbit in found.orbits])[~open_gap]
    flight = 2.0 * (np.pi - np.arccos(0.5 / low))
    contact = np.arctan2(0.5 * np.sqrt(low**2 - 0.25), 0.125)
    assert found.frequency_hz[~open_gap] == pytest.approx(1.0 / (flight + contact), rel=1e-8)


@pytest.mark.parametrize(("mode", "linear", "cubic"), [(1, 1.0, 0.0), (2, 1.4, 4.0)])
def test_two_masses_with_a_cubic_spring_between(mode, linear, cubic):
    """In phase linear; against each other u'' + (1 + 2 · 0.2) u + 8 · 0.5 u³ = 0."""
    system = System.from_matrices(
        np.eye(2), np.eye(2), {"a": [1.0, 0.0], "b": [0.0, 1.0]},
        springs=[Spring("a", 0.2, "b"), PolynomialSpring("a", [0.0, 0.0, 0.5], "b")],
    )  # fmt: skip
    found = backbone(system, mode, amplitude_m=(1e-3, 1.0))
    exact = duffing_hz(found.amplitude, linear, cubic)
    assert found.frequency_hz == pytest.approx(exact, rel=1e-9)


def test_modes_of_one_frequency_are_told_where_no_motion_is_found():
    """In a ring all directions are alike: the orbits of any size are a family in two numbers."""
    system = System.from_matrices(
        np.eye(2), np.eye(2), {"x": [1.0, 0.0], "y": [0.0, 1.0]},
        stops=[RoundStop(("x", "y"), 1.0, 0.5)],
    )  # fmt: skip
    with pytest.raises(ConvergenceError, match="mode 1, whose frequency is that of mode 2, too: "):
        backbone(system, amplitude_m=(1e-3, 1.0))


@pytest.mark.parametrize(
    ("changes", "arguments", "words"),
    [
        ({"modal_damping": 0.01}, {}, "needs a system that nothing damps"),
        ({"stops": [Stop.linear("x", 1.0, dashpot=1.0)]}, {}, "that nothing damps"),
        ({"excitation": [HarmonicForce("x", 1.0)]}, {}, "leave out all excitation"),
        ({"stops": [RigidStop("x", 1.0)]}, {}, "not followed against rigid stops"),
        ({}, {"mode": 2}, "mode must be"),
        ({}, {"amplitude_m": (1.0, 0.1)}, "two ascending positive numbers"),
    ],
)
def test_what_makes_no_sense_is_refused(changes, arguments, words):
    with pytest.raises(SystemModelError, match=words):
        backbone(oscillator(**changes), **{"amplitude_m": (0.1, 1.0), **arguments})
