"""The parameters of nodes in a robot file, checked before any node starts."""

from gravcomp.config import ConfigError, check_given, unknown_key
from gravcomp.description import RobotFile
from gravcomp.graph.nodes import NODES


def check_node_sections(file: RobotFile) -> None:
    """Check the section `nodes`, whose keys are executables. Raises ConfigError for a key or a value that is not allowed."""
    sections = file.section("nodes")
    executables = dict.fromkeys(entry.executable for entry in NODES)
    for name in sections:
        if name not in executables:
            raise ConfigError(f"{file.source}: {unknown_key(name, executables, 'nodes')}")
    for entry in NODES:
        given = sections.get(entry.executable)
        if not given:
            continue
        source = f"{file.source}: nodes.{entry.executable}"
        if not isinstance(given, dict):
            raise ConfigError(f"{source} is {given!r}; a mapping of keys is needed")
        check_given(entry.parameters_class, given, source)
