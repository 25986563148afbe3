"""Generate the tables of nodes, topics and parameters in the READMEs from the code.

    python -m gravcomp.graph.documentation REPOSITORY      # updates the tables between their marks

A table stands between `<!-- node NAME -->` (or `<!-- topics -->`) and `<!-- end -->`.
"""

import re
import sys
from pathlib import Path

from gravcomp.graph.interface import Node, Port
from gravcomp.graph.nodes import NODES, node

_BLOCK = re.compile(r"(<!-- (node (\w+)|topics) -->\n).*?(<!-- end -->)", re.DOTALL)
DOCUMENTS = ("README.md", "gravcomp_hw/README.md", "gravcomp_estimation/README.md", "gravcomp_fem/README.md")


def node_tables(entry: Node) -> str:
    """Topics, services and parameters of a node as Markdown."""
    parts = []
    ways = (("subscribes", entry.subscribes), ("publishes", entry.publishes), ("serves", entry.services))
    ports = [(way, port) for way, of_way in ways for port in of_way]
    parts.append("| | name | type | |\n|---|---|---|---|")
    parts += [f"| {way} | `{p.name}` | {_short(p.type)} | {p.meaning} |" for way, p in ports]
    leaves = entry.declared_parameters()
    if leaves:
        parts.append("\n| parameter | default | allowed | |\n|---|---|---|---|")
    for leaf in leaves:
        fixed = " (read-only)" if leaf.parameter.read_only else ""
        default = "" if leaf.default is None else f"`{leaf.default}`"
        parts.append(f"| `{leaf.key}` | {default} | {leaf.parameter.allowed()} | {leaf.parameter.description}{fixed} |")
    return "\n".join(parts) + "\n"


def topic_table() -> str:
    """Every topic with its publishers and subscribers as Markdown, without the tools."""
    topics: dict[str, tuple[Port, list, list]] = {}
    for entry in (entry for entry in NODES if not entry.tool):
        for port in entry.publishes:
            topics.setdefault(port.name, (port, [], []))[1].append(entry.executable)
        for port in entry.subscribes:
            topics.setdefault(port.name, (port, [], []))[2].append(entry.executable)
    rows = ["| topic | type | content | from | to |", "|---|---|---|---|---|"]
    for name, (port, publishers, subscribers) in topics.items():
        publishers = ["all"] if name == "/diagnostics" else publishers
        rows.append(f"| `{name}` | {_short(port.type)} | {port.meaning} | {', '.join(publishers)} | {', '.join(subscribers)} |")
    return "\n".join(rows) + "\n"


def renewed(text: str) -> str:
    """Return the document with its tables generated again."""
    return _BLOCK.sub(
        lambda m: m.group(1) + (topic_table() if m.group(2) == "topics" else node_tables(node(m.group(3)))) + m.group(4), text
    )


def _short(kind: str) -> str:
    return kind.replace("/msg/", "/").replace("/srv/", "/")


def main(root: Path) -> None:
    """Update the tables of all DOCUMENTS below `root`."""
    for name in DOCUMENTS:
        path = root / name
        path.write_text(renewed(path.read_text(encoding="utf-8")), encoding="utf-8")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
