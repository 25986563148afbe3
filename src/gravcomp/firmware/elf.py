"""The parts of a 32-bit little-endian ELF file that the firmware needs: what is loaded where, and the addresses of symbols."""

import dataclasses
import struct

_HEADER = struct.Struct("<16sHHIIIIIHHHHHH")
_SEGMENT = struct.Struct("<8I")
_SECTION = struct.Struct("<10I")
_SYMBOL = struct.Struct("<IIIBBH")
_LOADED, _SYMBOL_TABLE = 1, 2


@dataclasses.dataclass(frozen=True)
class Elf:
    """Loaded segments as (address where they are stored, offset in the file, bytes), and addresses by symbol."""

    segments: tuple[tuple[int, int, bytes], ...]
    symbols: dict[str, int]

    def flash(self, start: int) -> bytes:
        """Return what is stored from `start` on without a gap of a page; gaps are filled with ones, as erased flash."""
        result = bytearray()
        for address, _, data in sorted(self.segments):
            if not start <= address <= start + len(result) + 4096:
                continue
            result += b"\xff" * (address - start - len(result))
            result += data
        return bytes(result)

    def size(self, first: str, last: str) -> int:
        """Return the bytes between two symbols."""
        return self.symbols[last] - self.symbols[first]

    def offset(self, address: int) -> int:
        """Return the offset in the file of what is stored at an address. Raises KeyError where nothing is."""
        for start, offset, data in self.segments:
            if start <= address < start + len(data):
                return offset + address - start
        raise KeyError(hex(address))


def read_elf(data: bytes) -> Elf:
    """Read the file. Raises ValueError for what is no such file."""
    if data[:6] != b"\x7fELF\x01\x01":
        raise ValueError("not a 32-bit little-endian ELF file")
    header = _HEADER.unpack_from(data)
    segments_at, sections_at = header[5], header[6]
    segment_count, section_count = header[10], header[12]
    segments = []
    for index in range(segment_count):
        kind, offset, _, stored, file_size, *_ = _SEGMENT.unpack_from(data, segments_at + index * _SEGMENT.size)
        if kind == _LOADED and file_size:
            segments.append((stored, offset, data[offset : offset + file_size]))
    sections = [_SECTION.unpack_from(data, sections_at + index * _SECTION.size) for index in range(section_count)]
    symbols = {}
    for section in sections:
        if section[1] != _SYMBOL_TABLE:
            continue
        names_at = sections[section[6]][4]
        for place in range(section[4], section[4] + section[5], _SYMBOL.size):
            name, value, *_ = _SYMBOL.unpack_from(data, place)
            start = names_at + name
            symbols[data[start : data.index(b"\0", start)].decode()] = value
    return Elf(tuple(segments), symbols)
