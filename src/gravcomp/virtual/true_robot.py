"""What the virtual robot truly is: the description with true materials and cable places, and what it does not have."""

from dataclasses import dataclass

import numpy as np

from gravcomp.description import Robot
from gravcomp.materials.material_classes import MaterialClass
from gravcomp.virtual.parameters import Board, Motors


@dataclass(frozen=True)
class TrueMaterial:
    """Behaviour of one segment's material over time. None: from `kind` and the rod, see `build_material`."""

    kind: MaterialClass
    creep_ratio: tuple[float, ...]
    creep_time: tuple[float, ...]  # s
    damping_time: float | None  # s
    damping_factor: float  # on the damping of `kind`
    slip_ratio: float
    slip_curvature: float | None  # 1/m
    slip_strain: float  # of the outer fibre, where the curvature is not given


@dataclass(frozen=True)
class TrueCables:
    """Lines of m cables, in their order."""

    axial_stiffness: np.ndarray  # (m,) N, E A
    free_length: np.ndarray  # (m,) m, between capstan and robot
    friction: np.ndarray  # (m,) capstan friction coefficient
    guide_angle: np.ndarray  # (m,) rad, by which each is bent between capstan and robot
    presliding: float  # m
    slack: np.ndarray  # (m,) m at the start


@dataclass(frozen=True)
class TrueMotors:
    """Motors, one value for each."""

    torque_constant: np.ndarray  # N m/A
    capstan_radius: np.ndarray  # m
    backlash: np.ndarray  # rad
    load_friction: np.ndarray
    common: Motors  # what is the same for all


@dataclass(frozen=True)
class TrueRobot:
    """One robot as it truly is.

    robot: the description with true moduli, densities and cable places; materials: one for each segment, or for the body from a
    file; element_length (m): of the rod; drawn: what the seed decided, in words, by name.
    """

    robot: Robot
    materials: tuple[TrueMaterial, ...]
    cables: TrueCables
    motors: TrueMotors
    board: Board
    element_length: float
    seed: int
    drawn: dict[str, str]

    def materials_in_words(self) -> str:
        """Return long-term modulus and creep of each segment's material."""
        words = [
            f"{described.youngs_modulus * 1e-6:.4g} MPa in the long term, creep"
            f" {tuple(round(value, 4) for value in material.creep_ratio)} over {material.creep_time} s"
            for described, material in zip(self.robot.materials, self.materials)
        ]
        return "; ".join(dict.fromkeys(words))

    def summary(self) -> str:
        """Return the seed and what it decided, in one sentence."""
        if not self.drawn:
            return f"virtual robot, seed {self.seed}: all its true values are given"
        return f"virtual robot, seed {self.seed}: " + "; ".join(f"{name} {value}" for name, value in self.drawn.items())
