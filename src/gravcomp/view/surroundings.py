"""Lights, background, floor and camera of the scene."""

import math

import numpy as np
import viser

from gravcomp.view.scale import SCALE


class Surroundings:
    """Adds the surroundings to a scene; size: m, length of the robot. Attributes key, rim, sky: the lights."""

    def __init__(self, server: viser.ViserServer, size: float, dark: bool) -> None:
        self._scene = scene = server.scene
        self._reflections = 0.35 if dark else 0.5
        scene.set_up_direction("+z")
        scene.world_axes.visible = False
        scene.configure_default_lights(enabled=False)
        self.key = scene.add_light_directional(
            "/lights/key", intensity=2.2, cast_shadow=True, position=(2.0, -3.0, 5.0), color=(255, 246, 235)
        )
        self.rim = scene.add_light_directional("/lights/rim", intensity=0.9, position=(-4.0, 3.0, 2.0), color=(200, 220, 255))
        # Replaces the reflections in light graphics.
        self.sky = scene.add_light_hemisphere(
            "/lights/sky", sky_color=(235, 240, 255), ground_color=(120, 116, 110), intensity=1.6
        )
        scene.set_background_image(_gradient(dark), format="png")
        cell, section = ((46, 54, 68), (64, 76, 96)) if dark else ((214, 220, 228), (190, 198, 210))
        scene.add_grid(
            "/floor", width=14.0, height=14.0, position=(0.0, 0.0, -SCALE * 1.25 * size), cell_size=0.25, section_size=1.0,
            cell_color=cell, section_color=section, fade_distance=11.0, fade_strength=2.0, shadow_opacity=0.22,
            cell_thickness=0.7)  # fmt: skip
        camera, reach = server.initial_camera, SCALE * size
        # Robot and mount fit between the panels for every tilt of the base.
        camera.position = (1.05 * reach, -4.3 * reach, 0.95 * reach)
        camera.look_at = (0.12 * reach, 0.0, -0.08 * reach)
        camera.fov = math.radians(30.0)

    def set_light(self, light: bool) -> None:
        """Draw without reflections and shadows, or with them."""
        self._scene.configure_environment_map(None if light else "studio", environment_intensity=self._reflections)
        self.key.cast_shadow = self.rim.visible = not light
        self.sky.visible = light


def _gradient(dark: bool) -> np.ndarray:
    top, bottom = (
        (np.array([34, 40, 52]), np.array([14, 17, 23])) if dark else (np.array([252, 253, 255]), np.array([222, 229, 238]))
    )
    ramp = np.linspace(0.0, 1.0, 256)[:, None]
    column = top + (bottom - top) * ramp
    return np.repeat(column[:, None, :], 8, axis=1).astype(np.uint8)
