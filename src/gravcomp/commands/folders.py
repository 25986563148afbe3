"""Folders and files that options name: made or checked before a command computes anything."""

import os
from pathlib import Path


def made_folder(option: str, folder: Path) -> Path:
    """Create the folder that an option names, where it is missing, and return it. Raises ConfigError."""
    from gravcomp.config import ConfigError

    if folder.is_file():
        raise ConfigError(f"{option} is {folder}: is a file; the path of a folder is needed")
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ConfigError(f"{option} is {folder}: cannot be created: {error.strerror}") from error
    if not os.access(folder, os.W_OK | os.X_OK):
        raise ConfigError(f"{option} is {folder}: cannot be written into; a folder with write permission is needed")
    return folder


def made_logs(given: str | None) -> Path | None:
    """Create the folder that --logs names and return it; None where the option is not given. Raises ConfigError."""
    return made_folder("--logs", Path(given).expanduser()) if given else None


def checked_target(option: str, path: Path) -> Path:
    """Return the file to write that an option names; it is not touched yet. Raises ConfigError where it cannot be written."""
    from gravcomp.config import ConfigError

    try:
        is_folder, exists, folder_exists = path.is_dir(), path.exists(), path.parent.is_dir()
    except OSError as error:  # a name that is too long, a folder that cannot be entered
        raise ConfigError(f"{option} is {path}: cannot be written: {error.strerror}") from error
    if is_folder:
        raise ConfigError(f"{option} is {path}: is a folder; the path of a file is needed")
    if not folder_exists:
        raise ConfigError(f"{option} is {path}: cannot be written: there is no folder {path.parent}")
    if not os.access(path if exists else path.parent, os.W_OK):
        raise ConfigError(f"{option} is {path}: cannot be written: write permission is needed")
    return path
