"""QoS as bags store it, from plain names and numbers."""

from rosbags.interfaces import Qos, QosDurability, QosHistory, QosLiveliness, QosReliability, QosTime

_ENDLESS = QosTime(9223372036, 854775807)


def offered_qos(reliability: str, durability: str, history: str, depth: int) -> Qos:
    """A publisher's offer; the names are those of ROS, 'reliable', 'transient_local', 'keep_last'...; unknown ones count as unknown."""
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


def _member(kind, name: str):
    return getattr(kind, name.upper(), kind.UNKNOWN)
