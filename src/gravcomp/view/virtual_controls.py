"""Controls of the virtual robot: tilt of its base, a wall next to it, and faults."""

import math
from collections.abc import Callable

import viser

from gravcomp.view.handles import number, set_value
from gravcomp.view.placed_wall import SIDES, WallHandle
from gravcomp.view.requests import InjectFault, Request, TiltBase

_HINT = (
    '<div style="padding:.1em .9em .5em;font-size:.82em;line-height:1.45;opacity:.8">Drag the orange ball at the tip: a spring'
    " pulls the tip to the cursor. Put a wall up and drag it. The model knows neither.</div>"
)
_TILTS = ("0°", "45°", "90°", "135°", "-45°")
_FAULTS = {
    "IMU frames lost": "{{kind: drop, frames: imu, duration: {0:g}}}",
    "IMU stuck": "{{kind: imu_stuck, duration: {0:g}}}",
    "bus off": "{{kind: bus_off, duration: {0:g}}}",
    "30 % of the frames corrupt": "{{kind: corrupt, probability: 0.3, duration: {0:g}}}",
    "feedback delayed by 20 ms": "{{kind: delay, frames: feedback, duration: {0:g}}}",
    "heater dead": "{{kind: heater_dead, duration: {0:g}}}",
    "motor of {1} stalled": "{{kind: stall, cable: {1}, duration: {0:g}}}",
    "cable {1} broken": "{{kind: cable_break, cable: {1}, duration: {0:g}}}",
}


class VirtualControls:
    """Tilts the base, puts walls up and injects faults; `put` receives the requests."""

    def __init__(self, gui: viser.GuiApi, cables: tuple[str, ...], wall: WallHandle, put: Callable[[Request], None]) -> None:
        self._put = put
        self._touch = self._add_touch(gui, wall)
        self._base = self._add_base(gui)
        self._faults = self._add_faults(gui, cables)

    @property
    def visible(self) -> bool:
        """Whether the controls are shown."""
        return self._base.visible

    @visible.setter
    def visible(self, visible: bool) -> None:
        if self._base.visible != visible:
            self._touch.visible = self._base.visible = self._faults.visible = visible

    def _add_touch(self, gui: viser.GuiApi, wall: WallHandle) -> viser.GuiFolderHandle:
        folder = gui.add_folder("Touch the virtual robot")
        with folder:
            gui.add_html(_HINT)
            sides = gui.add_button_group("wall", SIDES)
            turn = gui.add_checkbox("turn the wall", False, hint="rings that turn it")
            away = gui.add_button("Take the wall away")
        sides.on_click(lambda e: wall.put_up(e.target.value))
        turn.on_update(lambda _: wall.show_rings(turn.value))
        away.on_click(lambda _: wall.take_away())
        return folder

    def _add_base(self, gui: viser.GuiApi) -> viser.GuiFolderHandle:
        folder = gui.add_folder("Base of the virtual robot")
        with folder:
            presets = gui.add_button_group("presets", _TILTS)
            self._inclination = gui.add_slider(
                "inclination °", min=-90.0, max=180.0, step=1.0, initial_value=0.0, hint="0: horizontal, 90: up"
            )
            self._roll = gui.add_slider("roll °", min=-180.0, max=180.0, step=1.0, initial_value=0.0)
        self._inclination.on_update(self._on_tilt)
        self._roll.on_update(self._on_tilt)
        presets.on_click(self._on_preset)
        return folder

    def _on_preset(self, event: viser.GuiEvent) -> None:
        if event.target.value in _TILTS:
            set_value(self._inclination, float(event.target.value.rstrip("°")))
            self._put_tilt()

    def _on_tilt(self, event: viser.GuiEvent) -> None:
        if event.client is not None:  # set by the user, not by the program
            self._put_tilt()

    def _put_tilt(self) -> None:
        self._put(TiltBase(math.radians(number(self._inclination)), math.radians(number(self._roll))))

    def _add_faults(self, gui: viser.GuiApi, cables: tuple[str, ...]) -> viser.GuiFolderHandle:
        texts = {text.replace("{1}", "the cable"): fault for text, fault in _FAULTS.items()}
        folder = gui.add_folder("Faults", expand_by_default=False)
        with folder:
            cable = gui.add_dropdown("cable", cables) if cables else None
            kind = gui.add_dropdown("fault", tuple(texts))
            duration = gui.add_slider("duration s", min=0.5, max=20.0, step=0.5, initial_value=2.0)
            inject = gui.add_button("Inject", color="red")
            clear = gui.add_button("Clear all")
        inject.on_click(lambda _: self._put(_fault(texts.get(str(kind.value), ""), number(duration), cable and cable.value)))
        clear.on_click(lambda _: self._put(InjectFault("clear")))
        return folder


def _fault(text: str, duration: float, cable: object) -> InjectFault:
    """The request for a fault of `duration` s; the virtual robot refuses what is none."""
    return InjectFault(text.format(duration, "" if cable is None else cable))
