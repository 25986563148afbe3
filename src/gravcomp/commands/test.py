"""`gravcomp test`: all tests, of every package and of the running graph."""

import argparse
import os
import subprocess
import sys
from pathlib import Path

OWN = ("--fast", "-h", "--help")
"""Arguments of the command's own, which come first; all others are pytest's."""

FOLDERS = ("src/test", "gravcomp_hw/test", "gravcomp_estimation/test", "gravcomp_fem/test", "test")
# What only tests need, and what it is for.
_BROWSER = {"chromium": "the viewer's tests"}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    parser.description = "All tests. Further arguments go to pytest, e.g. -k viewer -x."
    parser.add_argument("--fast", action="store_true", help="without the tests of the running graph (folder test/)")
    parser.add_argument("arguments", nargs=argparse.REMAINDER, help="for pytest; a path in place of all tests")


def run(args: argparse.Namespace) -> int:
    """Run the command; pytest's exit code."""
    root = Path(os.environ["GRAVCOMP_ROOT"])
    if not args.fast:
        _provide_browser()
    folders = [f for f in FOLDERS if (root / f).is_dir() and not (args.fast and f == "test")]
    given = [a for a in args.arguments if a != "--"]
    targets = [] if any((root / a.split("::")[0]).exists() for a in given if not a.startswith("-")) else folders
    command = [sys.executable, "-m", "pytest", "-p", "no:cacheprovider", "-ra", "--durations=10", *targets, *given]
    return subprocess.run(command, cwd=root).returncode


def _provide_browser() -> None:
    """Chromium, where it may be installed without asking; the tests that need it skip themselves otherwise."""
    from gravcomp.environment import system_packages
    from gravcomp.environment.errors import SetupError
    from gravcomp.view.browser import find_chromium

    if find_chromium():
        return
    names = ", ".join(f"{name} ({use})" for name, use in _BROWSER.items())
    if os.geteuid() != 0:
        print(f"Left out: {names}; to include it: sudo apt-get install -y {' '.join(_BROWSER)}", file=sys.stderr)
        return
    try:
        system_packages.install(list(_BROWSER), names)
    except SetupError as error:
        print(f"Left out: {names}: {error}", file=sys.stderr)
