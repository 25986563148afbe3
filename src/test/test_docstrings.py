"""Examples in docstrings are right."""

import doctest
import importlib
from pathlib import Path

import pytest

CORE = Path(__file__).resolve().parents[1]
MODULES = sorted(
    ".".join(path.relative_to(CORE).with_suffix("").parts)
    for path in (CORE / "gravcomp").rglob("*.py")
    if ">>> " in path.read_text(encoding="utf-8")
)


def test_there_are_examples():
    assert "gravcomp.inverse.target" in MODULES


@pytest.mark.parametrize("name", MODULES)
def test_the_examples_of_a_module_are_right(name):
    result = doctest.testmod(importlib.import_module(name))
    assert result.attempted and not result.failed
