"""The environment of the commands: pip's settings as uv's, and what lock files name."""

from pathlib import Path

import pytest

from gravcomp.environment import installer, packages
from gravcomp.environment.pip_settings import parse_pip_settings
from gravcomp.environment.ready import SEARCH_PATHS, environment

ROOT = Path(__file__).parents[2]

PIP_CONFIG = """\
:env:.find-links='/wheels'
global.extra-index-url='https://one.example/simple https://two.example/simple'
global.find-links='/other'
global.index-url='https://zero.example/simple'
install.index-url='https://better.example/simple'
list.format='json'
"""


def test_the_more_specific_of_pips_settings_has_precedence():
    settings = parse_pip_settings(PIP_CONFIG)
    assert settings == {
        "extra-index-url": "https://one.example/simple https://two.example/simple",
        "find-links": "/wheels",
        "index-url": "https://better.example/simple",
    }


def test_what_only_tests_need_is_not_in_the_locks_of_the_product():
    for lock in ("requirements.lock", "requirements-installed-ros.lock"):
        assert not {"pytest", "playwright", "ruff", "sphinx", "cmake"} & set(installer.names(ROOT / lock)), lock


def test_locks_agree_on_the_versions_of_common_packages():
    def versions(lock):
        lines = [line.split() for line in (ROOT / lock).read_text(encoding="utf-8").splitlines()]
        found = {}
        for words in lines:
            if words and "==" in words[0] and not words[0].startswith(("#", "-")):
                name, _, version = words[0].partition("==")
                found.setdefault(name, set()).add(version)
        return found

    product = versions("requirements.lock")
    for lock, _ in packages.EXTRAS.values():
        common = {name: found for name, found in versions(lock).items() if name in product}
        assert common == {name: product[name] for name in common}, lock


def test_no_lock_names_an_index():
    for lock in ROOT.glob("requirements*.lock"):
        assert "://" not in lock.read_text(encoding="utf-8"), lock.name


@pytest.mark.parametrize("same", [True, False])
def test_only_equal_libraries_are_linked(tmp_path, same):
    (tmp_path / "lib").mkdir()
    one, other = tmp_path / "lib" / "libone.so", tmp_path / "lib" / "libone.so.1"
    one.write_bytes(bytes(100_000))
    other.write_bytes(bytes(100_000) if same else bytes(99_999) + b"1")
    packages._link_equal_files(tmp_path)
    assert one.samefile(other) == same
    assert other.read_bytes()[-1:] == (b"\0" if same else b"1")


@pytest.mark.parametrize(("given", "kept"), [({}, ".workspace/bytecode"), ({"PYTHONPYCACHEPREFIX": "elsewhere"}, "elsewhere")])
def test_who_wants_no_bytecode_next_to_the_sources_gets_it_elsewhere(monkeypatch, tmp_path, given, kept):
    """Containers often forbid it, and then every process would compile all its modules."""
    monkeypatch.delenv("PYTHONPYCACHEPREFIX", raising=False)
    paths = dict.fromkeys(SEARCH_PATHS, "")
    monkeypatch.setenv("PYTHONDONTWRITEBYTECODE", "1")
    for name, value in given.items():
        monkeypatch.setenv(name, value)
    found = environment(tmp_path, paths)
    assert "PYTHONDONTWRITEBYTECODE" not in found and found["PYTHONPYCACHEPREFIX"].endswith(kept)
    monkeypatch.delenv("PYTHONDONTWRITEBYTECODE")
    assert environment(tmp_path, paths).get("PYTHONPYCACHEPREFIX") == given.get("PYTHONPYCACHEPREFIX")
