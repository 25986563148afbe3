"""Cache keys follow the content: equal content, equal key; any change, another key."""

import numpy as np
import pytest

from gravcomp import compiled_functions
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


@pytest.mark.parametrize(
    ("other", "same"),
    [
        ("import numba  # another comment\n\ndef f(x):\n    return x + 1", True),
        ('import numba\ndef f(x):\n    """Says what it does."""\n    return x + 1', True),
        ("import numba\ndef f(x):\n    return x + 2", False),
    ],
)
def test_compiled_functions_are_kept_by_the_code_of_all_modules(other, same, tmp_path, monkeypatch):
    """Numba would take a function from its cache although one that it calls, in another file, has changed."""
    monkeypatch.setenv("GRAVCOMP_CACHE", str(tmp_path / "cache"))
    monkeypatch.delenv("NUMBA_CACHE_DIR", raising=False)
    monkeypatch.setattr(compiled_functions, "PACKAGE", tmp_path / "package")
    (tmp_path / "package").mkdir()
    folders = []
    for text in ("import numba\ndef f(x):\n    return x + 1", other):
        (tmp_path / "package" / "compiled.py").write_text(text)
        (tmp_path / "package" / "plain.py").write_text(f"# {text}".replace("numba", "other"))
        folders.append(compiled_functions.compiled_folder())
    assert (folders[0] == folders[1]) == same


def test_the_digests_of_unchanged_files_are_remembered(tmp_path, monkeypatch):
    monkeypatch.setenv("GRAVCOMP_CACHE", str(tmp_path / "cache"))
    monkeypatch.delenv("NUMBA_CACHE_DIR", raising=False)
    folder = compiled_functions.compiled_folder()
    monkeypatch.setattr(compiled_functions, "digest", lambda source: pytest.fail("a file was read again"))
    assert compiled_functions.compiled_folder() == folder
