"""The whole closed loop on the virtual robot in one process, stepped in the virtual robot's time."""
