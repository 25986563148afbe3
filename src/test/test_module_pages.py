"""The pages of modules that `gravcomp docs` gives to Sphinx."""

from gravcomp.commands.module_pages import write_module_pages


def test_each_public_module_has_a_page_that_lists_what_is_in_it(tmp_path):
    package = tmp_path / "soft"
    for name in ("__init__.py", "rod.py", "_inner.py", "wall/__init__.py", "wall/plane.py", "wall/_hidden/__init__.py"):
        (package / name).parent.mkdir(parents=True, exist_ok=True)
        (package / name).touch()
    write_module_pages(package, tmp_path / "pages")
    pages = {path.stem: path.read_text(encoding="utf-8") for path in (tmp_path / "pages").iterdir()}
    assert set(pages) == {"soft", "soft.rod", "soft.wall", "soft.wall.plane"}
    assert pages["soft.rod"] == "soft.rod\n========\n\n.. automodule:: soft.rod\n"
    described, listed = pages["soft"].split(".. rubric:: Modules")
    assert described == "soft\n====\n\n.. automodule:: soft\n\n"
    assert listed == "\n\n.. autosummary::\n   :toctree:\n\n   rod\n   wall\n"
