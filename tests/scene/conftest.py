import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))

from fakes import FakeDiagram, FakeSpecialPoint

from nldyn.report import results


@pytest.fixture(autouse=True)
def fakes_know_their_normal_form(monkeypatch):
    """Normal forms of made-up special points, which have no flow map, are made up too."""
    real = results.normal_form

    def either(special, others=()):
        return special.form if isinstance(special, FakeSpecialPoint) else real(special, others)

    monkeypatch.setattr(results, "normal_form", either)


@pytest.fixture(autouse=True)
def fakes_are_saved(monkeypatch):
    """Made-up diagrams have no orbits that a file could hold."""
    real = results.save

    def either(found, path):
        made_up = isinstance(found, FakeDiagram)
        return path.write_bytes(b"branches") if made_up else real(found, path)

    monkeypatch.setattr(results, "save", either)
