"""Configuration of Sphinx for `./gravcomp docs`, which reads a copy of the repository."""

import builtins
import functools
import gc
import logging
import re
from collections.abc import Iterator
from types import GenericAlias
from typing import Any

from docutils.nodes import Node
from sphinx import addnodes
from sphinx.domains.python import PythonDomain
from sphinx.pycode.parser import Parser
from sphinx.search.en import SearchEnglish

from gravcomp import __version__

# The pages are millions of small objects that stay: looking for garbage among them took a quarter of the time.
gc.set_threshold(100_000, 20, 100)

project = "gravcomp"
copyright = "gravcomp maintainers"
version = release = __version__

extensions = ["sphinx.ext.autodoc", "sphinx.ext.autosummary", "sphinx.ext.napoleon", "myst_parser"]
root_doc = "index"  # a copy of index.md in this folder
include_patterns = [
    "index.md",
    "modules/**",
    "README.md",
    "CONTRIBUTING.md",
    "CHANGELOG.md",
    "gravcomp_*/README.md",
    "src/README.md",
    "src/doc/**",
    "src/gravcomp/canbus/*.md",
]
exclude_patterns = ["src/doc/api/**", "**/test/**", ".*"]

autosummary_generate = False  # gravcomp/commands/module_pages.py has written the pages
# An object is described where it is defined, not again in the packages that export it.
autodoc_default_options = {"members": True, "undoc-members": True, "ignore-module-all": True}
autodoc_typehints = "signature"
autodoc_member_order = "bysource"
autodoc_use_type_comments = False  # all types are annotations; the search for comments parses every function again
napoleon_google_docstring = False
# In docstrings `name` is code.
default_role = "code"

myst_enable_extensions = ["dollarmath"]
myst_heading_anchors = 4
myst_fence_as_directive = []
# Links to source files and folders lead nowhere in HTML; test/test_documents.py checks that their targets exist.
# In annotations Sphinx cannot tell the built-in `type` from an attribute of that name.
suppress_warnings = ["myst.xref_missing", "myst.header", "misc.highlighting_failure", "ref.python"]

html_theme = "alabaster"
html_sidebars = {"**": ["about.html", "searchfield.html", "localtoc.html", "relations.html"]}
html_title = f"gravcomp {release}"
html_show_copyright = False
html_copy_source = False
smartquotes = False  # for curly quotes each text is taken apart once more

_FOREIGN = {"np", "numpy", "collections", "pathlib", "typing", "enum", "argparse", "subprocess", "scipy"}
_SECTION = re.compile(r"^\s*-{3,}\s*$")


def plain_text(app: Any, what: str, name: str, obj: Any, options: Any, lines: list[str]) -> None:
    """Turn the prose of a docstring into reStructuredText: indented blocks become literal, other markup is escaped.

    Docstrings with sections of the NumPy style are left to napoleon, examples for doctest to Sphinx.
    """
    if any(_SECTION.match(line) for line in lines):
        return
    text, literal, example = [], False, False
    for line in lines:
        example = line.startswith(">>>") or (example and bool(line.strip()))
        if example:
            text.append(line)
            continue
        indented = line.startswith("  ") and bool(line.strip())
        if indented and not literal:
            text += ["", "::", ""]
        elif literal and line.strip() and not indented:
            text.append("")
        literal = indented or (literal and not line.strip())
        text.append(line if literal else _escaped(line))
    lines[:] = text


def _escaped(line: str) -> str:
    """Escape what reStructuredText would read as markup, except in `code`."""
    parts = line.split("`")
    if len(parts) % 2 == 0:  # an unpaired backtick
        return re.sub(r"([*|`_\\])", r"\\\1", line)
    for index in range(0, len(parts), 2):
        parts[index] = re.sub(r"([*|\\]|_(?=\W|$))", r"\\\1", parts[index])
    return "`".join(parts)


def skip_members(app: Any, what: str, name: str, obj: Any, skip: bool, options: Any) -> bool | None:
    """Leave out names of types as `dict[int, float]`, which Sphinx takes for classes and fails to describe.

    And what a module has imported: Sphinx leaves that out after it has put its description together.
    """
    if isinstance(obj, GenericAlias):
        return True
    own = app.env.current_document.autodoc_module
    imported = what == "module" and getattr(obj, "__name__", None) == name and getattr(obj, "__module__", own) != own
    return True if imported else None


def unlink_foreign_types(app: Any, doctree: Any) -> None:
    """Make text of the annotations' types that these pages do not describe: the search for each among all names is slow."""
    for reference in list(doctree.findall(addnodes.pending_xref)):
        target = reference.get("reftarget", "")
        if reference.get("refdomain") == "py" and (hasattr(builtins, target) or target.split(".")[0] in _FOREIGN):
            reference.replace_self(reference.children)


class NamedObjects:
    """Search for what a name in an annotation means only among the objects whose names end alike, in place of among all."""

    def __init__(self) -> None:
        self._search = PythonDomain.find_obj
        self._by_end: dict[str, list[str]] = {}
        self._count = -1

    def find(self, domain: PythonDomain, env: Any, module: str, cls: str, name: str, *how: Any) -> list:
        """Return what Sphinx finds: it compares whole names, or their ends."""
        every = domain.data["objects"]
        if len(every) != self._count:
            self._by_end, self._count = {}, len(every)
            for full in every:
                self._by_end.setdefault(full.rpartition(".")[2], []).append(full)
        ends_alike = self._by_end.get(name.removesuffix("()").rpartition(".")[2], ())
        domain.data["objects"] = {full: every[full] for full in ends_alike}
        try:
            return self._search(domain, env, module, cls, name, *how)
        finally:
            domain.data["objects"] = every


_FIND = Node.findall


def find_all(
    node: Node,
    condition: Any = None,
    include_self: bool = True,
    descend: bool = True,
    siblings: bool = False,
    ascend: bool = False,
) -> Iterator[Node]:
    """Yield what docutils' `findall` yields, which calls itself for each node, and passes each result up from level to level."""
    if not (include_self and descend) or siblings or ascend:
        yield from _FIND(node, condition, include_self, descend, siblings, ascend)
        return
    of_class = isinstance(condition, type)
    waiting = [node]
    while waiting:
        node = waiting.pop()
        if condition is None or (isinstance(node, condition) if of_class else condition(node)):
            yield node
        if node.children:
            waiting += node.children[::-1]


def setup(app: Any) -> None:
    """Register the hooks; the conversion comes before napoleon's."""
    logging.getLogger("sphinx").setLevel(logging.INFO)  # a hundred thousand messages of autodoc for its authors are not made
    # Lines of the definitions, which take an eighth of the build to find; only viewcode and pyobject of literalinclude use them.
    Parser.parse_definition = lambda parser: None
    # The same few thousand words, eighty thousand times.
    SearchEnglish.stem = functools.cache(SearchEnglish.stem)
    Node.findall = find_all
    objects = NamedObjects()
    PythonDomain.find_obj = lambda domain, *sought: objects.find(domain, *sought)
    app.connect("autodoc-skip-member", skip_members)
    app.connect("autodoc-process-docstring", plain_text, priority=400)
    app.connect("doctree-read", unlink_foreign_types)
