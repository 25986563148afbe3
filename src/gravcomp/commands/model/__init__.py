"""`gravcomp model SUBCOMMAND`: build, inspect, solve and view a robot's model; one module per subcommand."""

import argparse
import importlib

from gravcomp.commands.parsers import add_subcommand

SUBCOMMANDS = {
    "build": "build the reduced model, which the simulator then uses",
    "info": "print mass, lengths, natural frequencies, whether the cables can hold the robot, reach, and the mesh with its error",
    "solve": "print the shape under gravity for given tensions, displacements or a target",
    "view": "draw the deformed robot",
}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the subcommands and their arguments."""
    choices = parser.add_subparsers(dest="subcommand", required=True, metavar="SUBCOMMAND")
    for name, summary in SUBCOMMANDS.items():
        importlib.import_module(f"gravcomp.commands.model.{name}").add_arguments(add_subcommand(choices, name, summary))


def run(args: argparse.Namespace) -> int:
    """Run the subcommand. Returns its exit code.

    Raises MeshError when the body cannot be meshed, ConfigError when the robot or an argument cannot be used otherwise.
    """
    from gravcomp.config import ConfigError
    from gravcomp.mesh import MeshError

    try:
        return importlib.import_module(f"gravcomp.commands.model.{args.subcommand}").run(args)
    except MeshError:
        raise
    except ValueError as error:
        raise ConfigError(str(error)) from error
