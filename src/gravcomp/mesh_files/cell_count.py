"""How many cells a mesh file has, counted without reading it into memory."""

import re
from collections.abc import Iterator
from pathlib import Path

_BLOCK = 1 << 20
# Formats that announce how many cells follow. The last announcement of a keyword may be one of several blocks: they are added.
_ANNOUNCED = {
    ".vtk": re.compile(rb"\bCELLS\s+(\d+)"),
    ".vtu": re.compile(rb"NumberOfCells=\s*[\"']\s*(\d+)"),
    ".msh": re.compile(rb"\$Elements[ \r]*\n[ ]*(?:\d+ +(?=\d+ +\d+ +\d+))?(\d+)"),
    ".ply": re.compile(rb"element\s+face\s+(\d+)"),
}


def counted_cells(path: Path, suffix: str) -> int:
    """Return the number of cells in the file, 0 where its format cannot be counted. Needs the memory of one line."""
    if suffix == ".stl":
        return _stl_triangles(path)
    if suffix in _ANNOUNCED:
        return _announced(path, _ANNOUNCED[suffix])
    if suffix == ".obj":
        return sum(line.startswith(b"f ") for line in _lines(path))
    return _inp_elements(path) if suffix == ".inp" else 0


def _announced(path: Path, pattern: re.Pattern[bytes]) -> int:
    """Sum of the announced numbers; `\\b` and blocks that overlap keep an announcement whole."""
    total, kept = 0, b""
    with path.open("rb") as file:
        while block := file.read(_BLOCK):
            text = kept + block
            # One that reaches the end of the block may go on in the next.
            found = [match for match in pattern.finditer(text) if match.end() < len(text)]
            total += sum(int(match.group(1)) for match in found)
            kept = text[max(found[-1].end() if found else 0, len(text) - 80) :]
    return total + sum(int(match.group(1)) for match in pattern.finditer(kept))


def _stl_triangles(path: Path) -> int:
    size = path.stat().st_size
    with path.open("rb") as file:
        head = file.read(84)
    if len(head) == 84 and size == 84 + 50 * int.from_bytes(head[80:], "little"):
        return (size - 84) // 50
    return sum(b"endfacet" in line for line in _lines(path))


def _inp_elements(path: Path) -> int:
    """Lines of data below *ELEMENT; one that ends with a comma goes on."""
    total, inside, goes_on = 0, False, False
    for line in _lines(path):
        text = line.strip()
        if text.startswith(b"**") or not text:
            continue
        if text.startswith(b"*"):
            inside, goes_on = text.upper().startswith(b"*ELEMENT") and not text.upper().startswith(b"*ELEMENT "), False
            continue
        total += inside and not goes_on
        goes_on = text.endswith(b",")
    return total


def _lines(path: Path) -> Iterator[bytes]:
    """Yield the lines, long ones in parts."""
    with path.open("rb") as file:
        while line := file.readline(_BLOCK):
            yield line
