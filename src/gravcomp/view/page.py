"""The page of one robot, served to browsers: scene, plots, controls and figures."""

import socket
from collections.abc import Sequence
from typing import TYPE_CHECKING

import viser

from gravcomp.config import ConfigError
from gravcomp.description import Robot
from gravcomp.view import colours
from gravcomp.view.controls import Controls
from gravcomp.view.graphics import chosen
from gravcomp.view.inset import Inset
from gravcomp.view.options import PageOptions
from gravcomp.view.plots import Plots
from gravcomp.view.requests import Request
from gravcomp.view.scene import Scene
from gravcomp.view.skin import half_width
from gravcomp.view.snapshot import Snapshot
from gravcomp.view.status import cables_html, legend_html, status_html, touches_html
from gravcomp.view.timeline import Timeline
from gravcomp.view.web_origin import own_origin_only

if TYPE_CHECKING:
    from gravcomp.view.obstacle_shapes import ObstacleShape

PORTS_TRIED = 50
_PANEL_WIDTH = 320  # px


class Page:
    """A live page. Raises ConfigError when no port is free or the host is not an address of this machine."""

    def __init__(self, robot: Robot, options: PageOptions, shapes: "Sequence[ObstacleShape]" = ()) -> None:
        """shapes: of the obstacles around the robot."""
        port = free_port(options.host, options.port)
        with own_origin_only():
            self._server = viser.ViserServer(host=options.host, port=port, label=f"gravcomp · {robot.name}", verbose=False)
        shown = "localhost" if options.host in ("127.0.0.1", "0.0.0.0", "::") else options.host
        self.address = f"http://{shown}:{self._server.get_port()}"
        self._names, self._full_tension = robot.cable_names, colours.tension_scale(robot)
        self._frame, self._idle_frames = 0, max(1, round(options.rate))
        self._has_model = False  # whether the last snapshot had one
        self._shown: Snapshot | None = None  # while the page shows an earlier state
        gui = self._server.gui
        gui.configure_theme(dark_mode=options.dark, show_logo=False, show_share_button=False, brand_color=colours.BRAND)
        self._scene = Scene(self._server, robot, options, shapes)
        graphics = chosen(options.graphics)
        self._scene.set_graphics(graphics)
        gui.main_panel.dock_right()
        gui.main_panel.set_width(_PANEL_WIDTH)
        self._status = gui.add_html("")
        with gui.add_folder("Cables"):
            self._cables = gui.add_html("")
        self._touches = gui.add_html("", visible=False)
        self._inset = Inset(gui, shapes, robot.length, half_width(robot))
        self._controls = Controls(self._server, self._scene, self._inset, robot.length, self._names, graphics)
        self._legend = gui.add_html(legend_html(False))
        panel = gui.add_panel()
        with panel.add_tab(f"The last {options.window:g} s"):
            self._timeline = Timeline(gui, options.look_back, options.rate)
            self._plots = Plots(self._server, self._names, options)
        panel.dock_left()
        panel.set_width(_PANEL_WIDTH)
        self._server.on_client_disconnect(self._on_disconnect)

    @property
    def clients(self) -> int:
        """Number of browsers that show the page."""
        return len(self._server.get_clients())

    def show(self, snapshot: Snapshot) -> None:
        """Draw a snapshot: the scene at each call, plots at every second, texts and figures at every fourth.

        Without a browser the page is updated once per second and when the model begins, so that a new browser shows the current
        state. While the user looks back, the page does not change.
        """
        self._plots.add(snapshot)
        self._timeline.add(snapshot)
        self._frame += 1
        held = self._timeline.held
        if held is None:
            self._shown = None
            self._draw(snapshot)
        else:
            self._hold(*held)
        if self._frame % 4 == 0:
            self._controls.show_virtual(snapshot.virtual)
            self._controls.show_recording(bool(snapshot.recording))

    def _on_disconnect(self, client: viser.ClientHandle) -> None:
        """Let go of what a browser held that has left; after the last one return to the live state."""
        self._scene.hand.let_go(client.client_id)
        self._scene.wall.let_go(client.client_id)
        if not self.clients:
            self._timeline.return_to_live()

    def _draw(self, snapshot: Snapshot) -> None:
        """Draw the live state."""
        alone = not self.clients
        begins = snapshot.tension is not None and not self._has_model
        self._has_model = snapshot.tension is not None
        if alone and not begins and self._frame % self._idle_frames != 1 % self._idle_frames:
            return
        with self._server.atomic():
            self._scene.show(snapshot)
        if alone or self._frame % 2 == 0:
            self._plots.draw()
        if alone or self._frame % 4 == 0:
            self._write(snapshot, None)

    def _hold(self, snapshot: Snapshot, held_at: float) -> None:
        """Draw an earlier state, once."""
        if snapshot is self._shown:
            return
        self._shown = snapshot
        with self._server.atomic():
            self._scene.show(snapshot, live=False)
        self._plots.draw(snapshot.time)
        self._write(snapshot, held_at)

    def _write(self, snapshot: Snapshot, held_at: float | None) -> None:
        """Update texts and figures."""
        self._status.content = status_html(snapshot, held_at)
        self._cables.content = cables_html(snapshot, self._names, self._full_tension)
        touches = touches_html(snapshot)
        self._inset.show(snapshot)
        self._touches.content, self._touches.visible = touches, bool(touches)
        self._legend.content = legend_html(snapshot.truth is not None)

    def requests(self) -> list[Request]:
        """Return the user's requests since the last call; the page says why it refuses others."""
        accepted, refused = self._controls.requests()
        for sentence in refused:
            self.notify("Refused", sentence)
        return accepted

    def notify(self, title: str, sentence: str, *, good: bool = False) -> None:
        """Show a notification in every browser."""
        for client in self._server.get_clients().values():
            client.add_notification(title, sentence, auto_close_seconds=6.0, color="green" if good else "red")

    def close(self) -> None:
        """Stop the server."""
        self._server.stop()


def free_port(host: str, first: int) -> int:
    """Return the first free port from `first` on.

    Raises ConfigError when none is free or `host` is not an address of this machine.
    """
    last = min(first + PORTS_TRIED, 65536)
    for port in range(first, last):
        with socket.socket(socket.AF_INET6 if ":" in host else socket.AF_INET, socket.SOCK_STREAM) as probe:
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            try:
                probe.bind((host, port))
            except OSError as error:
                if error.errno in (98, 13, 48):  # in use, or reserved for the system
                    continue
                raise ConfigError(f"viewer: host is '{host}'; an address of this machine is needed ({error.strerror})") from error
            return port
    raise ConfigError(f"viewer: no port is free from {first} to {last - 1}; set another port")
