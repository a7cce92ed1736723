"""The engine as a guest: interruption, threads, other laws, memory that moves."""

from __future__ import annotations

import pickle
import re
import shutil
import signal
import subprocess
import sys
import threading
import time
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from nldyn import FlowMap, HarmonicForce, Stop, System, SystemModelError, Unbalance, solve_orbit
from nldyn.engine import layout, library
from nldyn.engine.fingerprint import fingerprint
from nldyn.longterm.growth_rates import growth_rates
from nldyn.orbits.periodic_schur import product_eigenvalues
from nldyn.system import CompiledLaw, linear
from nldyn.system.contact_law import power_law
from nldyn.system.springs_dampers import PolynomialSpring

TURN = 2.0 * np.pi
HERTZ = """
#include <math.h>
void hertz(double depth, double speed, double out[3])
{
    out[0] = 5e8 * depth * sqrt(depth);
    out[1] = 7.5e8 * sqrt(depth);
    out[2] = 0.0 * speed;
}
"""


def written(file, pattern):
    """The names or the number that a source of the engine has in some place."""
    text = (Path(library.__file__).parent / file).read_text("utf-8")
    return re.search(pattern, text, re.S)[1]


def test_what_python_and_c_share_is_the_same():
    outcomes = re.findall(r"\w+", written("engine.h", r"enum Status \{(.*?)\}"))
    assert [getattr(layout, name) for name in outcomes] == list(range(len(outcomes)))
    columns = re.findall(r"\w+", written("engine.h", r"enum Column \{(.*?)\}"))
    assert columns == [*map(str.upper, layout.StopRow._fields), "FIRST_POWER"]
    assert library.LIBRARY.nldyn_layout() == library.LAYOUT
    assert float(written("engine.h", r"#define ROUND (\S+)")) == layout.ROUND
    assert float(written("response.c", r"#define NEAR (\S+)")) == linear.NEAR


@pytest.mark.parametrize("exponent", [1.0, 1.5, 2.2])
def test_the_law_of_a_stop_is_the_same_in_python_and_in_c(exponent):
    """A still body on a stop, let go: the rate of its speed is the force over its mass."""
    stop = Stop("x", 1e5, exponent, dissipation=0.3)
    system = System.from_matrices([[2.0]], [[0.0]], {"x": [1.0]}, stops=[stop])
    flow, omega, depth, speed = FlowMap(system), 2e4, 3e-3, 0.02
    mode = system.participation["x"][0]
    modal = np.array([[depth, speed]]) / mode
    start = flow.to_state(modal)
    found = flow.shoot(start, np.array([0.0, 1e-3]), omega)
    change = (flow.to_modal(found.ends) - modal)[0] / (1e-3 / omega)
    force, _, _ = power_law(1e5, exponent, 0.3, 0.0, depth, speed)
    assert change[1] == pytest.approx(-force * mode, rel=1e-4)


def rattling(**law):
    """Two modes between two stops."""
    return System.from_modal(
        [10.0, 37.0],
        {"a": [1.0, 0.4], "b": [0.5, -0.8]},
        modal_damping=0.02,
        stops=[Stop("a", 5e8, **law), Stop("b", 5e8, gap=1e-5, direction=-1)],
        excitation=[Unbalance("a", 1e-4), HarmonicForce("b", 1.0)],
    )


def fly(flow, omega, periods):
    phases = TURN * np.arange(periods + 1.0)
    return flow.shoot(np.zeros((1, 4)), phases, omega, chained=True)


def swinging():
    """A motion in one long flight, whose mode swings ten million times."""
    system = System.from_modal([1e4], {"a": [1.0]}, excitation=[HarmonicForce("a", 1.0)])
    return FlowMap(system).trajectory(np.ones((1, 2)), np.array([0.0, TURN]), TURN * 1e-3)


LONG_CALLS = {
    "flights": lambda: partial(fly, FlowMap(rattling()), 80.0, 100_000),
    "panels": lambda: partial(fly, FlowMap(pressed(1)), 80.0, 100_000),
    "forces of many stops": lambda: partial(fly, FlowMap(pressed(60)), 80.0, 1000),
    "states": lambda: partial(swinging().states, np.linspace(0.0, TURN, 5 * 10**6)),
    "extremes": lambda: partial(swinging().extremes, 0),
    "growth rates": lambda: partial(growth_rates, random_matrices(3000, 40), np.eye(40), 0.0),
    "multipliers": lambda: partial(product_eigenvalues, random_matrices(100, 120)),
}


def pressed(count):
    """Two modes that many bonds hold, or one: there are no flights."""
    return System.from_modal(
        [10.0, 37.0],
        {"a": [1.0, 0.4], "b": [0.5, -0.8]},
        modal_damping=0.02,
        springs=[PolynomialSpring("a", [1e4 * (1.0 + k), 0.0, 1e10]) for k in range(count)],
        excitation=[HarmonicForce("b", 100.0)],
    )


def random_matrices(k, n):
    return np.random.default_rng(1).standard_normal((k, n, n))


@pytest.mark.skipif(sys.platform == "win32", reason="Windows sends no signal to itself in time")
@pytest.mark.parametrize("name", LONG_CALLS)
def test_ctrl_c_ends_a_long_call_within_a_second(name):
    """Each would take many times as long."""
    call = LONG_CALLS[name]()
    usual = signal.signal(signal.SIGINT, signal.default_int_handler)
    came = []

    def interrupt():
        came.append(time.monotonic())
        signal.raise_signal(signal.SIGINT)

    timer = threading.Timer(0.05, interrupt)
    try:
        timer.start()
        with pytest.raises(KeyboardInterrupt):
            call()
        late = time.monotonic() - came[0]
    finally:
        timer.cancel()
        signal.signal(signal.SIGINT, usual)
    assert late < 1.0
    again = fly(FlowMap(rattling()), 80.0, 1)  # nothing is left behind
    assert not again.failure


def evaluated(omega):
    """What all long functions of the engine make of a motion at an excitation frequency."""
    flow = FlowMap(rattling())
    found = fly(flow, omega, 40)
    motion = flow.trajectory(np.zeros((1, 4)), TURN * np.arange(41.0), omega, chained=True)
    states = motion.states(np.linspace(0.0, 40.0 * TURN, 1000))
    grown = growth_rates(found.jacobians, np.eye(4), 0.0)
    multipliers = product_eigenvalues(random_matrices(20, 30) * omega)[0]
    return found.ends, found.jacobians, states, motion.extremes(0), grown, multipliers


def test_two_threads_at_once_give_the_bits_of_one_after_the_other():
    speeds = (70.0, 95.0)
    alone = [evaluated(omega) for omega in speeds]
    beside = {}

    def work(omega):
        beside[omega] = evaluated(omega)

    threads = [threading.Thread(target=work, args=(omega,)) for omega in speeds]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    for omega, expected in zip(speeds, alone, strict=True):
        for found, array in zip(beside[omega], expected, strict=True):
            assert np.array_equal(found, array)


def test_a_motion_that_was_pickled_has_its_numbers_elsewhere():
    flow = FlowMap(rattling())
    motion = flow.trajectory(np.zeros((1, 4)), TURN * np.arange(4.0), 80.0, chained=True)
    phases = np.linspace(0.0, 6.0 * np.pi, 50)
    states, extremes = motion.states(phases), motion.extremes(0)
    content = pickle.dumps(motion)
    del motion
    other = pickle.loads(content)
    assert np.array_equal(other.states(phases), states)
    assert np.array_equal(other.extremes(0), extremes)


@pytest.fixture(scope="module")
def laws(tmp_path_factory):
    """A library of laws."""
    compiler = next(filter(None, map(shutil.which, ("cc", "gcc", "clang"))), None)
    if compiler is None:
        pytest.skip("there is no compiler")
    folder = tmp_path_factory.mktemp("laws")
    (folder / "laws.c").write_text(HERTZ)
    path = str(folder / "laws.so")
    command = [compiler, "-O2", "-shared", "-fPIC", "laws.c", "-o", path, "-lm"]
    subprocess.run(command, cwd=folder, check=True)
    return path


def test_a_law_of_c_gives_the_orbits_of_the_same_law_here(laws):
    law = CompiledLaw(laws, "hertz")
    usual = solve_orbit(rattling(), 12.0)
    flow = usual.problem.flow  # from rest, last digits decide which of several orbits is found
    guess = flow.to_modal(usual.problem.nodes(usual.point)[0])
    own = solve_orbit(rattling(law=law), 12.0, guess=guess)
    np.testing.assert_allclose(own.multipliers, usual.multipliers, rtol=1e-9, atol=1e-12)
    assert pickle.loads(pickle.dumps(law)) == law


def test_a_law_that_is_not_there_is_told(laws):
    with pytest.raises(SystemModelError, match=r"law 'hook': .*hook"):
        CompiledLaw(laws, "hook")
    with pytest.raises(SystemModelError, match=r"law 'hertz': .*nowhere"):
        CompiledLaw("nowhere.so", "hertz")


@pytest.mark.skipif(fingerprint(library.SOURCES) is None, reason="sources are not installed")
def test_an_engine_of_other_sources_says_what_to_run(tmp_path, monkeypatch):
    """A changed number, by which neither counts of fields nor dates of files tell."""
    for package in ("fem", "cms", "nldyn"):
        copy = shutil.copytree(library.SOURCES.parents[1] / package, tmp_path / package)
    monkeypatch.delenv("NLDYN_ENGINE", raising=False)
    shutil.copy(library.FOLDER / library.library_name(), copy / "engine")

    def said():
        command = [sys.executable, "-c", "from nldyn.engine import library; print('loaded')"]
        done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
        return [line.partition(": ")[2] or line for line in (done.stdout + done.stderr).split("\n")]

    assert said()[0] == "loaded"
    source = copy / "engine" / "growth.c"
    source.write_text(source.read_text("utf-8").replace("0", "1"), "utf-8")
    assert said()[-2] == (
        f"the engine of nldyn, {copy / 'engine' / library.library_name()}, was built from other "
        f"sources than these: run 'python compile_engine.py' in {tmp_path}"
    )
    for each in [*copy.glob("engine/*.c"), *copy.glob("engine/*.h")]:  # as a wheel installs it
        each.unlink()
    assert said()[0] == "loaded"
