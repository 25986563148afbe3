"""`./gravcomp docs`: the documentation of the Python interface is built without a warning."""

import pytest
from documents import documented

pytest.importorskip("sphinx", reason="Sphinx is not installed: ./gravcomp docs")
pytestmark = pytest.mark.timeout(1200)


def test_the_documentation_is_built_without_warnings(gravcomp, tmp_path):
    answer = gravcomp(*documented("./gravcomp docs")[1:], "--out", str(tmp_path / "html"), "--json", timeout=1100)
    assert answer.code == 0, answer.err
    assert answer.json["built"] and answer.json["pages"] > 100
    assert "InverseController" in (tmp_path / "html" / "modules" / "gravcomp.inverse.controller.html").read_text(encoding="utf-8")
    assert "modules/gravcomp.html" in (tmp_path / "html" / "index.html").read_text(encoding="utf-8")
