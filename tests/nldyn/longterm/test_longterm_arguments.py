"""Functions of long-term behaviour name what they cannot use, whatever it is, in one sentence."""

from __future__ import annotations

import math

import numpy as np
import pytest

from nldyn import (
    StatePlane,
    System,
    SystemModelError,
    basins,
    find_attractors,
    impacts,
    lyapunov_exponents,
    simulate,
    solve_orbit,
    sweep,
)
from nldyn.longterm import (
    basin_edge,
    brute_force,
    chaos_lifetime,
    contact_measures,
    impact_section,
    spectra_map,
    stable_manifold,
    stroboscopic_section,
)
from nldyn.longterm.attractors import AttractorOptions, zero_one_test
from nldyn.longterm.lyapunov import standard_errors
from nldyn.longterm.measures import measures_table, power_spectrum
from nldyn.plot.longterm import (
    plot_basins,
    plot_brute_force,
    plot_section,
    plot_spectra,
    plot_sweep,
)
from nldyn.runtime import run_all

JUNK = (None, "nonsense", {"a": 1}, math.nan, -1, 10**400, object(), np.zeros(3), 1j)


def at_50(system):
    plane = StatePlane.at_interface(system, (-2e-4, 0.0), (-0.05, 0.05))
    return plane, basins(system, 50.0, plane, shape=(3, 3), checks=1, starts=1)


@pytest.fixture(scope="module")
def given(one_dof):
    """What the functions are called with, apart from the argument that is wrong."""
    plane, found = at_50(one_dof)
    return {
        "system": one_dof,
        "orbit": solve_orbit(one_dof, 50.0),
        "motion": simulate(one_dof, 36.0, 20),
        "plane": plane,
        "basins": found,
        "diagram": brute_force(
            one_dof, (25.0, 25.1), points=1, recorded=2, options=AttractorOptions(periods=64)
        ),
    }


CALLS = {  # with the types that can be used
    "reduced": (lambda g, value: System.from_reduced(value), ()),
    "frequency_hz": (lambda g, value: simulate(g["system"], value, 2), ()),
    "transient": (lambda g, value: lyapunov_exponents(g["system"], 30.0, transient=value), ()),
    "range_hz": (lambda g, value: sweep(g["system"], value, 1.0), ()),
    "rate_hz_per_s": (lambda g, value: sweep(g["system"], (20.0, 21.0), value), ()),
    "attractor": (lambda g, value: chaos_lifetime(value), ()),
    "values": (lambda g, value: zero_one_test(value), ()),
    "samples": (lambda g, value: standard_errors(value), ()),
    "function": (lambda g, value: run_all(value, [1]), ()),
    "items": (lambda g, value: run_all(abs, value), (str, np.ndarray)),
    "motion": (lambda g, value: impacts(value), ()),
    "source": (lambda g, value: contact_measures(value), ()),
    "sources": (lambda g, value: measures_table(value), ()),
    "parts": (lambda g, value: spectra_map(g["motion"], parts=value), ()),
    "orders": (lambda g, value: spectra_map(g["motion"], orders=value), ()),
    "decades": (lambda g, value: plot_spectra(spectra_map(g["motion"]), decades=value), ()),
    "scale": (lambda g, value: plot_spectra(spectra_map(g["motion"]), scale=value), ()),
    "start": (lambda g, value: find_attractors(g["system"], 30.0, starts=value), ()),
    "progress": (
        lambda g, value: find_attractors(g["system"], 30.0, progress=value),
        (type(None),),
    ),
    "executor": (
        lambda g, value: sweep(g["system"], (20.0, 21.0), 1.0, executor=value),
        (type(None),),
    ),
    "quantity": (lambda g, value: power_spectrum(g["motion"], quantity=value), ()),
    "kind": (lambda g, value: g["diagram"].ranges(value), ()),
    "low": (lambda g, value: g["diagram"].share(value, 90.0), (int, float)),
    "index": (lambda g, value: g["basins"].points(value), ()),
    "modal": (lambda g, value: g["plane"].coordinates(value), ()),
    "orbit": (lambda g, value: stable_manifold(value, g["plane"]), ()),
    "plane": (lambda g, value: stable_manifold(g["orbit"], value), ()),
    "found": (lambda g, value: basin_edge(value), ()),
    "width": (lambda g, value: basin_edge(g["basins"], width=value), ()),
    "unit": (lambda g, value: plot_brute_force(g["diagram"], unit=value), (type(None),)),
    "motions": (lambda g, value: plot_sweep(value), ()),
    "saddles": (lambda g, value: plot_basins(g["basins"], saddles=value), (type(None),)),
    "manifolds": (lambda g, value: plot_basins(g["basins"], manifolds=value), ()),
}


@pytest.mark.parametrize("name", CALLS)
def test_what_cannot_be_used_is_named(name, given):
    call, usable = CALLS[name]
    for value in JUNK:
        if isinstance(value, usable):
            continue
        with pytest.raises(SystemModelError) as told:
            call(given, value)
        assert name in str(told.value) and "\n" not in str(told.value)


@pytest.mark.parametrize(
    "take", [stroboscopic_section, impact_section, power_spectrum, plot_section]
)
def test_what_is_no_motion_is_named(take):
    for value in JUNK:
        with pytest.raises(SystemModelError, match="motion must be a Motion"):
            take(value)


@pytest.mark.parametrize("draw", [plot_brute_force, plot_basins, plot_spectra])
def test_what_is_no_result_cannot_be_drawn(draw):
    for value in JUNK:
        with pytest.raises(SystemModelError, match="found must be a"):
            draw(value)


@pytest.mark.parametrize("name", ["x", "y"])
def test_one_direction_of_a_plane_of_a_wrong_length_is_refused(name):
    vectors = {"x": [1.0, 0.0], "y": [0.0, 1.0], name: [1.0, 2.0, 3.0]}
    with pytest.raises(SystemModelError, match="origin, x and y must be vectors of one length"):
        StatePlane([0.0, 0.0], **vectors, x_range=(0.0, 1.0), y_range=(0.0, 1.0))


def test_an_empty_list_of_initial_states_and_a_huge_plane_are_refused(given):
    with pytest.raises(SystemModelError, match="starts must hold at least one initial state"):
        find_attractors(given["system"], 30.0, starts=[])
    with pytest.raises(SystemModelError, match="shape may have up to 10000000 cells"):
        basins(given["system"], 50.0, given["plane"], shape=(10**6, 10**6))


def test_a_motion_too_long_to_keep_is_refused(given):
    for call in (simulate, lambda s, hz, n: contact_measures(given["motion"], periods=n)):
        with pytest.raises(
            SystemModelError, match="periods must be a whole number from 1 to 1000000"
        ):
            call(given["system"], 30.0, 10**6 + 1)
    with pytest.raises(SystemModelError, match="takes 10000000 steps of constant frequency"):
        sweep(given["system"], (20.0, 30.0), 1e-4)
