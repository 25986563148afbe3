"""The base of the virtual robot: its last poses, and the IMU samples that follow from them.

Angular rate and specific force are derived from the poses at the steps of the rod: the rate is the mean over one sample period,
the acceleration the second difference of the last three positions of the IMU.
"""

import numpy as np

from gravcomp.virtual.motion import BaseMotion, FollowedMotion, rotation_vector_between


class MovingBase:
    """The base on its motion, and the IMU that is mounted on it."""

    def __init__(
        self, motion: BaseMotion, mount: np.ndarray, imu_position: np.ndarray, gravity: np.ndarray, step: float, steps: int
    ):
        """mount (3, 3): soft_base from imu_link; imu_position (3,) m in soft_base; gravity (3,) m/s^2 in the world.

        A step of the rod lasts `step` s, a sample period of the IMU `steps` steps.
        """
        self._motion, self._mount, self._imu_position, self._gravity = motion, mount, imu_position, gravity
        self._step, self._period = step, steps * step
        self.recorded = False  # whether the last sample came from a recording
        self._poses = [motion.pose(0.0)] * (1 + steps)  # of the last steps of the rod

    @property
    def pose(self) -> tuple[np.ndarray, np.ndarray]:
        """Rotation (3, 3), world from soft_base, and position (3,) m at the last step of the rod."""
        return self._poses[-1]

    def turn(self, orientation: np.ndarray, time: float) -> None:
        """Turn to `orientation` (3, 3), world from soft_base, from `time` s on; this ends the motion that the base had."""
        if not isinstance(self._motion, FollowedMotion):
            self._motion = FollowedMotion(*self.pose, time=time)
        self._motion.follow(orientation)

    def advance(self, time: float) -> tuple[np.ndarray, np.ndarray]:
        """Take the pose at the next step of the rod, at `time` s, and return it."""
        self._poses = [*self._poses[1:], self._motion.pose(time)]
        return self.pose

    def skip(self, time: float) -> tuple[np.ndarray, np.ndarray]:
        """Continue at `time` s as if all steps up to it had been taken, and return the pose there.

        A steered base keeps its angular velocity meanwhile.
        """
        last = len(self._poses) - 1
        pose = self._motion.coast if isinstance(self._motion, FollowedMotion) else self._motion.pose
        self._poses = [pose(time - (last - k) * self._step) for k in range(last + 1)]
        return self.pose

    def imu(self, time: float) -> tuple[np.ndarray, np.ndarray]:
        """Return angular rate (3,) rad/s and specific force (3,) m/s^2 at `time` s, in imu_link, without IMU errors."""
        measured = self._motion.imu(time, self._period)
        self.recorded = measured is not None
        if measured is not None:
            return measured
        turn = rotation_vector_between(self._poses[0][0], self._poses[-1][0])
        before, middle, after = (position + orientation @ self._imu_position for orientation, position in self._poses[-3:])
        acceleration = (after - 2 * middle + before) / self._step**2
        force = self._poses[-2][0].T @ (acceleration - self._gravity)
        return self._mount.T @ turn / self._period, self._mount.T @ force
