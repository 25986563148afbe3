"""Reading of an MCAP file without its end: all messages before the first damaged record.

An MCAP file is a sequence of records (opcode, length, content; https://mcap.dev/spec), so every record before a damaged one is
complete. The reader of rosbags needs the footer at the end of the file; here the end of the readable data is found by scanning
the records.
"""

from collections.abc import Collection, Generator
from pathlib import Path

from rosbags.interfaces import Connection
from rosbags.rosbag2 import ReaderError
from rosbags.rosbag2.storage_mcap import McapReader, decompress

_MAGIC = b"\x89MCAP0\r\n"
_SCHEMA, _CHANNEL, _MESSAGE, _CHUNK, _DATA_END = 0x03, 0x04, 0x05, 0x06, 0x0F


class CutMcap(McapReader):
    """Reader of an MCAP file up to its last complete record, in the order of the file: a recorder need not write by time."""

    def _open(self) -> None:
        assert self.bio is not None  # the base class has opened the file
        if self.bio.read(8) != _MAGIC:
            raise ReaderError("File magic is invalid.")
        self.data_start = 8
        self.data_end = _end_of_data(Path(str(self.path)))
        # No index is read, so the messages are found by scanning.
        self.meta_scan()

    def messages(
        self, connections: Collection[Connection], start: int | None = None, stop: int | None = None
    ) -> Generator[tuple[Connection, int, bytes], None, None]:
        """Yield connection, time (ns) and content of the messages; that of the base class ends where the time goes back."""
        return self.messages_scan(connections, start, stop)


def _end_of_data(path: Path) -> int:
    """Return the offset after the last record that is complete and, for chunks, can be decompressed."""
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
            if head[0] == _CHUNK and not _is_good_chunk(content):
                return start


def _is_good_chunk(content: bytes) -> bool:
    """Return whether a chunk has the lengths and the CRC that it names, and contains whole records of the allowed kinds."""
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
            if records[place] not in (_SCHEMA, _CHANNEL, _MESSAGE):
                return False
            place += 9 + length
        return place == len(records)
    except Exception:  # any error of a decompressor on damaged data
        return False
