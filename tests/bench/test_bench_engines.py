"""Every engine finds the reference at its tolerance."""

import numpy as np
import pytest

from bench import motion
from bench.engines import ENGINES, NLDYN
from bench.measure import errors, flip_frequency_error, measure_engine
from bench.models import load_orbit_start

# setting and largest error allowed
ACCURACY = {
    NLDYN: (-1, 1e-11),
    "solve_ivp DOP853 in numpy": (1, 1e-4),
    "solve_ivp Radau": (1, 1e-5),
    "solve_ivp Radau, events": (1, 1e-5),
    "RK4, equal steps": (-1, 1e-4),
    "RK8, equal steps": (-1, 1e-4),
    "heyoka, events, regularised": (3, 1e-11),
}
WITH_DERIVATIVES = [engine for engine in ENGINES if engine.has_monodromy]


@pytest.mark.parametrize("engine", WITH_DERIVATIVES, ids=lambda engine: engine.name)
def test_engine_finds_the_reference_at_its_tolerance(engine, flip):
    if not engine.installed:
        pytest.skip(f"{engine.needs} is not installed")
    case = flip.case
    index, allowed = ACCURACY.get(engine.name, (2, 5e-6))
    prepared = engine.prepare(case, engine.settings[index])
    job = prepared(case.start, case.omega)
    found = job.read(job.run())
    assert max(errors(case, found)) < allowed
    assert flip_frequency_error(flip, prepared, found) < allowed


def test_collocation_finds_the_orbit(case):
    (engine,) = [e for e in ENGINES if not e.has_monodromy]
    job = engine.prepare(case, 1e-5)(case.start, case.omega)
    found = job.read(job.run()).state
    wanted = load_orbit_start("one_dof")
    assert np.linalg.norm((found - wanted) / case.scale) < 1e-5 * np.linalg.norm(
        wanted / case.scale
    )


def test_compiled_equations_are_those_in_numpy(case):
    rng = np.random.default_rng(1)
    for mode in (motion.FLIGHT, motion.CONTACT):
        p = motion.in_mode(motion.pack_parameters(case.system, case.start, case.omega), mode)
        y = rng.standard_normal(motion.initial(p, case.start).size)
        y[0] = abs(y[0])
        out = np.empty(y.size)
        motion.rate(0.7, y, p, out)
        assert np.allclose(out, motion.numpy_rate(0.7, y, p), rtol=1e-13)


def test_an_engine_that_is_missing_says_so(flip):
    engine = next(e for e in ENGINES if e.name == "RK4, equal steps")
    missing = type(engine)(engine.name, engine.settings, engine.prepare, needs="no_such_module")
    (sample,) = measure_engine(missing, flip)
    assert sample.note == "no_such_module is not installed"
