"""TF frames of the deformed robot, if tf2_msgs is installed (every ROS installation has it; it is not on PyPI)."""

import numpy as np
from geometry_msgs.msg import TransformStamped
from rclpy.node import Node
from std_msgs.msg import Header

from gravcomp.simulation import Shape
from gravcomp_fem.conversion import pose_message

try:
    from tf2_msgs.msg import TFMessage
except ImportError:
    TFMessage = None


class TransformPublisher:
    """Publishes the tip and the backbone points as child frames of the base."""

    def __init__(self, node: Node):
        self._node = node
        self._publisher = node.create_publisher(TFMessage, "/tf", 100) if TFMessage else None

    def destroy(self) -> None:
        """Destroy the publisher."""
        if self._publisher:
            self._node.destroy_publisher(self._publisher)

    def publish(self, shape: Shape, header: Header, tip_frame: str) -> None:
        """Publish the frames `tip_frame` and `<base>_backbone_<i>`, if tf2_msgs is installed and /tf has a subscriber."""
        if not self._publisher or not self._publisher.get_subscription_count():
            return
        frames = [(tip_frame, shape.tip_position, shape.tip_orientation)]
        for i, (position, orientation) in enumerate(zip(shape.backbone_position, shape.backbone_orientation)):
            frames.append((f"{header.frame_id}_backbone_{i}", position, orientation))
        self._publisher.publish(TFMessage(transforms=[_transform(header, *frame) for frame in frames]))


def _transform(header: Header, child: str, position: np.ndarray, orientation: np.ndarray) -> TransformStamped:
    pose = pose_message(position, orientation)
    transform = TransformStamped(header=header, child_frame_id=child)
    transform.transform.translation.x = pose.position.x
    transform.transform.translation.y = pose.position.y
    transform.transform.translation.z = pose.position.z
    transform.transform.rotation = pose.orientation
    return transform
