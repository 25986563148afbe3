"""The whole closed loop on the virtual robot in one process, in virtual time."""
