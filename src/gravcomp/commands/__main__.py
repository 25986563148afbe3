"""`python -m gravcomp.commands COMMAND ...`: what `./gravcomp` runs inside the environment."""

import errno
import sys

from gravcomp.commands import COMMANDS, output, overview
from gravcomp.commands.parsers import module_of, parse, parser_of
from gravcomp.environment.interrupt import run_interruptible

_FULL = (errno.ENOSPC, errno.EDQUOT)


def main(arguments: list[str]) -> int:
    """Run one command. Returns the exit code (gravcomp.commands.parsers.EXIT_CODES)."""
    if not arguments or arguments[0] not in COMMANDS:
        print(overview(), file=sys.stderr)
        return 2
    name, *rest = arguments
    parser = parser_of(name)
    module = module_of(name)
    if own := getattr(module, "OWN", ()):
        # The other words go to another program; argparse would reject options that it does not know.
        count = next((i for i, word in enumerate(rest) if word not in own), len(rest))
        rest.insert(count, "--")
    args = parse(parser, rest)
    output.configure(json=args.json, quiet=args.quiet)
    try:
        return module.run(args)
    except Exception as error:
        code = _exit_code(error)
        if code is None:
            raise
        print(f"gravcomp {name}: {_body(error, getattr(args, 'robot', None))}{_sentence(error)}", file=sys.stderr)
        return code


def _exit_code(error: Exception) -> int | None:
    """Return the exit code for an error whose text is meant for the user, or None for a defect, which shows its traceback."""
    # Imported here, because the fast commands do without.
    from gravcomp.config import ConfigError
    from gravcomp.environment.errors import SetupError
    from gravcomp.launcher import LaunchError, NodeDied
    from gravcomp.mesh_files.errors import MeshError

    if isinstance(error, SetupError):
        return 3
    if isinstance(error, OSError) and (error.filename is not None or error.errno in _FULL):
        return 2  # a file that cannot be read or written, in the cache as well
    return 2 if isinstance(error, (ConfigError, MeshError, LaunchError, NodeDied, TimeoutError)) else None


def _body(error: Exception, robot: str | None) -> str:
    """Return file and key for the error of a body that cannot be meshed: the model, from which it comes, knows no file."""
    from gravcomp.description.robot_file import robot_path
    from gravcomp.mesh_files.errors import MeshError

    return f"{robot_path(robot)}: robot: " if robot and isinstance(error, MeshError) else ""


def _sentence(error: Exception) -> str:
    """Return what is wrong, without Python's number of the error."""
    if not isinstance(error, OSError) or error.strerror is None:
        return str(error)
    return error.strerror if error.filename is None else f"{error.filename}: {error.strerror}"


if __name__ == "__main__":
    run_interruptible(lambda: main(sys.argv[1:]))
