"""Predicted resting tips and their derivatives by the moduli, cable offsets, cable compliance and winding ratio.

One model serves all moduli: their ratios to the described ones scale the stiffness of its elements. A cable that the motor
displaces by u pulls the path in by w u + o - c lambda, where o is its offset, c its compliance, lambda its tension and w the
winding ratio of all motors: it accounts for the real radius of the capstans and the real distance of the cables from the axis.

Derivatives follow from the linear response of each shape (taut cables a): dtip/do = W_ea W_aa^-1, dtip/dc = -dtip/do lambda,
dtip/dw = dtip/do u. Those by the moduli are difference quotients.
"""

import dataclasses
from dataclasses import dataclass

import numpy as np

from gravcomp.calibration.measured import StillWindows
from gravcomp.description import Robot
from gravcomp.simulation import Shape, Simulator

_MODULUS_STEP = 1e-3


@dataclass(frozen=True)
class StaticParameters:
    """Parameters of the static fit.

    youngs_modulus (s,) in Pa of the segments, or of the body from a file; offset (m,) in m; compliance (m,) in m/N; winding:
    ratio w.
    """

    youngs_modulus: np.ndarray
    offset: np.ndarray
    compliance: np.ndarray
    winding: float = 1.0


@dataclass(frozen=True)
class StaticPrediction:
    """Predictions for k windows.

    tip (k, 6): position in m and direction; its derivatives by_modulus (k, 6, s) by the logarithms of the moduli, by_offset (k,
    6, m) in 1/m, by_compliance (k, 6, m) in N/m, by_winding (k, 6); tension (k, m) in N.
    """

    tip: np.ndarray
    by_modulus: np.ndarray
    by_offset: np.ndarray
    by_compliance: np.ndarray
    by_winding: np.ndarray
    tension: np.ndarray


def with_moduli(robot: Robot, moduli: np.ndarray) -> Robot:
    """Return the robot with these moduli (s,) in Pa of its segments, or of its body from a file; caps keep theirs."""
    return robot.with_materials(
        [dataclasses.replace(material, youngs_modulus=float(modulus)) for material, modulus in zip(robot.materials, moduli)]
    )


class StaticPredictor:
    """Predicts the tips of a robot at rest in given windows."""

    def __init__(self, robot: Robot, windows: StillWindows):
        self.windows = windows
        self._simulator = Simulator(robot, reduced=False)
        self._present = np.array([material.youngs_modulus for material in robot.materials])
        self._elements = self._elements_of_segments()

    def predict(self, parameters: StaticParameters) -> StaticPrediction:
        """Return the prediction for all windows. Raises RuntimeError if there is no equilibrium."""
        self._simulator.model.tendons.axial_compliance = parameters.compliance
        rows = [self._window(k, parameters) for k in range(len(self.windows.tip_position))]
        return StaticPrediction(*(np.array(column) for column in zip(*rows)))

    def _elements_of_segments(self) -> np.ndarray:
        """Return (s, k) whether the modulus of segment s is that of element k; caps of their own material belong to none."""
        model = self._simulator.model
        robot, region, count = model.robot, model.mesh.region, len(self._present)
        if robot.body is not None:
            return np.ones((1, len(region)), dtype=bool)
        found = []
        for s in range(count):
            changed = with_moduli(robot, self._present * np.where(np.arange(count) == s, 2.0, 1.0)).pieces
            differs = [a.material.youngs_modulus != b.material.youngs_modulus for a, b in zip(robot.pieces, changed)]
            found.append(np.array(differs)[region])
        return np.array(found)

    def _set(self, moduli: np.ndarray) -> None:
        """Give the model the moduli (s,) in Pa."""
        factor = np.where(self._elements, (moduli / self._present)[:, None], 1.0).prod(axis=0)
        self._simulator.model.elements.scale_stiffness(factor)
        self._present = moduli

    def _window(self, k: int, parameters: StaticParameters) -> tuple:
        """Return window k's entries of a StaticPrediction."""
        count = len(self._present)
        moduli = np.array(np.broadcast_to(parameters.youngs_modulus, count))
        self._set(moduli)
        shape = self._solve(k, parameters)
        tip, by_modulus = _tip(shape), np.zeros((6, count))
        taut = shape.cable_tension > 0.0
        by_offset = np.zeros((6, len(taut)))
        if taut.any():
            response = shape.response
            own = response.compliance_aa[np.ix_(taut, taut)]
            by_offset[:, taut] = np.linalg.solve(own.T, response.compliance_ea[:6, taut].T).T
        by_winding = by_offset @ np.nan_to_num(self.windows.displacement[k])
        for s in range(count):
            self._set(moduli * np.where(np.arange(count) == s, 1.0 + _MODULUS_STEP, 1.0))
            by_modulus[:, s] = (_tip(self._solve(k, parameters)) - tip) / np.log1p(_MODULUS_STEP)
        tension = shape.cable_tension
        return tip, by_modulus, by_offset, -by_offset * tension, by_winding, tension

    def _solve(self, k: int, parameters: StaticParameters) -> Shape:
        """Return the shape in window k at the model's present moduli."""
        displacement = parameters.winding * self.windows.displacement[k] + parameters.offset
        shape = self._simulator.step(self.windows.gravity[k], displacement)
        if shape.status != 0:
            raise RuntimeError(
                f"no equilibrium at {', '.join(f'{e * 1e-6:.3g}' for e in self._present)} MPa in window {k + 1}: {shape.message}"
            )
        return shape


def _tip(shape: Shape) -> np.ndarray:
    """Return position and direction (6,) of the tip."""
    return np.concatenate([shape.tip_position, shape.tip_direction])
