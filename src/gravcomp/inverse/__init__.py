"""The inverse problem: the cable displacements that bring the modelled robot to its target."""

from gravcomp.inverse.command import Command
from gravcomp.inverse.controller import InverseController
from gravcomp.inverse.options import InverseOptions
from gravcomp.inverse.rest_target import rest_target
from gravcomp.inverse.solver import SolverFailed
from gravcomp.inverse.status import ControllerCode, Holdable
from gravcomp.inverse.target import Target, TargetError, bend_target, direction_weight, straight_target
from gravcomp.inverse.warm_up import warm_up

__all__ = [
    "Command",
    "ControllerCode",
    "Holdable",
    "InverseController",
    "InverseOptions",
    "SolverFailed",
    "Target",
    "TargetError",
    "bend_target",
    "direction_weight",
    "rest_target",
    "straight_target",
    "warm_up",
]
