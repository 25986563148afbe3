"""Cache keys follow the content: equal content, equal key; any change, another key."""

import os

import numpy as np

from gravcomp import cache
from gravcomp.cache import cache_path, content_key
from gravcomp.description import load_robot_file


def test_keys_follow_the_content():
    robot = load_robot_file("article").robot
    again = load_robot_file("article").robot
    assert content_key(robot, np.arange(3.0)) == content_key(again, np.arange(3.0))
    assert content_key(robot) != content_key(robot.with_material(youngs_modulus=0.5e6))
    assert content_key(np.arange(6.0)) != content_key(np.arange(6.0).reshape(2, 3))
    assert content_key("ab", "c") != content_key("a", "bc")


def test_the_folder_can_be_chosen(tmp_path, monkeypatch):
    monkeypatch.setenv("GRAVCOMP_CACHE", str(tmp_path))
    assert cache_path("reduction", "key", ".npz") == tmp_path / "reduction" / "key.npz"
    assert (tmp_path / "reduction").is_dir()


def test_compiled_functions_of_other_sources_are_kept_apart(tmp_path, monkeypatch):
    """Numba would take a function from its cache although one that it calls, in another file, has changed."""
    monkeypatch.setenv("GRAVCOMP_CACHE", str(tmp_path / "cache"))
    monkeypatch.setattr(cache, "__file__", str(tmp_path / "package" / "cache.py"))
    (tmp_path / "package").mkdir()
    folders = []
    for text in ("import numba  # one", "import numba  # other", "import numba  # one"):
        (tmp_path / "package" / "compiled.py").write_text(text)
        monkeypatch.setenv("NUMBA_CACHE_DIR", "")  # so that what is set below is undone
        monkeypatch.delenv("NUMBA_CACHE_DIR")
        cache.configure_numba()
        folders.append(os.environ["NUMBA_CACHE_DIR"])
    assert folders[0] == folders[2] != folders[1]
