"""C610 speed controllers, M2006 motors, gears with backlash and capstans: from currents to wound-in cable.

Angles and torques are positive in the direction that winds the cable in. At the rotor:

    J dw/dt = k_t i - b w - F / N r - friction,    di/dt = (i_commanded - i) / lag

with the force F of the cable, the gear ratio N and the radius r of the capstan. Coulomb friction (a constant part and a part
proportional to the load) removes at most the existing momentum, so a rotor at rest stays at rest. The capstan has no inertia of
its own: while the cable is taut it lies on the flank that winds in; inside the backlash it stays where it is while its drag is
larger than the torque of the cable.

The speed controller keeps the last current that it received; there is no timeout.
"""

import math

import numpy as np
from numba import njit

from gravcomp.canbus.c610 import LARGEST_CURRENT
from gravcomp.description.hardware import COUNTS_PER_TURN, Hardware
from gravcomp.virtual.parameters import Motors

TICK = 0.5e-3  # s


class MotorBank:
    """The m motors in the order of the cables."""

    def __init__(self, parameters: Motors, hardware: Hardware, slack: np.ndarray, random: np.random.Generator):
        """slack (m,) m: length of cable beyond the straight robot's at the start. Each rotor starts at a random angle."""
        m = len(hardware.motors)
        self._parameters, self._random = parameters, random
        self._ratio = hardware.drive.gear_ratio
        self._direction = np.array([motor.direction for motor in hardware.motors])
        self._start_count = random.integers(0, COUNTS_PER_TURN, m)
        self._slack = slack
        self._rotor, self._speed, self._capstan = np.zeros(m), np.zeros(m), np.zeros(m)
        self._current = np.zeros(m)
        self.commanded = np.zeros(m)  # A, as last received, positive as the motor counts
        self.stalled = np.zeros(m, dtype=bool)  # rotors that are blocked

    @property
    def wound(self) -> np.ndarray:
        """Length (m,) m of cable wound in; 0: the cable has exactly the length of its path in the straight robot."""
        return self._capstan * self._parameters.capstan_radius - self._slack

    def step(self, ticks: int, shortened: np.ndarray, spring: np.ndarray) -> None:
        """Advance by `ticks` of TICK s; cables are springs of `spring` (m,) N/m, slack at displacements up to `shortened` (m,) m."""
        p = self._parameters
        _step(
            ticks,
            self._rotor,
            self._speed,
            self._capstan,
            self._current,
            self.commanded,
            self._direction,
            self.stalled,
            shortened,
            self._slack,
            spring,
            p.torque_constant / self._ratio,
            p.rotor_inertia,
            p.friction_torque,
            p.load_friction,
            p.viscous_friction,
            p.no_load_speed,
            p.backlash,
            p.capstan_drag,
            p.capstan_radius,
            self._ratio,
            1.0 - math.exp(-TICK / p.current_lag),
        )

    def jump(self, motors: np.ndarray) -> None:
        """Shift the encoders of `motors` (m,) bool by a third of a turn, as when a magnet has slipped."""
        self._start_count = np.where(motors, self._start_count + COUNTS_PER_TURN // 3, self._start_count)

    def feedback(self) -> list[dict[str, float]]:
        """Return angle (counts), speed (rpm) and current (A) as the C610 of each motor sends them."""
        noise = self._parameters.current_noise * self._random.standard_normal(len(self._rotor))
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
    shortened: np.ndarray,
    slack: np.ndarray,
    spring: np.ndarray,
    torque_constant: float,
    inertia: float,
    friction: float,
    load_friction: float,
    viscous: float,
    no_load_speed: float,
    backlash: float,
    drag: float,
    radius: float,
    ratio: float,
    current_gain: float,
) -> None:
    half = 0.5 * backlash
    for c in range(rotor.shape[0]):
        command = direction[c] * min(LARGEST_CURRENT, max(-LARGEST_CURRENT, commanded[c]))
        offset = shortened[c] + slack[c]
        for _ in range(ticks):
            current[c] += current_gain * (command - current[c])
            # The back-EMF limits the current, the more the faster the rotor turns in the direction of the current.
            room = LARGEST_CURRENT * max(0.0, 1.0 - speed[c] * (1.0 if current[c] > 0.0 else -1.0) / no_load_speed)
            current[c] = min(room, max(-room, current[c]))
            force = spring[c] * max(0.0, radius * capstan[c] - offset)
            at_flank = rotor[c] / ratio - capstan[c] >= half - 1e-9
            load = force * radius / ratio if at_flank else 0.0
            if stalled[c]:
                speed[c] = 0.0
            else:
                drive = torque_constant * current[c] - viscous * speed[c] - load
                momentum = inertia * speed[c] + TICK * drive
                loss = TICK * (friction + load_friction * load)
                momentum = max(0.0, momentum - loss) if momentum > 0.0 else min(0.0, momentum + loss)
                speed[c] = momentum / inertia
                rotor[c] += TICK * speed[c]
            output = rotor[c] / ratio
            # Inside the backlash the cable pulls the capstan out until the drag holds it.
            held = offset / radius + (drag / (spring[c] * radius * radius) if spring[c] > 0.0 else 1e9)
            drawn = min(capstan[c], max(held, output - half))
            capstan[c] = min(output + half, max(output - half, drawn))
