"""The documented lines that reproduce the article's experiments, each with --brief.

No mark: all but one of the experiments compute the loop without a graph, for minutes; the delay of the graph takes 20 s.
"""

import pytest
from documents import documented

pytestmark = pytest.mark.timeout(1600)


def test_experiments_are_reproduced(made):
    """Without --brief all of them take minutes. `test_figures_table` checks what --write does with a document.

    One of them alone, and its other name, are in `test_reproduce_command`: this run computes it as well.
    """
    code, output = made("./gravcomp reproduce all --write src/doc/figures.md", low=True)
    # 1: a figure misses its limit, which can happen in a brief run.
    assert code in (0, 1) and "index" in output, output
    documented("./gravcomp reproduce freefall --brief")
    assert "Real to simulation" in output, output
