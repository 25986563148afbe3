"""The hooks with which `./gravcomp docs` builds pages faster: they find what docutils and Sphinx find."""

import gc
import importlib.util
from pathlib import Path
from types import SimpleNamespace

import pytest

nodes = pytest.importorskip("docutils.nodes", reason="Sphinx is not installed: ./gravcomp docs")
pytest.importorskip("sphinx", reason="Sphinx is not installed: ./gravcomp docs")
pytest.importorskip("numpy")

CONF = Path(__file__).resolve().parents[1] / "doc" / "api" / "conf.py"


@pytest.fixture(scope="module")
def conf():
    spec = importlib.util.spec_from_file_location("documentation_conf", CONF)
    module = importlib.util.module_from_spec(spec)
    threshold = gc.get_threshold()
    spec.loader.exec_module(module)
    gc.set_threshold(*threshold)  # of the tests
    return module


def tree():
    lists = [nodes.bullet_list("", *(nodes.list_item("", nodes.paragraph("", f"{n}{k}")) for k in range(3))) for n in "ab"]
    return nodes.section("", nodes.title("", "A title"), nodes.paragraph("", "text", nodes.emphasis("", "more")), *lists)


@pytest.mark.parametrize(
    "asked",
    [
        {},
        {"condition": nodes.Text},
        {"condition": nodes.section},
        {"condition": lambda node: len(node.children) == 1},
        {"condition": nodes.paragraph, "include_self": False},
        {"condition": nodes.Text, "descend": False},
        {"siblings": True},
        {"ascend": True},
    ],
)
def test_the_search_finds_what_docutils_finds_in_its_order(conf, asked):
    root = tree()
    for node in (root, root[1], root[2][0]):
        assert list(conf.find_all(node, **asked)) == list(conf._FIND(node, **asked))


def test_members_of_other_modules_are_left_out(conf):
    app = SimpleNamespace(env=SimpleNamespace(current_document=SimpleNamespace(autodoc_module="own")))

    def made(name, module):
        return type(name, (), {"__module__": module})

    left_out = {
        (what, name): conf.skip_members(app, what, name, made("Member", module), False, None)
        for what, name, module in (
            ("module", "Member", "other"),
            ("module", "Other", "other"),
            ("class", "Member", "other"),
        )
    }
    assert left_out == {("module", "Member"): True, ("module", "Other"): None, ("class", "Member"): None}
    assert conf.skip_members(app, "module", "Member", made("Member", "own"), False, None) is None
    assert conf.skip_members(app, "module", "Table", dict[int, float], False, None) is True
    assert conf.skip_members(app, "module", "LIMIT", 3.0, False, None) is None
