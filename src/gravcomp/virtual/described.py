"""The virtual robot of a robot file: what its section gives, and the description that the rest is drawn around."""

from dataclasses import dataclass
from pathlib import Path

from gravcomp.config import ConfigError, from_mapping
from gravcomp.description import Robot, RobotFile, load_robot_file
from gravcomp.description.hardware import Hardware
from gravcomp.virtual.draw import draw
from gravcomp.virtual.parameters import VirtualRobotParameters
from gravcomp.virtual.true_robot import TrueRobot


@dataclass(frozen=True)
class Described:
    """given: the section `virtual_robot`; robot and hardware: the description that it belongs to; seed: of all that is drawn.

    source: path of the file.
    """

    given: VirtualRobotParameters
    robot: Robot
    hardware: Hardware
    seed: int
    source: str

    def draw(self) -> TrueRobot:
        """Return what the virtual robot truly is. Raises ConfigError for a section that describes no robot."""
        return draw(self.given, self.robot, self.hardware, self.seed, f"{self.source}: virtual_robot")


def described(file: RobotFile, seed: int | None = None) -> Described:
    """Return the virtual robot of a robot file; `seed` replaces the file's.

    With `virtual_robot.description` it belongs to the robot of that file, with that file's section: a calibrated file has the
    virtual robot of the file that it was made from. Raises ConfigError where the cables of the two differ.
    """
    given = from_mapping(VirtualRobotParameters, file.section("virtual_robot"), source=file.source, key="virtual_robot")
    if given.description:
        key = f"{file.source}: virtual_robot.description"
        others = [name for name in file.section("virtual_robot") if name not in ("description", "seed")]
        if others:
            raise ConfigError(
                f"{key} is '{given.description}', whose section holds; {', '.join(others)} cannot be given next to it"
            )
        path = Path(given.description).expanduser()
        near = Path(file.source).resolve().parent / path
        try:
            origin = load_robot_file(near if near.is_file() else given.description)
        except ConfigError as error:
            raise ConfigError(f"{key}: {error}") from error
        if origin.section("virtual_robot").get("description"):
            raise ConfigError(f"{key} is '{given.description}', which itself names a description; name the first file")
        if origin.robot.cable_names != file.robot.cable_names:
            raise ConfigError(
                f"{key} is '{given.description}', a robot with the cables {', '.join(origin.robot.cable_names)};"
                f" needed: {', '.join(file.robot.cable_names)}"
            )
        own = file.section("virtual_robot").get("seed")
        return described(origin, given.seed if seed is None and own is not None else seed)
    hardware = file.hardware
    return Described(given, file.robot, hardware, given.seed if seed is None else seed, file.source)
