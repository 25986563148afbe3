"""Quality of the graphics."""

from pathlib import Path

GRAPHICS = ("full", "light")
"""With reflections and shadows, or without them: ten times faster on a machine without a graphics chip."""

AUTO = "auto"
_CHIPS = ("dri/renderD*", "dxg", "nvidia[0-9]*")  # below /dev


def chosen(graphics: str, devices: Path = Path("/dev")) -> str:
    """Return 'full' or 'light'. 'auto' depends on the graphics chip of this machine, where the page is usually viewed."""
    if graphics != AUTO:
        return graphics
    return "full" if any(True for pattern in _CHIPS for _ in devices.glob(pattern)) else "light"
