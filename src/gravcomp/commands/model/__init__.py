"""`gravcomp model SUBCOMMAND`: build, inspect, solve and view a robot's model; one module a subcommand."""

import argparse
import importlib
import sys

SUBCOMMANDS = {
    "build": "build the reduced model, which the simulator uses from then on",
    "info": "masses, lengths, natural frequencies, reach, mesh and its error",
    "solve": "the shape under gravity for given tensions, displacements or a target",
    "view": "a picture of the deformed robot",
}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the subcommands and their arguments."""
    choices = parser.add_subparsers(dest="subcommand", required=True, metavar="SUBCOMMAND")
    for name, summary in SUBCOMMANDS.items():
        own = choices.add_parser(name, help=summary, description=summary)
        importlib.import_module(f"gravcomp.commands.model.{name}").add_arguments(own)


def run(args: argparse.Namespace) -> int:
    """Run the subcommand; 2: the robot or an argument cannot be used."""
    from gravcomp.mesh import MeshError

    try:
        return importlib.import_module(f"gravcomp.commands.model.{args.subcommand}").run(args)
    except (MeshError, ValueError) as error:
        print(f"gravcomp model {args.subcommand}: {error}", file=sys.stderr)
        return 2
