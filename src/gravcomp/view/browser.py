"""A headless Chromium that looks at the live page: what it sees, as a picture.

The processor draws the scene, so on a small machine the graph beside it is slowed down.
"""

import shutil
from pathlib import Path

CHROMIUM_NAMES = ("chromium", "chromium-browser", "google-chrome")
# WebGL by the processor, and nothing else of the page by way of OpenGL.
_ARGUMENTS = ("--no-sandbox", "--use-angle=swiftshader-webgl", "--enable-unsafe-swiftshader", "--disable-gpu-rasterization")
_IS_DRAWN = """
document.querySelector('[data-gravcomp=status]')?.innerText
&& [...document.querySelectorAll('canvas')].some(canvas => canvas.clientWidth > 200 && canvas.clientHeight > 200)
"""


class BrowserError(RuntimeError):
    """There is no browser, or the page does not come; the text is for people."""


def find_chromium() -> str | None:
    """The path of an installed Chromium or Chrome."""
    return next(filter(None, map(shutil.which, CHROMIUM_NAMES)), None)


class Browser:
    """A window of `width` x `height` px; a context manager. `open` shows a page.

    `page` is Playwright's page; `received`: messages of the page's server until now; `foreign`: addresses outside the page's own that were
    asked for. Raises BrowserError when no Chromium is installed; what is waited for has to come within `patience` (s).
    """

    def __init__(self, width: int = 1600, height: int = 900, patience: float = 120.0):
        from gravcomp.environment.packages import provide_extra

        provide_extra("browser")
        from playwright.sync_api import Error, sync_playwright

        executable = find_chromium()
        if executable is None:
            raise BrowserError("no Chromium on this machine: apt-get install chromium")
        self._timeout = 1e3 * patience
        self.received, self.foreign = 0, []
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
        self.page.on("request", lambda request: None if request.url.startswith(self._own) else self.foreign.append(request.url))

    def open(self, address: str) -> None:
        """Show the page at `address` and wait until it is drawn. Raises BrowserError when it does not come."""
        from playwright.sync_api import Error

        self._own = (address.partition("?")[0], "data:", "blob:")
        try:
            self.page.goto(address, wait_until="commit")
            self.page.wait_for_function(_IS_DRAWN, polling=200)
            # Words about the browser itself, such as that a processor draws.
            self.page.add_style_tag(content=".mantine-Notifications-root { display: none }")
        except Error as error:
            raise BrowserError(f"the page at {address} could not be shown: {error.message.splitlines()[0]}") from error

    def __enter__(self) -> "Browser":
        return self

    def __exit__(self, *_) -> None:
        self._chromium.close()
        self._playwright.stop()

    def _count(self, _: object) -> None:
        self.received += 1

    def set_slider(self, label: str, value: float) -> None:
        """Give the page's slider of that label a value, as by hand."""
        slider = self.page.locator(f"text={label}").locator("xpath=ancestor::*[.//input][1]").locator("input").last
        slider.fill(f"{value:g}")

    def look_back(self, time: float) -> None:
        """Turn the page to what it showed at `time` (s, monotonic). Raises BrowserError when it does not turn so far."""
        from playwright.sync_api import Error

        try:
            self.set_slider("look back s", 0.1)
            self.page.wait_for_function("document.querySelector('[data-held-at]')?.dataset.heldAt", polling=200)
            held_at = float(self.page.locator("[data-held-at]").get_attribute("data-held-at"))
            self.set_slider("look back s", round(held_at - time, 1))
            self.page.wait_for_function(
                f"Math.abs(document.querySelector('[data-time]').dataset.time - {time}) < 0.2", polling=200
            )
        except Error as error:
            raise BrowserError(f"the page cannot be turned back: {error.message.splitlines()[0]}") from error

    def picture(self) -> bytes:
        """What is to be seen now, as PNG. Raises BrowserError."""
        from playwright.sync_api import Error

        try:
            return self.page.screenshot(timeout=self._timeout)
        except Error as error:
            raise BrowserError(f"no picture of the page: {error.message.splitlines()[0]}") from error

    def save(self, path: Path) -> None:
        """Write what is to be seen now."""
        path.write_bytes(self.picture())
