"""Recovery of bags that were cut off or damaged.

A recorder that was killed leaves neither an index nor metadata.yaml, which also says how a bag is compressed; an interrupted copy
ends within a record. What can be read is written once into a complete bag in the cache; the recording itself is not changed.
"""

import contextlib
import hashlib
import shutil
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

from rosbags.interfaces import Connection, ConnectionExtRosbag2
from rosbags.rosbag2 import Reader, ReaderError, StoragePlugin, Writer
from rosbags.rosbag2.storage_sqlite3 import Sqlite3Reader

from gravcomp.cache import cache_folder
from gravcomp.recordings.bags.cut_mcap import CutMcap
from gravcomp.recordings.bags.cut_sqlite import repaired
from gravcomp.recordings.bags.definitions import Definitions
from gravcomp.recordings.bags.errors import BagError
from gravcomp.recordings.bags.storage import is_compressed, message_of, storage_files, uncompressed

_VERSION = 3  # of what is saved: 2 has MCAP messages that are not in the order of their times; 3 is without unknown types
_LEFT_OUT = "left_out.txt"  # next to a copy that lacks topics: which
_REPORTED = 200  # messages between two reports of progress


@dataclass(frozen=True)
class ReadableBag:
    """A complete bag: `path` is the recording itself, or the recovered copy; in that case `problem` names the damage."""

    path: Path
    problem: str = ""
    messages: int = 0


def readable(path: str | Path, progress: Callable[[float], None] | None = None) -> ReadableBag:
    """Return a complete bag for `path`, a folder or its .mcap or .db3 file (also .zstd); a damaged one is recovered.

    Every message is read once, one after the other; `progress` receives the share of the bag's time that is read. Raises BagError
    when nothing can be read.
    """
    path = Path(path)
    if not path.exists():
        raise BagError(f"{path}: does not exist; a rosbag2 folder, or an .mcap or .db3 file, is needed")
    try:
        return ReadableBag(path, messages=_read_through(path, progress))
    except FileNotFoundError:
        problem = "metadata.yaml is missing"
    except Exception as error:  # any error of a reader on a damaged file
        problem = f"{type(error).__name__}: {error}" if not isinstance(error, ReaderError) else str(error)
    files = [path] if path.is_file() else storage_files(path)
    if not files:
        raise BagError(f"{path}: is not a bag: there is no .mcap and no .db3 file in it")
    if not any(file.stat().st_size for file in files):
        raise BagError(f"{path}: is empty: {', '.join(file.name for file in files)} has 0 bytes")
    saved = cache_folder("bags") / _key(files, path.stem) / path.stem
    count = _read_through(saved) if saved.exists() else _save(path, files, saved, problem)
    left_out = saved.parent / _LEFT_OUT
    return ReadableBag(saved, problem + (left_out.read_text(encoding="utf-8") if left_out.exists() else ""), count)


def _read_through(path: Path, progress: Callable[[float], None] | None = None) -> int:
    """Read every message once and return their number."""
    count = 0
    with Reader(path) as reader:
        for count, (_, received, stored) in enumerate(reader.messages(), 1):
            if is_compressed(stored):
                raise ReaderError("metadata.yaml, which says how the messages are compressed, is missing")
            if progress is not None and count % _REPORTED == 0:
                progress(share_read(reader, received))
    return count


def share_read(reader: Reader, received: int) -> float:
    """Return the share of a bag's time that is read with a message received at `received` ns."""
    return min(1.0, (received - reader.start_time) / max(reader.duration, 1))


def _save(path: Path, files: list[Path], saved: Path, problem: str) -> int:
    """Write what can be read of `files` to the bag `saved` and return the number of messages. Raises BagError for none.

    A copy needs the definition of each type. Recorders before Iron do not write it into SQLite files, so topics of types that are
    not installed are left out.
    """
    unfinished = saved.parent.with_suffix(".part")
    shutil.rmtree(unfinished, ignore_errors=True)
    definitions, count, unknown = Definitions(), 0, set[str]()
    with Writer(unfinished / saved.name, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        connections: dict[tuple[str, str], Connection] = {}
        for file in files:
            for source, time, message in _messages(file):
                key = source.topic, source.msgtype
                if key not in connections and source.topic not in unknown:
                    try:
                        connections[key] = _connection(writer, source, definitions)
                    except BagError:
                        unknown.add(source.topic)
                if key not in connections:
                    continue
                writer.write(connections[key], time, message)
                count += 1
    left_out = f"; without {', '.join(sorted(unknown))}, of types that are not installed" if unknown else ""
    if not count:
        shutil.rmtree(unfinished)
        raise BagError(f"{path}: nothing in it can be read: {problem}{left_out}")
    if left_out:
        (unfinished / _LEFT_OUT).write_text(left_out, encoding="utf-8")
    unfinished.rename(saved.parent)
    return count


def _connection(writer: Writer, source: Connection, definitions: Definitions) -> Connection:
    assert isinstance(source.ext, ConnectionExtRosbag2)
    if source.msgdef.data:
        definitions.add_text(source.msgtype, source.msgdef.data)
    definition, digest = definitions.of(source.msgtype)
    return writer.add_connection(
        source.topic, source.msgtype, msgdef=definition, rihs01=digest, offered_qos_profiles=source.ext.offered_qos_profiles
    )


def _messages(file: Path) -> Iterator[tuple[Connection, int, bytes]]:
    """Yield the messages up to the first that cannot be read."""
    with contextlib.ExitStack() as held:
        try:
            first, second = (held.enter_context(tempfile.TemporaryDirectory(dir=cache_folder("bags"))) for _ in range(2))
            plain = uncompressed(file, Path(first))
            reader: CutMcap | Sqlite3Reader
            reader = CutMcap(plain) if plain.suffix == ".mcap" else Sqlite3Reader(repaired(plain, Path(second)))
            held.callback(_close, reader)
            reader.open()
            for source, time, stored in reader.messages(reader.connections):
                yield source, time, message_of(stored)
        except Exception:  # the end of the readable part
            return


def _close(reader: CutMcap | Sqlite3Reader) -> None:
    with contextlib.suppress(Exception):
        reader.close()


def _key(files: list[Path], stem: str) -> str:
    """Return a name for the content of the files of a bag with the name `stem`."""
    digest = hashlib.sha256(f"{_VERSION} {stem}".encode())
    for file in files:
        with file.open("rb") as data:
            hashlib.file_digest(data, lambda: digest)
    return digest.hexdigest()[:32]
