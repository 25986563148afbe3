"""Version of gravcomp, and the commit in a git checkout. Works before anything is installed."""

import subprocess
from pathlib import Path

from gravcomp import __version__


def version_text(root: Path) -> str:
    """Return `gravcomp VERSION`, followed by the commit of the git repository at `root` where there is one."""
    commit = _commit(root)
    return f"gravcomp {__version__}" + (f" ({commit})" if commit else "")


def _commit(root: Path) -> str:
    """Return the abbreviated hash of HEAD, or '' outside a git repository or without git."""
    if not (root / ".git").exists():
        return ""
    command = ["git", "-C", str(root), "rev-parse", "--short=10", "HEAD"]
    try:
        done = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True, timeout=2.0)
    except (OSError, subprocess.TimeoutExpired):
        return ""
    return done.stdout.strip() if done.returncode == 0 else ""
