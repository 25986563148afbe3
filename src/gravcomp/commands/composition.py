"""The option `--composed` of the commands that start the loop."""

import argparse


def add_composed_argument(parser: argparse.ArgumentParser) -> None:
    """Add `--composed`."""
    parser.add_argument(
        "--composed",
        action="store_true",
        help="run estimator, simulator and controller in one process, without serialisation between them",
    )
