"""The length of a file's unit: declared, fixed by the format, or found from the size of the body."""

from gravcomp.mesh_files.errors import MeshError

SLENDER = 5e-3, 2.0
"""Shortest and longest robot (m) whose unit is taken from the size alone."""
LENGTHS = 1e-3, 5.0
"""Shortest and longest robot (m)."""
LENGTH_TOLERANCE = 1e-3
"""Largest difference between the length of the file and the declared one, of the length: rounding."""

# Units that files of bodies usually have are taken where they fit; the others are only named, because a body fits one by chance.
_TAKEN = {"mm": 1e-3, "m": 1.0}
_NAMED = {"inch": 25.4e-3, "cm": 1e-2, "um": 1e-6}


def unit_of(size: float, declared: float | None, fixed: float | None, length: float | None, name: str) -> tuple[float, str]:
    """Return the unit in m, and a sentence that says why.

    size: length of the body in units of the file; declared: the unit of the robot file; fixed: that of the format; length: the
    declared length in m. Raises MeshError, which names the units that fit, when size and length contradict each other, or when
    the size suits no usual unit.
    """
    given = declared or fixed
    if given is not None:
        source = "as declared" if declared else "fixed by the format"
        if length is not None and not _fits(size * given, length):
            raise MeshError(_contradiction(size, given, length, name))
        if not LENGTHS[0] <= size * given <= LENGTHS[1]:
            raise MeshError(
                f"{name}: the body is {size * given * 1e3:.6g} mm long with the unit {_text(given)}, {source}; allowed:"
                f" {LENGTHS[0] * 1e3:g} to {LENGTHS[1] * 1e3:g} mm. Possible: {_possible(size)}"
            )
        return given, f"unit {_text(given)}, {source}"
    if length is not None:
        for unit_name, unit in _TAKEN.items():
            if _fits(size * unit, length):
                return unit, f"unit {unit_name}, found from length_mm"
        raise MeshError(_contradiction(size, None, length, name))
    for unit_name, unit in _TAKEN.items():
        if SLENDER[0] <= size * unit <= SLENDER[1]:
            return unit, f"unit {unit_name}, guessed from the size; length_mm or file_unit_mm would make it sure"
    raise MeshError(
        f"{name}: the body is {size:.4g} units long, which is {SLENDER[0] * 1e3:g} mm to {SLENDER[1]:g} m neither in mm nor in m;"
        f" give the unit. Possible: {_possible(size)}"
    )


def _possible(size: float) -> str:
    """Return the units in which a body of this size has the length of a robot, with the keys that declare them."""
    fitting = [
        f"{unit_name} ({size * unit * 1e3:.4g} mm): file_unit_mm: {unit * 1e3:g}"
        for unit_name, unit in (_NAMED | _TAKEN).items()
        if 0.2 * SLENDER[0] <= size * unit <= 5.0 * SLENDER[1]
    ]
    return "; ".join(fitting) or "file_unit_mm: the length of one unit"


def _contradiction(size: float, unit: float | None, length: float, name: str) -> str:
    found = f"{size * unit * 1e3:.6g} mm" if unit else f"{size:.6g} units"
    near = [
        f"it fits a file in {unit_name}: write file_unit_mm: {value * 1e3:g}"
        for unit_name, value in (_TAKEN | _NAMED).items()
        if abs(size * value - length) <= 0.02 * length
    ]
    if unit is None and any(abs(size * value - length) <= 0.02 * length for value in _TAKEN.values()):
        scale = next(value for value in _TAKEN.values() if abs(size * value - length) <= 0.02 * length)
        near = [f"write length_mm: {size * scale * 1e3:.6g}, or leave it out"]
    elif unit is not None and abs(size * unit - length) <= 0.02 * length:
        near = [f"write length_mm: {size * unit * 1e3:.6g}, or leave it out"]
    hint = near[0] if near else f"check file_unit_mm ({length / size * 1e3:.6g} would fit) and the axis"
    return f"{name}: the body is {found} long; length_mm says {length * 1e3:g} along z ({hint})"


def _fits(found: float, length: float) -> bool:
    return abs(found - length) <= LENGTH_TOLERANCE * length


def _text(unit: float) -> str:
    names = {value: unit_name for unit_name, value in (_TAKEN | _NAMED).items()}
    return next((text for value, text in names.items() if abs(value - unit) < 1e-9 * unit), f"{unit * 1e3:g} mm")
