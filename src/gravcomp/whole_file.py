"""Files that are there whole or not at all: an interruption or a full disk leaves what was there before."""

import contextlib
import os
from pathlib import Path


def write_whole(path: Path, content: str | bytes, *, lasting: bool = False) -> None:
    """Write text (UTF-8) or bytes in place of what is in the file. Raises OSError, and then leaves the file as it was.

    lasting: return when it is on the disk, which takes some time: neither a loss of power nor a full disk takes it back.
    """
    partial = path.with_name(f"{path.name}.{os.getpid()}.partial")  # another process may write the same file
    try:
        with partial.open("wb") as file:
            file.write(content.encode() if isinstance(content, str) else content)
            if lasting:
                file.flush()
                os.fsync(file.fileno())
        partial.replace(path)
    except OSError:
        with contextlib.suppress(OSError):
            partial.unlink()
        raise
