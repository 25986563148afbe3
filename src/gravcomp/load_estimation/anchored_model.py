"""The robot under a load that is not known well: the model's tip hangs on a spring at the place where the tip was measured.

An equilibrium under a load that is assumed need not exist, or is far from the robot: a soft robot's tip moves by half its length
under a load of its weight. So a spring k draws the model's tip p to the measured place a, and the model balances

    f = f_c + k (a - p),

where f_c follows f, so that the tip comes to the measured place (the method of multipliers, Hestenes 1969).

The equations of the full model are those of given tensions, and under these a bent robot may be unstable that its cables hold. So
more springs act between sections and the places and directions that these had one step ago. At rest they pull at nothing.

What the springs add to the stiffness is taken out of the response. With the compliance C_s of all that springs act on, W_s of
the cables and E_s of it by tensions, and M = (K^-1 - C_s)^-1 with the springs' stiffnesses K (Woodbury 1950),

    C = C_s + C_s M C_s,    E = E_s + C_s M E_s,    W = W_s + E_s^T M E_s,

and what the weight moves in the same way.

So the springs decide about which shape the estimate is linearised, and nothing else.
"""

import dataclasses
from typing import NamedTuple

import numpy as np

from gravcomp.full_model.payload import with_payload
from gravcomp.full_model.robot_model import RobotModel
from gravcomp.full_model.shape import Response, Shape
from gravcomp.full_model.spring import Spring
from gravcomp.full_model.wrench import Load, PointLoads, Wrench
from gravcomp.mechanics.block_matrix import NotPositiveDefinite
from gravcomp.mesh.robot_axis import rest_tip
from gravcomp.scene.scene import Scene
from gravcomp.simulation import Simulator

_STATIONS = (1.0, 0.75, 0.5, 0.25)  # of the springs, the tip first
_TURN = 0.25  # of the length: lever that makes a spring of the tip as stiff as those against turning
_STIFF = 30.0  # stiffness of a spring over that of the tip at rest across its axis
_STRIDE = 0.04  # of the length: by how much the spring's end moves at once; a step that fails is halved
NEAR = _STRIDE
"""Of the length: a shape whose tip is farther from the measured one says too little of the robot."""
_SHARES = 0.2, 0.03  # of the way to the measured tip that it moves at once, and near it, where the way is mostly noise
_LEAST_STRIDE = 1e-3  # of a stride: where steps fail as short as this, the model begins again at rest
_TAKEN_OVER = 0.1  # of the spring's force that f_c takes over in a step
_COMPLIANCE_MOVED, _COMPLIANCE_EVERY = 0.01, 50  # of the length, or steps, after which the compliance is computed again
_SINGULAR = 1e-6  # least eigenvalue of 1 - K C_s: the robot without springs is about to snap through


class AnchoredShape(NamedTuple):
    """A shape with the response of the robot without springs.

    tip_compliance (3, 3) m/N at given tensions; carried (3,) N: the force at the tip that the shape balances;
    by_loads: as in `HeldRobot`.
    """

    shape: Shape
    tip_compliance: np.ndarray
    carried: np.ndarray
    by_loads: tuple[np.ndarray, np.ndarray]


class AnchoredModel:
    """Follows one robot whose tip is measured."""

    def __init__(self, model: RobotModel, scene: Scene | None = None):
        """scene: what the robot touches. Raises MeshError for a body without cross-sections."""
        # A search from rest takes long, and finds no shape that the springs hold.
        self._model, self._simulator = model, Simulator(model, reduced=False, scene=scene, searches=False)
        rows = np.concatenate([model.section_rows(station) for station in _STATIONS])
        self._rows, self._pulls = rows, np.kron(rows[:, : model.n_free].T, np.eye(3))
        # With less the robot may snap through, with more the tracker's noise presses on the axis.
        self._stiffness = _STIFF / float(np.linalg.norm(self._simulator.solver.tip_compliance(), 2))
        turn = self._stiffness * (_TURN * model.length) ** 2
        self._springs = self._stiffness, turn, turn
        self._near = NEAR * model.length
        self.reset()

    def reset(self) -> None:
        """Forget where the tip is."""
        self._wanted: np.ndarray | None = None
        self._begin()

    def _begin(self) -> None:
        """Return to rest, without a load."""
        self._simulator.reset()
        self._load = np.zeros(3)  # f_c
        self._end = rest_tip(self._model.robot)[0]  # of the tip's spring, on its way to where the tip was measured
        self._stride = _STRIDE * self._model.length
        self._sprung: np.ndarray | None = None
        self._steps, self._compliant_at = 0, self._end

    def anchor(self, place: np.ndarray) -> None:
        """Hold the tip at a place (3,) in m from now on."""
        self._wanted = np.array(place)

    def step(
        self, gravity: np.ndarray, wound: np.ndarray, known: tuple[Wrench, ...], duration: float | None
    ) -> AnchoredShape | None:
        """Return the shape under gravity (3,), with the cables wound (m,), and known wrenches.

        duration: s since the last step, None: unknown. None is returned where no equilibrium is found, and while the model is far
        from the measured tip or no tip was measured.
        """
        if self._wanted is None:
            return None
        longest = _STRIDE * self._model.length
        share = _SHARES[float(np.linalg.norm(self._wanted - self._end)) < self._near]
        end = _along_arc(self._end, self._wanted, share, self._stride)
        wrenches: tuple[Load, ...] = (*known, Wrench(self._load), *self._held(end))
        shape = self._simulator.step(gravity, wound, duration=duration, wrench=wrenches)
        if not shape.is_equilibrium:
            self._stride *= 0.5
            if self._stride < _LEAST_STRIDE * longest:
                self._begin()
            return None
        self._end, self._stride = end, min(1.5 * self._stride, longest)
        pull = self._stiffness * (end - shape.tip_position)
        carried = self._load + pull
        self._load = self._load + _TAKEN_OVER * pull
        near = np.linalg.norm(self._wanted - shape.tip_position) <= self._near
        return self._unsprung(shape, carried, known, wrenches) if near else None

    def _held(self, tip: np.ndarray) -> list[Spring]:
        """Return the springs that draw the tip to a place (3,) and hold the sections where they are."""
        sections = (self._rows @ (self._model.mesh.nodes + self._simulator.solver.state.u)).reshape(-1, 3, 3)
        sections[0, 0] = tip
        return [Spring(station, at, self._springs) for station, at in zip(_STATIONS, sections)]

    def _unsprung(
        self, shape: Shape, carried: np.ndarray, known: tuple[Wrench, ...], wrenches: tuple[Load, ...]
    ) -> AnchoredShape | None:
        """Return a shape under its wrenches with the response of the robot without springs."""
        solver, model = self._simulator.solver, self._model
        load = model.weight(shape.gravity)
        lasting = with_payload(model, shape.gravity, PointLoads.of(model, known))
        if lasting is not None:
            load = load + lasting.at(solver.state.u)
        moved = float(np.linalg.norm(shape.tip_position - self._compliant_at))
        if self._sprung is None or self._steps % _COMPLIANCE_EVERY == 0 or moved > _COMPLIANCE_MOVED * model.length:
            pulls = np.column_stack([self._pulls, load])
            try:
                compliance = solver.compliance(pulls, with_payload(model, shape.gravity, PointLoads.of(model, wrenches)))
            except NotPositiveDefinite:
                return None
            self._sprung, self._compliant_at = 0.5 * (compliance + compliance.T), shape.tip_position
        self._steps += 1
        sprung, by_load = self._sprung[:-1, :-1], self._sprung[:-1, -1]
        stiffness = np.tile(np.repeat(self._springs, 3), len(_STATIONS))
        root = np.sqrt(stiffness)
        inner = np.eye(len(sprung)) - root[:, None] * sprung * root
        if np.abs(np.linalg.eigvalsh(inner)).min() < _SINGULAR:
            return None
        more = root[:, None] * np.linalg.inv(inner) * root
        to_sections = self._pulls.T @ solver.state.answer
        freed = dataclasses.replace(shape, response=_without_springs(shape, to_sections, sprung, more))
        tip_compliance = sprung[:3, :3] + sprung[:3] @ more @ sprung[:, :3]
        tip = by_load[:3] + sprung[:3] @ more @ by_load + tip_compliance @ carried
        cables = solver.state.answer.T @ load + to_sections.T @ more @ by_load + freed.response.compliance_ea[:3].T @ carried
        return AnchoredShape(freed, tip_compliance, carried, (tip, cables))


def _along_arc(start: np.ndarray, goal: np.ndarray, share: float, stride: float) -> np.ndarray:
    """Return the place (3,) that is a share of the way, and at most `stride` m, from one place to another around the base.

    On the straight way between two tips the robot would be pressed together, and buckle.
    """
    sizes = np.linalg.norm(start), np.linalg.norm(goal)
    share = min(share, stride / max(float(np.linalg.norm(goal - start)), 1e-30))
    if min(sizes) < stride:  # at the base no arc leads around it
        straight: np.ndarray = start + share * (goal - start)
        return straight
    direction = (1.0 - share) * start / sizes[0] + share * goal / sizes[1]
    place: np.ndarray = direction / np.linalg.norm(direction) * ((1.0 - share) * sizes[0] + share * sizes[1])
    return place


def _without_springs(shape: Shape, to_sections: np.ndarray, sprung: np.ndarray, more: np.ndarray) -> Response:
    """Return the response of a shape without springs, of the tip alone of the effectors.

    to_sections: E_s; sprung: C_s; more: M.
    """
    with_springs, tension = shape.response, shape.cable_tension
    effector = with_springs.effector_free + with_springs.compliance_ea @ tension
    compliance = with_springs.compliance_aa + to_sections.T @ more @ to_sections
    to_effector = with_springs.compliance_ea.copy()
    to_effector[:3] += sprung[:3] @ more @ to_sections
    return dataclasses.replace(
        with_springs,
        compliance_aa=compliance,
        compliance_ea=to_effector,
        displacement_free=shape.cable_displacement - compliance @ tension,
        effector_free=effector - to_effector @ tension,
    )
