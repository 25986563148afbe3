"""An unknown load in the loop: what tracker and load cells say of it, given to its observer with what the model expects."""

import numpy as np

from gravcomp.closed_loop.setup import Setup
from gravcomp.full_model.wrench import Wrench
from gravcomp.graph.parameters.virtual_load_cells import VirtualLoadCellParameters
from gravcomp.load_estimation import LoadEstimationOptions, LoadObserver, at_once
from gravcomp.mechanics.block_matrix import NotPositiveDefinite
from gravcomp.simulation import Shape, Simulator
from gravcomp.virtual.load_cells import VirtualLoadCells
from gravcomp.virtual.truth import Truth

_COMPLIANCE_SAMPLES = 10  # between two computations of the tip's compliance


class LoadFinding:
    """Finds one load. Attribute observer: its `LoadObserver`."""

    def __init__(
        self,
        setup: Setup,
        simulator: Simulator,
        options: LoadEstimationOptions,
        cells: VirtualLoadCellParameters | None,
        tracked: bool,
    ):
        """simulator: of the loop; cells: load cells at the capstans; None: there are none; tracked: a tracker sees the tip."""
        self._simulator = simulator
        self._cells = None if cells is None else VirtualLoadCells(cells, setup.robot.limits.tension_max, setup.seed)
        kind = options.kind if tracked else "none"
        self.observer = LoadObserver(setup.robot, options, at_once(simulator.model, kind, setup.modelled_scene))
        self._compliance: np.ndarray | None = None
        self._samples = 0

    def observe(self, time: float, shape: Shape, carried: Wrench | None, wound: np.ndarray | None, truth: Truth) -> None:
        """Take the simulator's shape under the wrench at the time (s), and what the load cells measure of the truth.

        wound (m,): the winches' displacements in m; None: released.
        """
        if not self.observer.follow(time, shape, wound) and shape.is_equilibrium:
            self._predict(time, shape, carried, wound)
        measured = None if self._cells is None else self._cells.observe(truth)
        if measured is not None:
            self.observer.measure_tensions(time, measured)

    def _predict(self, time: float, shape: Shape, carried: Wrench | None, wound: np.ndarray | None) -> None:
        """Let the observer expect tip and tensions of the simulator's shape."""
        if self._compliance is None or self._samples % _COMPLIANCE_SAMPLES == 0:
            try:
                self._compliance = self._simulator.tip_compliance()
            except NotPositiveDefinite:  # the next shape may be stable
                return
        self._samples += 1
        force = np.zeros(3) if carried is None else carried.force
        self.observer.predict(time, shape, self._compliance, force, wound)
