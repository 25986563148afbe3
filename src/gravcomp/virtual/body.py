"""Data of the rod from the true robot: its sections, masses, tendons and material.

Where a section is hindered from contracting across the axis, the rod is stiffer (`held_sections`).
"""

import math

import numpy as np

from gravcomp.cables.disks import disk_masses
from gravcomp.config import ConfigError
from gravcomp.description import PointLoad, Robot
from gravcomp.mesh.mesh import MeshError
from gravcomp.mesh.robot_axis import rest_axis
from gravcomp.rest_axis import RestAxis
from gravcomp.virtual.held_sections import stiffen_held_sections
from gravcomp.virtual.law_curve import curve_of_law, filaments
from gravcomp.virtual.material import RodMaterial
from gravcomp.virtual.rod import RodModel
from gravcomp.virtual.stretches import Stretch, stretch_at, stretches_of
from gravcomp.virtual.tendon_friction import TendonFriction
from gravcomp.virtual.true_robot import TrueRobot
from gravcomp.virtual.ways import element_marks, routing_of

_LARGEST_TURN = 0.15  # rad by which an element is bent at rest
_FIRST_BENDING = 3.516  # squared wave number of a cantilever times its length squared


def build_rod(true: TrueRobot) -> RodModel:
    """Return the rod model. Raises ConfigError for a body from a file that has no section somewhere, or cannot be read."""
    robot = true.robot
    try:
        axis, stretches = rest_axis(robot), stretches_of(robot)
    except MeshError as error:
        raise ConfigError(str(error)) from error
    loads = [(load, *_place(robot, axis, load)) for load in robot.loads]
    ends = _element_ends(true, axis, stretches, [s for _, s, _ in loads])
    length, middle = np.diff(ends), (ends[1:] + ends[:-1]) / 2
    n = len(length)
    filament, curve = np.empty((n, 9, 3)), np.empty((n, 3))
    stiffness, rest_strain = np.empty((n, 6, 6)), np.tile([0.0, 0.0, 1.0, 0.0, 0.0, 0.0], (n, 1))
    mass, moment, inertia = np.zeros(n + 1), np.zeros((n + 1, 3)), np.zeros((n + 1, 3, 3))
    for e, z in enumerate(middle):
        stretch = stretch_at(stretches, z)
        section, material = stretch.section(z), stretch.material
        stiffness[e] = section.stiffness(material)
        filament[e], curve[e] = filaments(stiffness[e][2:5, 2:5]), curve_of_law(material)
        rest_strain[e, 3:5] = _curvature(axis, z)
        half = material.density * section.area * length[e] / 2
        across = np.diag([1.0, 1.0, 0.0]) * half * length[e] ** 2 / 12
        for k in (e, e + 1):
            mass[k] += half
            moment[k, :2] += half * np.array(section.centroid)
            inertia[k] += section.inertia(material.density) * length[e] / 2 + across
    stiffen_held_sections(stretches, ends, stiffness)
    for s, one, about_diameter, about_axis in disk_masses(robot):
        k = _nearest(ends, s)
        mass[k] += one
        inertia[k] += np.diag([about_diameter, about_diameter, about_axis])
    carried = [(_nearest(ends, s), load.mass, offset) for load, s, offset in loads]
    carried.append((n, robot.payload.mass, np.array(robot.payload.centre)))
    for k, one, offset in carried:
        mass[k] += one
        moment[k] += one * offset
        inertia[k] += one * (offset @ offset * np.eye(3) - np.outer(offset, offset))
    centre = moment / np.maximum(mass, 1e-300)[:, None]
    lines = true.cables
    inside = np.array([robot.line_length(cable) - (cable.free_length or 0.0) for cable in robot.cables])
    spring = lines.axial_stiffness / (lines.free_length + inside)
    return RodModel(length, stiffness, filament, curve, rest_strain, mass, centre, inertia, routing_of(robot, ends), spring)


def build_material(model: RodModel, true: TrueRobot) -> RodMaterial:
    """Return damping, creep and slip of the material.

    A damping that is not given is the class's share of the critical one in the first bending motion, and the curvature at which
    the frictional branch slips that of the class's strain in the outer fibre.
    """
    stretches = stretches_of(true.robot)
    ends = model.station * true.robot.length
    middle = (ends[1:] + ends[:-1]) / 2
    found = [stretch_at(stretches, z) for z in middle]
    materials = [true.materials[stretch.index] for stretch in found]
    branches = max(len(material.creep_ratio) for material in materials)
    ratio, time = np.zeros((model.elements, branches)), np.ones((model.elements, branches))
    damping, slip, moment = (np.empty(model.elements) for _ in range(3))
    frequency = first_frequency(model)
    bending = 0.5 * (model.stiffness[:, 3, 3] + model.stiffness[:, 4, 4])
    for e, (stretch, material) in enumerate(zip(found, materials)):
        k = len(material.creep_ratio)
        ratio[e, :k], time[e, :k] = material.creep_ratio, material.creep_time
        own = 2.0 * material.damping_factor * material.kind.damping / frequency
        damping[e] = own if material.damping_time is None else material.damping_time
        section = stretch.section(middle[e])
        curvature = material.slip_curvature or material.slip_strain / max(section.half_width, section.half_height)
        slip[e] = material.slip_ratio * bending[e]
        moment[e] = slip[e] * curvature
    return RodMaterial(ratio, time, damping, slip, moment)


def build_friction(true: TrueRobot) -> TendonFriction:
    """Return the friction of the tendons."""
    return TendonFriction(true.cables.friction, true.cables.guide_angle, true.cables.presliding)


def first_frequency(model: RodModel) -> float:
    """Return the first angular frequency (rad/s) of a uniform cantilever that is as soft and heavy as the rod on average."""
    length = float(model.length.sum())
    compliance = float((model.length / np.minimum(model.stiffness[:, 3, 3], model.stiffness[:, 4, 4])).sum())
    # A mass at the tip counts four times as much as one that is spread over the length.
    mass = float((model.mass[:-1]).sum() + 4.0 * max(model.mass[-1] - model.mass[-2], 0.0) + model.mass[-2])
    return _FIRST_BENDING / math.sqrt(length * compliance * length * max(mass, 1e-9))


def _curvature(axis: RestAxis, s: float) -> tuple[float, float]:
    """Curvature at rest at the arc length s (m), about x and about y (rad/m)."""
    start = 0.0
    for arc in axis.arcs:
        start += arc.length
        if s < start or arc is axis.arcs[-1]:
            bend = arc.angle / arc.length
            return -bend * math.sin(arc.plane), bend * math.cos(arc.plane)
    return 0.0, 0.0


def _nearest(ends: np.ndarray, z: float) -> int:
    return int(np.argmin(np.abs(ends - z)))


def _element_ends(true: TrueRobot, axis: RestAxis, stretches: list[Stretch], more: list[float]) -> np.ndarray:
    """Return the arc lengths (n + 1,) of the element ends; every end of a stretch or cable, disk and load is one."""
    robot = true.robot
    close = 1e-5 * robot.length
    arcs = np.cumsum([arc.length for arc in axis.arcs]).tolist()
    marks = sorted({0.0, robot.length, *(stretch.start for stretch in stretches), *arcs[:-1], *element_marks(robot), *more})
    distinct = [a for a, b in zip(marks, [*marks[1:], math.inf]) if b - a > close]
    ends = []
    for a, b in zip(distinct, distinct[1:]):
        turn = math.hypot(*_curvature(axis, (a + b) / 2)) * (b - a)
        count = max(1, math.ceil((b - a) / true.element_length - 1e-6), math.ceil(turn / _LARGEST_TURN))
        ends.append(np.linspace(a, b, count, endpoint=False))
    return np.append(np.concatenate(ends), distinct[-1])


def _place(robot: Robot, axis: RestAxis, load: PointLoad) -> tuple[float, np.ndarray]:
    """Return the arc length (m) of the section that a load hangs from, and its place (3,) m in the section."""
    at = np.array(load.at)
    stations = np.linspace(0.0, robot.length, 2001)
    position, orientation = axis.frames(stations)
    ahead = np.abs(np.einsum("ni,ni->n", at - position, orientation[:, :, 2]))
    best = int(np.argmin(np.linalg.norm(at - position, axis=1) + 1e3 * ahead))
    offset = orientation[best].T @ (at - position[best])
    return float(stations[best]), np.array([offset[0], offset[1], 0.0])
