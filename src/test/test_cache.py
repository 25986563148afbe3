"""Cache keys follow the content: equal content, equal key; any change, another key."""

import ast
import os
import subprocess
import sys

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


@pytest.fixture
def package(tmp_path, monkeypatch):
    """Return a function that writes a module of a package and returns the folder of its functions."""
    monkeypatch.setenv("GRAVCOMP_CACHE", str(tmp_path / "cache"))
    monkeypatch.delenv("NUMBA_CACHE_DIR", raising=False)
    monkeypatch.setattr(compiled_functions, "PACKAGE", tmp_path / "package")

    def write(text, name="compiled"):
        path = tmp_path / "package" / f"{name}.py"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
        compiled_functions._sources.cache_clear()
        return compiled_functions.module_folder(
            "gravcomp.compiled" if (tmp_path / "package/compiled.py").exists() else "gravcomp"
        )

    (tmp_path / "package").mkdir()
    write("", "__init__")
    yield write
    compiled_functions._sources.cache_clear()


BEFORE = "import numba\nfrom gravcomp.parts import LIMIT, called\ndef f(x):\n    return x + 1"


@pytest.mark.parametrize(
    ("other", "same"),
    [
        (f"# another comment\n\n{BEFORE}", True),
        (BEFORE.replace("(x):\n", '(x):\n    """Says what it does."""\n'), True),
        (BEFORE.replace("+ 1", "+ 2"), False),
    ],
)
def test_compiled_functions_are_kept_by_their_code(package, other, same):
    assert (package(BEFORE) == package(other)) == same


@pytest.mark.parametrize(
    ("name", "before", "after", "same"),
    [
        ("parts/inner", "import numba\ndef called():\n    return 1", "import numba\ndef called():\n    return 2", False),
        ("parts/values", "LIMIT = 1.0", "LIMIT = 2.0", False),
        ("parts/other", "import numba\ndef f():\n    return 1", "import numba\ndef f():\n    return 2", True),
        ("parts/plain", "def g(): return 1", "def g(): return 2", True),
    ],
)
def test_a_change_matters_where_functions_constants_or_named_tuples_come_from_it(package, name, before, after, same):
    """Numba would take a function from its cache although one that it calls, in another file, has changed."""
    passed_on = "from gravcomp.parts.inner import (\n    called,  # a function\n)\nfrom gravcomp.parts.values import LIMIT\n"
    package(passed_on, "parts/__init__")
    package("import numba\ndef called():\n    return 1", "parts/inner")
    package("LIMIT = 1.0", "parts/values")
    package(BEFORE + "\nfrom gravcomp.parts.plain import g")
    assert (package(before, name) == package(after, name)) == same


def test_the_functions_of_every_module_have_a_folder_by_what_they_consist_of(monkeypatch):
    monkeypatch.delenv("NUMBA_CACHE_DIR", raising=False)
    sources = compiled_functions._sources()
    compiled = [name for name, source in sources.items() if source.compiled]
    assert len({compiled_functions.module_folder(name) for name in compiled}) == len(compiled) > 40
    assert "gravcomp.rounding" in compiled_functions._contained("gravcomp.mechanics.assembly", sources)


def test_all_that_compiled_functions_use_of_other_modules_counts():
    """Lower-case values, classes and results of functions that are not compiled would not: a function would be kept wrongly."""
    sources, waiting, missed, seen = compiled_functions._sources(), [], [], set()
    waiting += [name for name, source in sources.items() if source.compiled]
    while waiting:
        name = waiting.pop()
        if name in seen:
            continue
        seen.add(name)
        contained = compiled_functions._contained(name, sources)
        waiting += contained
        for module, imported in used_imports(ast.parse(source_file(name).read_text(encoding="utf-8"))):
            if compiled_functions._origin(module, imported, sources) not in contained:
                missed.append(f"{name} uses {imported} of {module}")
    assert not missed and len(seen) > 40


def source_file(name):
    path = compiled_functions.PACKAGE.joinpath(*name.split(".")[1:])
    return path / "__init__.py" if path.is_dir() else path.with_suffix(".py")


def used_imports(tree):
    """Return module and name of what compiled functions and constants of a module use of others of the package."""
    parts = [
        node
        for node in ast.walk(tree)
        if isinstance(node, ast.FunctionDef) and any("jit" in ast.dump(decorator) for decorator in node.decorator_list)
    ]
    parts += [node for node in tree.body if isinstance(node, ast.Assign) and any(name.isupper() for name in targets(node))]
    used: set[str] = set()
    while parts:
        new = {name.id for part in parts for name in ast.walk(part) if isinstance(name, ast.Name)} - used
        used |= new
        # What these are made of: functions and values of the same module.
        parts = [node for node in tree.body if isinstance(node, ast.FunctionDef) and node.name in new]
        parts += [node for node in tree.body if isinstance(node, ast.Assign) and targets(node) & new]
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("gravcomp"):
            yield from ((node.module, alias.name) for alias in node.names if (alias.asname or alias.name) in used)


def targets(assignment):
    return {name.id for target in assignment.targets for name in ast.walk(target) if isinstance(name, ast.Name)}


def test_the_digests_of_unchanged_files_are_remembered(tmp_path, monkeypatch):
    monkeypatch.setenv("GRAVCOMP_CACHE", str(tmp_path / "cache"))
    monkeypatch.delenv("NUMBA_CACHE_DIR", raising=False)
    compiled_functions._sources.cache_clear()
    folder = compiled_functions.compiled_folder()
    compiled_functions._sources.cache_clear()
    monkeypatch.setattr(compiled_functions, "digest", lambda *source: pytest.fail("a file was read again"))
    assert compiled_functions.compiled_folder() == folder


@pytest.mark.parametrize("first", ["import numba", "import gravcomp.scene.scene", "pass"])
def test_compiled_functions_are_kept_by_their_code_whatever_is_imported_first(first):
    """Numba's own places look at the time of one file, and would keep a function whose callee in another file has changed."""
    program = f"{first}; import gravcomp.contact.places as m; print(type(m.find_places._cache._impl.locator).__name__)"
    environment = {name: value for name, value in os.environ.items() if not name.startswith("NUMBA_")}
    done = subprocess.run([sys.executable, "-c", program], env=environment, capture_output=True, text=True)
    assert done.stdout.strip() == "ContentLocator", done.stderr
