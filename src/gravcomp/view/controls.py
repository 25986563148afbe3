"""The page's control panel, and the queue of the user's requests."""

import functools
import queue

import viser

from gravcomp.view.graphics import GRAPHICS
from gravcomp.view.inset import Inset
from gravcomp.view.requests import (
    BridgeService,
    Compensate,
    PlaceWall,
    Push,
    Record,
    Request,
    SetTarget,
    TiltBase,
    objection,
)
from gravcomp.view.scene import BASE, WORLD, Scene
from gravcomp.view.target_controls import TargetControls
from gravcomp.view.virtual_controls import VirtualControls

# Of these only the newest one counts.
_REPLACED = (SetTarget, TiltBase, Push, PlaceWall)
_MODES = {"Compensate": "compensate", "Hold": "hold", "Release": "relax"}


class Controls:
    """Builds the control panel and collects its requests."""

    def __init__(
        self, server: viser.ViserServer, scene: Scene, inset: Inset, length: float, cables: tuple[str, ...], graphics: str
    ) -> None:
        self._requests: queue.SimpleQueue[Request] = queue.SimpleQueue()
        self._gui, self._scene, self._inset = server.gui, scene, inset
        self._recording = False
        self._target = TargetControls(server.gui, scene.target.gizmo, length, self._requests.put)
        self._record = self._add_compensation()
        self._length = length
        scene.wall.put = self._requests.put
        self._virtual = VirtualControls(server.gui, cables, scene.wall, self._requests.put)
        self._add_view(graphics)

    def requests(self) -> tuple[list[Request], list[str]]:
        """Return the requests since the last call, of targets and the like only the newest, and why others are refused."""
        taken: list[Request] = []
        while not self._requests.empty():
            taken.append(self._requests.get())
        push = self._scene.hand.request()
        if push is not None:
            taken.append(push)
        refused = {request: objection(request, self._length) for request in taken}
        if push is not None and refused[push]:  # else the refusal would come again with every frame
            self._scene.hand.drop()
        taken = [request for request in taken if not refused[request]]
        newest = {type(r): r for r in taken if isinstance(r, _REPLACED)}
        accepted = [r for r in taken if not isinstance(r, _REPLACED)] + list(newest.values())
        return accepted, list(dict.fromkeys(filter(None, refused.values())))

    def show_virtual(self, virtual: bool) -> None:
        """Show the controls of the virtual robot only if there is one."""
        self._virtual.visible = virtual

    def show_recording(self, on: bool) -> None:
        """Label the button with its next action."""
        label = "Stop recording" if on else "Record a bag"
        if self._record.label != label:
            self._record.label = label
        self._recording = on

    def _add_compensation(self) -> viser.GuiButtonHandle:
        with self._gui.add_folder("Compensation"):
            modes = self._gui.add_button_group("cables", tuple(_MODES))
            bridge = self._gui.add_button_group("motors", ("Home", "Stop"))
            record = self._gui.add_button("Record a bag")
        modes.on_click(lambda e: self._requests.put(Compensate(_MODES.get(str(e.target.value), str(e.target.value)))))
        bridge.on_click(lambda e: self._requests.put(BridgeService(str(e.target.value).lower())))
        record.on_click(lambda _: self._requests.put(Record(not self._recording)))
        return record

    def _add_view(self, graphics: str) -> None:
        with self._gui.add_folder("View", expand_by_default=False):
            quality = self._gui.add_dropdown(
                "graphics", GRAPHICS, initial_value=graphics, hint="light: for a machine without a graphics chip"
            )
            view = self._gui.add_dropdown("seen from", (WORLD, BASE))
            boxes = {
                "rest": self._gui.add_checkbox("rest shape", True),
                "truth": self._gui.add_checkbox("ground truth", True),
                "target": self._gui.add_checkbox("target", True),
                "obstacles": self._gui.add_checkbox("obstacles", True),
                "forces": self._gui.add_checkbox("forces", True),
            }
            camera = self._gui.add_checkbox("camera at the tip", True, hint="what a person sees who steers by its picture")
            handle = self._gui.add_checkbox("drag the target", False, hint="handle at the tip of the target")
        quality.on_update(lambda _: self._scene.set_graphics(quality.value))
        view.on_update(lambda _: self._scene.set_view(view.value))
        camera.on_update(lambda _: self._inset.show_panel(camera.value))
        handle.on_update(lambda _: self._target.show_gizmo(handle.value))
        for what, box in boxes.items():
            box.on_update(functools.partial(self._on_box, what))

    def _on_box(self, what: str, event: viser.GuiEvent) -> None:
        self._scene.set_visible(what, event.target.value)
