"""How late a message is, from its stamp on a clock that need not be the host's.

    lateness = (arrival - stamp) - c,    c: the clocks' difference

c is 0 where the fastest message of the last one to two WINDOWs came between 0 and SAME_CLOCK after its stamp: the sender then has
the host's clock. Otherwise c is the arrival - stamp of this message, so that only what a queue, a loaded machine or a blocked
process adds is left.
"""

import math

WINDOW = 10.0
"""s; so long a change of the clocks' difference counts as lateness, at most twice."""

SAME_CLOCK = 1.0
"""s; a sender whose clock is behind by less than this looks like one whose messages are late."""


class StampLateness:
    """Lateness of the messages of one sender."""

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Forget the clocks' difference: the sender may have another clock now."""
        self._begin, self._least, self._earlier = -math.inf, math.inf, math.inf

    def of(self, now: float, behind: float) -> float:
        """Return how late (s) a message is that arrives now (s), `behind` (s) its stamp by the host's clock."""
        if not now - self._begin <= WINDOW:
            self._begin, self._earlier, self._least = now, self._least, behind
        self._least = min(self._least, behind)
        fastest = min(self._least, self._earlier)
        return behind if 0.0 <= fastest <= SAME_CLOCK else behind - fastest
