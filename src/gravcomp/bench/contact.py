"""Contact of the model with a scene: accuracy against closed forms and CalculiX, penetration, energy, and the time of a step.

What a scene that is wrong does to the loop is in `wrong_scene`, the virtual robot's own contact in `contact_rods`.
"""

import dataclasses
import time
from collections.abc import Callable

import numpy as np
from scipy.spatial.transform import Rotation

from gravcomp.bench.contact_lumens import is_lumen, mesh_lumen
from gravcomp.bench.contact_scenes import GRAVITY, moved_robot, random_scene, scene_of, seeded_gravity
from gravcomp.bench.sampled_depth import sampled_depth
from gravcomp.description import Elements, Material, Robot, Segment, load_robot_file
from gravcomp.full_model.shape import Shape
from gravcomp.full_model.wrench import Wrench
from gravcomp.inverse import InverseController, straight_target
from gravcomp.references.calculix_contact import Rest, cylinder, stored_rests
from gravcomp.references.contact_beams import buckled_in_tube, laid_on_plane, over_peg, pressed_on_plane
from gravcomp.scene.scene import Scene
from gravcomp.simulation import RobotModel, Simulator

Progress = Callable[[str], None]

_SCENES, _STEPS = 200, 20  # seeded scenes, and steps of motion in each
_TIMED, _BRIEFLY_TIMED = 120, 30  # steps, of which the first 20 do not count
_TURN, _INTERVAL = np.deg2rad(2.0), 0.01  # of gravity in a step, rad; s
# A rod so slender that Euler-Bernoulli's beam is exact enough: 200 mm long, 4 mm thick.
_LENGTH, _DIAMETER, _MODULUS, _DENSITY = 0.2, 4e-3, 2e6, 1100.0
_SMALL = 0.01  # deflection of the closed forms, of the length


def run(progress: Progress, *, every: int = 1) -> dict:
    """Return all figures, with every `every`-th of the scenes; see the functions below and the modules imported here."""
    from gravcomp.bench.contact_itself import coiled
    from gravcomp.bench.contact_rods import rods  # the virtual robot, which tests of `slender_rod` do not need
    from gravcomp.bench.wrong_scene import wrong_scene

    return {
        **accuracy(progress), **motion(progress, every), **rods(progress, every), **step_time(progress, every),
        **wrong_scene(progress), **coiled(progress, brief=every > 1),
    }  # fmt: skip


def slender_rod() -> Robot:
    """Return the rod of the closed forms."""
    material = Material(law="svk", youngs_modulus=_MODULUS, poissons_ratio=0.3, density=_DENSITY)
    segment = Segment(name="rod", length=_LENGTH, outer_diameter=_DIAMETER, material=material)
    return Robot("slender rod", segments=(segment,), elements=Elements(around=8, along=24))


def accuracy(progress: Progress) -> dict:
    """Return `contact_by_case_pct`: errors against closed forms and CalculiX, and the worst, `contact_error_pct`.

    Errors of the force are shares of it, those of the tip of the length.
    """
    model = RobotModel(slender_rod())
    stiffness = _MODULUS * np.pi * _DIAMETER**4 / 64
    line = _DENSITY * np.pi / 4 * _DIAMETER**2  # kg/m
    weight = 8.0 * stiffness * 2.0 * _SMALL / _LENGTH**3  # N/m, sags freely by twice the small deflection
    gravity = np.array([-weight / line, 0.0, 0.0])
    gap, below = _SMALL * _LENGTH, -0.5 * _DIAMETER - _SMALL * _LENGTH
    errors = {}
    progress("closed forms")
    plane = scene_of(planes=[{"normal": [1, 0, 0], "point_mm": [1e3 * below, 0, 0]}])
    shape = Simulator(model, reduced=False, scene=plane).solve(gravity)
    errors["pressed on a plane"] = _errors(shape, *pressed_on_plane(weight, _LENGTH, stiffness, gap))
    place, radius = 0.6 * _LENGTH, 1e-3
    half = 0.25 * gap  # the peg holds it there
    low = 1e3 * (-0.5 * _DIAMETER - half - radius)
    peg = {"points_mm": [[low, -50, 1e3 * place], [low, 50, 1e3 * place]], "radius_mm": [1e3 * radius], "side": "outside"}
    shape = Simulator(model, reduced=False, scene=scene_of(tubes=[peg])).solve(gravity)
    errors["over a peg"] = _errors(shape, *over_peg(weight, _LENGTH, stiffness, half, place))
    near = 0.05 * gap
    plane = scene_of(planes=[{"normal": [1, 0, 0], "point_mm": [1e3 * (-0.5 * _DIAMETER - near), 0, 0]}])
    shape = Simulator(model, reduced=False, scene=plane).solve(3.0 * gravity)
    force, place = laid_on_plane(3.0 * weight, stiffness, near)
    # The plane bears the rest of the weight beyond the place where the rod comes down.
    errors["laid on a plane"] = _errors(shape, force + 3.0 * weight * (_LENGTH - place), near)
    clearance = 0.5 * gap
    tube = {"points_mm": [[0, 0, -10], [0, 0, 1e3 * _LENGTH + 50]], "radius_mm": [1e3 * (0.5 * _DIAMETER + clearance)]}
    simulator = Simulator(model, reduced=False, scene=scene_of(tubes=[tube]))
    load = 2.0 * np.pi**2 * stiffness / (4.0 * _LENGTH**2)
    # Its weight lays it on the tube, and the load, beyond the one at which it buckles freely, presses it on.
    shape = simulator.solve(gravity, wrench=Wrench(force=np.array([0.0, 0.0, -load])))
    errors["buckled in a tube"] = _errors(shape, *buckled_in_tube(weight, load, _LENGTH, stiffness, clearance))
    progress("against CalculiX")
    model = RobotModel(cylinder())
    low = -0.5 * model.robot.segments[0].outer_diameter
    for rest in stored_rests():
        plane = scene_of(planes=[{"normal": [1, 0, 0], "point_mm": [1e3 * (low - rest.gap), 0, 0]}])
        shape = Simulator(model, reduced=False, scene=plane).solve(np.array([-GRAVITY, 0.0, 0.0]))
        errors[f"CalculiX, {1e3 * rest.gap:g} mm over a plane"] = _from_calculix(shape, rest, model.length)
    worst = max(max(pair.values()) for pair in errors.values())
    return {"contact_error_pct": worst, "contact_by_case_pct": errors}


def _errors(shape: Shape, force: float, deflection: float) -> dict[str, float]:
    if not shape.is_equilibrium:
        return {"force": np.inf, "tip": np.inf}
    found = float(np.linalg.norm(shape.contacts.force[:, :2].sum(axis=0)))
    lateral = float(np.linalg.norm(shape.tip_position[:2]))
    return {
        "force": round(100.0 * abs(found - force) / force, 4),
        "tip": round(100.0 * abs(lateral - deflection) / _LENGTH, 4),
    }


def _from_calculix(shape: Shape, rest: Rest, length: float) -> dict[str, float]:
    if not shape.is_equilibrium:
        return {"force": np.inf, "tip": np.inf}
    force = float(shape.contacts.normal_force.sum())
    tip = float(np.linalg.norm(shape.tip_position - [0.0, 0.0, length] - rest.tip))
    return {"force": round(100.0 * abs(force - rest.force) / rest.force, 4), "tip": round(100.0 * tip / length, 4)}


def motion(progress: Progress, every: int = 1) -> dict:
    """Return figures of seeded scenes in which gravity turns, there and back: the worst or the sum of those of `scene_motion`.

    `penetration_mm`: deepest place of the surface in a rigid wall; `contact_energy`: work that contact gives to the robot over
    the closed path, as a share of the work of the weight on it, taken without sign; `contact_scenes`: scenes that touched;
    `lost_steps`: share of the steps without an equilibrium; `unsolved_scenes`: scenes that `solve` does not enter from the
    straight robot, left out; `lumen_penetration_mm`, `lumen_lost_steps` and `unsolved_lumens`: the same of the lumens from
    meshes, which are a tenth of the scenes.
    """
    model = RobotModel(moved_robot())
    found = {}
    for seed in range(0, _SCENES, every):
        progress(f"scene {seed + 1} of {_SCENES}")
        found[seed] = scene_motion(model, seed)
    moved = [scene for scene in found.values() if scene is not None]
    lumens = [scene for seed, scene in found.items() if is_lumen(seed)]
    in_lumens = [scene for scene in lumens if scene is not None]
    return {
        "penetration_mm": 1e3 * max((scene.deepest for scene in moved), default=0.0),
        "contact_energy": max((scene.gained for scene in moved), default=0.0),
        "contact_scenes": sum(scene.touches for scene in moved),
        "lost_steps": sum(scene.lost for scene in moved) / max(sum(scene.steps for scene in moved), 1),
        "unsolved_scenes": len(found) - len(moved),
        "lumen_penetration_mm": 1e3 * max((scene.deepest for scene in in_lumens), default=0.0),
        "lumen_lost_steps": sum(scene.lost for scene in in_lumens) / max(sum(scene.steps for scene in in_lumens), 1),
        "unsolved_lumens": len(lumens) - len(in_lumens),
    }


@dataclasses.dataclass(frozen=True)
class SceneMotion:
    """A seeded scene: deepest place in m, energy gained as a share of the work, whether the robot touches, lost steps of all."""

    deepest: float
    gained: float
    touches: bool
    lost: int
    steps: int


def scene_motion(model: RobotModel, seed: int) -> SceneMotion | None:
    """Turn gravity in the scene of a seed, there and back. None where `solve` does not enter it from the straight robot."""
    scene = (mesh_lumen if is_lumen(seed) else random_scene)(seed, model.robot)
    simulator, start = Simulator(model, reduced=False, scene=scene), seeded_gravity(seed)
    axis = np.random.default_rng(seed).standard_normal(3)
    axis /= np.linalg.norm(axis)
    angles = _TURN * np.concatenate([np.arange(_STEPS // 2), np.arange(_STEPS // 2 - 2, -1, -1)])
    shape, last = simulator.solve(start), start
    if not shape.is_equilibrium:
        return None
    moved, net, whole = simulator.displacements.copy(), model.elements.energy(simulator.displacements), 0.0
    deepest, lost = 0.0, 0
    for angle in angles:
        gravity = Rotation.from_rotvec(angle * axis).apply(start)
        shape = simulator.step(gravity)
        lost += not shape.is_equilibrium
        if shape.is_equilibrium and len(shape.contacts):
            touched_at = simulator.solver.contact
            assert touched_at is not None
            deepest = max(deepest, sampled_depth(touched_at, simulator.displacements))
        # What the elastic energy gains beyond the work of the weight comes from contact.
        work = float(model.nodal_weight @ (simulator.displacements - moved) @ (0.5 * (last + gravity)))
        net, whole = net + work, whole + abs(work)
        moved, last = simulator.displacements.copy(), gravity
    gained = (model.elements.energy(moved) - net) / whole if whole else 0.0
    return SceneMotion(deepest, gained, bool(len(shape.contacts)), lost, len(angles))


def timed_scenes() -> dict[str, Scene]:
    """Return scenes that the article's robot touches at 2 to 20 places."""
    plane = {"normal": [1, 0, 0], "point_mm": [-6.5, 0, 0]}
    straight = {"points_mm": [[0, 0, -20], [0, 0, 60], [0, 0, 130]], "radius_mm": [7.0]}
    return {
        "plane": scene_of(planes=[plane]),
        "plane with friction": scene_of(planes=[plane | {"friction": 0.3}]),
        "tube": scene_of(tubes=[straight]),
        "plane that yields": scene_of(planes=[plane | {"point_mm": [-5.0, 0, 0], "stiffness_mpa": 0.02}]),
    }


def step_time(progress: Progress, every: int = 1) -> dict:
    """Return `contact_step_ms`: a step of the reduced model in contact, cables released, and of the inverse problem, median.

    It is that of the slowest of `timed_scenes`; `contact_step_by_scene` has all, each with the median number of places and the
    share of the steps for which the reduced model was used. `contact_full_step_ms`: the same of the full model on the plane.
    """
    progress("time of a step")
    scenes, count = timed_scenes(), _TIMED if every == 1 else _BRIEFLY_TIMED
    found = {name: _timed(scene, True, count) for name, scene in scenes.items()}
    return {
        "contact_step_ms": max(row["ms"] for row in found.values()),
        "contact_step_by_scene": found,
        "contact_full_step_ms": _timed(scenes["plane"], False, count)["ms"],
    }


def _timed(scene: Scene, reduced: bool, count: int) -> dict[str, float]:
    """Return the time of a step of the article's robot whose base turns, ms, median places, and share of reduced steps."""
    robot = load_robot_file("article").robot
    simulator, controller = Simulator(robot, reduced=reduced, scene=scene), InverseController(robot)
    target, shape = straight_target(simulator.model.length), simulator.solve(np.array([-GRAVITY, 0.0, 0.0]))
    times, places, used = [], [], 0
    for step in range(count):
        angle = 0.3 * np.sin(0.02 * step)
        gravity = GRAVITY * np.array([-np.cos(angle), np.sin(angle), 0.0])
        started = time.process_time()
        shape = simulator.step(gravity)
        controller.step(
            shape.response, target, backbone_station=shape.backbone_station, tension=shape.cable_tension, interval=_INTERVAL
        )
        times.append(time.process_time() - started)
        places.append(len(shape.contacts))
        used += shape.model == "reduced"
    return {"ms": 1e3 * float(np.median(times[20:])), "places": float(np.median(places)), "reduced_share": used / len(times)}
