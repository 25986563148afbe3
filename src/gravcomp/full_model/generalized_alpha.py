"""Generalized-alpha time integration (Chung and Hulbert 1993).

    M a_(n+1-alpha_m) + (1 - alpha_f) g_(n+1) + alpha_f g_n = 0,     g = f_int - f_weight - H^T lambda,
    q_(n+1) = q_n + h v_n + h^2 ((1/2 - beta) a_n + beta a_(n+1)),   v_(n+1) = v_n + h ((1 - gamma) a_n + gamma a_(n+1)).

Second order, unconditionally stable; the spectral radius rho says how much of the highest frequencies is left after a
step: 1 keeps all, 0 none. Low frequencies are hardly damped, unlike by implicit Euler.
"""

import dataclasses

import numpy as np

from gravcomp.config import parameter


@dataclasses.dataclass(frozen=True)
class DynamicsOptions:
    """How motion is integrated and damped."""

    time_step: float = parameter(10.0, edge="ms", minimum=0.01, maximum=100.0, description="longest step of integration")
    spectral_radius: float = parameter(0.9, minimum=0.0, maximum=1.0, description="what a step leaves of the highest frequencies")
    damping: str = parameter(
        "kelvin_voigt",
        choices=("kelvin_voigt", "rayleigh"),
        description="objective damping by the materials' damping time, or alpha M + beta K as the article has it",
    )
    rayleigh_mass: float = parameter(0.1, unit="1/s", minimum=0.0, maximum=1e4, description="alpha of Rayleigh damping")
    rayleigh_stiffness: float = parameter(0.1, unit="s", minimum=0.0, maximum=1e3, description="beta of Rayleigh damping")


@dataclasses.dataclass(frozen=True)
class GeneralizedAlpha:
    """The scheme's coefficients for a step of h seconds."""

    h: float
    alpha_m: float
    alpha_f: float
    beta: float
    gamma: float

    @staticmethod
    def of(h: float, spectral_radius: float) -> "GeneralizedAlpha":
        """The optimal coefficients for a spectral radius."""
        alpha_m = (2.0 * spectral_radius - 1.0) / (spectral_radius + 1.0)
        alpha_f = spectral_radius / (spectral_radius + 1.0)
        return GeneralizedAlpha(h, alpha_m, alpha_f, 0.25 * (1.0 - alpha_m + alpha_f) ** 2, 0.5 - alpha_m + alpha_f)

    @property
    def velocity_rate(self) -> float:
        """dv/dq of the step in 1/s."""
        return self.gamma / (self.beta * self.h)

    @property
    def acceleration_rate(self) -> float:
        """da/dq of the step in 1/s^2."""
        return 1.0 / (self.beta * self.h**2)

    def predict(self, velocity: np.ndarray, acceleration: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Velocity and acceleration at the end of the step if the displacement stayed what it is."""
        after = -velocity / (self.beta * self.h) + (1.0 - 0.5 / self.beta) * acceleration
        return velocity + self.h * ((1.0 - self.gamma) * acceleration + self.gamma * after), after
