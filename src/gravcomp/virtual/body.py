"""Data of the rod from the description of the robot and the parameters of the virtual robot.

Stiffness of a tube: E A, E I, G J with J = 2 I, and the shear stiffness k G A with Cowper's coefficient for hollow circles
(G. R. Cowper, "The shear coefficient in Timoshenko's beam theory", J. Appl. Mech. 33, 1966):

    k = 6 (1 + nu) (1 + m^2)^2 / ((7 + 6 nu) (1 + m^2)^2 + (20 + 12 nu) m^2),   m = inner / outer radius

A clamped face cannot contract across the axis, which stiffens the tube next to it. Compared with three-dimensional finite
elements (CalculiX) this has the effect of a clamp that lies 0.39 nu^2 R_o farther along the axis.
"""

import math

import numpy as np

from gravcomp.config import ConfigError
from gravcomp.description import Cable, Robot
from gravcomp.virtual.lines import true_lines
from gravcomp.virtual.material import RodMaterial
from gravcomp.virtual.parameters import VirtualRobotParameters
from gravcomp.virtual.rod import RodModel
from gravcomp.virtual.tendon_friction import TendonFriction

_CLAMP_COEFFICIENT = 0.39


def build_rod(robot: Robot, parameters: VirtualRobotParameters) -> RodModel:
    """Return the rod model. Raises ConfigError for a body from a file and for cables through via points."""
    if robot.body is not None:
        raise ConfigError(f"robot '{robot.name}' has a body from a file; the virtual robot needs segments")
    for segment in robot.segments:
        if not segment.plain:
            raise ConfigError(
                f"segment '{segment.name}': the virtual robot needs round segments, straight at rest, of constant section,"
                " without lumens off the axis and without disks"
            )
    for cable in robot.cables:
        if cable.via_points is not None or cable.tip_radius is not None:
            raise ConfigError(
                f"cable '{cable.name}' runs through via_points_mm or has tip_radius_mm;"
                " the virtual robot needs angle_deg and radius_mm"
            )
    ends = _element_ends(robot, parameters.body.element_length)
    length = np.diff(ends)
    n = len(length)
    stiffness, line_density, line_inertia = np.empty((n, 6)), np.empty(n), np.empty((n, 3))
    for e, middle in enumerate((ends[1:] + ends[:-1]) / 2):
        stiffness[e], line_density[e], line_inertia[e] = _section(robot, parameters, middle)
    outer = robot.segments[0].outer_diameter / 2
    clamp = _CLAMP_COEFFICIENT * parameters.body.poissons_ratio**2 * outer
    stiffness[0, 3:5] *= length[0] / max(length[0] - clamp, 0.2 * length[0])

    mass, inertia = np.zeros(n + 1), np.zeros((n + 1, 3))
    for side in (slice(0, n), slice(1, n + 1)):
        mass[side] += line_density * length / 2
        inertia[side] += line_inertia * length[:, None] / 2
        inertia[side, :2] += (line_density * length**3 / 24)[:, None]
    mass[-1] += robot.payload.mass
    offset, start, end, spring = _tendons(robot, parameters, ends)
    return RodModel(length, stiffness, mass, inertia, offset, start, end, spring)


def build_material(model: RodModel, parameters: VirtualRobotParameters) -> RodMaterial:
    """Return damping, creep and slip of the material."""
    body = parameters.body
    slip = body.slip_ratio * model.stiffness[:, 3]
    return RodMaterial(np.array(body.creep_ratio), np.array(body.creep_time), body.damping_time, slip, slip * body.slip_curvature)


def build_friction(robot: Robot, parameters: VirtualRobotParameters) -> TendonFriction:
    """Return the friction of the tendons."""
    lines = true_lines(robot, parameters.tendons)
    return TendonFriction(lines.friction, lines.guide_angle, parameters.tendons.presliding)


def _element_ends(robot: Robot, longest: float) -> np.ndarray:
    """Return the positions (n + 1,) of the element ends along the axis; every end of a segment, cap or cable is one."""
    marks = {0.0}
    for segment in robot.segments:
        marks |= {max(marks) + segment.length, max(marks) + segment.full_length}
    for cable in robot.cables:
        marks |= {cable.start, robot.cable_end(cable)}
    rounded = sorted(round(mark, 9) for mark in marks)
    distinct = [a for a, b in zip(rounded, [*rounded[1:], math.inf]) if b - a > 1e-6]
    ends = [
        np.linspace(a, b, max(1, math.ceil((b - a) / longest - 1e-9)), endpoint=False) for a, b in zip(distinct, distinct[1:])
    ]
    return np.append(np.concatenate(ends), distinct[-1])


def _section(robot: Robot, parameters: VirtualRobotParameters, z: float) -> tuple[list[float], float, list[float]]:
    """Return stiffness (6,), mass and rotational inertia (3,) per metre of the cross-section at z m."""
    start = 0.0
    for segment in robot.segments:
        if z < start + segment.full_length:
            break
        start += segment.full_length
    body = parameters.body
    modulus, nu, density, inner = body.youngs_modulus, body.poissons_ratio, body.density, segment.lumen_diameter / 2
    if segment.cap and z > start + segment.length:
        cap = segment.cap.material
        modulus, nu, density, inner = cap.youngs_modulus, cap.poissons_ratio, cap.density, 0.0
    outer = segment.outer_diameter / 2
    area, second = math.pi * (outer**2 - inner**2), math.pi / 4 * (outer**4 - inner**4)
    m2 = (inner / outer) ** 2
    cowper = 6 * (1 + nu) * (1 + m2) ** 2 / ((7 + 6 * nu) * (1 + m2) ** 2 + (20 + 12 * nu) * m2)
    shear = modulus / (2 * (1 + nu))
    stiffness = [cowper * shear * area] * 2 + [modulus * area] + [modulus * second] * 2 + [2 * shear * second]
    return stiffness, density * area, [density * second, density * second, 2 * density * second]


def _tendons(robot: Robot, parameters: VirtualRobotParameters, ends: np.ndarray) -> tuple[np.ndarray, ...]:
    """Return offset (m, 3) m, first element (m,), the element after the last (m,) and stiffness (m,) N/m of each tendon."""

    def element_at(z: float) -> int:
        return int(np.argmin(np.abs(ends - z)))

    def offset(cable: Cable) -> list[float]:
        assert cable.radius is not None and cable.angle is not None  # `build_rod` refused via points
        radius, angle = cable.radius + tendons.radius_offset, cable.angle + tendons.angle_offset
        return [radius * math.cos(angle), radius * math.sin(angle), 0.0]

    tendons = parameters.tendons
    start = np.array([element_at(cable.start) for cable in robot.cables], dtype=np.int64)
    end = np.array([element_at(robot.cable_end(cable)) for cable in robot.cables], dtype=np.int64)
    inside = np.array([robot.cable_end(cable) - cable.start for cable in robot.cables])
    offsets = np.array([offset(cable) for cable in robot.cables]).reshape(-1, 3)
    lines = true_lines(robot, tendons)
    return offsets, start, end, lines.stiffness / (lines.free_length + inside)
