"""C610 speed controllers, M2006 motors, gears with backlash and capstans: from currents to wound-in cable.

Angles and torques are positive in the direction that winds the cable in. At the rotor:

    J dw/dt = k_t i - b w - F / N r - friction,    di/dt = (i_commanded - i) / lag

with the gear ratio N, the radius r of the capstan and the force F there: the sum of the forces of the motor's cables, each times
its ratio. Coulomb friction (a constant part and a part proportional to the load) removes at most the existing momentum, so a
rotor at rest stays at rest. The capstan has no inertia of its own: while the cable is taut it lies on the flank that winds in;
inside the backlash it stays where it is while its drag is larger than the torque of the cables. An antagonist that pulls more
draws it to the other flank.

The speed controller keeps the last current that it received; there is no timeout.
"""

import math

import numpy as np
from numba import njit

from gravcomp.canbus.c610 import LARGEST_CURRENT
from gravcomp.description.hardware import COUNTS_PER_TURN, Hardware
from gravcomp.virtual.true_robot import TrueMotors

TICK = 0.5e-3  # s
_DRAWS = 4  # moves of a capstan in its backlash; one more than cables that become slack or taut on the way


class MotorBank:
    """The k motors of m cables."""

    def __init__(self, true: TrueMotors, hardware: Hardware, slack: np.ndarray, random: np.random.Generator):
        """slack (m,) m: length of cable beyond the unloaded robot's at the start. Each rotor starts at a random angle."""
        k = len(hardware.motors)
        self._true, self._random = true, random
        self._ratio = hardware.drive.gear_ratio
        self._direction = np.array([motor.direction for motor in hardware.motors])
        self._start_count = random.integers(0, COUNTS_PER_TURN, k)
        self._matrix = np.ascontiguousarray(hardware.transmission.matrix)
        self._longer = slack - hardware.transmission.preload  # m, by which each cable is longer than its path at the start
        # On the flank that winds in, where homing, which ends at a taut cable, leaves the zero. Of antagonists none is the one.
        self._rotor = 0.5 * true.backlash * self._ratio * hardware.transmission.pays_out
        self._speed, self._capstan = np.zeros(k), np.zeros(k)
        self._current = np.zeros(k)
        self.commanded = np.zeros(k)  # A, as last received, positive as the motor counts
        self.stalled = np.zeros(k, dtype=bool)  # rotors that are blocked

    @property
    def wound(self) -> np.ndarray:
        """Length (m,) m of cable wound in; 0: the cable has exactly the length of its path in the unloaded robot."""
        return self._matrix @ (self._capstan * self._true.capstan_radius) - self._longer

    @property
    def rotor_speed(self) -> np.ndarray:
        """Speeds (k,) rpm of the rotors."""
        return self._speed * (60.0 / (2.0 * math.pi))

    def step(self, ticks: int, shortened: np.ndarray, spring: np.ndarray) -> None:
        """Advance by `ticks` of TICK s; cables are springs of `spring` (m,) N/m, slack up to displacements `shortened` (m,) m."""
        true, p = self._true, self._true.common
        _step(
            ticks,
            self._rotor,
            self._speed,
            self._capstan,
            self._current,
            self.commanded,
            self._direction,
            self.stalled,
            shortened + self._longer,
            spring,
            self._matrix,
            true.torque_constant / self._ratio,
            p.rotor_inertia,
            p.friction_torque,
            true.load_friction,
            p.viscous_friction,
            p.no_load_speed,
            true.backlash,
            p.capstan_drag,
            true.capstan_radius,
            self._ratio,
            1.0 - math.exp(-TICK / p.current_lag),
        )

    def jump(self, motors: np.ndarray) -> None:
        """Shift the encoders of `motors` (k,) bool by a third of a turn, as when a magnet has slipped."""
        self._start_count = np.where(motors, self._start_count + COUNTS_PER_TURN // 3, self._start_count)

    def feedback(self) -> list[dict[str, float]]:
        """Return angle (counts), speed (rpm) and current (A) as the C610 of each motor sends them."""
        noise = self._true.common.current_noise * self._random.standard_normal(len(self._rotor))
        values = _feedback(self._rotor, self._speed, self._current, self._direction, self._start_count, noise)
        return [{"angle": int(angle), "speed": speed, "current": current} for angle, speed, current in values.tolist()]


@njit(cache=True, error_model="numpy")
def _feedback(
    rotor: np.ndarray, speed: np.ndarray, current: np.ndarray, direction: np.ndarray, start_count: np.ndarray, noise: np.ndarray
) -> np.ndarray:
    """Return (m, 3): angle in counts, speed in rpm, current in A."""
    values = np.empty((rotor.shape[0], 3))
    for c in range(rotor.shape[0]):
        count = math.floor(direction[c] * rotor[c] / (2 * math.pi) * COUNTS_PER_TURN) + start_count[c]
        values[c, 0] = count % COUNTS_PER_TURN
        values[c, 1] = min(32767.0, max(-32768.0, np.rint(direction[c] * speed[c] * (60 / (2 * math.pi)))))
        values[c, 2] = min(32.0, max(-32.0, direction[c] * current[c] + noise[c]))
    return values


@njit(cache=True, error_model="numpy")
def _step(
    ticks: int,
    rotor: np.ndarray,
    speed: np.ndarray,
    capstan: np.ndarray,
    current: np.ndarray,
    commanded: np.ndarray,
    direction: np.ndarray,
    stalled: np.ndarray,
    offset: np.ndarray,
    spring: np.ndarray,
    matrix: np.ndarray,
    torque_constant: np.ndarray,
    inertia: float,
    friction: float,
    load_friction: np.ndarray,
    viscous: float,
    no_load_speed: float,
    backlash: np.ndarray,
    drag: float,
    capstan_radius: np.ndarray,
    ratio: float,
    current_gain: float,
) -> None:
    wound = np.empty(matrix.shape[0])
    for _ in range(ticks):
        for i in range(matrix.shape[0]):
            wound[i] = 0.0
            for j in range(matrix.shape[1]):
                wound[i] += capstan_radius[j] * matrix[i, j] * capstan[j]
        for c in range(rotor.shape[0]):
            half, radius = 0.5 * backlash[c], capstan_radius[c]
            command = direction[c] * min(LARGEST_CURRENT, max(-LARGEST_CURRENT, commanded[c]))
            current[c] += current_gain * (command - current[c])
            # The back-EMF limits the current, the more the faster the rotor turns in the direction of the current.
            room = LARGEST_CURRENT * max(0.0, 1.0 - speed[c] * (1.0 if current[c] > 0.0 else -1.0) / no_load_speed)
            current[c] = min(room, max(-room, current[c]))
            torque, _ = _cable_torque(c, 0.0, wound, offset, spring, matrix, radius)
            at_flank = (
                rotor[c] / ratio - capstan[c] >= half - 1e-9 if torque > 0.0 else capstan[c] - rotor[c] / ratio >= half - 1e-9
            )
            load = torque / ratio if at_flank else 0.0
            if stalled[c]:
                speed[c] = 0.0
            else:
                drive = torque_constant[c] * current[c] - viscous * speed[c] - load
                momentum = inertia * speed[c] + TICK * drive
                loss = TICK * (friction + load_friction[c] * abs(load))
                momentum = max(0.0, momentum - loss) if momentum > 0.0 else min(0.0, momentum + loss)
                speed[c] = momentum / inertia
                rotor[c] += TICK * speed[c]
            output = rotor[c] / ratio
            # Inside the backlash the cables pull the capstan until the drag holds it.
            before = capstan[c]
            capstan[c] = min(output + half, max(output - half, before))
            for _ in range(_DRAWS):
                torque, stiffness = _cable_torque(c, capstan[c] - before, wound, offset, spring, matrix, radius)
                excess = max(0.0, torque - drag) + min(0.0, torque + drag)
                if excess == 0.0 or stiffness == 0.0:
                    break
                capstan[c] = min(output + half, max(output - half, capstan[c] - excess / stiffness))


@njit(cache=True, error_model="numpy")
def _cable_torque(
    motor: int, turned: float, wound: np.ndarray, offset: np.ndarray, spring: np.ndarray, matrix: np.ndarray, radius: float
) -> tuple[float, float]:
    """Return the torque in N m of its cables on a capstan that has turned by `turned` rad since `wound`, and its derivative."""
    torque, stiffness = 0.0, 0.0
    for i in range(matrix.shape[0]):
        arm = radius * matrix[i, motor]
        stretch = wound[i] + arm * turned - offset[i]
        if arm != 0.0 and stretch > 0.0:
            torque += arm * spring[i] * stretch
            stiffness += arm * arm * spring[i]
    return torque, stiffness
