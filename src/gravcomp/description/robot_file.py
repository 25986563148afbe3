"""Reading a robot file (YAML): its sections, and the robot."""

import dataclasses
import functools
from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING

from gravcomp.config import ConfigError, from_mapping, load_yaml
from gravcomp.description.default_hardware import completed
from gravcomp.description.hardware import Hardware, parse_hardware
from gravcomp.description.overlay import on_base, with_whole_path
from gravcomp.description.pairs import check_pairs
from gravcomp.description.robot import Robot
from gravcomp.description.suited_capstan import has_motors
from gravcomp.scene import SceneSection

if TYPE_CHECKING:
    from gravcomp.scene.scene import Scene

IN_SOFTWARE = ("udp_multicast", "virtual")
"""Interfaces of python-can without hardware."""

SECTIONS = ("robot", "scene", "hardware", "virtual_robot", "nodes")
_OTHER_KEYS = ("base", "calibration")
"""Another robot file whose values this one changes; where they are from, which only people read."""


@dataclasses.dataclass(frozen=True)
class RobotFile:
    """A robot file: `source` is its path, `robot` the section `robot`, `sections` the whole document as read."""

    source: str
    robot: Robot
    sections: dict

    def section(self, name: str) -> dict:
        """Return a top-level section as a plain mapping of edge keys; empty when the file does not have it.

        The section `hardware` has motors and capstans that follow from the robot where the file has none, for the virtual robot
        (see `require_motors`). Raises ConfigError when no section has this name.
        """
        if name not in SECTIONS:
            raise ConfigError(f"{self.source}: there is no section '{name}'; allowed: {', '.join(SECTIONS)}")
        section = dict(self.sections.get(name) or {})
        return section if name != "hardware" else completed(section, self.robot)

    @functools.cached_property
    def hardware(self) -> Hardware:
        """The section `hardware`, checked against the robot's cables. Raises ConfigError."""
        hardware = parse_hardware(self.section("hardware"), source=self.source, cables=self.robot.cable_names)
        check_pairs(hardware, self.robot, self.source)
        if hardware.homing.tension_max is not None:
            return hardware
        homing = dataclasses.replace(hardware.homing, tension_max=self.robot.limits.tension_max)
        return dataclasses.replace(hardware, homing=homing)

    @functools.cached_property
    def scene(self) -> "Scene":
        """The walls of the section `scene`; without one, a scene without obstacles. Its files are read. Raises ConfigError."""
        return self._scene(forbidden=False)

    @functools.cached_property
    def zones(self) -> "Scene":
        """The forbidden zones of the section `scene`, as `scene`."""
        return self._scene(forbidden=True)

    def _scene(self, forbidden: bool) -> "Scene":
        from gravcomp.scene.scene import Scene

        scene = Scene(_scene_section(self.sections, self.source), self.source, forbidden)
        scene.refuse_other_units(self.robot.length)
        return scene

    @property
    def has_joints(self) -> bool:
        """Whether the motors are joints of a ros2_control robot."""
        return (self.sections.get("hardware") or {}).get("joints") is not None

    def require_motors(self, interface: str) -> None:
        """Raise ConfigError for a file without motors, or with assumed capstans, on a bus that can carry real motors.

        interface: python-can's name of the bus. Capstans that are not given are the standard ones where those suit the robot.
        """
        if interface in IN_SOFTWARE:
            return
        only = f"the robot can only be the virtual one ({', '.join(IN_SOFTWARE)})"
        if not has_motors(dict(self.sections.get("hardware") or {})):
            raise ConfigError(f"{self.source}: key 'hardware.motors' is missing, which {interface} needs; without it, {only}")
        drive = self.hardware.drive
        if drive.capstan_assumed:
            raise ConfigError(
                f"{self.source}: hardware.drive.capstan_radius_mm has not been measured, which {interface} needs; with the"
                f" assumed {1e3 * drive.capstan_radius:.3g} mm, {only}. Give the radius of your capstans, without capstan_assumed"
            )


def shipped_robots() -> dict[str, Path]:
    """Return name and path of every shipped robot file."""
    folder = Path(str(resources.files("gravcomp") / "robots"))
    return {path.stem: path for path in sorted(folder.glob("*.yaml"))}


def load_robot_file(name_or_path: str | Path) -> RobotFile:
    """Read and check a robot file: a shipped one by its name ('article'), any other by its path.

    Raises ConfigError, which names file and key and says what was found and what is allowed.

    >>> robot = load_robot_file("article").robot
    >>> robot.cable_names
    ('s1c1', 's1c2', 's1c3', 's2c1', 's2c2', 's2c3')
    >>> robot.length  # m
    0.1
    """
    path = robot_path(name_or_path)
    document = _document(path, ())
    if "robot" not in document:
        raise ConfigError(f"{path}: key 'robot' is missing (the body, its cables and limits)")
    robot = from_mapping(Robot, with_whole_path(document["robot"], path.resolve().parent), source=str(path), key="robot")
    _scene_section(document, str(path))
    return RobotFile(str(path), robot, document)


def _document(path: Path, above: tuple[Path, ...]) -> dict:
    """Return the document of a robot file, on its base where it has one; above: files whose base this one is."""
    document = load_yaml(path)
    if not isinstance(document, dict):
        raise ConfigError(f"{path}: is empty or not a mapping; allowed top-level keys: {', '.join(SECTIONS)}")
    for key in document:
        if key not in (*SECTIONS, *_OTHER_KEYS):
            raise ConfigError(f"{path}: unknown key '{key}'; allowed: {', '.join((*SECTIONS, *_OTHER_KEYS))}")
    for key, section in document.items():
        if section is not None and key != "base" and not isinstance(section, dict):
            raise ConfigError(f"{path}: {key} is {section!r}; a mapping of keys is needed")
    if "base" not in document:
        return document
    name = document["base"]
    if not isinstance(name, str) or not name:
        raise ConfigError(f"{path}: base is {name!r}; the path of a robot file or the name of a shipped robot is needed")
    near = path.resolve().parent / Path(name).expanduser()
    try:
        base = (near if near.is_file() else robot_path(name)).resolve()
    except ConfigError as error:
        raise ConfigError(f"{path}: base: {error}") from error
    if base in (*above, path.resolve()):
        raise ConfigError(f"{path}: base is '{name}', which itself stands on this file; name a file that does not")
    return on_base(document, _document(base, (*above, path.resolve())), base.parent)


def _scene_section(document: dict, source: str) -> SceneSection:
    """Return the section `scene` of a robot file. Raises ConfigError."""
    return from_mapping(SceneSection, document.get("scene"), source=source, key="scene")


def robot_path(name_or_path: str | Path) -> Path:
    """Return the path of a shipped robot's file, or of any other by its path. Raises ConfigError where there is no such file."""
    text = str(name_or_path)
    shipped = shipped_robots()
    if text in shipped:
        return shipped[text]
    path = Path(text).expanduser()
    if path.is_file():
        return path
    kind = "is a folder" if path.is_dir() else "does not exist"
    raise ConfigError(f"{path}: {kind}; give the path of a robot file or the name of a shipped robot: {', '.join(shipped)}")
