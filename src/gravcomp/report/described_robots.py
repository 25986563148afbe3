"""Robots with a picture in the documentation: those that a page describes in a YAML block, and the shipped ones."""

import re
from pathlib import Path

import yaml

from gravcomp.config import ConfigError, from_mapping
from gravcomp.description import Robot, load_robot_file, shipped_robots

_BLOCK = re.compile(r"^```yaml\n(robot:.*?)^```\n+!\[[^\]]*\]\(([^)]+)\)", re.MULTILINE | re.DOTALL)


def robots_on(page: Path) -> list[tuple[Robot, Path]]:
    """Return every robot of a Markdown page with the path of its picture.

    Raises ConfigError, with the name of the picture, for a robot that cannot be read.
    """
    found = []
    for text, picture in _BLOCK.findall(page.read_text(encoding="utf-8")):
        source = f"{page.name}, above {Path(picture).name}"
        try:
            document = yaml.safe_load(text)
        except yaml.YAMLError as error:
            raise ConfigError(f"{source}: {error}") from error
        found.append((from_mapping(Robot, document["robot"], source=source, key="robot"), page.parent / picture))
    return found


def shipped_pictures(folder: Path) -> list[tuple[Robot, Path]]:
    """Return every shipped robot with the path of its picture in `folder`. Raises ConfigError for a robot that cannot be read."""
    return [(load_robot_file(name).robot, folder / f"{name}.png") for name in shipped_robots()]
