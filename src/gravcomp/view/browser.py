"""A headless Chromium that opens the live page and takes pictures of it.

The CPU draws the scene, so on a small machine the browser slows down a graph that runs at the same time.
"""

import shutil
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from playwright.sync_api import Request

CHROMIUM_NAMES = ("chromium", "chromium-browser", "google-chrome")
# WebGL on the CPU; the rest of the page without OpenGL.
_ARGUMENTS = ("--no-sandbox", "--use-angle=swiftshader-webgl", "--enable-unsafe-swiftshader", "--disable-gpu-rasterization")
_IS_DRAWN = """
document.querySelector('[data-gravcomp=status]')?.innerText
&& [...document.querySelectorAll('canvas')].some(canvas => canvas.clientWidth > 200 && canvas.clientHeight > 200)
"""


class BrowserError(RuntimeError):
    """No browser is installed, or the page cannot be shown; the text is for the user."""


def find_chromium() -> str | None:
    """Return the path of an installed Chromium or Chrome, or None."""
    return next(filter(None, map(shutil.which, CHROMIUM_NAMES)), None)


class Browser:
    """A window of `width` x `height` px; a context manager.

    Attributes: page (Playwright's page), received (number of messages from the page's server), foreign (requested addresses
    that do not belong to the page). patience: s, longest wait of each call. Raises BrowserError when no Chromium is installed.
    """

    def __init__(self, width: int = 1600, height: int = 900, patience: float = 120.0) -> None:
        from gravcomp.environment.packages import provide_extra

        provide_extra("browser")
        from playwright.sync_api import Error, sync_playwright

        executable = find_chromium()
        if executable is None:
            raise BrowserError("no Chromium on this machine: apt-get install chromium")
        self._timeout = 1e3 * patience
        self.received = 0
        self.foreign: list[str] = []
        self._playwright = sync_playwright().start()
        try:
            self._chromium = self._playwright.chromium.launch(executable_path=executable, args=list(_ARGUMENTS))
            self.page = self._chromium.new_page(viewport={"width": width, "height": height})
        except Error as error:
            self._playwright.stop()
            raise BrowserError(f"{executable} does not start: {error.message.splitlines()[0]}") from error
        self.page.set_default_timeout(self._timeout)
        self.page.on("websocket", lambda socket: socket.on("framereceived", self._count))
        self._own: tuple[str, ...] = ()
        self.page.on("request", self._note_foreign)

    def open(self, address: str) -> None:
        """Open the page at `address` and wait until it is drawn. Raises BrowserError when it cannot be shown."""
        from playwright.sync_api import Error

        self._own = (address.partition("?")[0], "data:", "blob:")
        try:
            self.page.goto(address, wait_until="commit")
            self.page.wait_for_function(_IS_DRAWN, polling=200)
            # Hide notifications about the browser itself, such as missing graphics hardware.
            self.page.add_style_tag(content=".mantine-Notifications-root { display: none }")
        except Error as error:
            raise BrowserError(f"the page at {address} could not be shown: {error.message.splitlines()[0]}") from error

    def __enter__(self) -> "Browser":
        return self

    def __exit__(self, *_: object) -> None:
        self._chromium.close()
        self._playwright.stop()

    def _count(self, _: object) -> None:
        self.received += 1

    def _note_foreign(self, request: "Request") -> None:
        if not request.url.startswith(self._own):
            self.foreign.append(request.url)

    def set_slider(self, label: str, value: float) -> None:
        """Set the page's slider with this label, like a user."""
        slider = self.page.locator(f"text={label}").locator("xpath=ancestor::*[.//input][1]").locator("input").last
        slider.fill(f"{value:g}")

    def look_back(self, time: float) -> None:
        """Show the state at `time` (s, monotonic) on the page. Raises BrowserError when the page no longer has it."""
        from playwright.sync_api import Error

        try:
            self.set_slider("look back s", 0.1)
            self.page.wait_for_function("document.querySelector('[data-held-at]')?.dataset.heldAt", polling=200)
            held_at = float(self.page.locator("[data-held-at]").get_attribute("data-held-at") or "nan")
            self.set_slider("look back s", round(held_at - time, 1))
            self.page.wait_for_function(
                f"Math.abs(document.querySelector('[data-time]').dataset.time - {time}) < 0.2", polling=200
            )
        except Error as error:
            raise BrowserError(f"the page cannot show an earlier state: {error.message.splitlines()[0]}") from error

    def picture(self) -> bytes:
        """Return a picture of the page as PNG. Raises BrowserError when none can be taken."""
        from playwright.sync_api import Error

        try:
            return self.page.screenshot(timeout=self._timeout)
        except Error as error:
            raise BrowserError(f"no picture of the page: {error.message.splitlines()[0]}") from error

    def save(self, path: Path) -> None:
        """Write a picture of the page as PNG. Raises BrowserError when none can be taken."""
        path.write_bytes(self.picture())
