"""A call of a service that is repeated until the service answers that it has succeeded.

A single call is not enough: a node that has just been discovered, or restarted, can miss a request, and one that is not active
refuses it. Two requests that wait for a busy node are served in the order in which it has created its services, not in that of
the calls: the second one is sent when the first one has been answered.
"""

import math
import time
from typing import Any

from rclpy.client import Client
from rclpy.task import Future

_ANSWER = 5.0  # s: a service that has not answered by then is called again
_PAUSE = 1.0  # s, at least, between two calls


class RepeatedCall:
    """Calls of a service whose answer has the fields `success` and `message`.

    service: its name. refusal: the message of the last answer, when it was none of success; else empty.
    """

    def __init__(self, client: Client, request: Any):
        self._client, self._request = client, request
        self._future: Future | None = None
        self._called_at = -math.inf
        self._succeeded = False
        self.service = client.srv_name
        self.refusal = ""

    def succeeds(self) -> bool:
        """Call the service where that is due; return whether it has succeeded. For a timer; it does not wait."""
        now = time.monotonic()
        if self._future is not None and self._future.done():
            answer, self._future = self._future.result(), None
            self._succeeded = answer is not None and answer.success
            self.refusal = "" if answer is None or answer.success else answer.message
        elif self._future is not None and now - self._called_at > _ANSWER:
            self._client.remove_pending_request(self._future)
            self._future = None
        if not self._succeeded and self._future is None and now - self._called_at > _PAUSE and self._client.service_is_ready():
            self._future, self._called_at = self._client.call_async(self._request), now
        return self._succeeded
