"""The documented lines that measure performance figures, each with --brief."""

import pytest

pytest.importorskip("rclpy", reason="it runs the graph: ./gravcomp test")

pytestmark = pytest.mark.timeout(1600)


@pytest.mark.parametrize(
    ("line", "about"),
    [
        ("./gravcomp bench engine --write src/README.md", "closed-loop"),
        ("./gravcomp bench estimator", "CPU time of a sample"),
        ("./gravcomp bench estimator --write src/doc/figures.md", "CPU time of a sample"),
        ("./gravcomp bench streams --json", "bench streams"),
        ("./gravcomp bench board", "hostile frames"),
        ("./gravcomp bench loads", "payload"),
        ("./gravcomp bench joints --write src/doc/joints.md", "joint_bridge"),
        ("./gravcomp bench track", "with a tracker"),
        ("./gravcomp bench track --write src/doc/figures.md", "with a tracker"),
        pytest.param("./gravcomp bench graph", "two robots", marks=pytest.mark.graph),
        pytest.param("./gravcomp bench graph --write src/doc/figures.md", "two robots", marks=pytest.mark.graph),
        pytest.param("./gravcomp bench page --write src/doc/figures.md", "page", marks=pytest.mark.graph),
        pytest.param("./gravcomp bench faults --write src/doc/figures.md", "hostile frames", marks=pytest.mark.graph),
        pytest.param("./gravcomp bench soak --write src/doc/figures.md", "lost", marks=pytest.mark.graph),
    ],
)
def test_performance_is_measured(made, apart, line, about):
    """Without --brief they take from minutes to half an hour. `test_figures_table` checks what --write does with a document."""
    code, output = made(line, low=bool(apart))
    # 1: a figure misses its limit, which can happen in a brief run.
    assert code in (0, 1) and about in output, output


@pytest.mark.parametrize(
    ("line", "key", "answer"),
    [
        ("./gravcomp bench robots --write src/doc/figures.md", "rest_error_pct", '"rest_error_pct": '),
        ("./gravcomp bench robots --mesh --write src/doc/figures.md", "rest_error_pct", '"rest_error_pct": '),
        ("./gravcomp bench robots --loop --write src/doc/figures.md", "unholdable", '"unholdable": null'),
    ],
)
def test_robots_are_measured(type_in, line, key, answer):
    """One figure of one robot, which is computed in seconds; all of them take a quarter of an hour a robot."""
    code, output = type_in(line, f"--figures {key} --json article")
    assert code in (0, 1) and answer in output, output
