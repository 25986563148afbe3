"""The commands of ./gravcomp, one module each: `add_arguments(parser)` and `run(args) -> int`; a dash in a name is an underscore in its module's.

This list is read before anything is installed, so it imports nothing.
"""

COMMANDS = {
    "demo": "the main job on a virtual robot: sag, compensate, tilt; ends with the figures",
    "up": "the graph for real hardware or as the robot's YAML says, until Ctrl-C",
    "test": "all tests",
    "bench": "the performance figures",
    "reproduce": "the article's experiments, with report pages",
    "calibrate": "fit the robot's model to measured tip positions",
    "calibrate-imu": "the IMU's scale, offsets, mount and bias over temperature from a recording at rest",
    "estimate": "orientation and gravity from a recorded IMU stream, offline",
    "model": "build, inspect, solve and view a robot's model",
    "record": "write the graph's topics into a bag",
    "replay": "the graph on a recorded IMU stream",
    "arm": "a seven-axis arm carries the virtual robot through five poses",
    "doctor": "what is installed, what is missing, and the line that mends it",
}


def overview() -> str:
    """The text of `./gravcomp --help`."""
    lines = [f"  {name:<13} {summary}" for name, summary in COMMANDS.items()]
    return "usage: ./gravcomp COMMAND [OPTIONS]\n\n" + "\n".join(lines) + "\n\n./gravcomp COMMAND --help explains a command."
