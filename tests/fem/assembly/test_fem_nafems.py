"""NAFEMS benchmarks of free vibration are met within the tolerance of the mesh."""

import re
from pathlib import Path

import numpy as np
import pytest
from nafems import BENCHMARKS, thin_plate_hz

DOC = Path(__file__).resolve().parents[3] / "docs" / "reference" / "structures.md"


def rows():
    """Published and computed frequencies as in the documentation, one row per distinct value."""
    for benchmark in BENCHMARKS:
        computed, published = benchmark.computed, np.array(benchmark.published)
        for value in dict.fromkeys(benchmark.published):
            own = computed[published == value]
            worst = own[np.argmax(np.abs(own - value))]
            times = f" ({len(own)} times)" if len(own) > 1 else ""
            error = 100 * (worst / value - 1)
            yield (
                f"| {benchmark.name} | {benchmark.note} | {value:g}{times} | {worst:.4g}"
                f" | {error + 0.0:+.2f} |"
            )


@pytest.mark.parametrize("benchmark", BENCHMARKS, ids=lambda b: b.name.split()[0])
def test_published_frequencies_are_met(benchmark):
    np.testing.assert_allclose(benchmark.computed, benchmark.reference, rtol=benchmark.tolerance)


def test_thin_plates_have_the_frequencies_of_the_literature():
    """Leissa, A.W. (1973) The free vibration of rectangular plates. Journal of Sound and Vibration
    31(3), 257-293: upper bounds of the same method with 36 beam functions, up to 1 % higher."""
    free = np.array([13.489, 19.789, 24.432, 35.024, 35.024, 61.526])
    clamped = np.array([3.4917, 8.5246, 21.429, 27.331, 31.111, 54.443])
    speed = 0.05 * np.sqrt(2e11 / (12 * 8000 * 0.91)) / (2 * np.pi * 100)
    for held, bounds in ((False, free), (True, clamped)):
        found = np.array(thin_plate_hz(held, 6))
        assert np.all(found < speed * bounds) and np.all(found > 0.99 * speed * bounds)


def test_the_table_in_the_documentation_is_what_is_computed():
    text = DOC.read_text(encoding="utf-8")
    table = re.search(r"<!-- nafems -->\n(.*?)<!-- end of nafems -->", text, re.DOTALL)[1]
    assert table.strip().splitlines()[2:] == list(rows())
