"""Argument parsers of the commands, from one place: each has --json and --quiet, and each --help ends with the exit codes.

Only the standard library is imported here and, outside of functions, by the modules of the commands.
"""

import argparse
import importlib
import re
from collections.abc import Callable
from typing import Any

from gravcomp.commands import COMMANDS

EXIT_CODES = {
    0: "success",
    1: "a figure, target or check failed",
    2: "wrong use or input, or a run that could not be carried out",
    3: "the environment could not be built",
    130: "interrupted",
}

_EPILOG = "exit codes: " + "; ".join(f"{code} {meaning}" for code, meaning in EXIT_CODES.items())


def module_of(command: str) -> Any:
    """Return the module of a command; a dash in the command's name is an underscore in the module's."""
    return importlib.import_module(f"gravcomp.commands.{command.replace('-', '_')}")


def parser_of(command: str, kind: type[argparse.ArgumentParser] = argparse.ArgumentParser) -> argparse.ArgumentParser:
    """Return the whole parser of a command, of the class `kind`; subparsers have the same class."""
    parser = kind(
        prog=f"gravcomp {command}",
        description=COMMANDS[command],
        epilog=_EPILOG,
        allow_abbrev=False,
        parents=[_common()],
    )
    module_of(command).add_arguments(parser)
    return parser


def add_subcommand(choices: Any, name: str, summary: str) -> argparse.ArgumentParser:
    """Add a subcommand to what `add_subparsers` returned; returns its parser."""
    return choices.add_parser(
        name,
        help=summary,
        description=summary,
        epilog=_EPILOG,
        allow_abbrev=False,
        parents=[_common()],
    )


def parse(parser: argparse.ArgumentParser, words: list[str]) -> argparse.Namespace:
    """Parse the words of a command line; `json` and `quiet` are always set."""
    return parser.parse_args(words, argparse.Namespace(json=False, quiet=False))


def in_range(kind: type, least: float, most: float, unit: str = "") -> Callable[[str], Any]:
    """Return the type of an option for argparse: a number of `kind`, int or float, from `least` to `most`."""
    allowed = f"allowed: {least:g} to {most:.10g} {unit}".rstrip()

    def read(text: str) -> Any:
        try:
            value = kind(text)
        except ValueError:
            raise argparse.ArgumentTypeError(f"is '{text}'; {allowed}{', whole numbers' if kind is int else ''}") from None
        if not least <= value <= most:
            raise argparse.ArgumentTypeError(f"is {text}; {allowed}")
        return value

    return read


def namespace(text: str) -> str:
    """Return a namespace of nodes without a slash at its end, empty for /, as the type of an option for argparse."""
    text = text.rstrip("/")
    if text and not re.fullmatch(r"(/[A-Za-z_][A-Za-z0-9_]*)+", text):
        raise argparse.ArgumentTypeError(f"is '{text}'; a name that begins with / is needed, e.g. /left")
    return text


def _common() -> argparse.ArgumentParser:
    """Return a parent parser with the options of every command.

    They have no default, because the one of a subcommand's parser would overwrite what was given before the subcommand.
    """
    common = argparse.ArgumentParser(add_help=False)
    common.add_argument(
        "--json", action="store_true", default=argparse.SUPPRESS, help="print the result as one line of JSON on stdout"
    )
    common.add_argument(
        "--quiet",
        action="store_true",
        default=argparse.SUPPRESS,
        help="print no notes and no progress, only the result and errors",
    )
    return common
