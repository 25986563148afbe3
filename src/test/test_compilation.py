"""Parts of the compiled functions: each is compiled once, after those whose functions it calls."""

import threading

import pytest

from gravcomp.launcher import compilation


@pytest.fixture
def compiled(monkeypatch, tmp_path):
    """The parts in the order in which they have been compiled, none at first."""
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    done = []
    monkeypatch.setattr(compilation, "_WORK", {part: lambda part=part: done.append(part) for part in compilation.PARTS})
    return done


def test_a_part_follows_those_whose_functions_it_calls(compiled):
    compilation.compile_part("self_contact")
    assert compiled == ["model", "contact", "self_contact"]
    compilation.compile_part("reduced_contact")
    assert compiled == ["model", "contact", "self_contact", "reduced", "reduced_contact"]
    assert compilation.missing(compilation.PARTS) == ["virtual_robot", "controller", "surroundings", "virtual_self_contact"]
    compilation.compile_part("contact")
    assert len(compiled) == 5


def test_parts_that_begin_at_the_same_time_compile_nothing_twice(compiled):
    together = [threading.Thread(target=compilation.compile_part, args=(part,)) for part in reversed(compilation.PARTS)]
    for thread in together:
        thread.start()
    for thread in together:
        thread.join()
    assert sorted(compiled) == sorted(compilation.PARTS)
    for part, called in compilation._CALLED.items():
        assert all(compiled.index(other) < compiled.index(part) for other in called)
