"""`gravcomp docs`: build the documentation of the Python interface, with the repository's pages, as HTML."""

import argparse
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from gravcomp.commands import output
from gravcomp.commands.folders import made_folder
from gravcomp.commands.module_pages import write_module_pages

CONFIGURATION = Path("src/doc/api")
"""Folder of Sphinx's conf.py and of the index page, relative to the repository."""

PACKAGE = Path("src/gravcomp")
"""The package whose modules have a page each, relative to the repository."""

PAGE = Path("src/doc/bodies.md")
"""The page with a picture of each robot that it describes, relative to the repository."""

GALLERY = Path("src/doc/pictures/robots")
"""Folder with a picture of each shipped robot, which the README shows, relative to the repository."""

TOUCHES = Path("src/doc/pictures/touched")
"""Folder of the pictures of the live page in which a user touches the virtual robot, relative to the repository."""

_LEFT_OUT = (".*", "build", "install", "log", "reports", "__pycache__", "*.egg-info")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    parser.description = "Build the documentation of the Python interface with Sphinx. A warning counts as an error."
    parser.add_argument(
        "--pictures",
        action="store_true",
        help=f"draw the pictures of the shipped robots and of those that {PAGE} describes again, and build nothing",
    )
    parser.add_argument(
        "--page",
        action="store_true",
        help="take the pictures of the live page in which a user touches the virtual robot again, and build nothing",
    )
    parser.add_argument(
        "--out", metavar="DIR", help="folder for the HTML pages (default: build/docs in the repository), or --page's pictures"
    )


def run(args: argparse.Namespace) -> int:
    """Build. Returns 0: built without warnings, 1: not. Raises ConfigError, and SetupError when Sphinx cannot be installed."""
    from gravcomp.environment.packages import provide_extra

    root = Path(os.environ["GRAVCOMP_ROOT"])
    if args.pictures:
        return _draw_pictures(root)
    if args.page:
        return _take_pictures(root, Path(args.out).expanduser().resolve() if args.out else root / TOUCHES)
    provide_extra("development")
    out = made_folder("--out", Path(args.out).expanduser().resolve() if args.out else root / "build" / "docs")
    output.note("sphinx ...")
    built, text = build(root, out)
    if not built:
        print(text, file=sys.stderr, flush=True)
    pages = sorted(out.rglob("*.html"))
    output.result({"built": built, "out": str(out), "pages": len(pages)}, f"{out / 'index.html'}: {len(pages)} pages")
    return 0 if built else 1


def _draw_pictures(root: Path) -> int:
    """Draw the picture that follows each robot on the page, and that of each shipped robot."""
    from gravcomp.environment.packages import provide_extra
    from gravcomp.report.body_picture import draw_body
    from gravcomp.report.described_robots import robots_on, shipped_pictures

    provide_extra("reports")
    pictures = []
    for robot, picture in [*robots_on(root / PAGE), *shipped_pictures(root / GALLERY)]:
        picture.parent.mkdir(parents=True, exist_ok=True)
        draw_body(robot, str(picture))
        output.note(f"{picture}")
        pictures.append(str(picture))
    output.result({"pictures": pictures}, f"{root / PAGE}, {root / GALLERY}: {len(pictures)} pictures")
    return 0


def _take_pictures(root: Path, folder: Path) -> int:
    """Take the pictures of the live page. Raises ConfigError."""
    from gravcomp.commands.touch_pictures import draw_touches

    pictures = [str(path) for path in draw_touches(root, made_folder("--out", folder))]
    output.result({"pictures": pictures}, f"{folder}: {len(pictures)} pictures")
    return 0


def build(root: Path, out: Path) -> tuple[bool, str]:
    """Run Sphinx on the repository `root`, HTML into `out`. Returns whether there was no warning, and the warnings.

    Sphinx reads a copy of the repository with the pages of the modules. It imports them from the repository, where they are
    compiled to bytecode.
    """
    with tempfile.TemporaryDirectory(prefix="gravcomp-") as scratch:
        source = Path(scratch) / "source"
        shutil.copytree(root, source, ignore=shutil.ignore_patterns(*_LEFT_OUT), symlinks=True)
        shutil.copy(source / CONFIGURATION / "index.md", source)
        write_module_pages(root / PACKAGE, source / "modules")
        done = subprocess.run(
            [sys.executable, "-m", "sphinx", "-W", "--keep-going", "-q", "-d", f"{scratch}/doctrees", "-c",
             str(source / CONFIGURATION), str(source), str(out)],
            env={**os.environ, "PYTHONPATH": os.pathsep.join([str(root / "src"), os.environ.get("PYTHONPATH", "")])},
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )  # fmt: skip
    return done.returncode == 0, done.stdout.replace(f"{source}/", "").replace(f"{root}/", "").strip()
