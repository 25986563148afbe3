"""Writing of bags: MCAP, version 9; a message is on disk one second after its reception."""

import time
from collections.abc import Sequence
from pathlib import Path

from rosbags.interfaces import Connection, Qos
from rosbags.rosbag2 import StoragePlugin, Writer, WriterError
from rosbags.rosbag2.storage_mcap import McapWriter

from gravcomp.recordings.bags.definitions import Definitions
from gravcomp.recordings.bags.errors import BagError


class BagWriter:
    """A bag that is being written; `messages` is their number."""

    def __init__(self, path: Path, flush_interval: float = 1.0, definitions: Definitions | None = None):
        """flush_interval (s): time of which the data are lost when the process is killed.

        Raises BagError for a path that exists or cannot be written.
        """
        if path.exists():
            raise BagError(f"{path}: exists; a bag is not overwritten, name another folder")
        self.path = path
        self.messages = 0
        self._definitions = definitions or Definitions()
        self._flush_interval, self._flushed, self._dirty = flush_interval, time.monotonic(), False
        try:
            self._writer = Writer(path, version=9, storage_plugin=StoragePlugin.MCAP)
            self._writer.open()
        except (WriterError, OSError) as error:
            raise BagError(f"{path}: cannot be written: {error}") from error

    def __enter__(self) -> "BagWriter":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def add_topic(self, name: str, kind: str, qos: Sequence[Qos] = ()) -> Connection:
        """Add a topic with the QoS that its publishers offer. Raises BagError for a type that is not installed."""
        definition, digest = self._definitions.of(kind)
        return self._writer.add_connection(name, kind, msgdef=definition, rihs01=digest, offered_qos_profiles=qos)

    def write(self, topic: Connection, received: int, message: bytes) -> None:
        """Write a serialised message that was received at `received` (ns)."""
        self._writer.write(topic, received, message)
        self.messages += 1
        self._dirty = True

    def flush(self, now: float | None = None) -> None:
        """Write the data to disk if the interval has passed at `now` (s, monotonic; default: the present); call it repeatedly."""
        now = time.monotonic() if now is None else now
        if self._dirty and now - self._flushed >= self._flush_interval:
            storage = self._writer.storage
            assert isinstance(storage, McapWriter)
            # A closed chunk can be read without the end of the file.
            storage.close_chunk()
            storage.bio.flush()
            self._flushed, self._dirty = now, False

    def close(self) -> None:
        """Write index, footer and metadata.yaml, and close the bag."""
        self._writer.close()
