"""Check of a robot file, all sections."""

from gravcomp.config import ConfigError
from gravcomp.doctor.finding import Finding
from gravcomp.graph.nodes import NODES


def examine(robot: str) -> list[Finding]:
    """Return one finding: the file can be used, or the first error in it."""
    from gravcomp.description import load_robot_file
    from gravcomp.launcher.robot_graph import check_robot_file

    try:
        check_robot_file(robot)
        file = load_robot_file(robot)
        known = {entry.executable for entry in NODES}
        for name in file.section("nodes"):
            if name not in known:
                raise ConfigError(f"{file.source}: unknown key 'nodes.{name}'; allowed: {', '.join(sorted(known))}")
    except ConfigError as error:
        return [Finding("missing", "robot file", str(error))]
    return [
        Finding(
            "ok",
            "robot file",
            f"{file.source}: {file.robot.name}, {len(file.robot.cables)} cables, {1e3 * file.robot.length:g} mm",
        )
    ]
