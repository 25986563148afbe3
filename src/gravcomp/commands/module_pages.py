"""The page of each module for `gravcomp docs`: its docstrings, and a list of what is in a package.

Sphinx can write such pages itself, but reads every module once more for members that these pages do not list.
"""

import pkgutil
from collections.abc import Iterator
from pathlib import Path


def write_module_pages(package: Path, folder: Path) -> None:
    """Write a page NAME.rst into `folder`, made when missing, for the package and each public module below it."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, inner in _modules(package.name, package):
        (folder / f"{name}.rst").write_text(_page(name, inner), encoding="utf-8")


def _modules(name: str, folder: Path) -> Iterator[tuple[str, list[str]]]:
    """Yield the name of a package and those of the modules in it; then the same of each of these."""
    inner = [module for module in pkgutil.iter_modules([str(folder)]) if not module.name.startswith("_")]
    yield name, [module.name for module in inner]
    for module in inner:
        full = f"{name}.{module.name}"
        yield from _modules(full, folder / module.name) if module.ispkg else [(full, [])]


def _page(name: str, inner: list[str]) -> str:
    lines = [name, "=" * len(name), "", f".. automodule:: {name}", ""]
    if inner:
        lines += [".. rubric:: Modules", "", ".. autosummary::", "   :toctree:", "", *(f"   {module}" for module in inner), ""]
    return "\n".join(lines)
