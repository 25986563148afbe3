"""The option --tracker of the commands with a virtual robot."""

import argparse
from typing import Any


def add_tracker_argument(parser: argparse.ArgumentParser, condition: str = "") -> None:
    """Declare --tracker; condition: beginning of its help."""
    parser.add_argument(
        "--tracker",
        type=float,
        default=0.0,
        metavar="HZ",
        help=f"{condition}the virtual robot also publishes measured/tip at this rate, 100 ms late, with 0.5 mm noise",
    )


def tracker_parameters(args: argparse.Namespace) -> dict[str, Any]:
    """Return the parameters of virtual_robot for --tracker. Raises ConfigError for a rate that it cannot have."""
    from gravcomp.config import ConfigError

    if not 0.0 <= args.tracker <= 50.0:
        raise ConfigError(f"--tracker is {args.tracker:g}; allowed: 0 (no tracker) to 50 Hz")
    return {"tracker.rate": args.tracker} if args.tracker else {}
