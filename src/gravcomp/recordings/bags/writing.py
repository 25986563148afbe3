"""Writing bags: MCAP, version 9, on disk a second after it was received."""

import time
from collections.abc import Sequence
from pathlib import Path

from rosbags.interfaces import Connection, Qos
from rosbags.rosbag2 import StoragePlugin, Writer, WriterError

from gravcomp.recordings.bags.definitions import Definitions
from gravcomp.recordings.bags.errors import BagError


class BagWriter:
    """A bag being written; `messages` counts them. Raises BagError."""

    def __init__(self, path: Path, flush_interval: float = 1.0, definitions: Definitions | None = None):
        """`flush_interval` (s): what a kill may lose."""
        if path.exists():
            raise BagError(f"{path}: exists; a bag is not written over, name another folder")
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

    def __exit__(self, *_) -> None:
        self.close()

    def add_topic(self, name: str, kind: str, qos: Sequence[Qos] = ()) -> Connection:
        """Announce a topic with the QoS that its publishers offer."""
        definition, digest = self._definitions.of(kind)
        return self._writer.add_connection(name, kind, msgdef=definition, rihs01=digest, offered_qos_profiles=qos)

    def write(self, topic: Connection, received: int, message: bytes) -> None:
        """A serialised message and when it was received, ns."""
        self._writer.write(topic, received, message)
        self.messages += 1
        self._dirty = True

    def flush(self, now: float | None = None) -> None:
        """To be called now and then: hands what is older than the interval to the system."""
        now = time.monotonic() if now is None else now
        if self._dirty and now - self._flushed >= self._flush_interval:
            # A closed chunk can be read without the file's end.
            self._writer.storage.close_chunk()
            self._writer.storage.bio.flush()
            self._flushed, self._dirty = now, False

    def close(self) -> None:
        """Finish: index, footer and metadata.yaml."""
        self._writer.close()
