"""Hardware side of gravcomp: the nodes can_bridge, virtual_robot and judge."""
