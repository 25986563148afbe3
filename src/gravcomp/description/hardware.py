"""The section `hardware:` of a robot file: CAN bus, motors, homing and watchdog as data.

    hardware:
      can: {interface: socketcan, channel: can0}
      drive: {capstan_radius_mm: 5, ...}           # the same for every motor
      motors:
        - {cable: s1c1, can_id: 1, direction: 1}

    hardware:                                      # more than eight motors: buses with names
      buses: [{name: left, channel: can0}, {name: right, channel: can1}]
      motors:
        - {cable: c0, can_id: 1, bus: left}
        - {cable: c1, pair: c3, can_id: 1, bus: right}   # an antagonistic pair on one motor

Instead of C610 on CAN buses, the motors may be joints of a ros2_control robot (`joints`, see `joint_motors`).

Cable displacement [m] is positive when pulled in:  displacement = direction x rotor turns / gear_ratio x 2 pi capstan_radius.
"""

import dataclasses
import functools
import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from gravcomp.config import ConfigError, from_mapping, parameter
from gravcomp.description.can_buses import CanBus, CanInterface
from gravcomp.description.drive import COUNTS_PER_TURN, LEAST_RISE, Drive, Homing, Watchdog
from gravcomp.description.joint_motors import Joints
from gravcomp.description.motor import MOTOR_IDS, CableMotor, Motor
from gravcomp.description.transmission import Transmission

__all__ = [
    "COUNTS_PER_TURN", "MOTOR_IDS", "CanBus", "CanInterface", "Drive", "Hardware", "Homing", "Joints", "Motor",
    "Watchdog", "parse_hardware",
]  # fmt: skip


@dataclasses.dataclass(frozen=True)
class Hardware:
    """CAN buses, motors, homing and watchdog.

    With one motor a cable, the motors are in the order of the cables. `order`: names of the cables in the robot's order, where
    motors are shared; `parse_hardware` fills it.
    """

    motors: tuple[Motor, ...] = parameter(description="motors; with one a cable, in the order of robot.cables")
    can: CanInterface = dataclasses.field(default_factory=CanInterface)
    drive: Drive = dataclasses.field(default_factory=Drive)
    homing: Homing = dataclasses.field(default_factory=Homing)
    watchdog: Watchdog = dataclasses.field(default_factory=Watchdog)
    buses: tuple[CanBus, ...] = parameter((), description="named buses, instead of can; each carries up to eight motors")
    imu_bus: str | None = parameter(None, description="name of the bus of the IMU board; the first when not given")
    order: tuple[str, ...] = parameter((), description="order of the cables where motors are shared; that of robot.cables")
    joints: Joints | None = parameter(None, description="joints of a ros2_control robot that wind the cables, for joint_bridge")

    def __post_init__(self) -> None:
        if not self.motors:
            raise ValueError(f"0 motors; allowed: 1 to {len(MOTOR_IDS)} on a bus")
        self._check_buses()
        self._check_cables()
        if self.buses:
            object.__setattr__(self, "can", self.board_bus)

    def _check_buses(self) -> None:
        names = [bus.name for bus in self.buses]
        for index, name in enumerate(names):
            if not name.strip():
                raise ValueError(f"buses[{index}].name is empty; every bus needs a name")
        _refuse_twice("bus", "name", names)
        _refuse_twice("bus", "interface and channel", [f"{bus.interface} {bus.channel}" for bus in self.buses])
        allowed = ", ".join(names) or "none (hardware.buses is not given)"
        if self.imu_bus is not None and self.imu_bus not in names:
            raise ValueError(f"imu_bus is '{self.imu_bus}'; allowed: {allowed}")
        for index, motor in enumerate(self.motors):
            if motor.bus is None and len(names) > 1:
                raise ValueError(f"motors[{index}].bus is missing; allowed: {allowed}")
            if motor.bus is not None and motor.bus not in names:
                raise ValueError(f"motors[{index}].bus is '{motor.bus}'; allowed: {allowed}")
        for index, bus in enumerate(self.all_buses):
            ids = [str(motor.can_id) for motor in self.motors if self.bus_index(motor) == index]
            where = f" on bus '{bus.name}'" if self.buses else ""
            if len(ids) > len(MOTOR_IDS):
                more = "" if self.buses else "; more motors need more buses (hardware.buses, and `bus` of each motor)"
                raise ValueError(f"{len(ids)} motors{where}; allowed: 1 to {len(MOTOR_IDS)} on a bus{more}")
            twice = sorted({can_id for can_id in ids if ids.count(can_id) > 1})
            if twice:
                raise ValueError(
                    f"can_id {', '.join(twice)} is given to more than one motor{where}; several cables of one motor are one"
                    " entry, with `pair` or `also`"
                )

    def _check_cables(self) -> None:
        named = _cables_of(self.motors)
        if self.order and sorted(self.order) != sorted(named):
            raise ValueError(f"order names the cables {', '.join(self.order)}; the motors have {', '.join(named)}")
        _refuse_equal_effects(self.transmission)
        if self.joints is None:
            return
        wound = _cables_of(self.joints.motors)
        if sorted(wound) != sorted(named):
            raise ValueError(f"joints.motors wind the cables {', '.join(wound)}; the robot has {', '.join(named)}")
        _refuse_equal_effects(self.joint_transmission)

    @functools.cached_property
    def all_buses(self) -> tuple[CanBus, ...]:
        """The buses: those with names, or the only one, whose name is empty."""
        return self.buses or (CanBus(name="", **{f.name: getattr(self.can, f.name) for f in dataclasses.fields(CanInterface)}),)

    def bus_index(self, motor: Motor) -> int:
        """Return the index of the motor's bus in `all_buses`."""
        return 0 if motor.bus is None else [bus.name for bus in self.buses].index(motor.bus)

    @property
    def board_bus(self) -> CanBus:
        """The bus of the IMU board."""
        return next((bus for bus in self.all_buses if bus.name == self.imu_bus), self.all_buses[0])

    @property
    def weakest_tension(self) -> float:
        """Tension (N) that every motor gives each of its cables at the current limit, without friction."""
        ratio = max(abs(value) for motor in self.motors for value in motor.ratios.values())
        return self.drive.current_limit * self.drive.tension_per_ampere / ratio

    @property
    def strong_homing(self) -> str:
        """Why homing would pull too much, as a sentence; empty where it would not, or where no largest tension is known."""
        homing, ratio = self.homing, min(motor.ratio for motor in self.motors)
        pull = homing.current_rise * self.drive.tension_per_ampere / ratio
        if homing.tension_max is None or pull <= homing.tension_max:
            return ""
        rise = math.floor(1e4 * homing.current_rise * homing.tension_max / pull) * 1e-4
        larger = f"; hardware.homing.current_rise may be {rise:.2g} A at most" if rise >= LEAST_RISE else ""
        capstan = "A larger capstan lets the current show smaller tensions"
        if self.drive.capstan_assumed:
            capstan = (
                f"The capstans of {1e3 * self.drive.capstan_radius:.3g} mm are assumed: give the radius of yours"
                " (hardware.drive.capstan_radius_mm); the virtual robot needs no homing"
            )
        return (
            f"no homing: it would pull a cable with {pull:.3g} N before it counts as taut, and {homing.tension_max:g} N are"
            f" allowed{larger}. {capstan}; or hold the robot straight with its cables just taut and start with zero: start"
        )

    @property
    def cables(self) -> tuple[str, ...]:
        """Names of the cables in their order."""
        return self.order or tuple(dict.fromkeys(cable for motor in self.motors for cable in motor.ratios))

    @functools.cached_property
    def transmission(self) -> Transmission:
        """The way from motors to cables."""
        return Transmission(self.motors, self.cables)

    @functools.cached_property
    def joint_transmission(self) -> Transmission:
        """The way from `joints.motors` to cables. Raises ValueError without `joints`."""
        if self.joints is None:
            raise ValueError("the hardware has no joints")
        return Transmission(self.joints.motors, self.cables)

    def on(self, interface: str, channel: str) -> "Hardware":
        """Return the hardware on other buses: an interface for all, and channels by commas, one a bus; empty: as described.

        Raises ConfigError for another number of channels.
        """
        channels = [part.strip() for part in channel.split(",")] if channel else []
        if channels and len(channels) != len(self.all_buses):
            names = ", ".join(bus.name for bus in self.all_buses)
            one_each = f"one each for the buses {names}, separated by commas" if self.buses else "one"
            raise ConfigError(f"channel is '{channel}', {len(channels)} channels; needed: {one_each}")
        given: list[dict[str, Any]] = [
            {key: value for key, value in (("interface", interface), ("channel", own)) if value}
            for own in channels or [""] * len(self.all_buses)
        ]
        if not self.buses:
            return dataclasses.replace(self, can=dataclasses.replace(self.can, **given[0]))
        return dataclasses.replace(self, buses=tuple(dataclasses.replace(bus, **new) for bus, new in zip(self.buses, given)))


def parse_hardware(section: Any, *, source: str, cables: tuple[str, ...] | None = None) -> Hardware:
    """Read the section `hardware` of the file `source`.

    `cables` are the names of the robot's cables in their order; None skips the comparison with the motors.
    Raises ConfigError when a value is wrong or the motors do not have these cables; with one motor a cable, in this order.
    """
    if isinstance(section, Mapping) and "can" in section and section.get("buses"):
        raise ConfigError(f"{source}: hardware.can and hardware.buses are both given; allowed: one of them")
    hardware = from_mapping(Hardware, section, source=source, key="hardware")
    if cables is None:
        return hardware
    shared = not hardware.transmission.direct
    if shared and sorted(hardware.cables) == sorted(cables):
        return dataclasses.replace(hardware, order=tuple(cables))
    if hardware.cables != tuple(cables):
        raise ConfigError(
            f"{source}: hardware.motors are for the cables {', '.join(hardware.cables)}; "
            f"needed{'' if shared else ', in this order'}: {', '.join(cables)}"
        )
    return hardware


def _cables_of(motors: Sequence[CableMotor]) -> list[str]:
    """Return the names of the cables that motors move. Raises ValueError for one that is given to several without a need."""
    named: dict[str, list[CableMotor]] = {}
    for motor in motors:
        for cable in motor.ratios:
            named.setdefault(cable, []).append(motor)
    for cable, own in named.items():
        if len(own) > 1 and not all(motor.differential for motor in own):
            raise ValueError(
                f"cable {cable} is given to more than one motor: {', '.join(m.label for m in own)};"
                " a differential needs `differential: true` at each of them"
            )
    return list(named)


def _refuse_equal_effects(transmission: Transmission) -> None:
    if np.linalg.matrix_rank(transmission.matrix) < transmission.matrix.shape[1]:
        raise ValueError("two motors move the same cables with the same ratios; each motor needs an effect of its own")


def _refuse_twice(what: str, key: str, values: list[str]) -> None:
    twice = sorted({value for value in values if values.count(value) > 1})
    if twice:
        raise ValueError(f"buses: {key} {', '.join(repr(value) for value in twice)} is given to more than one {what}")
