"""Where Numba keeps this package's compiled functions: one folder for each state of the code that those of a module consist of.

Numba itself looks at the time stamp of a function's own file. But functions here call those of other files, and a comment changes
no function. A module's folder is therefore named after the syntax trees, without docstrings, of the module and of those from
which it imports compiled functions, constants or named tuples, directly or through others. A change of one module leaves the
functions of all that do not use it in the cache.
"""

import ast
import functools
import json
import os
import re
import sys
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from pathlib import Path

from gravcomp.cache import cache_folder, content_key
from gravcomp.whole_file import write_whole

PACKAGE = Path(__file__).parent
_NUMBA = re.compile(rb"^(?:from|import) numba\b", re.MULTILINE)
_IMPORTS = re.compile(rb"^from (gravcomp[\w.]*) import (\([^)]*\)|[^\n]*)", re.MULTILINE)
_COMMENT = re.compile(r"#[^\n]*")


@dataclass(frozen=True)
class Source:
    """A module as it matters here: stamp of its file, digest of its code, and `imported`: names by module.

    compiled: it imports Numba; tuples: it contains named tuples.
    """

    stamp: list[int]
    digest: str
    compiled: bool
    tuples: bool
    imported: dict[str, list[str]]


def compiled_folder() -> Path:
    """Return the folder that belongs to the present state of all compiled code, made when missing."""
    if "NUMBA_CACHE_DIR" in os.environ:
        folder = Path(os.environ["NUMBA_CACHE_DIR"])
    else:
        sources = _sources()
        folder = _folder_of(name for name, source in sources.items() if source.compiled)
    folder.mkdir(parents=True, exist_ok=True)
    return folder


def module_folder(module: str) -> Path:
    """Return the folder of the functions of a module, as gravcomp.cables.slack; it may not exist yet."""
    return _folder_of([module])


def _folder_of(modules: Iterable[str]) -> Path:
    """Return the folder named after these modules and all whose code their functions contain."""
    sources, needed, waiting = _sources(), set(), list(modules)
    while waiting:
        name = waiting.pop()
        if name not in needed:
            needed.add(name)
            waiting += _contained(name, sources)
    digests = [f"{name} {sources[name].digest}" for name in sorted(needed)]
    return cache_folder("numba") / content_key(sys.version, _numba_version(), *digests)


@functools.cache
def _numba_version() -> str:
    from importlib import metadata

    return metadata.version("numba")


def _contained(name: str, sources: dict[str, Source]) -> list[str]:
    """Return the modules whose functions, constants or named tuples a module imports."""
    found = []
    for module, names in sources[name].imported.items():
        for imported in names:
            origin = _origin(module, imported, sources)
            if origin is None:
                continue
            source = sources[origin]
            constant = imported.lstrip("_").isupper() or imported == "*"
            if source.compiled or constant or (source.tuples and imported.lstrip("_")[:1].isupper()):
                found.append(origin)
    return found


def _origin(module: str, name: str, sources: dict[str, Source]) -> str | None:
    """Return the module that a name imported from `module` comes from: through packages that only pass it on."""
    if f"{module}.{name}" in sources:
        return f"{module}.{name}"
    if module not in sources:
        return None
    for further, names in sources[module].imported.items():
        if name in names and further != module:
            return _origin(further, name, sources)
    return module


@functools.cache
def _sources() -> dict[str, Source]:
    """Return all modules of the package by name, remembered as long as the files do not change."""
    memory = cache_folder("numba") / f"modules-{content_key(str(PACKAGE))}.json"
    try:
        known = {name: Source(**entry) for name, entry in json.loads(memory.read_text(encoding="utf-8")).items()}
    except (OSError, ValueError, TypeError):
        known = {}
    current = {}
    for path in PACKAGE.rglob("*.py"):
        status = path.stat()
        stamp = [status.st_mtime_ns, status.st_size]
        parts = ["gravcomp", *path.relative_to(PACKAGE).with_suffix("").parts]
        name = ".".join(parts[:-1] if parts[-1] == "__init__" else parts)
        before = known.get(name)
        current[name] = before if before and before.stamp == stamp else _read(path.read_bytes(), stamp)
    if current != known:
        write_whole(memory, json.dumps({name: asdict(source) for name, source in current.items()}))
    return current


def _read(source: bytes, stamp: list[int]) -> Source:
    imported: dict[str, list[str]] = {}
    for found in _IMPORTS.finditer(source):
        names = _COMMENT.sub("", found.group(2).decode()).strip("() \n").split(",")
        imported.setdefault(found.group(1).decode(), []).extend(n.split(" as ")[0].strip() for n in names if n.strip())
    compiled = _NUMBA.search(source) is not None
    return Source(stamp, digest(source, compiled), compiled, b"NamedTuple" in source, imported)


def digest(source: bytes, compiled: bool) -> str:
    """Return a digest of the code in a module; comments, docstrings and the layout of a compiled one do not count."""
    if not compiled:
        return content_key(source)
    try:
        tree = ast.parse(source)
    except SyntaxError:  # an import will report it
        return content_key(source)
    for node in ast.walk(tree):
        if isinstance(node, (ast.Module, ast.ClassDef, ast.FunctionDef)) and ast.get_docstring(node, clean=False) is not None:
            del node.body[0]
    return content_key(ast.dump(tree))
