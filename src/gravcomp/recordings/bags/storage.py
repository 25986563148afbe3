"""Files of a bag, also those that zstd has compressed as a whole or message by message.

metadata.yaml says how a bag is compressed. Without it, the name of the file and the first bytes of a message do.
"""

import contextlib
from pathlib import Path

_SUFFIXES = (".mcap", ".db3")
_ZSTD = ".zstd"
_MAGIC = b"\x28\xb5\x2f\xfd"  # of a zstd frame; a serialised message begins with 0


def is_storage(path: Path) -> bool:
    """Whether a path has the name of a file of a bag."""
    return path.name.removesuffix(_ZSTD).endswith(_SUFFIXES)


def storage_files(folder: Path) -> list[Path]:
    """Return the files of the bag in a folder; of one that is there with and without compression, the one without."""
    files = sorted(path for path in folder.iterdir() if is_storage(path))
    return [path for path in files if path.suffix != _ZSTD or path.with_suffix("") not in files]


def uncompressed(file: Path, folder: Path) -> Path:
    """Return the file, or what can be read of one compressed as a whole, as a new file in `folder`."""
    if file.suffix != _ZSTD:
        return file
    import zstandard

    plain = folder / file.stem
    # An error of zstd is the end of the readable part.
    with file.open("rb") as source, plain.open("wb") as target, contextlib.suppress(zstandard.ZstdError):
        zstandard.ZstdDecompressor().copy_stream(source, target)
    return plain


def is_compressed(message: bytes) -> bool:
    """Whether a message as it is stored is a zstd frame."""
    return bytes(message[:4]) == _MAGIC


def message_of(stored: bytes) -> bytes:
    """Return the serialised message of one as it is stored. Raises zstandard.ZstdError for a damaged one."""
    if not is_compressed(stored):
        return stored
    import zstandard

    return zstandard.ZstdDecompressor().decompressobj().decompress(stored)
