"""Pictures of the live page while a user touches the virtual robot, for `docs --page`.

The whole loop runs in this process in virtual time, so that the pictures are the same on a busy machine.
"""

from pathlib import Path

import numpy as np

from gravcomp.closed_loop.loop import ClosedLoop
from gravcomp.closed_loop.setup import Setup
from gravcomp.commands import output
from gravcomp.config import ConfigError
from gravcomp.description import load_robot_file
from gravcomp.inverse import ControllerCode
from gravcomp.inverse.target import straight_target
from gravcomp.view.backbone import Backbone
from gravcomp.view.browser import Browser, BrowserError
from gravcomp.view.obstacle_shapes import obstacle_shapes
from gravcomp.view.options import PageOptions
from gravcomp.view.page import Page
from gravcomp.view.snapshot import Snapshot, TargetView
from gravcomp.view.touches import HAND, Touch, model_touches
from gravcomp.virtual.motion import StaticMotion, base_orientation

ROBOT = Path("src/examples/lumen_robot.yaml")
"""The robot of the pictures, relative to the repository."""

_PORT, _RATE = 8990, 20.0
_DRAWN = 3.0  # s after which a browser has drawn what it has received
# It rises towards the tip and lifts it, also that of a straight robot.
_WALL = {"name": "unknown wall", "normal": [1, 0, -0.12], "point_mm": [-8, 0, 0]}


def draw_touches(root: Path, folder: Path) -> list[Path]:
    """Write the pictures into the folder and return them. Raises ConfigError without a browser."""
    file = load_robot_file(root / ROBOT)
    setup = Setup.of(file)
    loop = ClosedLoop(setup, StaticMotion(base_orientation(0.0)))
    length = setup.robot.length
    loop.hold(straight_target(length, tip_direction_weight=setup.direction_weight))
    shapes = obstacle_shapes(file.scene, length) + obstacle_shapes(file.zones, length, forbidden=True)
    page = Page(setup.robot, PageOptions(port=_PORT, rate=_RATE, graphics="full"), shapes)
    bystander = loop.virtual.bystander

    def run(seconds: float, hand: np.ndarray | None = None) -> None:
        for _ in range(round(seconds * _RATE)):
            if hand is not None:
                bystander.order_hand({"place_mm": (1e3 * hand).tolist()}, "virtual/hand", loop.time)
            loop.run(1.0 / _RATE)
            page.show(_snapshot(loop))

    pictures = []
    run(4.0)  # the browser takes a page that shows something
    try:
        with Browser() as browser:
            browser.open(f"{page.address}?fixedDpr=1")  # full resolution, even when drawing is slow

            def take(name: str) -> None:
                browser.page.wait_for_timeout(1e3 * _DRAWN)
                pictures.append(folder / f"{name}.png")
                browser.save(pictures[-1])
                output.note(f"{pictures[-1]}")

            run(2.0, np.array([0.012, 0.0, 0.95 * length]))
            take("pulled")
            bystander.order_hand("release", "virtual/hand", loop.time)
            bystander.order_wall(_WALL, "virtual/wall")
            run(3.0)
            take("unknown_wall")
    except BrowserError as error:
        raise ConfigError(f"--page: {error}") from error
    finally:
        page.close()
    return pictures


def _snapshot(loop: ClosedLoop) -> Snapshot:
    """Return the state of the loop as a graph would show it."""
    shape, truth, command = loop.shape, loop.truth, loop.command
    assert shape is not None  # the loop has started
    station = np.asarray(loop.setup.robot.effectors.backbone_station)
    touched = [Touch(name, place, force) for name, place, force in zip(
        truth.contact_obstacle, truth.contact_place, truth.contact_force)]  # fmt: skip
    if truth.hand_force.any():
        touched.append(Touch(HAND, truth.tip_position, truth.hand_force))
    walls, pressed = loop.setup.modelled_scene, shape.contacts.by_obstacle()
    forces = pressed.names, pressed.force, pressed.position, shape.backbone_position
    return Snapshot(
        time=loop.time,
        backbone=Backbone(shape.backbone_station, shape.backbone_position, shape.backbone_orientation),
        gravity=shape.gravity,
        tension=shape.cable_tension,
        displacement=shape.cable_displacement,
        model=shape.model,
        truth=Backbone(station, truth.backbone_position, truth.backbone_orientation),
        target=TargetView(np.array([0.0, 0.0, loop.setup.robot.length])),
        status=command.message if command is not None else "",
        status_level="ok" if command is not None and command.code == ControllerCode.OK else "warn",
        virtual=True,
        model_touches=model_touches(walls, shape.gravity, *forces) if walls else (),
        virtual_touches=tuple(touched),
        wall=truth.wall,
    )
