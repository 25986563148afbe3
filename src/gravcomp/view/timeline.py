"""Earlier states: the page keeps the snapshots of the last minutes, and a slider selects one of them while the robot runs."""

import bisect
import collections

import viser

from gravcomp.view.handles import set_value
from gravcomp.view.snapshot import Snapshot


class Timeline:
    """The slider, in the current GUI container, and the snapshots of the last `span` s at up to `rate` per second.

    The page is held when the slider leaves 0; from then on the slider counts from that moment.
    """

    def __init__(self, gui: viser.GuiApi, span: float, rate: float) -> None:
        self._snapshots: collections.deque[Snapshot] = collections.deque(maxlen=int(span * rate) + 1)
        self._ago = gui.add_slider(
            "look back s", min=0.0, max=span, step=0.1, initial_value=0.0, hint="0: live; the robot continues to run"
        )
        self._since: list[Snapshot] = []  # the snapshots at the moment when the page was held

    def add(self, snapshot: Snapshot) -> None:
        """Keep a snapshot. A time before the last one clears the timeline first."""
        if self._snapshots and snapshot.time < self._snapshots[-1].time:
            self._snapshots.clear()
        self._snapshots.append(snapshot)

    def return_to_live(self) -> None:
        """Show the live state."""
        set_value(self._ago, 0.0)

    @property
    def held(self) -> tuple[Snapshot, float] | None:
        """The snapshot to show, and the time (s) at which the page was held; None in the live state."""
        ago = self._ago.value
        if ago <= 0.0 or not self._snapshots:
            self._since = []
            return None
        if not self._since:
            self._since = list(self._snapshots)
        held_at = self._since[-1].time
        index = bisect.bisect_right(self._since, held_at - ago, key=lambda snapshot: snapshot.time)
        return self._since[max(0, index - 1)], held_at
