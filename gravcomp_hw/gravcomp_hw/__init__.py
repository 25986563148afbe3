"""The hardware side of gravcomp: nodes can_bridge and virtual_robot."""
