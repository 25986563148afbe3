"""Folders that options name."""

from pathlib import Path


def made_folder(option: str, folder: Path) -> Path:
    """Create the folder that an option names, where it is missing, and return it. Raises ConfigError."""
    from gravcomp.config import ConfigError

    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ConfigError(f"{option} is {folder}: cannot be created: {error.strerror}") from error
    return folder
