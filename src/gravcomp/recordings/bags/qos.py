"""QoS profiles of bags, from names and numbers."""

from enum import Enum
from typing import TypeVar

from rosbags.interfaces import Qos, QosDurability, QosHistory, QosLiveliness, QosReliability, QosTime

_Kind = TypeVar("_Kind", bound=Enum)

_ENDLESS = QosTime(9223372036, 854775807)


def offered_qos(reliability: str, durability: str, history: str, depth: int) -> Qos:
    """Return the QoS profile that a publisher offers.

    The names are those of ROS: 'reliable', 'transient_local', 'keep_last' and so on; any other name gives UNKNOWN.
    """
    return Qos(
        history=_member(QosHistory, history),
        depth=depth,
        reliability=_member(QosReliability, reliability),
        durability=_member(QosDurability, durability),
        deadline=_ENDLESS,
        lifespan=_ENDLESS,
        liveliness=QosLiveliness.AUTOMATIC,
        liveliness_lease_duration=_ENDLESS,
        avoid_ros_namespace_conventions=False,
    )


def _member(kind: type[_Kind], name: str) -> _Kind:
    members = kind.__members__
    return members.get(name.upper(), members["UNKNOWN"])
