"""A picture of a robot as it is described: its body at rest, and its sections at base and tip of every segment."""

import io
from typing import Any

import numpy as np

from gravcomp.description import BlendedOutline, Outline, Robot
from gravcomp.view.backbone import rest_backbone
from gravcomp.view.skin import Skin, cable_line, cable_skin
from gravcomp.view.wall import lumen_skin, wall_skins

_DPI = 110
_BODY, _NEXT, _LUMEN, _CABLE = "#c9b79a", "#a9bcc9", "#5b6570", "#d55e00"
_MOST_SECTIONS = 4
_YAW, _PITCH = 28.0, 16.0  # deg: how far the tip is turned towards the viewer, and the view from above
_LIGHT = (-0.4, 0.8, 0.6)


def draw_body(robot: Robot, path: str) -> None:
    """Write the picture to `path` (.png, .svg or .pdf). It needs matplotlib, the packages of the reports."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib.figure import Figure

    sections = _sections(robot)
    figure = Figure(figsize=(6.4, 2.2))
    _draw_surface(figure.add_axes((0.01, 0.09, 0.66 if sections else 0.98, 0.9)), robot)
    figure.text(0.02, 0.03, f"{robot.name}, {robot.length * 1e3:g} mm", fontsize=8, color="#37404a")
    widest = max((max(o.half_width, o.half_height) for o, _, _ in sections), default=1.0)
    for number, (outline, lumens, s) in enumerate(sections):
        low = 0.25 if len(sections) <= 2 else 0.47 - 0.47 * (number // 2)
        place = figure.add_axes((0.69 + 0.155 * (number % 2), low, 0.15, 0.48))
        _draw_section(place, robot, outline, lumens, s, widest)
    if path.endswith(".png"):
        _save_small(figure, path)
    else:
        figure.savefig(path, facecolor="white")


def _save_small(figure: Any, path: str) -> None:
    """Write a PNG of few colours, drawn larger and reduced, so that no seams between the faces are seen."""
    from PIL import Image

    large = io.BytesIO()
    figure.savefig(large, format="png", dpi=3 * _DPI, facecolor="white")
    picture = Image.open(large).convert("RGB").reduce(3)
    picture.quantize(colors=96, dither=Image.Dither.NONE).save(path, optimize=True)


def _draw_surface(axes: Any, robot: Robot) -> None:
    """Draw the body at rest from the side, a little from above and from its tip: back walls, lumens and cables, front walls."""
    backbone, view = rest_backbone(robot), _view()
    walls = [(skin, _BODY if index % 2 == 0 else _NEXT) for index, skin in enumerate(wall_skins(robot))]
    lumens = lumen_skin(robot)
    drawn: list[tuple[Skin, str, float, int]] = [(skin, colour, 1.0, -1) for skin, colour in walls]
    if lumens is not None:  # they face inward: the half behind the channel
        drawn.append((lumens, _LUMEN, 0.8, 1))
    drawn += [(cable_skin(robot, cable), _CABLE, 1.0, 1) for cable in robot.cables]
    drawn += [(skin, colour, 0.5, 1) for skin, colour in walls]
    points = []
    for order, (skin, colour, alpha, side) in enumerate(drawn):
        points.append(_add_faces(axes, 1e3 * skin.on(backbone) @ view.T, skin.faces, colour, alpha, side, order))
    low, high = np.concatenate(points).min(axis=0), np.concatenate(points).max(axis=0)
    room = 0.03 * (high - low).max()
    axes.set(xlim=(low[0] - room, high[0] + room), ylim=(low[1] - room, high[1] + room), aspect="equal")
    axes.set_axis_off()


def _view() -> np.ndarray:
    """Rows: what lies to the right, up and towards the viewer, in soft_base."""
    yaw, pitch = np.radians([_YAW, _PITCH])
    right, up, near = np.array([0.0, 0.0, 1.0]), np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0])
    right, near = np.cos(yaw) * right - np.sin(yaw) * near, np.sin(yaw) * right + np.cos(yaw) * near
    up, near = np.cos(pitch) * up - np.sin(pitch) * near, np.sin(pitch) * up + np.cos(pitch) * near
    return np.array([right, up, near])


def _add_faces(
    axes: Any, vertices: np.ndarray, faces: np.ndarray, colour: str, alpha: float, side: int, order: int
) -> np.ndarray:
    """Add the faces (f, 3) that face the viewer (side 1) or away (-1), the nearest last. Returns their places (v, 2)."""
    from matplotlib.collections import PolyCollection
    from matplotlib.colors import to_rgb

    triangles = vertices[faces]
    normal = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    size = np.linalg.norm(normal, axis=1)
    shown = (size > 0.0) & (side * normal[:, 2] > 0.0)
    triangles, normal = triangles[shown], normal[shown] / size[shown, None]
    nearest = np.argsort(triangles[:, :, 2].mean(axis=1))
    triangles, normal = triangles[nearest], normal[nearest]
    light = np.array(_LIGHT) / np.linalg.norm(_LIGHT)
    shade = 0.62 + 0.38 * np.clip(side * normal @ light, -0.3, 1.0)
    colours = np.column_stack([np.clip(shade[:, None] * to_rgb(colour), 0.0, 1.0), np.full(len(shade), alpha)])
    axes.add_collection(PolyCollection(
        triangles[:, :, :2], facecolors=colours, edgecolors=colours if alpha == 1.0 else "none", linewidths=0.3,
        antialiaseds=alpha == 1.0, zorder=order,
    ))  # fmt: skip
    return triangles[:, :, :2].reshape(-1, 2)


def _sections(robot: Robot) -> list[tuple[Outline | BlendedOutline, tuple[Outline, ...], float]]:
    """Outline, lumens and arc length (m) at the ends of the segments, without those that are like the one before."""
    found: list[tuple[Outline | BlendedOutline, tuple[Outline, ...], float]] = []
    for piece in robot.pieces:
        for s in (piece.start, piece.start + piece.length):
            outline, lumens = piece.visible.section(s)
            if not found or (outline, lumens) != found[-1][:2]:
                found.append((outline, lumens, s))
    if len(found) > _MOST_SECTIONS:
        found = [found[round(k * (len(found) - 1) / (_MOST_SECTIONS - 1))] for k in range(_MOST_SECTIONS)]
    return found


def _draw_section(
    axes: Any, robot: Robot, outline: Outline | BlendedOutline, lumens: tuple[Outline, ...], s: float, widest: float
) -> None:
    angle = np.linspace(0.0, 2 * np.pi, 181)
    disk = max((segment.disks.outer_diameter / 2 for segment in robot.segments if segment.disks), default=0.0)
    if disk:
        axes.plot(*(1e3 * Outline.circle(2 * disk).boundary(angle).T), color=_LUMEN, linewidth=0.8)
    axes.fill(*(1e3 * outline.boundary(angle).T), facecolor=_BODY, edgecolor="#37404a", linewidth=0.8)
    for lumen in lumens:
        axes.fill(*(1e3 * lumen.boundary(angle).T), facecolor="white", edgecolor="#37404a", linewidth=0.8)
    for cable in robot.cables:
        low, high = cable_line(robot, cable).station[[0, -1]] * robot.length
        if low - 1e-9 <= s <= high + 1e-9:
            axes.plot(*(1e3 * np.array(robot.cable_place(cable, s))), "o", color=_CABLE, markersize=3.0)
    reach = 1.08e3 * max(widest, disk)
    axes.set(xlim=(-reach, reach), ylim=(-reach, reach), aspect="equal")
    axes.set_axis_off()
    axes.set_title(f"{s * 1e3:.4g} mm", fontsize=7, color="#37404a", y=0.93)
