"""Install the packages of a lock file: by uv where it can be had, otherwise by pip.

uv downloads in parallel, keeps the files in its own cache, and links them into the environment. pip's settings count for both.
"""

import hashlib
import os
import re
import subprocess
from collections import deque
from pathlib import Path

from gravcomp.environment.errors import SetupError
from gravcomp.environment.pip_settings import uv_settings
from gravcomp.environment.progress import Progress

INSTALLER_LOCK = "requirements-installer.lock"
_OPTIONS = ("--require-hashes", "--no-deps")
_PIP = ("-m", "pip", "--disable-pip-version-check", "--no-input", "install", "--progress-bar", "off")


def install(root: Path, inner: Path, lock: Path, title: str, target: "Path | None" = None) -> None:
    """Install the packages of `lock` for the Python `inner`, into its environment or into the folder `target`.

    Raises SetupError with the installer's last words.
    """
    uv = _provide_uv(root, inner)
    place = [] if target is None else ["--target", str(target)]
    with Progress(title, total=len(names(lock))) as progress:
        if uv:
            words, environment = uv_settings(inner)
            command = [str(uv), "pip", "install", "--python", str(inner), *place, *words, *_OPTIONS, "-r", str(lock)]
            problem = _follow(command, environment, progress)
            if problem is None:
                return
            progress.note("uv could not install the packages, so pip does")
        command = [str(inner), *_PIP, *place, *(["--upgrade"] if place else []), *_OPTIONS, "-r", str(lock)]
        problem = _follow(command, dict(os.environ), progress)
        if problem is not None:
            raise SetupError(f"the packages of {lock.name} could not be installed:\n{problem}")


def names(lock: Path) -> "list[str]":
    """Names of the packages in a lock file; a package with several versions is named once for each."""
    found = (re.match(r"[A-Za-z0-9][A-Za-z0-9._-]*", line) for line in lock.read_text(encoding="utf-8").splitlines())
    return [match.group() for match in found if match]


def _follow(command: "list[str]", environment: "dict[str, str]", progress: Progress) -> "str | None":
    """Run the installer and show its progress. Return None, or its last lines when it failed."""
    last: "deque[str]" = deque(maxlen=15)
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, env=environment)
    for line in process.stdout or ():
        last.append(line)
        words = line.split()
        # uv prints "Downloading numpy (16.0MiB)" and " + numpy==2.4.6", pip "Collecting numpy==2.4.6".
        if line.startswith(("Collecting ", " + ")):
            progress.advance(words[1])
        elif line.startswith("Downloading "):
            progress.advance(" ".join(words[1:]), 0)
        elif line.startswith("Requirement already"):
            progress.advance(words[3])
        elif line.startswith("Prepared "):
            progress.note("downloaded " + line[len("Prepared ") :].strip())
    return None if process.wait() == 0 else "".join(last).strip()


def _provide_uv(root: Path, inner: Path) -> "Path | None":
    """Return the path of uv below `.workspace`, installed by pip when missing; None where pip cannot get it."""
    lock = root / INSTALLER_LOCK
    folder = root / ".workspace" / "installer" / hashlib.sha256(lock.read_bytes()).hexdigest()[:16]
    uv = folder / "bin" / "uv"
    if not os.access(str(uv), os.X_OK):
        command = [str(inner), *_PIP, "--quiet", "--no-compile", "--target", str(folder), "--upgrade", *_OPTIONS, "-r", str(lock)]
        if subprocess.run(command, capture_output=True, text=True).returncode != 0:
            return None
    try:
        answer = subprocess.run([str(uv), "--version"], capture_output=True, text=True)
    except OSError:
        return None
    return uv if answer.returncode == 0 else None
