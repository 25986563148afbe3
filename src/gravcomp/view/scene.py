"""The 3D scene: body with cables and rest shape, gravity, markers, obstacles, forces, handles, mount and surroundings."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
import viser

from gravcomp.description import Robot
from gravcomp.view import colours
from gravcomp.view.backbone import Backbone, arc_backbone, rest_backbone
from gravcomp.view.drawn_skin import add_skin
from gravcomp.view.forces import Forces
from gravcomp.view.in_base import BaseFrame
from gravcomp.view.markers import TargetMarker, TruthMarker
from gravcomp.view.mount import Mount
from gravcomp.view.obstacles import Obstacles
from gravcomp.view.options import LumenOptions, PageOptions
from gravcomp.view.placed_wall import WallHandle
from gravcomp.view.scale import SCALE, scaled
from gravcomp.view.skin import cable_skin, half_width, joined, revolved
from gravcomp.view.snapshot import Snapshot
from gravcomp.view.surroundings import Surroundings
from gravcomp.view.tip_handle import TipHandle
from gravcomp.view.touches import HAND
from gravcomp.view.wall import lumen_skin, wall_skins
from gravcomp.view.world import BaseInWorld, quaternion_wxyz

if TYPE_CHECKING:
    from gravcomp.view.obstacle_shapes import ObstacleShape

GRAVITY_LENGTH = 0.45  # of the arrow for 9.81 m/s^2, over the robot's length
WORLD, BASE = "world: gravity points down", "robot base: gravity turns"
_BASE_WXYZ = (0.5, 0.5, -0.5, 0.5)  # z of the base along x of the scene


class Scene:
    """Draws snapshots of one robot.

    Attributes: body (the meshes that follow the backbone), target, surroundings, hand and wall (what the user does to a virtual
    robot).
    """

    def __init__(
        self, server: viser.ViserServer, robot: Robot, options: PageOptions, shapes: "Sequence[ObstacleShape]" = ()
    ) -> None:
        """shapes: of the obstacles around the robot."""
        self._scene, self._robot = server.scene, robot
        self._world = BaseInWorld()
        self._view = WORLD
        self._hidden: set[str] = set()
        self.surroundings = Surroundings(server, robot.length, options.dark)
        self._root = self._scene.add_frame("/robot", show_axes=False)
        diameter = 2 * half_width(robot)
        Mount(self._scene, 2.0 * diameter, len(robot.cables))
        rest = rest_backbone(robot)
        self._add_body(rest)
        self._truth = TruthMarker(self._scene, rest, 0.5 * diameter)
        self.target = TargetMarker(self._scene, rest, 0.5 * diameter)
        unit = SCALE * robot.length
        self._gravity = self._scene.add_arrows(
            "/robot/gravity", np.zeros((1, 2, 3)), colours.GRAVITY,
            shaft_radius=unit * 0.009, head_radius=unit * 0.026, head_length=unit * 0.07)  # fmt: skip
        self._obstacles = Obstacles(self._scene, shapes)
        self._forces = Forces(self._scene, robot.length, 0.5 * diameter, robot.limits.tension_max)
        frame = BaseFrame(self._root)
        self.hand = TipHandle(self._scene, frame, 0.5 * diameter)
        self.wall = WallHandle(self._scene, frame, robot.length, 0.5 * diameter)
        if options.lumen.diameter > 0.0:
            self._add_lumen(options.lumen)

    def set_graphics(self, graphics: str) -> None:
        """'full': with reflections and shadows; 'light': without them, ten times faster on a machine without a graphics chip."""
        light = graphics == "light"
        self.surroundings.set_light(light)
        for handle in self._inside:
            handle.visible = not light

    def set_view(self, view: str) -> None:
        """WORLD: the base tilts and gravity points down; BASE: the base is fixed and gravity turns."""
        self._view = view

    def set_visible(self, what: str, visible: bool) -> None:
        """Show or hide 'rest', 'truth', 'target', 'obstacles' or 'forces'."""
        self._hidden = (self._hidden - {what}) | (set() if visible else {what})
        self._obstacles.set_visible("obstacles" not in self._hidden)
        for ghost in self._ghosts:
            ghost.visible = "rest" not in self._hidden

    def show(self, snapshot: Snapshot, live: bool = True) -> None:
        """Draw a snapshot; live: it is the present state, in which the user can touch a virtual robot."""
        if snapshot.backbone is not None:
            vertices = scaled(self._body_skin.on(snapshot.backbone))
            for handle, part in zip(self.body, self._body_parts):
                handle.vertices = vertices[part]
        if snapshot.tension is not None:
            for handle, tension in zip(self._cables, snapshot.tension):
                handle.color = colours.tension_colour(tension, colours.tension_scale(self._robot))
        self._show_gravity(snapshot)
        self._truth.show(None if "truth" in self._hidden else snapshot.truth)
        self.target.show(None if "target" in self._hidden else snapshot.target)
        self._show_forces(snapshot)
        self.wall.show(snapshot, live)
        self.hand.show(snapshot.truth.tip if live and snapshot.virtual and snapshot.truth is not None else None)

    def _show_forces(self, snapshot: Snapshot) -> None:
        load = () if snapshot.load is None else (snapshot.load,)
        pushes = [touch for touch in snapshot.virtual_touches if touch.source != HAND]
        pulls = [touch for touch in snapshot.virtual_touches if touch.source == HAND]
        shown = {"model": snapshot.model_touches, "virtual": pushes, "hand": pulls, "load": load}
        self._forces.show(snapshot.time, {} if "forces" in self._hidden else shown)

    def _show_gravity(self, snapshot: Snapshot) -> None:
        self._gravity.visible = snapshot.gravity is not None
        if snapshot.gravity is None:
            return
        middle = 0.5 * self._robot.length * np.array([0.0, 0.0, 1.0])
        if snapshot.backbone is not None:
            middle = snapshot.backbone.at(np.array([0.5]))[0][0]
        arrow = self._robot.length * GRAVITY_LENGTH / 9.81 * snapshot.gravity
        self._gravity.points = scaled(np.array([[middle, middle + arrow]]))
        if self._obstacles.in_world:
            from gravcomp.scene.world_axes import world_rotation  # imports Numba

            self._obstacles.turn(quaternion_wxyz(world_rotation(snapshot.gravity).T))
        rotation = self._world.follow(snapshot.gravity)
        self._root.wxyz = quaternion_wxyz(rotation) if self._view == WORLD else _BASE_WXYZ

    def _add_body(self, rest: Backbone) -> None:
        """Add walls, lumens and cables, and the walls at rest."""
        scene, walls = self._scene, wall_skins(self._robot)
        skins = list(walls)
        self.body: list[viser.MeshHandle] = []
        for index, skin in enumerate(walls):
            colour = colours.PROXIMAL if index % 2 == 0 else colours.DISTAL
            # Translucent, so that the colours of the cables inside are visible.
            self.body.append(add_skin(scene, f"/robot/wall{index}", skin, rest, colour, opacity=0.6))
        lumen = lumen_skin(self._robot)
        self._inside: list[viser.MeshHandle] = []
        if lumen is not None:
            skins.append(lumen)
            self._inside = [add_skin(scene, "/robot/lumen", lumen, rest, colours.LUMEN, opacity=0.35, cast_shadow=False)]
            self.body += self._inside
        self._cables: list[viser.MeshHandle] = []
        for cable in self._robot.cables:
            skins.append(cable_skin(self._robot, cable))
            colour = colours.tension_colour(0.0, colours.tension_scale(self._robot))
            self._cables.append(add_skin(scene, f"/robot/cable_{cable.name}", skins[-1], rest, colour, cast_shadow=False))
        self.body += self._cables
        self._body_skin, self._body_parts = joined(skins)
        self._ghosts = [
            add_skin(scene, f"/robot/rest{i}", skin, rest, colours.GHOST, opacity=0.3, cast_shadow=False)
            for i, skin in enumerate(walls)
        ]

    def _add_lumen(self, lumen: LumenOptions) -> None:
        """Add the wall of a channel around the robot: an arc that begins at z = `start` (m) of the base."""
        arc = arc_backbone(lumen.length, lumen.bend, lumen.plane)
        wall = revolved(np.full(40, lumen.diameter / 2), np.linspace(0.0, 1.0, 40), 1.0, around=48)
        vertices = wall.on(Backbone(arc.station, arc.position + np.array([0.0, 0.0, lumen.start]), arc.orientation))
        self._scene.add_mesh_simple(
            "/robot/lumen_wall",
            SCALE * vertices,
            wall.faces,
            color=(226, 120, 120),
            opacity=0.16,
            side="double",
            cast_shadow=False,
        )
