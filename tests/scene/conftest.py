import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))

from fakes import FakeSpecialPoint

from nldyn.bifurcations import normal_forms


@pytest.fixture(autouse=True)
def fakes_know_their_normal_form(monkeypatch):
    """Normal forms of made-up special points, which have no flow map, are made up too."""
    real = normal_forms.normal_form

    def either(special, others=()):
        return special.form if isinstance(special, FakeSpecialPoint) else real(special, others)

    monkeypatch.setattr(normal_forms, "normal_form", either)
