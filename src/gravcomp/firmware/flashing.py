"""The command lines that write an image into a board: over ST-Link by pyOCD or OpenOCD, over USB by dfu-util."""

import shutil
from pathlib import Path

from gravcomp.environment.errors import SetupError
from gravcomp.firmware.image import BOOT_START, CODE_START

TOOLS = {
    "pyocd": "ST-Link at SWDIO, SWCLK, GND; run: pip install pyocd, then pyocd pack install stm32f407vg",
    "openocd": "ST-Link at SWDIO, SWCLK, GND; run: apt-get install openocd",
    "dfu-util": "USB and BOOT0 high at the reset; run: apt-get install dfu-util",
}
"""Programmes, in the order in which they are looked for, with what each needs."""


def commands_for(folder: Path, tool: str | None, *, needed: bool = True) -> list[list[str]]:
    """Return the command lines for the image in `folder`. `needed`: the programme must be there. Raises SetupError."""
    found = tool or next((name for name in TOOLS if shutil.which(name)), None)
    if found is None or (needed and not shutil.which(found)):
        ways = "; ".join(f"{name} ({need})" for name, need in TOOLS.items() if tool in (None, name))
        if found is None and not needed:
            found = "openocd"
        else:
            raise SetupError(f"nothing that writes the flash is on this machine. One of these is needed: {ways}")
    image, boot, code = (str(folder / name) for name in ("image.elf", "boot.bin", "code.bin"))
    if found == "pyocd":
        return [["pyocd", "load", "--target", "stm32f407vg", image]]
    if found == "openocd":
        write = f"program {image} verify reset exit"
        return [["openocd", "-f", "interface/stlink.cfg", "-f", "target/stm32f4x.cfg", "-c", write]]
    return [
        ["dfu-util", "-a", "0", "-d", "0483:df11", "-s", f"0x{CODE_START:08x}", "-D", code],
        ["dfu-util", "-a", "0", "-d", "0483:df11", "-s", f"0x{BOOT_START:08x}:leave", "-D", boot],
    ]
