"""The rod in motion: its base moves, its tendons are wound in, gravity pulls, the material creeps."""

import numpy as np

from gravcomp.scene.scene import turn_to
from gravcomp.virtual.backbone import backbone_poses
from gravcomp.virtual.capstan_spring import capstan_springs
from gravcomp.virtual.contact import find_contacts, slots
from gravcomp.virtual.contact_force import touching_of
from gravcomp.virtual.equilibrium import RodShape
from gravcomp.virtual.forces import half_bandwidth
from gravcomp.virtual.material import RodMaterial
from gravcomp.virtual.own_contact import OwnTouching, own_touching_of
from gravcomp.virtual.rod import RodModel, strains
from gravcomp.virtual.routing import tendon_lengths
from gravcomp.virtual.se3 import rotation_exp, rotation_log
from gravcomp.virtual.surroundings import RodSurroundings, Touches, own_touches_of, touches_of
from gravcomp.virtual.tendon_friction import TendonFriction, tension_shares
from gravcomp.virtual.time_step import time_step

_PARTS = 4  # of a step that does not converge at once


class MovingRod:
    """State of the moving rod. The arrays are changed in place by each step."""

    def __init__(
        self, model: RodModel, material: RodMaterial, friction: TendonFriction, surroundings: RodSurroundings | None = None
    ):
        """Start unloaded and at rest, the base at the origin, the tendons slack. Without `surroundings` nothing is around it."""
        self.model, self.material, self.friction = model, material, friction
        self._held, self._rim = np.zeros((slots(model.elements), 0, 3)), np.zeros((0, 3))
        self.surround(surroundings or RodSurroundings.none())
        n, m, k = model.elements, model.tendons, material.branch_time.shape[1]
        self.orientation, self.position = model.unloaded()
        self.mass, self.centre = model.mass, model.centre  # with what is attached
        self.load = np.zeros((n + 1, 3))  # N, in the fixed frame, at the centre of mass of each cross-section
        self.velocity = np.zeros((n + 1, 6))
        self._acceleration, self._velocity_rate = np.zeros((n + 1, 6)), np.zeros((n + 1, 6))
        self._branch_strain = np.tile(model.rest_strain, (k, 1, 1))
        self._slip_strain = model.rest_strain[:, 3:5].copy()
        self.strain = np.zeros((n, 6))
        self._sliding = np.zeros((m, n + 1))  # the guide first
        self._path = np.zeros((m, n))
        self._wound = np.zeros(m)
        self.tension = np.zeros(m)  # N, at the capstan
        self.shortened = np.zeros(m)  # m, by how much the tendons' paths are shorter than in the unloaded rod
        self._compliance = np.zeros(m)  # m/N, of the tendons' paths within one step
        self.tendon_stiffness = model.tendon_stiffness.copy()  # N/m; 0: the tendon is broken
        self._direction, self._chord = model.scratch()
        self._band = np.empty((6 * n, 2 * half_bandwidth(model.routing.reach) + 1))
        self._measure()

    def along(self, station: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return positions (k, 3) and orientations (k, 4), x y z w, at the stations (k,), in the frame of the base."""
        position, orientation = np.empty((len(station), 3)), np.empty((len(station), 4))
        backbone_poses(
            station, self.model.station, self.orientation, self.position, self.strain, self.model.length, position, orientation
        )
        return position, orientation

    @property
    def capstan_springs(self) -> tuple[np.ndarray, np.ndarray]:
        """What each capstan feels within a step: displacements (m,) m at which its spring is slack, its stiffness (m,) N/m."""
        return capstan_springs(self.tension, self.tendon_stiffness, self._compliance, self._wound, self.shortened)

    @property
    def touches(self) -> Touches:
        """The places where the rod touches walls and itself at present."""
        walls = touches_of(self._touching, self.orientation, self.position)
        if self._own is None or not self._own.force[: self._own.count[0]].any():
            return walls
        return walls.and_more(own_touches_of(self._own, self.orientation, self.position))

    def surround(self, around: RodSurroundings) -> None:
        """Put other obstacles around the rod; the rows that they and the present ones begin with are the same."""
        rows, points = len(around.walls.moving), len(self._held)
        kept = min(rows, len(self._rim))
        held, rim = np.zeros((points, rows, 3)), np.zeros((rows, 3))
        held[:, :kept], rim[:kept] = self._held[:, :kept], self._rim[:kept]
        self._around, self._held, self._rim = around, held, rim
        self._touching, self._checked = (touching_of(points * rows) for _ in range(2))
        self._own: OwnTouching | None = None
        self._own_checked: OwnTouching | None = None
        if around.itself:
            self._own, self._own_checked = (own_touching_of(self.model.elements) for _ in range(2))

    def move_plane(self, row: int, point: np.ndarray, normal: np.ndarray) -> None:
        """Move the plane of a row of the scene to a point (3,) m and a normal (3,), in the frame of the row."""
        scene = self._around.walls.scene
        scene.origin[row], scene.rotation[row] = point, turn_to(normal)

    def place_free_of_walls(self, shape: RodShape, base_orientation: np.ndarray, base_position: np.ndarray) -> tuple[float, int]:
        """Set the rod to `shape` as `rest` does; return by how much (m) it is then in a wall, and that obstacle's number."""
        self.rest(shape, base_orientation, base_position)
        around = self._around
        if not len(around.walls.moving):
            return 0.0, -1
        find_contacts(
            around.walls, around.surface, self.model.length, around.rigid, 0.0, self.orientation, self.position,
            self.orientation, self.position, self._held, self._rim, self._checked,
        )  # fmt: skip
        gaps = self._checked.gap[: self._checked.count[0]]
        if not len(gaps):
            return 0.0, -1
        return max(0.0, -float(gaps.min())), int(around.walls.scene.obstacle[self._checked.row[int(gaps.argmin())]])

    @property
    def tension_share(self) -> np.ndarray:
        """Share (m, n) of the tension at the capstan that arrives in each element."""
        friction = self.friction
        return tension_shares(
            self.strain,
            self.model.length,
            self._sliding,
            self.model.routing.start,
            self.model.routing.end,
            friction.coefficient,
            friction.guide_angle,
        )

    def rest(self, shape: RodShape, base_orientation: np.ndarray, base_position: np.ndarray) -> None:
        """Set the rod to `shape`, at rest and fully relaxed, with its base at the given pose."""
        self.orientation = base_orientation @ shape.orientation
        self.position = base_position + shape.position @ base_orientation.T
        self.velocity[:] = 0.0
        self._acceleration[:] = 0.0
        self._velocity_rate[:] = 0.0
        self._measure()
        self._branch_strain[:] = self.strain
        self._slip_strain[:] = self.strain[:, 3:5]
        self.tension = shape.tension.copy()
        self._compliance[:] = 0.0
        self._held[:] = 0.0
        self._forget_touching()
        taut = (self.tension > 0.0) & (self.tendon_stiffness > 0.0)
        self._wound[taut] = self.shortened[taut] + self.tension[taut] / self.tendon_stiffness[taut]

    def step(
        self, dt: float, base_orientation: np.ndarray, base_position: np.ndarray, gravity: np.ndarray, wound: np.ndarray
    ) -> bool:
        """Advance by `dt` s and return whether the iteration converged.

        The base is at base_orientation (3, 3) and base_position (3,) m at the end of the step, and the displacement wound (m,) m
        is pulled in then; gravity (3,) m/s^2 is in the fixed frame. If the state at the end is not possible, the rod moves
        rigidly with the base and is at rest. A step at a wall that does not converge is taken again in parts.
        """
        if not self._around.exist:
            return self._step(dt, base_orientation, base_position, gravity, wound)
        state, pose = self._state(), (self.orientation[0].copy(), self.position[0].copy())
        if self._step(dt, base_orientation, base_position, gravity, wound):
            return True
        self._take_back(state)
        turn, before = np.empty(3), self._wound.copy()
        rotation_log(np.ascontiguousarray(pose[0].T @ base_orientation), turn)
        converged = True
        for part in range(1, _PARTS + 1):
            share, rotation = part / _PARTS, np.empty((3, 3))
            rotation_exp(share * turn, rotation)
            place = pose[1] + share * (base_position - pose[1])
            last = part == _PARTS
            orientation = base_orientation if last else pose[0] @ rotation
            converged &= self._step(dt / _PARTS, orientation, place, gravity, before + share * (wound - before))
        return converged

    def _state(self) -> list[np.ndarray]:
        """Copies of all that a step changes."""
        return [array.copy() for array in self._changing()]

    def _take_back(self, state: list[np.ndarray]) -> None:
        for array, before in zip(self._changing(), state):
            array[:] = before

    def _changing(self) -> list[np.ndarray]:
        return [
            self.orientation, self.position, self.velocity, self._acceleration, self._velocity_rate, self.strain,
            self._branch_strain, self._slip_strain, self._sliding, self._path, self._wound, self.tension, self.shortened,
            self._compliance, self._held, self._rim, *self._touching, *(self._own or ()),
        ]  # fmt: skip

    def _step(
        self, dt: float, base_orientation: np.ndarray, base_position: np.ndarray, gravity: np.ndarray, wound: np.ndarray
    ) -> bool:
        model, material, friction = self.model, self.material, self.friction
        possible, converged = time_step(
            dt,
            base_orientation,
            base_position,
            gravity,
            self.load,
            wound,
            self._wound,
            self.orientation,
            self.position,
            self.velocity,
            self._acceleration,
            self._velocity_rate,
            self.strain,
            self._branch_strain,
            self._slip_strain,
            self._sliding,
            self._path,
            self.tension,
            self.shortened,
            self._compliance,
            model.length,
            model.stiffness,
            model.filament,
            model.curve,
            model.rest_strain,
            self.mass,
            self.centre,
            model.inertia,
            model.routing,
            model.tendon_length,
            self.tendon_stiffness,
            material.branch_ratio,
            material.branch_time,
            material.damping_time,
            material.slip_stiffness,
            material.slip_moment,
            friction.coefficient,
            friction.guide_angle,
            friction.presliding,
            model.tolerances,
            self._direction,
            self._chord,
            self._band,
            self._around.walls,
            self._around.surface,
            self._around.rigid,
            self._around.depth,
            self._held,
            self._rim,
            self._touching,
            self._checked,
            self._own,
            self._own_checked,
        )
        self._wound[:] = wound
        if not possible:
            self._rest_as_it_was(base_orientation, base_position)
            return False
        return converged

    def attach(self, mass: float) -> None:
        """Fix a point mass in kg to the axis at the tip, in place of what was attached before."""
        model = self.model
        self.mass, self.centre = model.mass.copy(), model.centre.copy()
        self.mass[-1] += mass
        self.centre[-1] = model.mass[-1] * model.centre[-1] / max(self.mass[-1], 1e-300)

    def carry(self, base_orientation: np.ndarray, base_position: np.ndarray) -> None:
        """Move the rod rigidly with its base to the given pose; shape, strains and body velocities do not change."""
        turn = base_orientation @ self.orientation[0].T
        self.orientation = turn @ self.orientation
        self.orientation[0] = base_orientation  # exactly: otherwise its rounding error grows with each call
        self.position = base_position + (self.position - self.position[0]) @ turn.T

    def _forget_touching(self) -> None:
        self._touching.count[0] = 0
        if self._own is not None:
            self._own.count[0] = 0

    def _measure(self) -> None:
        model = self.model
        strains(self.orientation, self.position, model.length, self.strain)
        tendon_lengths(
            self.orientation, self.position, self.strain, model.length, model.routing, self._direction, self._chord, self._path
        )
        self.shortened[:] = model.tendon_length - self._path.sum(axis=1)

    def _rest_as_it_was(self, base_orientation: np.ndarray, base_position: np.ndarray) -> None:
        self.carry(base_orientation, base_position)
        for rates in (self.velocity, self._acceleration, self._velocity_rate):
            rates[:] = 0.0
        self._sliding[:] = 0.0
        self._held[:] = 0.0
        self._forget_touching()
        self.tension[:] = 0.0
        self._measure()
