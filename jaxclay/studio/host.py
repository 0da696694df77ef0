"""A page of its own for the modeller: HTTP and a WebSocket on 127.0.0.1, by ``websockets`` alone.

The page shows the widget of Jupyter, whose comm is the WebSocket.  Every tab is a view of the one
piece.  Nothing else on the machine or beyond may speak to it: it binds 127.0.0.1, answers only to
its own name in Host and Origin, knows four paths, and limits the size of messages.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import logging
import struct
from collections.abc import Callable
from http import HTTPStatus
from pathlib import Path
from typing import Any

from jaxclay.numerics.checks import needing

with needing("studio", "jaxclay studio"):
    from websockets.asyncio.server import ServerConnection, serve
    from websockets.datastructures import Headers
    from websockets.exceptions import ConnectionClosed
    from websockets.http11 import Request, Response

ADDRESS = "127.0.0.1"
MOST_BYTES = 16 * 2**20  # of a message
_STATIC = Path(__file__).parent / "static"
_PAGES = {
    "/": ("page.html", "text/html; charset=utf-8"),
    "/page.js": ("page.js", "text/javascript; charset=utf-8"),
    "/studio.js": ("studio.js", "text/javascript; charset=utf-8"),
}
_SOCKET = "/socket"
_POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'unsafe-inline'; connect-src 'self'; "
    "img-src data: blob:; frame-ancestors 'none'; base-uri 'none'; form-action 'none'"
)


class Host:
    """Serves the page and carries messages between its tabs and a widget.

    Parameters
    ----------
    make : callable
        Makes the widget, once, when its comm can be created; in a thread, since it imports much.
    port : int
        0 for any that is free.
    """

    def __init__(self, make: Callable[[], Any], port: int = 0):
        self._make, self._port = make, port
        self._tabs: set[ServerConnection] = set()
        self._sending: set[asyncio.Task[None]] = set()  # the loop itself holds them weakly
        self._widget: Any = None
        self._comm = ""
        self._loop: asyncio.AbstractEventLoop | None = None

    async def run(self, started: Callable[[str], None]) -> None:
        """Serve until cancelled; ``started`` is told the address."""
        self._loop = asyncio.get_running_loop()
        options: dict[str, Any] = {"compression": None, "max_size": MOST_BYTES}
        async with serve(
            self._talk, ADDRESS, self._port, process_request=self._page, ping_interval=None,
            **options,
        ) as server:  # fmt: skip
            self._port = next(iter(server.sockets)).getsockname()[1]
            started(f"http://{ADDRESS}:{self._port}/")
            self._widget = await asyncio.to_thread(self._made)
            for tab in list(self._tabs):
                await self._greet(tab)
            await asyncio.Future()

    def _publish(self, data: dict, buffers: list) -> None:
        """Send what the widget says to all tabs; from any thread."""
        frame = _packed(data, buffers)
        assert self._loop is not None
        with contextlib.suppress(RuntimeError):  # the loop has ended
            if _in_loop(self._loop):
                self._broadcast(frame)
            else:
                self._loop.call_soon_threadsafe(self._broadcast, frame)

    def _made(self) -> Any:
        """The widget, its comm one of sockets."""
        import comm
        from comm.base_comm import BaseComm

        host = self

        class Comm(BaseComm):
            def publish_msg(self, msg_type, data=None, metadata=None, buffers=None, **keys):
                if msg_type == "comm_msg" and self.comm_id == host._comm:
                    host._publish(data or {}, buffers or [])

        comm.create_comm = Comm
        widget = self._make()
        self._comm = widget.model_id
        return widget

    def _broadcast(self, frame: bytes) -> None:
        assert self._loop is not None
        for tab in list(self._tabs):
            sending = self._loop.create_task(_send(tab, frame))
            self._sending.add(sending)
            sending.add_done_callback(self._sending.discard)

    async def _greet(self, tab: ServerConnection) -> None:
        state = {k: v for k, v in self._widget.get_state().items() if not k.startswith("_")}
        state.pop("layout", None)
        await _send(tab, _packed({"method": "open", "state": state}, []))

    async def _talk(self, tab: ServerConnection) -> None:
        self._tabs.add(tab)
        views: set[str] = set()
        try:
            if self._widget is not None:
                await self._greet(tab)
            async for frame in tab:
                if self._widget is None:
                    continue
                data, buffers = _unpacked(frame)
                if data is None:
                    self._refuse("no message: JSON, and perhaps buffers after it")
                    continue
                content = data.get("content")
                if isinstance(content, dict) and isinstance(content.get("view"), str):
                    views.add(content["view"][:64])
                try:
                    message = {"content": {"data": data}, "buffers": buffers}
                    self._widget.comm.handle_msg(message)
                except Exception:
                    logging.getLogger("jaxclay.studio").exception("a fault inside")
                    self._refuse("a fault inside, not in what was asked: the piece is kept")
                await asyncio.sleep(0)
        except ConnectionClosed:
            pass
        finally:
            self._tabs.discard(tab)
            if self._widget is not None:
                for view in views:
                    self._widget.left(view)

    def _refuse(self, text: str) -> None:
        told = {"type": "refused", "message": text, "view": "", "id": 0}
        self._publish({"method": "custom", "content": told}, [])

    def _page(self, connection: ServerConnection, request: Request) -> Response | None:
        """Files, or a reason to refuse; None lets a WebSocket be opened."""
        names = {f"{name}:{self._port}" for name in (ADDRESS, "localhost")}
        if request.headers.get("Host") not in names:
            return _response(HTTPStatus.FORBIDDEN, b"not this host")
        path = request.path.split("?")[0]
        if path == _SOCKET:
            origins = {f"http://{name}" for name in names}
            if request.headers.get("Origin") not in origins:
                return _response(HTTPStatus.FORBIDDEN, b"not from this page")
            return None
        if path not in _PAGES:
            return _response(HTTPStatus.NOT_FOUND, b"nothing here")
        name, kind = _PAGES[path]
        return _response(HTTPStatus.OK, (_STATIC / name).read_bytes(), kind)


def _in_loop(loop: asyncio.AbstractEventLoop) -> bool:
    try:
        return asyncio.get_running_loop() is loop
    except RuntimeError:
        return False


async def _send(tab: ServerConnection, frame: bytes) -> None:
    with contextlib.suppress(ConnectionClosed):
        await tab.send(frame)


def _response(status: HTTPStatus, body: bytes, kind: str = "text/plain") -> Response:
    headers = Headers()
    for name, value in (
        ("Content-Type", kind), ("Content-Length", str(len(body))), ("Connection", "close"),
        ("Cache-Control", "no-store"), ("X-Content-Type-Options", "nosniff"),
        ("Referrer-Policy", "no-referrer"), ("Content-Security-Policy", _POLICY),
    ):  # fmt: skip
        headers[name] = value
    return Response(status.value, status.phrase, headers, body)


def _packed(data: dict, buffers: list) -> bytes:
    """The length of the JSON, the JSON with the buffers' lengths, the buffers."""
    sizes = [len(memoryview(buffer).cast("B")) for buffer in buffers]
    text = json.dumps(data | {"sizes": sizes}).encode()
    return b"".join([struct.pack("<I", len(text)), text, *map(bytes, buffers)])


def _unpacked(frame: Any) -> tuple[dict | None, list[bytes]]:
    """What a tab has sent; None where it makes no sense."""
    try:
        (length,) = struct.unpack_from("<I", frame)
        data, at, buffers = json.loads(frame[4 : 4 + length]), 4 + length, []
        sizes = data.pop("sizes")
        if sum(sizes) != len(frame) - at or not all(type(s) is int and s >= 0 for s in sizes):
            return None, []
        for size in sizes:
            buffers.append(frame[at : at + size])
            at += size
        key = {"custom": "content", "update": "state"}[data["method"]]
        sound = isinstance(data[key], dict)
        return ({"method": data["method"], key: data[key]} if sound else None), buffers
    except (ValueError, TypeError, AttributeError, KeyError, RecursionError, struct.error):
        return None, []
