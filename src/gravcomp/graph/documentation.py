"""The tables of nodes, topics and parameters in the packages' READMEs, made from the code.

    python -m gravcomp.graph.documentation REPOSITORY      # renews the tables between their marks

A table stands between `<!-- node NAME -->` (or `<!-- topics -->`) and `<!-- end -->`.
"""

import re
import sys
from pathlib import Path

from gravcomp.graph.nodes import NODES, Node, Port, node

_BLOCK = re.compile(r"(<!-- (node (\w+)|topics) -->\n).*?(<!-- end -->)", re.DOTALL)
DOCUMENTS = ("README.md", "gravcomp_hw/README.md", "gravcomp_estimation/README.md", "gravcomp_fem/README.md")


def node_tables(entry: Node) -> str:
    """Topics, services and parameters of a node as Markdown."""
    parts = []
    ports = [("takes", p) for p in entry.takes] + [("gives", p) for p in entry.gives] + [("serves", p) for p in entry.services]
    parts.append("| | name | type | |\n|---|---|---|---|")
    parts += [f"| {way} | `{p.name}` | {_short(p.type)} | {p.meaning} |" for way, p in ports]
    leaves = entry.declared_parameters()
    if leaves:
        parts.append("\n| parameter | default | allowed | |\n|---|---|---|---|")
    for leaf in leaves:
        fixed = " (fixed at the start)" if leaf.parameter.read_only else ""
        default = "" if leaf.default is None else f"`{leaf.default}`"
        parts.append(f"| `{leaf.key}` | {default} | {leaf.parameter.allowed()} | {leaf.parameter.description}{fixed} |")
    return "\n".join(parts) + "\n"


def topic_table() -> str:
    """Every topic with who gives and who takes it, tools left out, as Markdown."""
    topics: dict[str, tuple[Port, list, list]] = {}
    for entry in (entry for entry in NODES if not entry.tool):
        for port in entry.gives:
            topics.setdefault(port.name, (port, [], []))[1].append(entry.executable)
        for port in entry.takes:
            topics.setdefault(port.name, (port, [], []))[2].append(entry.executable)
    rows = ["| topic | type | carries | from | to |", "|---|---|---|---|---|"]
    for name, (port, givers, takers) in topics.items():
        givers = ["all"] if name == "/diagnostics" else givers
        rows.append(f"| `{name}` | {_short(port.type)} | {port.meaning} | {', '.join(givers)} | {', '.join(takers)} |")
    return "\n".join(rows) + "\n"


def renewed(text: str) -> str:
    """The document with its tables as the code has them now."""
    return _BLOCK.sub(
        lambda m: m.group(1) + (topic_table() if m.group(2) == "topics" else node_tables(node(m.group(3)))) + m.group(4), text
    )


def _short(kind: str) -> str:
    return kind.replace("/msg/", "/").replace("/srv/", "/")


def main(root: Path) -> None:
    for name in DOCUMENTS:
        path = root / name
        path.write_text(renewed(path.read_text()))


if __name__ == "__main__":
    main(Path(sys.argv[1]))
