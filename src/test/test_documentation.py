"""The READMEs say what the code says."""

import re
from pathlib import Path

import pytest

from gravcomp.graph import documentation
from gravcomp.graph.nodes import NODES

ROOT = Path(__file__).resolve().parents[2]


@pytest.mark.parametrize("name", documentation.DOCUMENTS)
def test_the_tables_are_those_of_the_code(name):
    text = (ROOT / name).read_text(encoding="utf-8")
    assert "<!-- end -->" in text
    assert documentation.renewed(text) == text, "renew them: python -m gravcomp.graph.documentation ."


def test_every_node_is_documented_in_its_package():
    for entry in NODES:
        assert f"<!-- node {entry.executable} -->" in (ROOT / entry.package / "README.md").read_text(encoding="utf-8")


def test_every_executable_is_in_the_table_of_nodes():
    # The guard is a process of the bridge, not a node; composed_loop runs three of the nodes.
    for package in {entry.package for entry in NODES}:
        executables = re.findall(r"^\s+\"(\w+) = ", (ROOT / package / "setup.py").read_text(encoding="utf-8"), re.MULTILINE)
        assert set(executables) - {"can_guard", "composed_loop"} == {
            entry.executable for entry in NODES if entry.package == package
        }
