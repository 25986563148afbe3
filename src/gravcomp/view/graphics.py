"""How elaborately the scene is drawn."""

from pathlib import Path

GRAPHICS = ("full", "light")
"""With reflections and shadows, or without: ten times faster where a processor draws in place of a graphics chip."""

AUTO = "auto"
_CHIPS = ("dri/renderD*", "dxg", "nvidia[0-9]*")  # below /dev


def chosen(graphics: str, devices: Path = Path("/dev")) -> str:
    """'full' or 'light'; for 'auto' as this machine can, on which the page is most often looked at."""
    if graphics != AUTO:
        return graphics
    return "full" if any(True for pattern in _CHIPS for _ in devices.glob(pattern)) else "light"
