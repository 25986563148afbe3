"""Bags that were cut off or damaged, read as far as they go.

A recorder that was killed leaves no index and no metadata.yaml; a copy that broke off leaves half a record. An MCAP file is a row of
records (opcode, length, content; https://mcap.dev/spec), so all before the first bad one is good. What can be read is written once into
a whole bag in the cache; the recording itself is never touched.
"""

import contextlib
import hashlib
import shutil
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from rosbags.interfaces import Connection
from rosbags.rosbag2 import Reader, ReaderError, StoragePlugin, Writer
from rosbags.rosbag2.storage_mcap import McapReader
from rosbags.rosbag2.storage_sqlite3 import Sqlite3Reader

from gravcomp.cache import cache_folder
from gravcomp.recordings.bags.definitions import Definitions
from gravcomp.recordings.bags.errors import BagError

_MAGIC = b"\x89MCAP0\r\n"
_MESSAGE, _CHUNK, _DATA_END = 0x05, 0x06, 0x0F


@dataclass(frozen=True)
class ReadableBag:
    """A whole bag: `path` is the recording itself, or what was saved of it; then `problem` says what is wrong with it."""

    path: Path
    problem: str = ""
    messages: int = 0


def readable(path: str | Path) -> ReadableBag:
    """A bag (folder, or its .mcap or .db3 file) that any reader takes. Raises BagError when nothing can be read."""
    path = Path(path)
    if not path.exists():
        raise BagError(f"{path}: does not exist; a rosbag2 folder, or an .mcap or .db3 file, is needed")
    try:
        return ReadableBag(path, messages=_read_through(path))
    except FileNotFoundError:
        problem = "metadata.yaml is missing"
    except Exception as error:  # whatever a damaged file makes a reader raise
        problem = f"{type(error).__name__}: {error}" if not isinstance(error, ReaderError) else str(error)
    files = [path] if path.is_file() else sorted([*path.glob("*.mcap"), *path.glob("*.db3")])
    if not files:
        raise BagError(f"{path}: is not a bag: there is no .mcap and no .db3 file in it")
    saved = cache_folder("bags") / _key(files) / path.stem
    if saved.exists():
        return ReadableBag(saved, problem, _read_through(saved))
    return ReadableBag(saved, problem, _save(path, files, saved, problem))


def _read_through(path: Path) -> int:
    """Every message read once; the count."""
    # A raw file has no metadata.yaml beside it to believe.
    with Reader(path) as reader:
        return sum(1 for _ in reader.messages())


def _save(path: Path, files: list[Path], saved: Path, problem: str) -> int:
    unfinished = saved.parent.with_suffix(".part")
    shutil.rmtree(unfinished, ignore_errors=True)
    definitions, count = Definitions(), 0
    with Writer(unfinished / saved.name, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        connections: dict[tuple[str, str], Connection] = {}
        for file in files:
            for source, time, message in _messages(file):
                key = source.topic, source.msgtype
                if key not in connections:
                    connections[key] = _connection(writer, source, definitions)
                writer.write(connections[key], time, message)
                count += 1
    if not count:
        shutil.rmtree(unfinished)
        raise BagError(f"{path}: nothing in it can be read: {problem}")
    unfinished.rename(saved.parent)
    return count


def _connection(writer: Writer, source: Connection, definitions: Definitions) -> Connection:
    if source.msgdef.data:
        definitions.add_text(source.msgtype, source.msgdef.data)
    definition, digest = definitions.of(source.msgtype)
    return writer.add_connection(
        source.topic, source.msgtype, msgdef=definition, rihs01=digest, offered_qos_profiles=source.ext.offered_qos_profiles
    )


def _messages(file: Path) -> Iterator[tuple[Connection, int, bytes]]:
    """Messages until the first that cannot be read."""
    reader = _CutMcap(file) if file.suffix == ".mcap" else Sqlite3Reader(file)
    try:
        reader.open()
        yield from reader.messages(reader.connections)
    except Exception:  # the end of what is good
        return
    finally:
        with contextlib.suppress(Exception):
            reader.close()


class _CutMcap(McapReader):
    """An MCAP file without its end: read record by record up to the last good one."""

    def _open(self) -> None:
        if self.bio.read(8) != _MAGIC:
            raise ReaderError("File magic is invalid.")
        self.data_start = 8
        self.data_end = _last_good(self.path)
        # No index is read, so messages are found by scanning.
        self.meta_scan()


def _last_good(path: Path) -> int:
    """Offset behind the last record that is complete and, for chunks, can be unpacked."""
    size = path.stat().st_size
    with path.open("rb") as file:
        file.seek(8)
        while True:
            start = file.tell()
            head = file.read(9)
            if len(head) < 9 or head[0] == _DATA_END:
                return start
            length = int.from_bytes(head[1:], "little")
            if start + 9 + length > size:
                return start
            content = file.read(length)
            if head[0] == _CHUNK and not _good_chunk(content):
                return start


def _good_chunk(content: bytes) -> bool:
    from rosbags.rosbag2.storage_mcap import decompress

    try:
        uncompressed, crc = int.from_bytes(content[16:24], "little"), int.from_bytes(content[24:28], "little")
        named = 32 + int.from_bytes(content[28:32], "little")
        data = content[named + 8 :]
        if len(data) != int.from_bytes(content[named : named + 8], "little"):
            return False
        records = decompress(data, content[32:named].decode(), uncompressed, crc)
        place = 0
        while place < len(records):
            length = int.from_bytes(records[place + 1 : place + 9], "little")
            if records[place] not in (0x03, 0x04, _MESSAGE):
                return False
            place += 9 + length
        return place == len(records)
    except Exception:  # whatever a decompressor makes of it
        return False


def _key(files: list[Path]) -> str:
    digest = hashlib.sha256()
    for file in files:
        with file.open("rb") as data:
            while block := data.read(1 << 20):
                digest.update(block)
    return digest.hexdigest()[:32]
