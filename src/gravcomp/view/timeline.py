"""Looking back: what the page showed in the last minutes is kept, and a slider turns it back while the robot goes on."""

import bisect
import collections

import viser

from gravcomp.view.snapshot import Snapshot


class Timeline:
    """The slider, in the current GUI container, and the snapshots of the last `span` s at up to `rate` a second.

    The first move of the slider away from 0 holds the page; from then on it counts from that moment.
    """

    def __init__(self, gui: viser.GuiApi, span: float, rate: float):
        self._snapshots: collections.deque[Snapshot] = collections.deque(maxlen=int(span * rate) + 1)
        self._ago = gui.add_slider(
            "look back s", min=0.0, max=span, step=0.1, initial_value=0.0, hint="0: live; the robot goes on meanwhile"
        )
        self._since: list[Snapshot] = []  # what could be looked back at when the page was held

    def add(self, snapshot: Snapshot) -> None:
        """Keep it. One whose time went back begins anew."""
        if self._snapshots and snapshot.time < self._snapshots[-1].time:
            self._snapshots.clear()
        self._snapshots.append(snapshot)

    def return_to_live(self) -> None:
        """Stop looking back."""
        self._ago.value = 0.0

    @property
    def held(self) -> tuple[Snapshot, float] | None:
        """What the page shall show in place of the newest, and at which time (s) it was held; None while it is live."""
        ago = self._ago.value
        if ago <= 0.0 or not self._snapshots:
            self._since = []
            return None
        if not self._since:
            self._since = list(self._snapshots)
        held_at = self._since[-1].time
        index = bisect.bisect_right(self._since, held_at - ago, key=lambda snapshot: snapshot.time)
        return self._since[max(0, index - 1)], held_at
