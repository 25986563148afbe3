"""The model of a silicone beam with a weight hung from the upper edge of its free face."""

import dataclasses

import numpy as np

from gravcomp.description import Elements, Material, PointLoad, PronyTerm, Robot, Section, Segment
from gravcomp.full_model.cable_input import CableInput
from gravcomp.full_model.dynamics import DynamicSolver
from gravcomp.full_model.generalized_alpha import DynamicsOptions
from gravcomp.full_model.observation import observe
from gravcomp.full_model.robot_model import RobotModel
from gravcomp.full_model.statics import StaticSolver

LENGTH, WIDTH = 0.1, 0.03
GRAVITY = np.array([-9.81, 0.0, 0.0])  # the recordings' x points upwards
EDGE = (WIDTH / 2, 0.0, LENGTH)  # the weights hang from the middle of the upper edge of the free face
STEP = 5e-3  # s


@dataclasses.dataclass(frozen=True)
class FacePose:
    """Place (3,) of the free face's middle, and its rotation (3, 3)."""

    position: np.ndarray
    rotation: np.ndarray

    def carry(self, at: np.ndarray, middle: np.ndarray) -> np.ndarray:
        """Return where points `at` (p, 3) go that are fixed to the face, whose middle was at `middle` (3,)."""
        return middle + (self.position - [0.0, 0.0, LENGTH]) + (at - middle) @ self.rotation.T


def beam(
    modulus: float,
    mass: float,
    plate: float,
    elements: Elements,
    damping_time: float = 0.02,
    prony: tuple[PronyTerm, ...] = (),
) -> Robot:
    """Return the beam with a weight of `mass` in kg; plate: mass of the plate with the markers on the free face, in kg."""
    material = Material("neo_hookean", modulus, 0.499, density=1070.0, damping_time=damping_time, prony=prony)
    segment = Segment("beam", LENGTH, section=Section("rectangle", WIDTH, WIDTH), material=material)
    loads = tuple(PointLoad(at, kg) for at, kg in ((EDGE, mass), ((0.0, 0.0, LENGTH), plate)) if kg > 0.0)
    return Robot("beam", segments=(segment,), elements=elements, loads=loads)


def face(model: RobotModel, u: np.ndarray) -> FacePose:
    """Return the pose of the free face at the displacements u (n, 3)."""
    from scipy.spatial.transform import Rotation

    sections = model.effectors.sections(model.mesh.nodes + u)
    _, _, orientation = observe(sections, np.zeros((*sections.shape, 0)))
    return FacePose(sections[-1, 0], Rotation.from_quat(orientation[-1]).as_matrix())


def resting_face(modulus: float, mass: float, plate: float, elements: Elements) -> FacePose:
    """Return the free face's pose at rest. Raises RuntimeError if there is no equilibrium."""
    model = RobotModel(beam(modulus, mass, plate, elements))
    state = StaticSolver(model).solve(GRAVITY, CableInput())
    if not state.converged:
        raise RuntimeError(f"beam: no equilibrium at {modulus * 1e-3:.0f} kPa under {1e3 * mass:.0f} g")
    return face(model, state.u)


def motion(robot: Robot, duration: float) -> list[FacePose]:
    """Return the free face at every 2 steps after the release. Raises RuntimeError if a step does not converge."""
    model = RobotModel(robot)
    solver = DynamicSolver(model, DynamicsOptions(time_step=STEP))
    solver.place(np.zeros_like(model.mesh.nodes), gravity=GRAVITY)
    poses = [face(model, solver.state.u)]
    for number in range(round(duration / STEP)):
        if not _advance(solver, STEP):
            raise RuntimeError(f"beam: the motion does not converge at {number * STEP:.3f} s")
        if number % 2:
            poses.append(face(model, solver.state.u))
    return poses


def _advance(solver: DynamicSolver, step: float, halvings: int = 5) -> bool:
    """Move on by `step` s, in halves if that does not converge. Returns whether it was possible."""
    if solver.step(GRAVITY, CableInput(), step).converged:
        return True
    return halvings > 0 and _advance(solver, step / 2, halvings - 1) and _advance(solver, step / 2, halvings - 1)
