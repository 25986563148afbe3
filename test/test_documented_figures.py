"""The documented lines that measure figures, each with --brief."""

import functools
import subprocess

import pytest
from documents import documented

pytest.importorskip("rclpy", reason="it runs the graph: ./gravcomp test")

pytestmark = pytest.mark.timeout(900)


@pytest.mark.parametrize(
    ("line", "about"),
    [
        ("./gravcomp bench engine --write src/README.md", "closed-loop"),
        ("./gravcomp bench estimator", "CPU time of a sample"),
        ("./gravcomp bench estimator --write src/doc/figures.md", "CPU time of a sample"),
        ("./gravcomp bench graph", "two robots"),
        ("./gravcomp bench graph --write src/doc/figures.md", "two robots"),
        ("./gravcomp bench page --write src/doc/figures.md", "page"),
        ("./gravcomp bench faults --write src/doc/figures.md", "hostile frames"),
        ("./gravcomp bench soak --write src/doc/figures.md", "lost"),
        ("./gravcomp reproduce static --brief", "recovery rate"),
        ("./gravcomp reproduce all --write src/doc/figures.md", "index"),
    ],
)
def test_figures_are_made(made, line, about):
    """Without --brief they take from minutes to half an hour. `test_figures_table` checks what --write does with a document."""
    code, output = made(
        tuple(word for word in documented(line) if word not in ("--brief", "--write") and not word.endswith(".md"))
    )
    # 1: a figure misses its limit, which can happen in a brief run.
    assert code in (0, 1) and about in output, output


@pytest.fixture(scope="module")
def made(folder):
    """Return a function that runs a command with --brief; lines that differ only in the document they write to run once."""

    @functools.cache
    def run(words: tuple[str, ...]) -> tuple[int, str]:
        done = subprocess.run([*words, "--brief"], cwd=folder, capture_output=True, text=True, timeout=800)
        return done.returncode, done.stderr + done.stdout

    return run
