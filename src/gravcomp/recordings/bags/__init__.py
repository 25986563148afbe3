"""Bags: rosbag2 folders (MCAP, version 9). Without ROS.

When the recorder is killed, at most the last second is lost; damaged bags are read up to the damage.

with BagWriter(path) as bag:                              # gravcomp.recordings.bags.writing
    topic = bag.add_topic("/gravity", "geometry_msgs/msg/Vector3Stamped", [qos])
    bag.write(topic, time_ns, serialised)
bag = readable(path)                                      # gravcomp.recordings.bags.recovery: a complete bag, recovered if needed
"""

from gravcomp.recordings.bags.errors import BagError

__all__ = ["BagError"]
