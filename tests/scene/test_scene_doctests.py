"""The examples in the docstrings run."""

import doctest
import importlib

import pytest

MODULES = (
    "output",
    "plot",
    "resources",
    "result_directory",
    "scene",
    "scene_messages",
    "scene_schema",
    "version",
)


@pytest.mark.parametrize("name", MODULES)
def test_examples(name):
    result = doctest.testmod(importlib.import_module(f"nldyn.{name}"))
    assert result.failed == 0
