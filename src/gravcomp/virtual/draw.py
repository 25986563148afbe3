"""The true values of the virtual robot: those given in `virtual_robot`, the others drawn around the description by a seed.

| what | drawn |
|---|---|
| Young's modulus of each segment | described +- 8 % |
| density | described +- 2 % |
| pitch radius, angle of each cable | described +- 1 %, +- 1 deg, as far as the cable stays inside the body |
| stiffness of each line | described +- 10 %; without one, 0.1 to 0.3 % of stretch at the largest tension |
| free length | described, exactly; without one, twice the robot's length +- 10 % |
| friction of the lines | described +- 20 %; without one, 0.05 to 0.11; sheath angle described, else 15 to 25 deg |
| creep, damping, inner friction | that of the material's class, or the described creep, +- 30 % |
| torque constant, capstan radius of each motor | described +- 4 %, +- 0.3 % |
| backlash, friction of the gears | described +- a third, 6 to 10 % of the load |
| surroundings | 18 to 26 degC |

All distributions are uniform. Every number is drawn whether it is used or not, so that giving one value changes no other.
"""

import contextlib
import dataclasses
import math
from collections.abc import Callable

import numpy as np

from gravcomp.config import ConfigError
from gravcomp.description import Cable, Material, Robot
from gravcomp.description.cable_line import ASSUMED_FREE_LENGTH, ASSUMED_STRETCH
from gravcomp.description.hardware import Hardware
from gravcomp.materials.material_classes import class_of
from gravcomp.thermal.plant import ThermalPlantOptions
from gravcomp.virtual.parameters import Board, Body, Tendons, VirtualRobotParameters
from gravcomp.virtual.true_robot import TrueCables, TrueMaterial, TrueMotors, TrueRobot

_MODULUS_SPREAD, _DENSITY_SPREAD = 0.08, 0.02
_RADIUS_SPREAD, _ANGLE_SPREAD = 0.01, math.radians(1.0)
_LINE_SPREAD, _LINE_STRETCH = 0.1, (0.5 * ASSUMED_STRETCH, 1.5 * ASSUMED_STRETCH)
_FREE_SPREAD = 0.1
_FRICTION_SPREAD, _FRICTION, _GUIDE_ANGLE = 0.2, (0.05, 0.11), (math.radians(15.0), math.radians(25.0))
_PRESLIDING = 5e-4  # of the robot's length
_MATERIAL_SPREAD = 0.3
_TORQUE_SPREAD, _CAPSTAN_SPREAD = 0.04, 0.003
_BACKLASH_SPREAD, _LOAD_FRICTION = 1.0 / 3.0, (0.06, 0.10)
_AMBIENT = (18.0, 26.0)
_ELEMENTS = 20


def draw(
    given: VirtualRobotParameters, robot: Robot, hardware: Hardware, seed: int | None = None, section: str = "virtual_robot"
) -> TrueRobot:
    """Return what the virtual robot truly is; `seed` replaces the one of the section; section: file and key, for errors.

    Raises ConfigError for a section that describes no robot: values for other segments than the robot has, cables outside its
    body, a material with no stiffness left.
    """
    seed = given.seed if seed is None else seed
    # The first four streams are those of the run, see `VirtualRobot`; the first of them is the slack at the start.
    streams = np.random.SeedSequence(seed).spawn(5)
    slack = np.random.default_rng(streams[0]).standard_normal(len(robot.cables))
    body, cables, lines, motors, board = (np.random.default_rng(stream) for stream in streams[4].spawn(5))
    drawn: dict[str, str] = {}
    true = _with_true_body(robot, given.body, body, drawn, section)
    materials = _materials(robot, given.body, body)
    true = _with_true_cables(true, given, cables, drawn, section)
    return TrueRobot(
        robot=true,
        materials=materials,
        cables=_lines(robot, given, lines, slack, drawn),
        motors=_motors(given, hardware, motors, drawn),
        board=_board(given, board, drawn),
        element_length=given.body.element_length or robot.length / _ELEMENTS,
        seed=seed,
        drawn=drawn,
    )


def _with_true_body(robot: Robot, body: Body, random: np.random.Generator, drawn: dict[str, str], section: str) -> Robot:
    described = robot.materials
    count = len(described)
    ratio = 1.0 + random.uniform(-_MODULUS_SPREAD, _MODULUS_SPREAD, count)
    density = 1.0 + random.uniform(-_DENSITY_SPREAD, _DENSITY_SPREAD)
    if body.modulus_ratio is not None:
        if len(body.modulus_ratio) not in (1, count):
            raise ConfigError(
                f"{section}.body.modulus_ratio has {len(body.modulus_ratio)} entries; robot '{robot.name}' has {count}"
                f" segment{'s' if count > 1 else ''}: give one for all or one for each"
            )
        ratio = np.resize(np.array(body.modulus_ratio), count)
    elif body.youngs_modulus is None:
        drawn["modulus"] = ", ".join(f"{100 * (value - 1):+.1f} %" for value in ratio)
    if body.density is None:
        drawn["density"] = f"{100 * (density - 1):+.1f} %"

    def true(material: Material, factor: float) -> Material:
        return dataclasses.replace(
            material,
            youngs_modulus=factor * material.youngs_modulus if body.youngs_modulus is None else body.youngs_modulus,
            poissons_ratio=material.poissons_ratio if body.poissons_ratio is None else body.poissons_ratio,
            density=density * material.density if body.density is None else body.density,
        )

    return robot.with_materials([true(material, factor) for material, factor in zip(described, ratio)])


def _materials(robot: Robot, body: Body, random: np.random.Generator) -> tuple[TrueMaterial, ...]:
    """Behaviour over time of each segment's material."""
    found = []
    for described in robot.materials:
        kind = class_of(described.youngs_modulus)
        creep, damping, slip, strain = 1.0 + random.uniform(-_MATERIAL_SPREAD, _MATERIAL_SPREAD, 4)
        ratio, time = kind.creep_ratio, kind.creep_time
        if described.branches:
            ratio, time = zip(*described.branches)
        found.append(
            TrueMaterial(
                kind,
                creep_ratio=tuple(creep * value for value in ratio) if body.creep_ratio is None else body.creep_ratio,
                creep_time=time if body.creep_time is None else body.creep_time,
                damping_time=body.damping_time,
                damping_factor=float(damping),
                slip_ratio=float(slip * kind.slip) if body.slip_ratio is None else body.slip_ratio,
                slip_curvature=body.slip_curvature,
                slip_strain=float(strain * kind.slip_strain),
            )
        )
    return tuple(found)


def _with_true_cables(
    robot: Robot, given: VirtualRobotParameters, random: np.random.Generator, drawn: dict[str, str], section: str
) -> Robot:
    tendons, count = given.tendons, len(robot.cables)
    radius, angle = random.uniform(-1.0, 1.0, (2, count))
    if tendons.radius_offset is None and count:
        drawn["cable radii"] = f"+-{100 * _RADIUS_SPREAD:g} %"
    if tendons.angle_offset is None and count:
        drawn["cable angles"] = f"+-{math.degrees(_ANGLE_SPREAD):g} deg"
    turns = _ANGLE_SPREAD * angle if tendons.angle_offset is None else np.full(count, tendons.angle_offset)
    relative = tendons.radius_offset is None
    offsets = _RADIUS_SPREAD * radius if tendons.radius_offset is None else np.full(count, tendons.radius_offset)
    moved = [_moved(*values, relative) for values in zip(robot.cables, offsets.tolist(), turns.tolist())]
    with contextlib.suppress(ValueError):  # mostly all places are inside the body, and one check is enough
        return dataclasses.replace(robot, cables=tuple(moved))
    for index in range(count):
        robot = _with_moved_cable(robot, index, float(offsets[index]), float(turns[index]), tendons, section)
    return robot


def _with_moved_cable(robot: Robot, index: int, offset: float, turn: float, tendons: Tendons, section: str) -> Robot:
    """The robot with one cable moved. A drawn place is moved back towards the described one until it lies inside the body."""
    relative = tendons.radius_offset is None
    given = not relative or tendons.angle_offset is not None
    for part in (1.0,) if given else (1.0, 0.5, 0.2, 0.0):
        moved = _moved(robot.cables[index], part * offset, turn if given else part * turn, relative)
        try:
            return dataclasses.replace(robot, cables=(*robot.cables[:index], moved, *robot.cables[index + 1 :]))
        except ValueError as error:
            problem = str(error)
    raise ConfigError(f"{section}.tendons describes no robot: {problem}")


def _moved(cable: Cable, radius: float, turn: float, relative: bool) -> Cable:
    """The cable farther from the axis by `radius`, in m or relative, and turned about the axis by `turn` (rad)."""

    def away(value: float) -> float:
        return max(value * (1.0 + radius) if relative else value + radius, 0.0)

    if cable.via_points is not None:
        points = []
        for x, y, s in cable.via_points:
            distance, angle = away(math.hypot(x, y)), math.atan2(y, x) + turn
            points.append((distance * math.cos(angle), distance * math.sin(angle), s))
        return dataclasses.replace(cable, via_points=tuple(points))
    assert cable.radius is not None and cable.angle is not None  # Cable.__post_init__
    tip = None if cable.tip_radius is None else away(cable.tip_radius)
    return dataclasses.replace(cable, radius=away(cable.radius), tip_radius=tip, angle=cable.angle + turn)


def _lines(
    robot: Robot, given: VirtualRobotParameters, random: np.random.Generator, slack: np.ndarray, drawn: dict[str, str]
) -> TrueCables:
    tendons, count = given.tendons, len(robot.cables)
    spread, friction_spread = random.uniform(-1.0, 1.0, (2, count))
    stretch, friction = random.uniform(*_LINE_STRETCH), random.uniform(*_FRICTION)
    free = ASSUMED_FREE_LENGTH * robot.length * (1.0 + random.uniform(-_FREE_SPREAD, _FREE_SPREAD))
    guide = random.uniform(*_GUIDE_ANGLE)

    def each(name: str, value: float | None, described: Callable[[Cable, int], float | None], otherwise: float) -> np.ndarray:
        if value is not None:
            return np.full(count, value)
        found = [described(cable, index) for index, cable in enumerate(robot.cables)]
        values = np.array([otherwise if one is None else one for one in found])
        if count:
            low, high = values.min(), values.max()
            drawn[name] = f"{low:.3g}" if math.isclose(low, high) else f"{low:.3g} to {high:.3g}"
        return values

    def stiffness(cable: Cable, index: int) -> float | None:
        return cable.stiffness * (1.0 + _LINE_SPREAD * spread[index]) if cable.stretches else None

    def rubbing(cable: Cable, index: int) -> float | None:
        return cable.friction * (1.0 + _FRICTION_SPREAD * friction_spread[index]) if cable.friction else None

    return TrueCables(
        axial_stiffness=each("E A (N)", tendons.axial_stiffness, stiffness, robot.limits.tension_max / stretch),
        free_length=each("free length (m)", tendons.free_length, lambda cable, _: cable.free_length, free),
        friction=each("line friction", tendons.friction, rubbing, friction),
        guide_angle=each("sheath angle (rad)", tendons.guide_angle, lambda cable, _: cable.sheath_angle, guide),
        presliding=_PRESLIDING * robot.length if tendons.presliding is None else tendons.presliding,
        slack=tendons.slack + tendons.slack_spread * slack,
    )


def _motors(given: VirtualRobotParameters, hardware: Hardware, random: np.random.Generator, drawn: dict[str, str]) -> TrueMotors:
    motors, drive, count = given.motors, hardware.drive, len(hardware.motors)
    torque, radius = random.uniform(-1.0, 1.0, (2, count))
    backlash = drive.backlash * random.uniform(1.0 - _BACKLASH_SPREAD, 1.0 + _BACKLASH_SPREAD, count)
    friction = random.uniform(*_LOAD_FRICTION, count)

    def each(name: str, value: float | None, drawn_values: np.ndarray, scale: float, unit: str) -> np.ndarray:
        if value is not None:
            return np.full(count, value)
        drawn[name] = f"{scale * drawn_values.min():.3g} to {scale * drawn_values.max():.3g} {unit}"
        return drawn_values

    return TrueMotors(
        torque_constant=each(
            "torque constant", motors.torque_constant, drive.torque_constant * (1.0 + _TORQUE_SPREAD * torque), 1.0, "N m/A"
        ),
        capstan_radius=each(
            "capstan radius", motors.capstan_radius, drive.capstan_radius * (1.0 + _CAPSTAN_SPREAD * radius), 1e3, "mm"
        ),
        backlash=each("backlash", motors.backlash, backlash, math.degrees(1.0), "deg"),
        load_friction=each("gear friction", motors.load_friction, friction, 100.0, "%"),
        common=motors,
    )


def _board(given: VirtualRobotParameters, random: np.random.Generator, drawn: dict[str, str]) -> Board:
    ambient = random.uniform(*_AMBIENT)
    if given.board.thermal is not None:
        return given.board
    drawn["surroundings"] = f"{ambient:.1f} degC"
    return dataclasses.replace(given.board, thermal=ThermalPlantOptions(ambient=ambient))
