"""When the guard of a joint bridge sends zero efforts. It has no process, no clock and no topics of its own.

A forward command controller keeps its last efforts for ever. So joint_bridge starts a second process, to which it writes a byte
every control period:

    heartbeats come              the guard is silent
    none for TIMEOUT             it sends zeros, until they come again (the bridge was blocked)
    the pipe ends                it sends zeros for LASTING (the bridge was killed), and then ends
    a good-bye                   it ends
"""

TIMEOUT = 0.1
"""s without a heartbeat."""

LASTING = 15.0
"""s for which zeros are sent after the bridge has ended."""

BEAT, GOODBYE = b".", b"q"


class JointGuard:
    """State of the guard; times in s (monotonic)."""

    def __init__(self, now: float):
        self._beat = now
        self._ended: float | None = None
        self._left = False

    def on_bytes(self, data: bytes, now: float) -> None:
        """Take what came through the pipe; nothing: the pipe has ended."""
        if not data:
            self._ended = now if self._ended is None else self._ended
        elif GOODBYE in data:
            self._left = True
        else:
            self._beat = now

    def acting(self, now: float) -> bool:
        """Whether zeros must be sent."""
        return not self._left and (self._ended is not None or now - self._beat > TIMEOUT)

    def done(self, now: float) -> bool:
        """Whether the guard may end."""
        return self._left or (self._ended is not None and now - self._ended > LASTING)
