"""The page's controls: what they show, and the requests that they raise."""

import math
import queue

import numpy as np
import viser

from gravcomp.view.graphics import GRAPHICS
from gravcomp.view.requests import BridgeService, Compensate, InjectFault, Record, Request, SetTarget, TiltBase
from gravcomp.view.scene import BASE, SCALE, WORLD, Scene

_TILTS = ("0°", "45°", "90°", "135°", "-45°")
_MODES = {"Compensate": "compensate", "Hold": "hold", "Release": "relax"}
_FAULTS = {
    "IMU frames lost": "{{kind: drop, frames: imu, duration: {0:g}}}",
    "IMU stuck": "{{kind: imu_stuck, duration: {0:g}}}",
    "bus off": "{{kind: bus_off, duration: {0:g}}}",
    "30 % of the frames corrupt": "{{kind: corrupt, probability: 0.3, duration: {0:g}}}",
    "feedback late by 20 ms": "{{kind: delay, frames: feedback, duration: {0:g}}}",
    "heater dead": "{{kind: heater_dead, duration: {0:g}}}",
    "motor of {1} stalled": "{{kind: stall, cable: {1}, duration: {0:g}}}",
    "cable {1} broken": "{{kind: cable_break, cable: {1}, duration: {0:g}}}",
}


class Controls:
    """Builds the control panel; requests wait in `requests` until they are taken."""

    def __init__(self, server: viser.ViserServer, scene: Scene, length: float, cables: tuple[str, ...], graphics: str):
        self._requests: queue.SimpleQueue[Request] = queue.SimpleQueue()
        self._gui, self._scene, self._length = server.gui, scene, length
        self._quiet = False
        self._add_target()
        self._add_compensation()
        self._add_base()
        self._add_faults(cables)
        self._add_view(graphics)

    def requests(self) -> list[Request]:
        """What was asked for since the last call; of targets and tilts only the newest."""
        taken = []
        while not self._requests.empty():
            taken.append(self._requests.get())
        newest = {type(r): r for r in taken if isinstance(r, (SetTarget, TiltBase))}
        return [r for r in taken if not isinstance(r, (SetTarget, TiltBase))] + list(newest.values())

    def show_virtual(self, virtual: bool) -> None:
        """Controls of the virtual robot are shown only where there is one."""
        if self._base.visible != virtual:
            self._base.visible = self._faults.visible = virtual

    def show_recording(self, on: bool) -> None:
        """Say on the button what it does next."""
        label = "Stop recording" if on else "Record a bag"
        if self._record.label != label:
            self._record.label = label
        self._recording = on

    # Target.

    def _add_target(self) -> None:
        with self._gui.add_folder("Target"):
            self._angle = self._gui.add_slider(
                "bend °", min=0.0, max=120.0, step=1.0, initial_value=0.0, hint="between base and tip direction"
            )
            self._plane = self._gui.add_slider(
                "plane °", min=-180.0, max=180.0, step=1.0, initial_value=0.0, hint="into which it bends, from x"
            )
            straight = self._gui.add_button("Straight")
        self._angle.on_update(self._on_bend)
        self._plane.on_update(self._on_bend)
        self._scene.gizmo.on_update(self._on_gizmo)
        straight.on_click(lambda _: self._set_bend(0.0, math.radians(self._plane.value)))

    def _on_bend(self, event) -> None:
        if event.client is None:  # set by the program, not by a person
            return
        angle, plane = math.radians(self._angle.value), math.radians(self._plane.value)
        self._place_gizmo(angle, plane)
        self._requests.put(SetTarget(angle, plane))

    def _on_gizmo(self, event) -> None:
        if event.client is None:
            return
        # The arc through the handle: its chord leans by half the bend.
        x, y, z = np.asarray(self._scene.gizmo.position)
        angle = min(2.0 * math.atan2(math.hypot(x, y), z), math.radians(120.0))
        plane = math.atan2(y, x) if angle > math.radians(1.0) else math.radians(self._plane.value)
        self._angle.value, self._plane.value = round(math.degrees(angle), 1), round(math.degrees(plane), 1)
        self._requests.put(SetTarget(angle, plane))

    def _set_bend(self, angle: float, plane: float) -> None:
        self._angle.value, self._plane.value = math.degrees(angle), math.degrees(plane)
        self._place_gizmo(angle, plane)
        self._requests.put(SetTarget(angle, plane))

    def _place_gizmo(self, angle: float, plane: float) -> None:
        from gravcomp.inverse.target import arc_points

        self._scene.gizmo.position = SCALE * arc_points(self._length, angle, plane, np.array([1.0]))[0]

    # Loop, base, faults.

    def _add_compensation(self) -> None:
        with self._gui.add_folder("Compensation"):
            modes = self._gui.add_button_group("cables", tuple(_MODES))
            bridge = self._gui.add_button_group("motors", ("Home", "Stop"))
            self._record = self._gui.add_button("Record a bag")
        self._recording = False
        modes.on_click(lambda e: self._requests.put(Compensate(_MODES[e.target.value])))
        bridge.on_click(lambda e: self._requests.put(BridgeService(e.target.value.lower())))
        self._record.on_click(lambda _: self._requests.put(Record(not self._recording)))

    def _add_base(self) -> None:
        self._base = self._gui.add_folder("Base of the virtual robot")
        with self._base:
            presets = self._gui.add_button_group("presets", _TILTS)
            self._inclination = self._gui.add_slider(
                "inclination °", min=-90.0, max=180.0, step=1.0, initial_value=0.0, hint="0 horizontal, 90 pointing up"
            )
            self._roll = self._gui.add_slider("roll °", min=-180.0, max=180.0, step=1.0, initial_value=0.0)
        self._inclination.on_update(self._on_tilt)
        self._roll.on_update(self._on_tilt)

        @presets.on_click
        def _(event) -> None:
            self._inclination.value = float(event.target.value.rstrip("°"))
            self._put_tilt()

    def _on_tilt(self, event) -> None:
        if event.client is not None:
            self._put_tilt()

    def _put_tilt(self) -> None:
        self._requests.put(TiltBase(math.radians(self._inclination.value), math.radians(self._roll.value)))

    def _add_faults(self, cables: tuple[str, ...]) -> None:
        self._faults = self._gui.add_folder("Faults", expand_by_default=False)
        with self._faults:
            cable = self._gui.add_dropdown("cable", cables) if cables else None
            kind = self._gui.add_dropdown("fault", tuple(text.replace("{1}", "the cable") for text in _FAULTS))
            duration = self._gui.add_slider("for s", min=0.5, max=20.0, step=0.5, initial_value=2.0)
            inject = self._gui.add_button("Inject", color="red")
            clear = self._gui.add_button("Clear all")
        texts = {text.replace("{1}", "the cable"): fault for text, fault in _FAULTS.items()}
        name = cable.value if cable else ""

        @inject.on_click
        def _(_) -> None:
            self._requests.put(InjectFault(texts[kind.value].format(duration.value, cable.value if cable else name)))

        clear.on_click(lambda _: self._requests.put(InjectFault("clear")))

    def _add_view(self, graphics: str) -> None:
        with self._gui.add_folder("View", expand_by_default=False):
            quality = self._gui.add_dropdown("graphics", GRAPHICS, initial_value=graphics, hint="light: where a processor draws")
            view = self._gui.add_dropdown("seen from", (WORLD, BASE))
            boxes = {
                "rest": self._gui.add_checkbox("rest shape", True),
                "truth": self._gui.add_checkbox("virtual robot's truth", True),
                "target": self._gui.add_checkbox("target", True),
            }
            handle = self._gui.add_checkbox("drag the target", False, hint="a handle at the tip of the target")

        @quality.on_update
        def _(_) -> None:
            self._scene.set_graphics(quality.value)

        @view.on_update
        def _(_) -> None:
            self._scene.view = view.value

        @handle.on_update
        def _(_) -> None:
            self._place_gizmo(math.radians(self._angle.value), math.radians(self._plane.value))
            self._scene.gizmo.visible = handle.value

        for what, box in boxes.items():
            box.on_update(lambda _, what=what, box=box: self._scene.set_visible(what, box.value))
