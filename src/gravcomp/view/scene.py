"""The 3D scene: body, cables, ghost, truth, target, gravity, mount, floor and lumen."""

import math

import numpy as np
import viser

from gravcomp.description import Robot
from gravcomp.view import colours
from gravcomp.view.backbone import Backbone, arc_backbone, straight_backbone
from gravcomp.view.options import LumenOptions, PageOptions
from gravcomp.view.skin import Skin, cable_skin, joined, line_skin, lumen_skin, revolved, wall_skins
from gravcomp.view.snapshot import Snapshot, TargetView
from gravcomp.view.world import BaseInWorld, quaternion_wxyz

# Robots are small: drawn ten times as large, so that cameras, shadows and handles made for metres suit them.
SCALE = 10.0
GRAVITY_LENGTH = 0.045  # m, of the arrow for 9.81 m/s^2
WORLD, BASE = "world: gravity points down", "robot base: gravity turns"


class Scene:
    """Draws snapshots of one robot. `gizmo` is the handle that drags the target's tip."""

    def __init__(self, server: viser.ViserServer, robot: Robot, options: PageOptions):
        dark = options.dark
        self._scene, self._robot = server.scene, robot
        self._reflections = 0.35 if dark else 0.5
        self._world = BaseInWorld()
        self.view = WORLD
        size = robot.length
        self._surroundings(server, size, dark)
        self._root = self._scene.add_frame("/robot", show_axes=False)
        self._add_mount()
        straight = straight_backbone(robot.length)
        self._add_body(straight)
        radius = 0.5 * max((s.outer_diameter for s in robot.segments), default=0.09 * size)
        self._add_truth(straight, radius)
        self._add_target(straight, radius)
        self._gravity = self._scene.add_arrows(
            "/robot/gravity", np.zeros((1, 2, 3)), colours.GRAVITY,
            shaft_radius=SCALE * 0.0009, head_radius=SCALE * 0.0026, head_length=SCALE * 0.007)  # fmt: skip
        if options.lumen.diameter > 0.0:
            self._add_lumen(options.lumen)

    def set_graphics(self, graphics: str) -> None:
        """'full': reflections and shadows; 'light': without, ten times faster where a processor draws in place of a graphics chip."""
        light = graphics == "light"
        self._scene.configure_environment_map(None if light else "studio", environment_intensity=self._reflections)
        self._key.cast_shadow = self._rim.visible = not light
        self._sky.visible = light
        for handle in self._inside:
            handle.visible = not light

    def show(self, snapshot: Snapshot) -> None:
        """Move everything to where it is now."""
        if snapshot.backbone is not None:
            vertices = SCALE * self._body_skin.on(snapshot.backbone)
            for handle, part in zip(self._body, self._body_parts):
                handle.vertices = vertices[part]
            for handle, tension in zip(self._cables, snapshot.tension):
                handle.color = colours.tension_colour(tension)
        self._show_gravity(snapshot)
        self._show_truth(snapshot.truth)
        self._show_target(snapshot)

    def set_visible(self, what: str, visible: bool) -> None:
        """Show or hide 'rest', 'truth' or 'target'."""
        self._hidden = (self._hidden - {what}) | (set() if visible else {what})
        for ghost in self._ghosts:
            ghost.visible = "rest" not in self._hidden

    # Parts.

    def _add_lumen(self, lumen: LumenOptions) -> None:
        """The wall of a channel that the robot reaches through, an arc that begins `start` m from the base's plane."""
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

    def _surroundings(self, server: viser.ViserServer, size: float, dark: bool) -> None:
        scene = self._scene
        scene.set_up_direction("+z")
        scene.world_axes.visible = False
        scene.configure_default_lights(enabled=False)
        self._key = scene.add_light_directional(
            "/lights/key", intensity=2.2, cast_shadow=True, position=(2.0, -3.0, 5.0), color=(255, 246, 235)
        )
        self._rim = scene.add_light_directional("/lights/rim", intensity=0.9, position=(-4.0, 3.0, 2.0), color=(200, 220, 255))
        # In place of the reflections where graphics are light.
        self._sky = scene.add_light_hemisphere(
            "/lights/sky", sky_color=(235, 240, 255), ground_color=(120, 116, 110), intensity=1.6
        )
        scene.set_background_image(_gradient(dark), format="png")
        cell, section = ((46, 54, 68), (64, 76, 96)) if dark else ((214, 220, 228), (190, 198, 210))
        scene.add_grid(
            "/floor", width=14.0, height=14.0, position=(0.0, 0.0, -SCALE * 1.25 * size), cell_size=0.25, section_size=1.0,
            cell_color=cell, section_color=section, fade_distance=11.0, fade_strength=2.0, shadow_opacity=0.22,
            cell_thickness=0.7)  # fmt: skip
        camera, reach = server.initial_camera, SCALE * size
        # Robot and mount fit into the space between the panels however the base is tilted.
        camera.position = (1.05 * reach, -4.3 * reach, 0.95 * reach)
        camera.look_at = (0.12 * reach, 0.0, -0.08 * reach)
        camera.fov = math.radians(30.0)

    def _mesh(self, name: str, skin: Skin, backbone: Backbone, colour: colours.Rgb, **options) -> viser.MeshHandle:
        return self._scene.add_mesh_simple(name, SCALE * skin.on(backbone), skin.faces, color=colour, side="front", **options)

    def _add_mount(self) -> None:
        """The frame that is held: flange, housing, one motor a cable around it, and the IMU's board."""
        size = 2.0 * max((s.outer_diameter for s in self._robot.segments), default=0.09 * self._robot.length)
        _Mount(self._scene, size, len(self._robot.cables))

    def _add_body(self, straight: Backbone) -> None:
        """Walls, lumen and cables, and the walls once more as they are at rest."""
        walls = wall_skins(self._robot)
        skins = list(walls)
        self._body = []
        for index, skin in enumerate(walls):
            colour = colours.PROXIMAL if index % 2 == 0 else colours.DISTAL
            # Seen through, so that the cables inside show their colours.
            self._body.append(self._mesh(f"/robot/wall{index}", skin, straight, colour, opacity=0.6))
        lumen = lumen_skin(self._robot)
        self._inside = []
        if lumen is not None:
            skins.append(lumen)
            self._inside = [self._mesh("/robot/lumen", lumen, straight, colours.LUMEN, opacity=0.35, cast_shadow=False)]
            self._body += self._inside
        self._cables = []
        for cable in self._robot.cables:
            skins.append(cable_skin(self._robot, cable))
            colour = colours.tension_colour(0.0)
            self._cables.append(self._mesh(f"/robot/cable_{cable.name}", skins[-1], straight, colour, cast_shadow=False))
        self._body += self._cables
        self._body_skin, self._body_parts = joined(skins)
        self._ghosts = [
            self._mesh(f"/robot/rest{i}", skin, straight, colours.GHOST, opacity=0.3, cast_shadow=False)
            for i, skin in enumerate(walls)
        ]

    def _add_truth(self, straight: Backbone, radius: float) -> None:
        self._truth_skin = line_skin(0.3 * radius)
        self._truth = self._mesh("/robot/truth", self._truth_skin, straight, colours.TRUTH, cast_shadow=False)
        self._truth_tip = self._scene.add_icosphere(
            "/robot/truth_tip", SCALE * 0.42 * radius, color=colours.TRUTH, cast_shadow=False
        )
        self._truth.visible = self._truth_tip.visible = False

    def _add_target(self, straight: Backbone, radius: float) -> None:
        self._hidden: set[str] = set()
        self._shown_target: TargetView | None = None
        self._target_skin = line_skin(0.07 * radius)
        self._target = self._mesh("/robot/target", self._target_skin, straight, colours.TARGET, cast_shadow=False)
        ring = 1.5 * radius
        angle = np.linspace(0.0, 2 * math.pi, 49)
        circle = ring * np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
        self._target_ring = self._scene.add_line_segments(
            "/robot/target_ring", SCALE * np.stack([circle[:-1], circle[1:]], axis=1), colours.TARGET, thickness=SCALE * 0.0006
        )
        self.gizmo = self._scene.add_transform_controls(
            "/robot/target_handle", scale=SCALE * 0.022, line_width=2.0, disable_rotations=True, disable_sliders=True,
            depth_test=False, opacity=0.85, position=SCALE * straight.tip, visible=False)  # fmt: skip

    def _show_gravity(self, snapshot: Snapshot) -> None:
        self._gravity.visible = snapshot.gravity is not None
        if snapshot.gravity is None:
            return
        middle = 0.5 * self._robot.length * np.array([0.0, 0.0, 1.0])
        if snapshot.backbone is not None:
            middle = snapshot.backbone.at(np.array([0.5]))[0][0]
        self._gravity.points = SCALE * np.array([[middle, middle + snapshot.gravity / 9.81 * GRAVITY_LENGTH]])
        rotation = self._world.follow(snapshot.gravity)
        self._root.wxyz = quaternion_wxyz(rotation) if self.view == WORLD else (0.5, 0.5, -0.5, 0.5)

    def _show_truth(self, truth: Backbone | None) -> None:
        visible = truth is not None and "truth" not in self._hidden
        self._truth.visible = self._truth_tip.visible = visible
        if visible:
            self._truth.vertices = SCALE * self._truth_skin.on(truth)
            self._truth_tip.position = SCALE * truth.tip

    def _show_target(self, snapshot: Snapshot) -> None:
        target = snapshot.target
        visible = target is not None and "target" not in self._hidden
        self._target_ring.visible = visible
        self._target.visible = visible and target.curve is not None
        if not visible or target is self._shown_target:
            return
        self._shown_target = target
        self._target_ring.position = SCALE * target.tip
        if target.curve is not None:
            self._target.vertices = SCALE * self._target_skin.on(target.curve)
            x, y, z, w = target.curve.orientation[-1]
            self._target_ring.wxyz = (w, x, y, z)


class _Mount:
    """Fixed parts behind the base, sized by `size` (m)."""

    def __init__(self, scene: viser.SceneApi, size: float, motors: int):
        unit = size / 0.018
        self._scene, self._unit = scene, unit
        self._turn(
            "flange", [(0, 0), (7, 0), (8, -1), (8, -6), (22, -8), (23, -9), (23, -12), (22, -13), (0, -13)], colours.METAL
        )
        self._turn("core", [(0, -13), (9, -13), (9, -42), (0, -42)], (58, 64, 74))
        self._turn("plate", [(0, -42), (22, -42), (23, -43), (23, -46), (22, -47), (0, -47)], colours.METAL)
        self._turn("handle", [(0, -47), (9, -47), (10.5, -49), (9.5, -62), (10.5, -80), (8, -84), (0, -84)], (52, 58, 68))
        for i in range(motors):
            angle = 2 * math.pi * i / motors
            self._turn(
                f"motor{i}", [(0, -14), (4.6, -14), (5, -14.6), (5, -41), (0, -41)], (176, 184, 196), 16.0, angle, around=20
            )
        scene.add_box(
            "/robot/mount/board", color=colours.BOARD, dimensions=tuple(SCALE * unit * 1e-3 * d for d in (14, 18, 1.6)),
            position=(0.0, -SCALE * unit * 0.012, -SCALE * unit * 0.0072), wxyz=(0.9659, 0.2588, 0.0, 0.0))  # fmt: skip

    def _turn(
        self, name: str, profile_mm: list, colour: colours.Rgb, away_mm: float = 0.0, angle: float = 0.0, around: int = 36
    ) -> None:
        """A turned part; its profile (radius, z) in mm runs from the front backward."""
        profile = 1e-3 * self._unit * np.array(profile_mm, float)[::-1]
        radii, heights = _sharp(profile)
        part = revolved(radii, heights, 1.0, around)
        vertices = np.column_stack([part.offset, part.station])
        away = SCALE * 1e-3 * self._unit * away_mm
        position = (away * math.cos(angle), away * math.sin(angle), 0.0)
        self._scene.add_mesh_simple(
            f"/robot/mount/{name}", SCALE * vertices, part.faces, color=colour, position=position, side="front"
        )


def _sharp(profile: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Points near each corner added, so that smooth shading keeps the edges."""
    points = [profile[0]]
    for a, b in zip(profile, profile[1:]):
        points += [a + 0.04 * (b - a), a + 0.96 * (b - a), b]
    points = np.array(points)
    return points[:, 0], points[:, 1]


def _gradient(dark: bool) -> np.ndarray:
    top, bottom = (
        (np.array([34, 40, 52]), np.array([14, 17, 23])) if dark else (np.array([252, 253, 255]), np.array([222, 229, 238]))
    )
    ramp = np.linspace(0.0, 1.0, 256)[:, None]
    column = top + (bottom - top) * ramp
    return np.repeat(column[:, None, :], 8, axis=1).astype(np.uint8)
