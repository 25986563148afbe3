"""A small robot for tests of the inverse problem: two segments of constant curvature, six cables, gravity; no finite elements.

Coordinates q (6,): for each segment the curvatures about y and -x (rad/m) and the axial strain. Potential energy
U = sum_j L_j/2 (EI |kappa_j|^2 + EA strain_j^2) - integral of w g . p ds. Cable i at the pitch radius r and angle phi_i
has the path displacement delta_i = sum over its segments of L_j (r (cos phi_i kappa_x + sin phi_i kappa_y) - strain_j).
"""

import functools
from types import SimpleNamespace

import numpy as np

from gravcomp.cables.slack import taut_tensions
from gravcomp.description import Cable, Limits, Robot, Segment
from gravcomp.inverse import Command, InverseController, InverseOptions, Target

SEGMENT = 0.05
LENGTH = 2 * SEGMENT
BENDING = 0.8e6 * np.pi / 64 * (9e-3**4 - 3.6e-3**4)
AXIAL = 0.8e6 * np.pi / 4 * (9e-3**2 - 3.6e-3**2)
LINE_DENSITY = 1145.0 * np.pi / 4 * (9e-3**2 - 3.6e-3**2)
RADIUS = 3.15e-3
NAMES = ("s1c1", "s1c2", "s1c3", "s2c1", "s2c2", "s2c3")
ANGLES = np.radians([0, 120, 240, 60, 180, 300])
STATIONS = np.linspace(0.0, 1.0, 9)
_POINTS_A_SEGMENT = 16
_HALVES = 0.5 * np.arange(1, 2 * _POINTS_A_SEGMENT + 1)  # middles and ends of its pieces

LIMITS = Limits(tension_max=5.0, displacement_min=-0.02, displacement_max=0.02, tension_rate=1e3, displacement_rate=0.05)


def description(limits: Limits = LIMITS) -> Robot:
    """The robot's description for the controller."""
    segments = tuple(Segment(name=f"s{j}", length=SEGMENT, outer_diameter=9e-3, lumen_diameter=3.6e-3) for j in (1, 2))
    cables = tuple(Cable(name=n, angle=float(a), radius=RADIUS, segment=n[:2]) for n, a in zip(NAMES, ANGLES))
    return Robot(name="arc", segments=segments, cables=cables, limits=limits)


def cable_jacobian() -> np.ndarray:
    """Return d delta / d q (6, 6), which is constant for this robot."""
    jacobian = np.zeros((6, 6))
    for i, angle in enumerate(ANGLES):
        row = SEGMENT * np.array([RADIUS * np.cos(angle), RADIUS * np.sin(angle), -1.0])
        jacobian[i, :3] = row
        if i >= 3:
            jacobian[i, 3:] = row
    return jacobian


def centre_line(q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Points (..., 33, 3), base to tip, and directions there (..., 33, 3), for coordinates (..., 6), by the midpoint rule.

    A segment lies in a plane: its directions are sums of two, `ahead` at its begin and `aside`, toward which it bends.
    """
    q = np.asarray(q)
    position, frame = np.zeros((*q.shape[:-1], 1, 3)), np.broadcast_to(np.eye(3), (*q.shape[:-1], 3, 3))
    positions, directions = [position], [frame[..., None, :, 2]]
    h = SEGMENT / _POINTS_A_SEGMENT
    for segment in np.split(q, 2, axis=-1):
        curvature = np.maximum(np.hypot(segment[..., 0], segment[..., 1]), 1e-12)[..., None]
        toward = segment[..., :2] / curvature
        aside, ahead = (frame[..., :2] @ toward[..., None])[..., None, :, 0], frame[..., None, :, 2]
        sine, cosine = np.sin(curvature * h * _HALVES)[..., None], np.cos(curvature * h * _HALVES)[..., None]
        step = h * (1.0 + segment[..., 2, None, None])
        gone = [step * np.cumsum(part[..., ::2, :], axis=-2) for part in (sine, cosine)]
        positions.append(position + gone[0] * aside + gone[1] * ahead)
        directions.append(sine[..., 1::2, :] * aside + cosine[..., 1::2, :] * ahead)
        position, end = positions[-1][..., -1:, :], directions[-1][..., -1, :]
        # The frame turns in the plane of `aside` and `ahead`; what is across it stays.
        change = (cosine[..., -1, :] - 1.0) * aside[..., 0, :] - sine[..., -1, :] * ahead[..., 0, :]
        frame = np.concatenate([frame[..., :2] + change[..., None] * toward[..., None, :], end[..., None]], axis=-1)
    return np.concatenate(positions, axis=-2), np.concatenate(directions, axis=-2)


def effector(q: np.ndarray) -> np.ndarray:
    """Tip position, tip direction, backbone positions, (..., 6 + 27), for coordinates (..., 6)."""
    positions, directions = centre_line(q)
    backbone = positions[..., :: 2 * _POINTS_A_SEGMENT // (STATIONS.size - 1), :]
    return np.concatenate([positions[..., -1, :], directions[..., -1, :], backbone.reshape(*backbone.shape[:-2], -1)], axis=-1)


class ArcRobot:
    """Quasi-static, one Newton step per call, driven by cable displacements with slack."""

    def __init__(self):
        self.q = np.zeros(6)
        self.tension = np.zeros(6)

    def step(self, gravity: np.ndarray, displacement: np.ndarray | None, iterations: int = 1) -> SimpleNamespace:
        """Take a step; return the linear response at the new state. displacement (6,) in m; None: cables released."""
        jacobian = cable_jacobian()
        for _ in range(iterations):
            gradient, hessian = _derivatives(self.q, gravity)
            compliance = jacobian @ np.linalg.solve(hessian, jacobian.T)
            free = self.q - np.linalg.solve(hessian, gradient)
            self.tension = np.zeros(6) if displacement is None else taut_tensions(compliance, jacobian @ free, displacement)
            self.q = free + np.linalg.solve(hessian, jacobian.T @ self.tension)
        return self.response(gravity)

    def response(self, gravity: np.ndarray) -> SimpleNamespace:
        jacobian = cable_jacobian()
        answer = np.linalg.solve(_derivatives(self.q, gravity)[1], jacobian.T)
        shifts = 1e-6 * np.eye(6)
        there, ahead, behind = np.split(effector(self.q + np.concatenate([np.zeros((1, 6)), shifts, -shifts])), (1, 7))
        sensitivity = (ahead - behind).T / 2e-6
        compliance_aa, compliance_ea = jacobian @ answer, sensitivity @ answer
        return SimpleNamespace(
            compliance_aa=compliance_aa,
            compliance_ea=compliance_ea,
            displacement_free=jacobian @ self.q - compliance_aa @ self.tension,
            effector_free=there[0] - compliance_ea @ self.tension,
        )


def _weight_energy(q: np.ndarray) -> np.ndarray:
    """Potential energy (..., 3) of the weight per unit of gravity along x, y and z."""
    positions, _ = centre_line(q)
    centres = 0.5 * (positions[..., 1:, :] + positions[..., :-1, :])
    return -LINE_DENSITY * LENGTH / centres.shape[-2] * centres.sum(axis=-2)


def _derivatives(q: np.ndarray, gravity: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Gradient (6,) and Hessian (6, 6) of the potential energy."""
    stiffness = np.diag(np.tile([BENDING, BENDING, AXIAL], 2)) * SEGMENT
    gradient, hessian = _weight_derivatives(tuple(q))
    return stiffness @ q + gradient @ gravity, stiffness + hessian @ gravity


@functools.lru_cache(maxsize=64)
def _weight_derivatives(q: tuple[float, ...]) -> tuple[np.ndarray, np.ndarray]:
    """Gradient (6, 3) and Hessian (6, 6, 3) of `_weight_energy` by central differences. A step reuses the last response's."""
    steps = np.diag(np.tile([1e-2, 1e-2, 1e-4], 2))
    first, second = np.triu_indices(6)
    signs = np.array([(1, 1), (1, -1), (-1, 1), (-1, -1)])
    shifts = signs[:, 0, None, None] * steps[first] + signs[:, 1, None, None] * steps[second]
    energy = _weight_energy(np.array(q) + shifts)
    size = np.diag(steps)
    gradient = (energy[0] - energy[3])[first == second] / (4 * size[:, None])
    hessian = np.empty((6, 6, 3))
    hessian[first, second] = (energy[0] - energy[1] - energy[2] + energy[3]) / (4 * size[first] * size[second])[:, None]
    hessian[second, first] = hessian[first, second]
    return gradient, hessian


def controller(options: InverseOptions | None = None, limits: Limits = LIMITS) -> InverseController:
    """A controller of this robot."""
    return InverseController(description(limits), options)


def closed_loop(
    gravities: np.ndarray | list,
    target: Target,
    control: InverseController | None = None,
    robot: "ArcRobot | None" = None,
) -> "tuple[ArcRobot, np.ndarray, Command]":
    """Run the closed loop over the gravities (k, 3); return robot, displacements (k, 6) and the last command."""
    robot = robot or ArcRobot()
    control = control or controller()
    response = robot.step(gravities[0], None, iterations=20)
    displacements = []
    for gravity in gravities:
        command = control.step(response, target, backbone_station=STATIONS, tension=robot.tension)
        response = robot.step(gravity, command.displacement)
        displacements.append(command.displacement)
    return robot, np.array(displacements), command
