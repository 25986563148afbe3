"""The inverse problem: which cable displacements bring the modelled robot to its target."""

from gravcomp.cache import configure_numba

configure_numba()  # before the first module here imports Numba

from gravcomp.inverse.command import Command
from gravcomp.inverse.controller import InverseController
from gravcomp.inverse.options import InverseOptions
from gravcomp.inverse.solver import SolverFailed
from gravcomp.inverse.status import ControllerCode
from gravcomp.inverse.target import Target, TargetError, bend_target, straight_target
from gravcomp.inverse.warm_up import warm_up

__all__ = [
    "Command",
    "ControllerCode",
    "InverseController",
    "InverseOptions",
    "SolverFailed",
    "Target",
    "TargetError",
    "bend_target",
    "straight_target",
    "warm_up",
]
