"""What the controller of a ros2_control robot is sent: angles that follow the setpoints, or efforts of position loops.

    trajectory, position:   q = angle of the setpoint; the controller of the robot closes the loop
    effort:                 tau = d r F,  F the force of the loop of `loop`

A controller of efforts keeps the last one. So the loops of efforts become softer as the measured states become older and the
messages to the controller rarer (`loop_delay`). Of an effort that answers an old state, or that stays for long, the force that
the model expects is left, under which a robot of springs comes to rest by itself.

The backlash is taken up as over CAN (`take_up`), but by the way of the setpoints: joint states may be late, and how exactly a
controller comes to rest is not known.
"""

import dataclasses
from collections.abc import Sequence

import numpy as np

from gravcomp.description.hardware import Drive, Watchdog
from gravcomp.motors.joint_states import JointStates
from gravcomp.motors.loop import REST_COUNTS, PositionLoop
from gravcomp.motors.loop_delay import LoopDelay
from gravcomp.motors.monitor import MotorMonitor
from gravcomp.motors.setpoint import Setpoint
from gravcomp.motors.take_up import TakeUp, act_together, targets_to_hold

_AWAY = 0.1  # of the following error, at rest away from the setpoint
_AWAY_TIME = 4.0  # stall times
_STAY = 1.0 / 3.0  # of the take-up's time, in which a joint comes to where its setpoint already is


class JointLoops:
    """Setpoints, or position loops, of the joints of `states`.

    pays_out (k,): motors that only pay out when they turn back; delay: with efforts, the smallest delay (s) of the loops that
    counts, None: what is measured. Attributes: target (k,) m at the capstans; delays (k,), of the loops of efforts.
    """

    def __init__(
        self, states: JointStates, watchdog: Watchdog, pays_out: np.ndarray, *, by_effort: bool, delay: float | None = None
    ):
        self._states, self._watchdog, self._pays_out, self._by_effort = states, watchdog, pays_out, by_effort
        drives = [scale.drive for scale in states.scales]
        self._drives: list[Drive] = drives
        self.delays = [LoopDelay(delay) for _ in drives]
        self._setpoints = [Setpoint(drive.acceleration_limit) for drive in drives]
        self._loops = [PositionLoop(drive, two_way=not alone) for drive, alone in zip(drives, pays_out)]
        self._monitors = [MotorMonitor(drive, watchdog) for drive in drives]
        self._take_up: list[TakeUp | None] = [None] * len(drives)
        self._away = [0.0] * len(drives)  # s, for which each joint has been at rest away from its setpoint
        self.target, self._tension = [0.0] * len(drives), [0.0] * len(drives)
        self._resting = True

    @property
    def arrived(self) -> bool:
        """Whether every setpoint is on its target."""
        return self._positions() == self.target

    def limits(self) -> list[tuple[float, float]]:
        """Smallest and largest displacement (m) of each motor."""
        return [scale.limits() for scale in self._states.scales]

    def reset(self) -> None:
        """Start at rest at the measured displacements, within the limits."""
        self._resting = False
        start = [min(max(x, low), high) for x, (low, high) in zip(self._states.displacement(), self.limits())]
        for setpoint, loop, displacement in zip(self._setpoints, self._loops, start):
            setpoint.reset(displacement)
            loop.reset(displacement)
        for monitor in self._monitors:
            monitor.reset()
        # The limits count from here on, when the zero positions are known. Antagonists are on both flanks of their gear.
        self._take_up = [
            TakeUp(
                dataclasses.replace(drive, displacement_min=low),
                REST_COUNTS * drive.travel_per_count,
                _STAY * drive.take_up_time,
            )
            if alone
            else None
            for drive, alone, (low, _) in zip(self._drives, self._pays_out, self.limits())
        ]
        self._away = [0.0] * len(self._away)

    def follow(self, displacement: Sequence[float], tension: Sequence[float]) -> None:
        """Set targets (m), clamped to the limits, and expected forces (N; none: 0)."""
        self.target = [min(max(x, low), high) for x, (low, high) in zip(displacement, self.limits())]
        self._tension = list(tension) or [0.0] * len(self.target)

    def hold(self) -> None:
        """Keep the cables where their setpoints are now; the expected tensions stay."""
        self.target = targets_to_hold(self.target, self._take_up, self._positions())

    def pay_out(self) -> None:
        """Move all cables to the smallest displacement; motors with antagonists go to zero, where no cable is pulled in."""
        self.follow([low if alone else 0.0 for alone, (low, _) in zip(self._pays_out, self.limits())], [])

    def no_current(self) -> None:
        """Command no effort; joints away from their setpoints are led to where they are, if that is near, and left there."""
        if self._by_effort or self._resting:
            return
        self._resting = True
        near = self._watchdog.following_error
        self.target = [
            s if abs(x - s) <= _AWAY * near else min(max(x, low, s - near), high, s + near)
            for x, s, (low, high) in zip(self._states.displacement(), self._positions(), self.limits())
        ]

    def rest(self, dt: float) -> list[float] | None:
        """Return what the controller is sent while the motors are not driven, None for nothing."""
        if self._by_effort:
            for delay in self.delays:
                delay.pause()
            return [0.0] * len(self.target)
        if self.arrived:
            return None
        return self._angles(self.target, [None] * len(self.target), dt)

    def drive(self, now: float, dt: float) -> tuple[list[float], str | None]:
        """Return what the controller is sent in a control period of `dt` s, and the fault of a motor, or None."""
        displacement, velocity, force = self._states.displacement(), self._states.velocity(), self._states.force()
        seen = self._states.times()
        goals, limits = self._goals(displacement, dt)
        if self._by_effort:
            for loop, delay, measured in zip(self._loops, self.delays, seen):
                loop.softness = delay.update(now, measured)
            wanted = [
                loop.step(goal, tension, x, v, dt, limit)
                for loop, goal, limit, tension, x, v in zip(self._loops, goals, limits, self._tension, displacement, velocity)
            ]
            output = [
                self._states.effort(i, current * drive.tension_per_ampere)
                for i, (current, drive) in enumerate(zip(wanted, self._drives))
            ]
        else:
            output = self._angles(goals, limits, dt)
            wanted = [0.0 if f is None else f / drive.tension_per_ampere for f, drive in zip(force, self._drives)]
        for i, (x, v, setpoint) in enumerate(zip(displacement, velocity, self._positions())):
            fault = self._monitors[i].update(seen[i], wanted[i], v, setpoint - x) or self._left_behind(i, dt, setpoint - x, v)
            if fault:
                return output, f"{self._states.motors[i].label} {fault}"
        return output, None

    def _positions(self) -> list[float]:
        return [part.setpoint for part in self._loops] if self._by_effort else [part.position for part in self._setpoints]

    def _goals(self, displacement: Sequence[float], dt: float) -> tuple[list[float], list[float | None]]:
        """Return where each motor goes now on its way to its target (m), and how fast at most (m/s; None: the drive's limit)."""
        goals = list(self.target)
        limits: list[float | None] = [None] * len(goals)
        act_together(self._take_up)
        for i, (take_up, position) in enumerate(zip(self._take_up, self._positions())):
            if take_up is not None:
                goals[i], limits[i] = take_up.step(self.target[i], displacement[i], dt, position)
        return goals, limits

    def _angles(self, goals: Sequence[float], limits: Sequence[float | None], dt: float) -> list[float]:
        result = []
        for setpoint, goal, limit, drive, scale in zip(self._setpoints, goals, limits, self._drives, self._states.scales):
            setpoint.advance(goal, drive.velocity_limit if limit is None else limit, dt)
            result.append(scale.angle(setpoint.position))
        return result

    def _left_behind(self, index: int, dt: float, lag: float, velocity: float) -> str | None:
        """Detect a joint that rests away from its setpoint: a controller that refuses, or is not active."""
        watchdog, drive = self._watchdog, self._drives[index]
        resting = abs(lag) > _AWAY * watchdog.following_error and abs(velocity) < _AWAY * drive.velocity_limit
        self._away[index] = self._away[index] + dt if resting else 0.0
        if self._by_effort or self._away[index] <= _AWAY_TIME * watchdog.stall_time:
            return None
        return f"rests {1e3 * abs(lag):.1f} mm away from its setpoint: does its controller take the commands?"
