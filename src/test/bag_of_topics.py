"""Bags for tests, written without ROS."""

from pathlib import Path

import numpy as np
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

MESSAGES = Path(__file__).parents[2] / "gravcomp_msgs" / "msg"
OWN = ("CableState", "CableCommand", "ControllerStatus", "ShapeTarget")


class TopicBag:
    """A bag that is written by `with TopicBag(path) as bag: bag.vector("/gravity", time, (x, y, z))`.

    time: stamp and time of reception in s; `late`: delay of the reception after the stamp, s.
    """

    def __init__(self, path: Path, storage: StoragePlugin = StoragePlugin.SQLITE3):
        self._store = get_typestore(Stores.ROS2_JAZZY)
        for name in OWN:
            self._store.register(
                get_types_from_msg((MESSAGES / f"{name}.msg").read_text(encoding="utf-8"), f"gravcomp_msgs/msg/{name}")
            )
        self._types = {
            kind.rsplit("/", 1)[1]: made
            for kind, made in self._store.types.items()
            if kind.startswith(("geometry_msgs/", "std_msgs/", "builtin", "gravcomp", "sensor_msgs/"))
        }
        self._bag = Writer(path, version=9, storage_plugin=storage)
        self._topics: dict = {}

    def __enter__(self) -> "TopicBag":
        self._bag.open()
        return self

    def __exit__(self, *_) -> None:
        self._bag.close()

    def vector(self, topic: str, time: float, value) -> None:
        self._write(topic, "geometry_msgs/msg/Vector3Stamped", time, vector=self._types["Vector3"](*map(float, value)))

    def pose(self, topic: str, time: float, position, orientation=(0.0, 0.0, 0.0, 1.0), late: float = 0.0) -> None:
        pose = self._types["Pose"](
            self._types["Point"](*map(float, position)), self._types["Quaternion"](*map(float, orientation))
        )
        self._write(topic, "geometry_msgs/msg/PoseStamped", time, late, pose=pose)

    def state(self, topic: str, time: float, displacement, late: float = 0.0) -> None:
        none = np.zeros(0)
        self._write(
            topic,
            "gravcomp_msgs/msg/CableState",
            time,
            late,
            state=3,
            message="",
            command=none,
            displacement=np.asarray(displacement, float),
            velocity=none,
            current=none,
            tension=none,
        )

    def command(self, topic: str, time: float, displacement, late: float = 0.0) -> None:
        self._write(
            topic, "gravcomp_msgs/msg/CableCommand", time, late, displacement=np.asarray(displacement, float), tension=np.zeros(0)
        )

    def status(self, topic: str, time: float, code: int) -> None:
        point = self._types["Point"](0.0, 0.0, 0.0)
        self._write(
            topic,
            "gravcomp_msgs/msg/ControllerStatus",
            time,
            code=code,
            message="",
            distance=0.0,
            lateral=0.0,
            axial=0.0,
            tilt=0.0,
            solve_time=0.0,
            holdable=0,
            hold_message="",
            nearest_tip=point,
            contact_obstacle="",
            contact_force=0.0,
            contact_position=point,
        )

    def bend(self, topic: str, time: float, angle: float, plane: float) -> None:
        point, vector, none = self._types["Point"](0.0, 0.0, 0.0), self._types["Vector3"](0.0, 0.0, 0.0), np.zeros(0)
        self._write(
            topic,
            "gravcomp_msgs/msg/ShapeTarget",
            time,
            tip_position=point,
            tip_position_weight=1.0,
            tip_direction=vector,
            tip_direction_weight=0.0,
            backbone_station=none,
            backbone_position=[],
            backbone_weight=none,
            bend=True,
            bend_angle=angle,
            bend_plane=plane,
        )

    def imu(self, topic: str, time: float, gyro, accel, late: float = 0.0) -> None:
        vector, none = self._types["Vector3"], np.zeros(9)
        self._write(
            topic,
            "sensor_msgs/msg/Imu",
            time,
            late,
            orientation=self._types["Quaternion"](0.0, 0.0, 0.0, 1.0),
            orientation_covariance=none,
            angular_velocity=vector(*map(float, gyro)),
            angular_velocity_covariance=none,
            linear_acceleration=vector(*map(float, accel)),
            linear_acceleration_covariance=none,
        )

    def joints(self, topic: str, time: float, names, positions) -> None:
        none, positions = np.zeros(0), np.asarray(positions, float)
        self._write(topic, "sensor_msgs/msg/JointState", time, name=list(names), position=positions, velocity=none, effort=none)

    def text(self, topic: str, time: float, text: str) -> None:
        kind = "std_msgs/msg/String"
        self._topics[topic] = self._bag.add_connection(topic, kind, typestore=self._store)
        message = self._store.types[kind](data=text)
        self._bag.write(self._topics[topic], round(1e9 * time), self._store.serialize_cdr(message, kind))

    def _write(self, topic: str, kind: str, time: float, late: float = 0.0, **fields) -> None:
        if topic not in self._topics:
            self._topics[topic] = self._bag.add_connection(topic, kind, typestore=self._store)
        stamp = round(1e9 * time)
        header = self._types["Header"](stamp=self._types["Time"](sec=stamp // 10**9, nanosec=stamp % 10**9), frame_id="soft_base")
        message = self._store.types[kind](header=header, **fields)
        self._bag.write(self._topics[topic], stamp + round(1e9 * late), self._store.serialize_cdr(message, kind))
