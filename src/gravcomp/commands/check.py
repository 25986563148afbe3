"""`gravcomp check`: check the source with ruff (lint and format) and mypy (types)."""

import argparse
import contextlib
import fcntl
import os
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from gravcomp.commands import output


@dataclass(frozen=True)
class Check:
    """A check: the tool's module and the arguments for it.

    keeps: the tool finds what has not changed since an earlier run, also of another copy of the repository, in a folder of
    `~/.cache/gravcomp`.
    """

    tool: str
    arguments: tuple[str, ...]
    remedy: str = ""
    keeps: bool = False


CHECKS = {
    "ruff check": Check(
        "ruff", ("check", "--output-format", "concise"), "many findings are repaired by: .venv/bin/ruff check --fix"
    ),
    "ruff format": Check("ruff", ("format", "--check"), "repaired by: .venv/bin/ruff format"),
    "mypy": Check("mypy", (), keeps=True),
}
"""Checks by name, in the order in which they run; pyproject.toml holds the rules."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    parser.description = "Check style and types of the source: " + ", ".join(CHECKS) + ". The rules are in pyproject.toml."


def run(args: argparse.Namespace) -> int:
    """Run all checks. Returns 0: all pass, 1: at least one fails. Raises SetupError when the tools cannot be installed."""
    from gravcomp.environment.packages import provide_extra

    provide_extra("development")
    root = Path(os.environ["GRAVCOMP_ROOT"])
    outcomes: dict[str, dict] = {}
    for name, check in CHECKS.items():
        output.note(f"{name} ...")
        passed, text = run_check(root, name)
        outcomes[name] = {"passed": passed, "output": text.splitlines()}
        if not passed:
            print(text, file=sys.stderr, flush=True)
            if check.remedy:
                output.note(check.remedy)
    passed = all(outcome["passed"] for outcome in outcomes.values())
    lines = [f"{name}: {'passed' if outcome['passed'] else 'failed'}" for name, outcome in outcomes.items()]
    output.result({"passed": passed, "checks": outcomes}, "\n".join(lines))
    return 0 if passed else 1


def run_check(root: Path, name: str) -> tuple[bool, str]:
    """Run one of CHECKS over the repository at `root`. Returns whether it passed, and the output of the tool."""
    check = CHECKS[name]
    with _kept(check) as options:
        done = subprocess.run(
            [sys.executable, "-m", check.tool, *check.arguments, *options],
            cwd=root,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )
    return done.returncode == 0, done.stdout.strip()


@contextlib.contextmanager
def _kept(check: Check) -> Iterator[list[str]]:
    """Context with the options that name the folder of what the tool keeps, which no other run uses meanwhile."""
    if not check.keeps:
        yield []
        return
    from gravcomp.cache import cache_folder

    folder = cache_folder(check.tool)
    with open(folder / "lock", "w", encoding="utf-8") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        yield ["--cache-dir", str(folder)]


def installed(tool: str) -> bool:
    """Return whether the module of a tool can be run by this Python."""
    from importlib.util import find_spec

    return find_spec(tool) is not None
