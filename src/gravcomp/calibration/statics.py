"""Predicted resting tips and their exact derivatives by modulus, cable offsets, cable compliance and winding ratio.

One model is enough for all moduli, because without inertia only ratios matter: with s = E_0 / E, the robot of modulus E under
gravity g has the shape of the robot of modulus E_0 under s g, with tensions lambda = lambda_0 / s and, for a cable of
compliance c, the elongation c lambda = (c / s) lambda_0. A cable that the motor displaces by u pulls the path in by w u + o - c
lambda, where o is its offset and w the winding ratio of all motors: it accounts for the real radius of the capstans and the
real distance of the cables from the axis.

Derivatives follow from the linear response of each shape (taut cables a): dtip/do = W_ea W_aa^-1, dtip/dc = -dtip/do lambda,
dtip/dw = dtip/do u. The derivative by the modulus is a difference quotient.
"""

from dataclasses import dataclass

import numpy as np

from gravcomp.calibration.measured import StillWindows
from gravcomp.description import Robot
from gravcomp.simulation import Shape, Simulator

_MODULUS_STEP = 1e-3


@dataclass(frozen=True)
class StaticParameters:
    """Parameters of the static fit: youngs_modulus in Pa; offset (m,) in m; compliance (m,) in m/N; winding: ratio w."""

    youngs_modulus: float
    offset: np.ndarray
    compliance: np.ndarray
    winding: float = 1.0


@dataclass(frozen=True)
class StaticPrediction:
    """Predictions for k windows.

    tip (k, 3) in m; its derivatives by_modulus (k, 3) in m/Pa, by_offset (k, 3, m), by_compliance (k, 3, m) in N, by_winding
    (k, 3) in m; tension (k, m) in N.
    """

    tip: np.ndarray
    by_modulus: np.ndarray
    by_offset: np.ndarray
    by_compliance: np.ndarray
    by_winding: np.ndarray
    tension: np.ndarray


class StaticPredictor:
    """Predicts the tips of a robot at rest in given windows."""

    def __init__(self, robot: Robot, windows: StillWindows):
        self.windows = windows
        self._simulator = Simulator(robot, reduced=False)
        self._modulus = self._simulator.model.mesh.materials[0].youngs_modulus

    def predict(self, parameters: StaticParameters) -> StaticPrediction:
        """Return the prediction for all windows. Raises RuntimeError if there is no equilibrium."""
        rows = [self._window(k, parameters) for k in range(len(self.windows.tip_position))]
        return StaticPrediction(*(np.array(column) for column in zip(*rows)))

    def _window(self, k: int, parameters: StaticParameters) -> tuple:
        """Return window k's entries of a StaticPrediction."""
        shape = self._solve(k, parameters, parameters.youngs_modulus)
        ahead = self._solve(k, parameters, parameters.youngs_modulus * (1.0 + _MODULUS_STEP))
        by_modulus = (ahead.tip_position - shape.tip_position) / (_MODULUS_STEP * parameters.youngs_modulus)
        similarity = self._modulus / parameters.youngs_modulus
        tension = shape.cable_tension / similarity
        taut = shape.cable_tension > 0.0
        by_offset = np.zeros((3, len(taut)))
        if taut.any():
            response = shape.response
            own = response.compliance_aa[np.ix_(taut, taut)]
            by_offset[:, taut] = np.linalg.solve(own.T, response.compliance_ea[:3, taut].T).T
        by_winding = by_offset @ np.nan_to_num(self.windows.displacement[k])
        return shape.tip_position, by_modulus, by_offset, -by_offset * tension, by_winding, tension

    def _solve(self, k: int, parameters: StaticParameters, modulus: float) -> Shape:
        """Return the shape in window k at a modulus in Pa."""
        similarity = self._modulus / modulus
        self._simulator.model.tendons.axial_compliance = parameters.compliance / similarity
        displacement = parameters.winding * self.windows.displacement[k] + parameters.offset
        shape = self._simulator.step(similarity * self.windows.gravity[k], displacement)
        if shape.status != 0:
            raise RuntimeError(f"no equilibrium at {modulus * 1e-6:.3g} MPa in window {k + 1}: {shape.message}")
        return shape
