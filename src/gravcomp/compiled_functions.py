"""Where Numba keeps this package's compiled functions: one folder for each state of the code that is compiled.

Numba itself looks at the time stamp of a function's own file. But functions here call those of other files, and a comment changes
no function. The folder is therefore named after the syntax trees, without docstrings, of all modules that use Numba.
"""

import ast
import json
import os
import sys
from pathlib import Path

from gravcomp.cache import cache_folder, content_key
from gravcomp.whole_file import write_whole

PACKAGE = Path(__file__).parent
_LOCATORS = "gravcomp.numba_locator.ContentLocator,UserProvidedCacheLocator,InTreeCacheLocator,UserWideCacheLocator"


def configure_numba() -> None:
    """Let Numba keep its compiled functions in the cache; to be called before the first import of numba.

    A NUMBA_CACHE_DIR of the user's own has precedence; then Numba decides by itself what is up to date.
    """
    if "NUMBA_CACHE_DIR" not in os.environ:
        os.environ.setdefault("NUMBA_CACHE_LOCATOR_CLASSES", _LOCATORS)


def compiled_folder() -> Path:
    """Return the folder of the compiled functions of the present code, made when missing."""
    from importlib import metadata

    if "NUMBA_CACHE_DIR" in os.environ:
        folder = Path(os.environ["NUMBA_CACHE_DIR"])
    else:
        folder = cache_folder("numba") / content_key(sys.version, metadata.version("numba"), *_digests())
    folder.mkdir(parents=True, exist_ok=True)
    return folder


def _digests() -> list[str]:
    """Digests of the modules that use Numba, remembered as long as the files do not change."""
    memory = cache_folder("numba") / f"sources-{content_key(str(PACKAGE))}.json"
    try:
        known = json.loads(memory.read_text())
    except (OSError, ValueError):
        known = {}
    current = {}
    for path in sorted(PACKAGE.rglob("*.py")):
        status = path.stat()
        stamp = [status.st_mtime_ns, status.st_size]
        name = str(path.relative_to(PACKAGE))
        before = known.get(name)
        current[name] = before if before and before[:2] == stamp else [*stamp, digest(path.read_bytes())]
    if current != known:
        write_whole(memory, json.dumps(current))
    return [f"{name} {entry[2]}" for name, entry in current.items() if entry[2]]


def digest(source: bytes) -> str:
    """Return a digest of the code in a module, or an empty text when the module does not use Numba.

    Comments, docstrings and the layout do not count.
    """
    if b"numba" not in source and b"fastmath" not in source:
        return ""
    try:
        tree = ast.parse(source)
    except SyntaxError:  # an import will report it
        return content_key(source)
    for node in ast.walk(tree):
        if isinstance(node, (ast.Module, ast.ClassDef, ast.FunctionDef)) and ast.get_docstring(node, clean=False) is not None:
            del node.body[0]
    return content_key(ast.dump(tree))
