"""Cache keys follow the content: equal content, equal key; any change, another key."""

import numpy as np

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
