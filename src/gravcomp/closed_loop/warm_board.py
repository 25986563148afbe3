"""The temperatures at which a run starts: a board that has been on for long, in its surroundings."""

import dataclasses

from gravcomp.closed_loop.setup import Setup
from gravcomp.thermal import HeaterControl
from gravcomp.thermal.plant import ThermalPlantOptions
from gravcomp.virtual.parameters import VirtualRobotParameters


def with_warm_board(setup: Setup) -> VirtualRobotParameters:
    """Return the parameters of the virtual robot whose board starts at the target temperature of the heater."""
    heater, thermal, truth = setup.estimator.heater, true_thermal(setup), setup.truth
    target = thermal.ambient + heater.rise if heater.target is None else heater.target
    thermal = dataclasses.replace(thermal, start=target)
    return dataclasses.replace(truth, board=dataclasses.replace(truth.board, thermal=thermal))


def warm_heater(setup: Setup) -> HeaterControl:
    """Return the temperature control of such a board: its first reading is not the temperature of the surroundings."""
    return HeaterControl(dataclasses.replace(setup.estimator.heater, ambient=true_thermal(setup).ambient))


def true_thermal(setup: Setup) -> ThermalPlantOptions:
    """Return heater and surroundings of the virtual robot's board."""
    return setup.true_robot.board.thermal or ThermalPlantOptions()
