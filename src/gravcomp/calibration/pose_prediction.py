"""Predicted markers of measured poses.

One model serves all moduli: without inertia only ratios matter (see `statics`). A model is built for each set of loads and of
cable places; each pose starts from the shape that it had at the last prediction.
"""

import dataclasses

import numpy as np

from gravcomp.calibration.markers import Markers
from gravcomp.calibration.poses import PoseParameters, Poses
from gravcomp.description import Cable, PointLoad, Robot
from gravcomp.full_model.cable_input import CableInput
from gravcomp.full_model.equilibrium import Equilibrium
from gravcomp.full_model.robot_model import RobotModel
from gravcomp.full_model.statics import StaticSolver
from gravcomp.mesh import MeshError

_MODELS = 8  # models that are kept
_PARTS = 64, 16  # a load step of 1 / _PARTS that fails ends the search: at the first prediction of a pose, and later


@dataclasses.dataclass
class _Model:
    solver: StaticSolver
    markers: Markers
    states: dict[int, Equilibrium]


class PosePredictor:
    """Predicts the markers of poses by the full model of a robot."""

    def __init__(self, robot: Robot, poses: Poses):
        self.robot, self.poses = robot, poses
        self.modulus = robot.materials[0].youngs_modulus
        self._models: dict[tuple, _Model] = {}

    def initial(self) -> PoseParameters:
        """Return the parameters of the robot as it is described."""
        return PoseParameters.of(self.modulus, len(self.robot.cables))

    def predict(self, parameters: PoseParameters) -> np.ndarray:
        """Return (k, p, 3) the markers in m; NaN for poses that have no equilibrium, and where cables would leave the body."""
        from scipy.spatial.transform import Rotation

        try:
            robot = with_moved_cables(self.robot, parameters)
        except ValueError:
            return np.full_like(self.poses.measured, np.nan)
        turn = Rotation.from_rotvec(parameters.base_rotation)
        try:
            places = np.array([self._pose(k, robot, parameters, turn.inv().apply(g)) for k, g in enumerate(self.poses.gravity)])
        except MeshError:
            if robot == self.robot:  # the described robot cannot be meshed
                raise
            return np.full_like(self.poses.measured, np.nan)
        return turn.apply(places.reshape(-1, 3)).reshape(places.shape) + parameters.base_position

    def _pose(self, k: int, robot: Robot, parameters: PoseParameters, gravity: np.ndarray) -> np.ndarray:
        """Return the markers (p, 3) of pose k in the frame of the base, under gravity (3,) there."""
        model, poses = self._model(robot, parameters, self.poses.loads[k]), self.poses
        similarity = self.modulus / parameters.youngs_modulus
        cables = CableInput()
        if poses.tension is not None:
            cables = CableInput(tension=similarity * parameters.gain * poses.tension[k])
        elif poses.displacement is not None:
            cables = CableInput(wound=parameters.gain * poses.displacement[k] + parameters.zero)
        solver = model.solver
        if k in model.states:
            solver.state = model.states[k]
        else:
            solver.reset()
        state = solver.solve(similarity * gravity, cables, _PARTS[k in model.states])
        if not state.converged and k in model.states:
            solver.reset()
            state = solver.solve(similarity * gravity, cables, _PARTS[k in model.states])
        if not state.converged:
            return np.full_like(poses.at, np.nan)
        model.states[k] = state
        return model.markers.positions(state.u)

    def _model(self, robot: Robot, parameters: PoseParameters, loads: tuple[PointLoad, ...]) -> _Model:
        """Return the model with these loads and cable places."""
        key = (loads, parameters.angle.tobytes(), parameters.tip_radius.tobytes())
        found = self._models.pop(key, None)
        if found is None:
            model = RobotModel(dataclasses.replace(robot, loads=(*robot.loads, *loads)))
            found = _Model(StaticSolver(model), Markers(model, self.poses.at), self._carried(model, loads))
            while len(self._models) >= _MODELS:
                self._models.pop(next(iter(self._models)))
        self._models[key] = found
        return found

    def _carried(self, model: RobotModel, loads: tuple[PointLoad, ...]) -> dict[int, Equilibrium]:
        """Return the shapes of the newest model with these loads as starts for a model whose cables lie elsewhere."""
        for key, known in reversed(self._models.items()):
            nodes = known.solver.model.mesh.nodes
            if key[0] == loads and nodes.shape == model.mesh.nodes.shape and np.array_equal(nodes, model.mesh.nodes):
                return {
                    k: dataclasses.replace(state, tendons=model.tendons.state(nodes + state.u))
                    for k, state in known.states.items()
                }
        return {}


def with_moved_cables(robot: Robot, parameters: PoseParameters) -> Robot:
    """Return the robot with its cables where the parameters say. Raises ValueError where one leaves the body."""
    cables = tuple(
        _moved(cable, float(angle), float(radius))
        for cable, angle, radius in zip(robot.cables, parameters.angle, parameters.tip_radius)
    )
    return dataclasses.replace(robot, cables=cables)


def _moved(cable: Cable, angle: float, radius: float) -> Cable:
    """Return a cable turned about the axis by `angle` in rad, and at its end farther from the axis by `radius` in m."""
    if not angle and not radius:
        return cable
    assert cable.angle is not None and cable.radius is not None  # pose_unknowns.unknowns_of
    tip = cable.radius if cable.tip_radius is None else cable.tip_radius
    return dataclasses.replace(
        cable, angle=cable.angle + angle, tip_radius=max(tip + radius, 0.0) if radius else cable.tip_radius
    )
