"""`gravcomp test`: all tests, of every package and of the running graph."""

import argparse
import os
import subprocess
import sys
import tempfile
from pathlib import Path

from gravcomp.commands import output

OWN = ("--fast", "--json", "--quiet", "-h", "--help")
"""Options of the command itself, which come first; all other words are passed to pytest."""

CORE = "src/test"
FOLDERS = (CORE, "gravcomp_hw/test", "gravcomp_estimation/test", "gravcomp_fem/test", "test")
_WORKERS = (os.cpu_count() or 1) + 1
"""Processes that run tests side by side: one more than cores, as a test with a graph waits for events half of its time, and unit
tests for buses in real time."""

# System packages that only tests need, and their use.
_BROWSER = {"chromium": "tests of the viewer"}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    parser.usage = "gravcomp test [--fast] [--json] [--quiet] [PATH ...] [OPTIONS OF PYTEST]"
    parser.description = "Run all tests, or those in the given paths. Further arguments are passed to pytest, e.g. -k viewer -x."
    parser.add_argument(
        "--fast", action="store_true", help=f"only the unit tests of the core (folder {CORE}, those without the mark slow)"
    )
    parser.add_argument("arguments", nargs=argparse.REMAINDER, help="paths in place of all tests, and options of pytest")


def run(args: argparse.Namespace) -> int:
    """Run pytest. Returns 0: all tests passed, 1: a test failed, 2: wrong use, or no test found."""
    from gravcomp.commands.model.build import prepare_model
    from gravcomp.commands.preparation import compile_parts
    from gravcomp.environment.packages import provide_extra
    from gravcomp.firmware.toolchain import provide as provide_firmware_tools
    from gravcomp.launcher.compilation import PARTS

    root = Path(os.environ["GRAVCOMP_ROOT"])
    for extra in ("development", "reports"):
        provide_extra(extra, root)
    _provide_meshers()
    provide_firmware_tools()
    if not args.fast:
        _provide_browser()
    folders = [CORE] if args.fast else [folder for folder in FOLDERS if (root / folder).is_dir()]
    given = [a for a in args.arguments if a != "--"]
    targets = [] if any((root / a.split("::")[0]).exists() for a in given if not a.startswith("-")) else folders
    how = ["-q", "--no-header"] if args.quiet else ["-ra", "--durations=10"]
    if targets:
        if "--collect-only" not in given:
            # Here once, with a note, rather than in each of the processes that need it at the same time.
            compile_parts(PARTS)
            if not args.fast:
                # Else the first graph builds it in the background with low priority, and a command that needs it waits for that.
                prepare_model("article")
        # A module's tests share a process, because they share what takes long to make: a graph, a model, a browser.
        how += ["-n", str(_WORKERS), "--dist", "loadgroup", "--no-loadscope-reorder"]
        # pytest-xdist 3.8 waits for ever after it has replaced a process that crashed: it then hands out tests that are done (its
        # issue 1378). Without a replacement the run ends, and names the test that crashed.
        how += ["--max-worker-restart", "0"]
        if args.fast:
            how += ["-m", "not slow"]
    command = [sys.executable, "-m", "pytest", "-p", "no:cacheprovider", *how, *targets, *given]
    if not args.json:
        return _exit_code(subprocess.run(command, cwd=root).returncode)
    with tempfile.TemporaryDirectory(prefix="gravcomp-") as scratch:
        report = Path(scratch) / "report.xml"
        code = subprocess.run(
            [*command, f"--junitxml={report}"], cwd=root, stdout=subprocess.DEVNULL if args.quiet else sys.stderr
        ).returncode
        figures = {"passed": code == 0, **_counts(report)}
    output.result(figures, f"{figures['tests']} tests, {figures['failures'] + figures['errors']} failed")
    return _exit_code(code)


def _exit_code(pytest_code: int) -> int:
    """Convert an exit code of pytest: 1 when a test failed or could not run, 2 for wrong use or when no test is found."""
    return {0: 0, 4: 2, 5: 2}.get(pytest_code, 1)


def _counts(report: Path) -> dict[str, int]:
    """Return the numbers of tests, failures, errors and skipped tests in pytest's JUnit report; zeros where there is none."""
    from xml.etree import ElementTree

    suites = ElementTree.parse(report).getroot().iter("testsuite") if report.exists() else ()
    total = dict.fromkeys(("tests", "failures", "errors", "skipped"), 0)
    for suite in suites:
        for name in total:
            total[name] += int(suite.get(name, 0))
    return total


def _provide_meshers() -> None:
    """Install the meshers; without the system libraries of Gmsh the tests that need it are skipped."""
    from gravcomp.environment.errors import SetupError
    from gravcomp.mesh_files.gmsh_library import install_gmsh

    try:
        install_gmsh()
    except SetupError as error:
        output.note(f"Skipped: tests of surfaces that are filled: {error}")


def _provide_browser() -> None:
    """Install Chromium when running as root; otherwise the tests that need it are skipped."""
    from gravcomp.environment import system_packages
    from gravcomp.environment.errors import SetupError
    from gravcomp.view.browser import find_chromium

    if find_chromium():
        return
    names = ", ".join(f"{name} ({use})" for name, use in _BROWSER.items())
    if os.geteuid() != 0:
        output.note(f"Skipped: {names}; to include them: sudo apt-get install -y {' '.join(_BROWSER)}")
        return
    try:
        system_packages.install(list(_BROWSER), names)
    except SetupError as error:
        output.note(f"Skipped: {names}: {error}")
