"""Bags: rosbag2 folders (MCAP, version 9) written so that a kill loses at most a second, and read as far as they go. No ROS needed.

with BagWriter(path) as bag:                              # gravcomp.recordings.bags.writing
    topic = bag.add_topic("/gravity", "geometry_msgs/msg/Vector3Stamped", [qos])
    bag.write(topic, time_ns, serialised)
bag = readable(path)                                      # gravcomp.recordings.bags.recovery: a whole bag, mended when need be
"""

from gravcomp.recordings.bags.errors import BagError

__all__ = ["BagError"]
