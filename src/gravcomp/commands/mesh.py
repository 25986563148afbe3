"""`gravcomp mesh install`: Gmsh for bodies from surfaces and STEP files, in the product's own environment."""

import argparse

from gravcomp.commands import output
from gravcomp.commands.parsers import add_subcommand


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the subcommands."""
    choices = parser.add_subparsers(dest="subcommand", required=True, metavar="SUBCOMMAND")
    add_subcommand(choices, "install", "install Gmsh and the system libraries that it needs into gravcomp's own environment")


def run(args: argparse.Namespace) -> int:
    """Run the subcommand. Returns 0: Gmsh works. Raises SetupError."""
    from gravcomp.mesh_files.gmsh_library import install_gmsh

    version = install_gmsh()
    output.result({"gmsh": version}, f"Gmsh {version} works: bodies from surfaces and STEP files can be meshed")
    return 0
