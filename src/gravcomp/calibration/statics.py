"""Predicted resting tips and their derivatives by the parameters of a robot.

A cable that the motor displaces by u pulls the path in by w u + o - c lambda, where o is its offset, c its compliance, lambda its
tension and w the winding ratio of all motors. The path itself may lie farther from the axis and be turned about it; gravity acts
through the density, the payload, and the IMU's bias and mount; the body creeps by branches of given times
(`full_model.viscosity`), and friction inside it holds its tip back (`held_back`).

One model serves all parameters: moduli scale the stiffness of its elements, density and payload its weights. Windows are computed
in the order of time, so that each begins with what the branches hold (`walk`).

Derivatives by offset, compliance and winding follow from the linear response of each shape (taut cables a): dtip/do = W_ea
W_aa^-1, dtip/dc = -dtip/do lambda, dtip/dw = dtip/do u. All others are difference quotients.
"""

import dataclasses
import functools
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from gravcomp.cables.routing import route_cables
from gravcomp.cables.tendons import Tendons
from gravcomp.calibration.held_back import held_back, reach_of
from gravcomp.calibration.load_response import LoadResponse
from gravcomp.calibration.measured import StillWindows
from gravcomp.calibration.parameters import StaticParameters, starting_parameters, with_cable_places, with_moduli
from gravcomp.calibration.walk import Step, Walk, steps_of
from gravcomp.description import PronyTerm, Robot
from gravcomp.full_model.equilibrium import Equilibrium
from gravcomp.full_model.robot_model import RobotModel
from gravcomp.mechanics.block_matrix import NotPositiveDefinite
from gravcomp.mesh.coarse import with_coarse_elements

_STEPS = {
    "modulus": 1e-2, "density": 1e-2, "payload": 1e-2, "mount": 1e-2, "bias": 0.1, "creep": 1e-2, "friction": 2e-2,
    "radius": 5e-3, "angle": 5e-3,
}  # fmt: skip
"""Steps of the difference quotients, in the units of `StaticParameters`; of the modulus: of its logarithm."""

_CENTRAL = ("mount", "bias")
"""Kinds whose effect is about as much quadratic as linear: under a turned gravity a horizontal robot is also pressed together."""

_SMALL = 1e-9  # ratio of a branch that does not creep, so that the model has it


@dataclass(frozen=True)
class StaticPrediction:
    """Predictions for k windows: tip (k, 6), position in m and direction; tension (k, m) in N."""

    tip: np.ndarray
    tension: np.ndarray


class StaticPredictor:
    """Predicts the tips of a robot at rest in given windows."""

    def __init__(
        self,
        robot: Robot,
        windows: StillWindows,
        creep_times: tuple[float, ...] = (),
        near: Sequence[Equilibrium] | None = None,
    ):
        """creep_times: of the branches in s; none: the body creeps as it is described. Raises MeshError.

        near: shapes of the described robot in relaxed windows, of the same mesh, from which the first prediction begins.
        """
        self.windows, self._robot = windows, robot
        self._described = np.array([material.youngs_modulus for material in robot.materials])
        model = RobotModel(_with_branches(robot, creep_times) if creep_times else robot)
        self._model, self._present = model, self._described
        self._elements = _elements_of_segments(model, len(self._described))
        self._payload = robot.payload.mass * model.effectors.tip_weights
        self._carried = model.nodal_weight - model.body_weight - self._payload
        self._friction = model.tendons.friction.coefficient.copy()
        self._steps = steps_of(windows, crept=bool(creep_times))
        self._tendons: dict[tuple[float, ...], Tendons] = {self._key(np.zeros((2, model.tendons.count))): model.tendons}
        self._walk, self._response = Walk(model, creep_times), LoadResponse(model)
        self._last: tuple[bytes, list[Step]] | None = None
        self._near = [dataclasses.replace(step, state=state) for step, state in zip(self._steps, near or ())] or None
        self._coarse: StaticPredictor | None = None
        self._creep_times = creep_times
        self._tips: dict[bytes, np.ndarray] = {}  # of `tips_of`, by gravity and displacements

    def predict(self, parameters: StaticParameters) -> StaticPrediction:
        """Return the prediction for all windows. Raises RuntimeError if there is no equilibrium."""
        shown = [step for step in self._walked(parameters) if step.window is not None]
        tip = np.array([step.tip for step in shown])
        if parameters.slip:
            tip = tip - parameters.slip * self._held_back(parameters)
        return StaticPrediction(tip, np.array([step.tension for step in shown]))

    def tips_of(self, displacement: np.ndarray) -> np.ndarray:
        """Return the tips (k, 6) of the described robot where the measured displacements were these (k, m), NaN: released.

        A window is computed once, unless creep or friction lets it depend on those before it: exchanged cables change few.
        Raises RuntimeError if there is no equilibrium.
        """
        other = dataclasses.replace(self.windows, displacement=displacement)
        parameters = starting_parameters(self._robot, self._creep_times)
        self._apply(parameters)
        steps = self._inputs(parameters, steps_of(other, crept=bool(self._creep_times)))
        if self._creep_times or self._friction.any():
            return np.array([step.tip for step in self._walk.run(steps, parameters.creep) if step.window is not None])
        new = [step for step in steps if step.key not in self._tips]
        self._tips |= {step.key: step.tip for step in self._walk.run(new, parameters.creep)}
        return np.array([self._tips[step.key] for step in steps])

    def differentiate(self, parameters: StaticParameters, kinds: set[str]) -> dict[str, np.ndarray]:
        """Return the derivatives (k, 6, n) of the tips by the fields named in `kinds`, by the logarithm of the modulus.

        They are those of a coarse mesh, which are right within a few per cent; its own, where the coarse one has no equilibrium.
        Raises RuntimeError if there is no equilibrium next to these parameters on either side.
        """
        if self._coarse is None:
            coarse = with_coarse_elements(self._robot)
            self._coarse = self if coarse == self._robot else StaticPredictor(coarse, self.windows, self._creep_times)
        if self._coarse is not self:
            try:
                return self._coarse.differentiate(parameters, kinds)
            except RuntimeError:
                pass
        steps = self._walked(parameters)
        shown = [step for step in steps if step.window is not None]
        found = self._by_forces(parameters, shown) if kinds & _FORCES else {}
        found |= {kind: self._differences(parameters, kind, steps, shown) for kind in _WALKED if kind in kinds - found.keys()}
        found["slip"] = -self._held_back(parameters)[:, :, None]
        by_offset = np.array([step.by_offset for step in shown])
        wound = np.nan_to_num(np.array([self.windows.displacement[step.window] for step in shown]))
        found["offset"] = by_offset
        found["compliance"] = -by_offset * np.array([step.tension for step in shown])[:, None, :]
        found["winding"] = np.einsum("kec,kc->ke", by_offset, wound)[:, :, None]
        self._apply(parameters)
        for kind in ("radius", "angle"):
            if kind in kinds:
                found[kind] = self._by_place(parameters, kind, shown)
        return found

    def _walked(self, parameters: StaticParameters) -> list[Step]:
        """Return the steps at the parameters; those of the last call are kept."""
        key = parameters.key
        if self._last is None or self._last[0] != key:
            self._apply(parameters)
            known = self._last[1] if self._last else self._near
            self._last = key, self._walk.run(self._inputs(parameters), parameters.creep, known)
        return self._last[1]

    def _held_back(self, parameters: StaticParameters) -> np.ndarray:
        """Return (k, 6) by what the tips of the windows stay behind, for a friction as stiff as the body."""
        return held_back(self._walked(parameters), reach_of(self._robot, self._model), self._robot.length)

    def _inputs(self, parameters: StaticParameters, steps: list[Step] | None = None) -> list[Step]:
        """Return the steps (None: its own) with the gravity and displacements that the parameters make of the measured ones."""
        steps = self._steps if steps is None else steps
        gravity = parameters.true_gravity(np.array([step.gravity for step in steps]))
        return [
            dataclasses.replace(step, gravity=true, displacement=parameters.winding * step.displacement + parameters.offset)
            for step, true in zip(steps, gravity)
        ]

    def _apply(self, parameters: StaticParameters) -> None:
        """Give the model the parameters."""
        model = self._model
        moduli = np.broadcast_to(parameters.youngs_modulus, len(self._described))
        model.elements.scale_stiffness(np.where(self._elements, (moduli / self._present)[:, None], 1.0).prod(axis=0))
        self._present = np.array(moduli)
        model.nodal_weight = parameters.density * model.body_weight + parameters.payload * self._payload + self._carried
        self._set_tendons(parameters, np.stack([parameters.radius, parameters.angle]))

    def _set_tendons(self, parameters: StaticParameters, places: np.ndarray) -> None:
        """Give the model cables at the places (2, m): radius and angle, as in `StaticParameters`.

        Raises RuntimeError where a cable would leave the body: such a robot has no equilibrium either.
        """
        key = self._key(places)
        if key not in self._tendons:
            mesh = self._model.mesh
            try:
                robot = with_cable_places(self._model.robot, *places)
                routes = route_cables(robot, mesh)
            except ValueError as error:
                raise RuntimeError(str(error)) from error
            self._tendons[key] = Tendons(robot.cables, routes, mesh.nodes, self._model.pattern)
            while len(self._tendons) > 6 * places.shape[1] + 2:
                self._tendons.pop(next(iter(self._tendons)))
        self._model.tendons = tendons = self._tendons[key]
        tendons.axial_compliance = parameters.compliance
        tendons.friction.coefficient = self._friction + parameters.friction

    @staticmethod
    def _key(places: np.ndarray) -> tuple[float, ...]:
        return tuple(places.ravel().tolist())

    def _by_forces(self, parameters: StaticParameters, shown: list[Step]) -> dict[str, np.ndarray]:
        """Return the derivatives (k, 6, n) by moduli, weights and errors of the IMU; none where a shape has no linear response.

        What creep held back before a window counts as given.
        """
        from scipy.spatial.transform import Rotation

        self._apply(parameters)
        found: dict[str, list[np.ndarray]] = {kind: [] for kind in _FORCES}
        model, axes = self._model, Rotation.from_rotvec(parameters.mount).as_matrix().T
        for step in shown:
            along = step.gravity / np.linalg.norm(step.gravity)
            pulls = {
                "density": (model.body_weight, step.gravity[None]),
                "payload": (self._payload, step.gravity[None]),
                "mount": (model.nodal_weight, np.cross(np.eye(3), step.gravity)),
                "bias": (model.nodal_weight, axes - np.outer(axes @ along, along)),
            }
            forces = {"modulus": self._response.elastic_forces(step, self._elements)}
            for kind, (weight, directions) in pulls.items():
                forces[kind] = np.column_stack([np.outer(weight[: model.n_free], pull).ravel() for pull in directions])
            try:
                moved = self._response.tips(step, np.hstack([*forces.values()]))
            except NotPositiveDefinite:
                return {}
            ends = np.cumsum([columns.shape[1] for columns in forces.values()])
            for kind, part in zip(forces, np.split(moved, ends[:-1], axis=1)):
                found[kind].append(part)
        return {kind: np.array(columns) for kind, columns in found.items()}

    def _differences(self, parameters: StaticParameters, kind: str, steps: list[Step], shown: list[Step]) -> np.ndarray:
        """Return the difference quotients (k, 6, n) by a field, each from walks of its own near `steps`."""
        here, columns, step = np.array([step.tip for step in shown]), [], _STEPS[kind]

        def quotients(index: int, change: float) -> np.ndarray:
            parameters_there = parameters.changed(kind, (index,), change)
            self._apply(parameters_there)
            walked = self._walk.run(self._inputs(parameters_there), parameters_there.creep, steps)
            return (np.array([one.tip for one in walked if one.window is not None]) - here) / change

        for index in range(parameters.count(kind)):
            quotient = functools.partial(quotients, index)
            columns.append((_on_both_sides if kind in _CENTRAL else _on_either_side)(quotient, step))
        return np.stack(columns, axis=2)

    def _by_place(self, parameters: StaticParameters, kind: str, shown: list[Step]) -> np.ndarray:
        """Return the derivatives (k, 6, m) by the places of the cables: only taut ones move the tip."""
        result = np.zeros((len(shown), 6, parameters.count(kind)))
        inputs = [step for step in self._inputs(parameters) if step.window is not None]
        for cable in range(result.shape[2]):
            taut = [k for k, step in enumerate(shown) if step.tension[cable] > 0.0]
            if not taut:
                continue

            def quotients(change: float, cable: int = cable, taut: list[int] = taut) -> np.ndarray:
                moved = parameters.changed(kind, (cable,), change)
                self._set_tendons(parameters, np.stack([moved.radius, moved.angle]))
                return np.array([(self._walk.near(inputs[k], shown[k]) - shown[k].tip) / change for k in taut])

            result[taut, :, cable] = _on_either_side(quotients, _STEPS[kind])
        return result


_FORCES = {"modulus", "density", "payload", "mount", "bias"}
_WALKED = ("modulus", "density", "payload", "mount", "bias", "creep", "friction")


def _on_either_side(quotient: Callable[[float], np.ndarray], step: float) -> np.ndarray:
    """Return the difference quotient of a step forwards; backwards, where there is no equilibrium. Raises RuntimeError."""
    try:
        return quotient(step)
    except RuntimeError:
        return quotient(-step)


def _on_both_sides(quotient: Callable[[float], np.ndarray], step: float) -> np.ndarray:
    """Return the mean of the quotients of both steps; of one, where the other has no equilibrium. Raises RuntimeError."""
    try:
        forwards = quotient(step)
    except RuntimeError:
        return quotient(-step)
    try:
        return 0.5 * (forwards + quotient(-step))
    except RuntimeError:
        return forwards


def _with_branches(robot: Robot, times: tuple[float, ...]) -> Robot:
    """Return the robot whose segments have branches of these times in s, without stiffness."""
    terms = tuple(PronyTerm(share=_SMALL, time=time) for time in times)
    return robot.with_material(prony=terms, creep_ratio=0.0)


def _elements_of_segments(model: RobotModel, count: int) -> np.ndarray:
    """Return (s, k) whether the modulus of segment s is that of element k; caps of their own material belong to none."""
    robot, region = model.robot, model.mesh.region
    if robot.body is not None:
        return np.ones((1, len(region)), dtype=bool)
    moduli = np.array([material.youngs_modulus for material in robot.materials])
    found = []
    for s in range(count):
        changed = with_moduli(robot, moduli * np.where(np.arange(count) == s, 2.0, 1.0)).pieces
        differs = [a.material.youngs_modulus != b.material.youngs_modulus for a, b in zip(robot.pieces, changed)]
        found.append(np.array(differs)[region])
    return np.array(found)
