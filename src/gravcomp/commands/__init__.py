"""The commands of ./gravcomp, one module per command with `add_arguments(parser)` and `run(args) -> int`.

This package is imported before anything is installed, so it imports nothing itself.
"""

COMMANDS = {
    "demo": "run the loop on a virtual robot: sag, compensate, tilt; print the figures",
    "up": "start the graph on real hardware, or as the robot file says, until Ctrl-C",
    "test": "run all tests",
    "check": "check style and types of the source: ruff and mypy",
    "bench": "measure the performance figures",
    "reproduce": "reproduce the article's experiments, with report pages",
    "calibrate": "fit the robot's model to measured tip positions",
    "calibrate-imu": "fit the IMU's scale, offsets, mount and bias over temperature to a recording at rest",
    "calibrate-mount": "fit the mount of the IMU to the poses of the arm that carries it",
    "estimate": "estimate orientation and gravity from a recorded IMU stream, offline",
    "model": "build, inspect, solve and view a robot's model",
    "mesh": "install Gmsh, which fills surfaces with elements and reads STEP files",
    "firmware": "build, flash and test the firmware of the board",
    "record": "record the graph's topics into a bag",
    "replay": "run the graph on a recorded IMU stream",
    "arm": "move the virtual robot through five poses on a seven-axis arm",
    "doctor": "print what is installed, what is missing, and the command that installs it",
    "docs": "build the documentation of the Python interface",
    "completion": "print the completion script for bash or zsh",
}


def overview() -> str:
    """Return the text of `./gravcomp --help`."""
    lines = [f"  {name:<13} {summary}" for name, summary in COMMANDS.items()]
    return (
        "usage: ./gravcomp COMMAND [OPTIONS]\n\n"
        + "\n".join(lines)
        + "\n\nEach command has --json (the result as one line of JSON on stdout) and --quiet (no notes, no progress)."
        + "\n./gravcomp COMMAND --help explains a command, ./gravcomp --version prints the version."
    )
