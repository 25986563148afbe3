"""Only the page itself may open the connection by which a browser drives the robot.

A browser lets every web page that it shows connect to a WebSocket of this machine, and names in the header `Origin`
where the page comes from (RFC 6455, section 10.2). viser takes every origin, so that a foreign page could drive the robot of a
user who has opened it. Here the origin has to be the address that the connection itself asks for. Programs that are no browsers
send no origin, and are taken.
"""

import functools
import http
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any
from unittest import mock

import websockets.asyncio.server
from websockets.datastructures import Headers


def is_foreign(headers: Headers) -> bool:
    """Return whether the headers of a request come from a web page of another address than the one that they ask for."""
    origins = headers.get_all("Origin")
    return bool(origins) and [origin.partition("://")[2].lower() for origin in origins] != [headers.get("Host", "").lower()]


@contextmanager
def own_origin_only() -> Iterator[None]:
    """Let a viser server that is started within refuse connections of foreign pages, as viser has no setting for it."""
    with mock.patch.object(websockets.asyncio.server, "serve", _serve(websockets.asyncio.server.serve)):
        yield


def _serve(serve: Callable[..., Any]) -> Callable[..., Any]:
    @functools.wraps(serve)
    def guarded(*arguments: Any, process_request: Callable[..., Any], **named: Any) -> Any:
        def process(connection: Any, request: Any) -> Any:
            if is_foreign(request.headers):
                return connection.respond(http.HTTPStatus.FORBIDDEN, "This page belongs to another address.\n")
            return process_request(connection, request)

        return serve(*arguments, process_request=process, **named)

    return guarded
