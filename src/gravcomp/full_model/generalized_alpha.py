"""Generalized-alpha time integration (Chung and Hulbert 1993).

    M a_(n+1-alpha_m) + (1 - alpha_f) g_(n+1) + alpha_f g_n = 0,     g = f_int - f_weight - H^T lambda,
    q_(n+1) = q_n + h v_n + h^2 ((1/2 - beta) a_n + beta a_(n+1)),   v_(n+1) = v_n + h ((1 - gamma) a_n + gamma a_(n+1)).

Second order and unconditionally stable. The spectral radius rho is the factor by which a step multiplies the highest
frequencies: 1 keeps them, 0 removes them. Unlike with implicit Euler, low frequencies are hardly damped.
"""

import dataclasses

import numpy as np

from gravcomp.config import parameter


@dataclasses.dataclass(frozen=True)
class DynamicsOptions:
    """Options of integration and damping."""

    time_step: float = parameter(10.0, edge="ms", minimum=0.01, maximum=100.0, description="longest time step of the integration")
    spectral_radius: float = parameter(0.9, minimum=0.0, maximum=1.0, description="factor of a step on the highest frequencies")
    damping: str = parameter(
        "kelvin_voigt",
        choices=("kelvin_voigt", "rayleigh"),
        description="objective damping by the materials' damping time, or alpha M + beta K as in the article",
    )
    rayleigh_mass: float = parameter(0.1, unit="1/s", minimum=0.0, maximum=1e4, description="alpha of Rayleigh damping")
    rayleigh_stiffness: float = parameter(0.1, unit="s", minimum=0.0, maximum=1e3, description="beta of Rayleigh damping")


@dataclasses.dataclass(frozen=True)
class GeneralizedAlpha:
    """Coefficients of the scheme for a step of h seconds."""

    h: float
    alpha_m: float
    alpha_f: float
    beta: float
    gamma: float

    @staticmethod
    def of(h: float, spectral_radius: float) -> "GeneralizedAlpha":
        """Return the optimal coefficients for a spectral radius."""
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
        """Return velocity and acceleration at the end of the step for an unchanged displacement."""
        after = -velocity / (self.beta * self.h) + (1.0 - 0.5 / self.beta) * acceleration
        return velocity + self.h * ((1.0 - self.gamma) * acceleration + self.gamma * after), after
