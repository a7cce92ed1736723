"""NAFEMS benchmarks of free vibration are met within the tolerance of the mesh."""

import re
from pathlib import Path

import numpy as np
import pytest
from nafems import BENCHMARKS

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
    np.testing.assert_allclose(benchmark.computed, benchmark.published, rtol=benchmark.tolerance)


def test_the_table_in_the_documentation_is_what_is_computed():
    text = DOC.read_text(encoding="utf-8")
    table = re.search(r"<!-- nafems -->\n(.*?)<!-- end of nafems -->", text, re.DOTALL)[1]
    assert table.strip().splitlines()[2:] == list(rows())
