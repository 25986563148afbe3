"""The option `--seed` of the commands that run the virtual robot."""

import argparse

_LARGEST = 2**31 - 1


def add_seed_argument(parser: argparse.ArgumentParser, when: str = "") -> None:
    """Declare the option; `when`: words about when it applies."""
    parser.add_argument(
        "--seed",
        type=int,
        metavar="N",
        help=f"seed of the virtual robot: of its noise and of all that its file does not give (default: the file's){when}",
    )


def seed_of(args: argparse.Namespace) -> int | None:
    """Return the seed, None: the file's. Raises ConfigError."""
    from gravcomp.config import ConfigError

    if args.seed is not None and not 0 <= args.seed <= _LARGEST:
        raise ConfigError(f"--seed is {args.seed}; allowed: 0 to {_LARGEST}")
    return args.seed
