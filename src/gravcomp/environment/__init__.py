"""What `./gravcomp` does before the first command: interpreter, system packages, Python packages, colcon workspace.

Nothing but Python's own library is used here: it runs before anything is installed.
"""
