"""The stream as a page in a browser on this machine: the vehicle, the force as an arrow, the last
30 s.

The page is served on 127.0.0.1 alone and asks for nothing from elsewhere. A browser gets new
estimates ten times a second as server-sent events. Requests for another host are refused: no
page of another site reads the stream by pointing its name at this machine. One thread serves all
browsers without waiting. The thread holds few connections, each for a time, and skips events for a
slow browser.
"""

import asyncio
import json
import logging
import math
import socket
import threading
from collections import deque
from importlib import resources
from typing import Any

from ..runtime.errors import InputError
from .session import SILENT, VIEWED, Session

_EVERY = 0.1  # s between two events
_HOSTS = ("127.0.0.1", "localhost")
_MOST = 16  # connections; a browser holds one for events, and one for the page
_TIMEOUT = 5.0  # s, longest time of a request, and of a browser without reading
_HEAD = 8192  # most bytes of a request
_HEADERS = """HTTP/1.1 {status}
Content-Type: {kind}
Cache-Control: no-store
Connection: close
Content-Security-Policy: default-src 'none'; script-src 'unsafe-inline'; \
style-src 'unsafe-inline'; connect-src 'self'

""".replace("\n", "\r\n")


class WebView:
    """Serves the page of a session while a ``with`` block lasts.

    Args:
        session: to show.
        port: to listen at; 0: any free one.

    Raises:
        InputError: another listens there.
    """

    def __init__(self, session: Session, port: int) -> None:
        self._session = session
        self._over = threading.Event()
        self._page = resources.files(__package__).joinpath("view.html").read_bytes()
        # time, s, and text of each estimate
        self._points: deque[tuple[float, str]] = deque(maxlen=VIEWED)
        self._open: set[asyncio.Task[None]] = set()  # connections
        try:
            self._socket = socket.create_server(("127.0.0.1", port))
        except (OSError, OverflowError) as error:
            raise InputError(
                f"--port {port}: no page can be served there: {getattr(error, 'strerror', error)}; "
                "expected another, or 0 for any that is free"
            ) from error
        self.address = f"http://127.0.0.1:{self._socket.getsockname()[1]}/"
        self._thread = threading.Thread(target=self._run, daemon=True, name="page")

    def __enter__(self) -> "WebView":
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._over.set()
        self._thread.join(_TIMEOUT)

    def _run(self) -> None:
        logging.getLogger("asyncio").setLevel(logging.CRITICAL)  # browsers that go are no error
        with self._session.tallies.spared("not shown", "the page"), self._socket:
            asyncio.run(self._serve())

    async def _serve(self) -> None:
        self._look()
        server = await asyncio.start_server(self._connected, sock=self._socket, limit=_HEAD)
        while not self._over.is_set():
            await asyncio.sleep(_EVERY)
            self._look()
        server.close()
        if self._open:
            await asyncio.wait(self._open, timeout=10 * _EVERY)  # until browsers know

    async def _connected(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        """Answer one request, or turn its connection away."""
        try:
            if len(self._open) >= _MOST:
                self._session.tallies.counts["turned away"] += 1
                writer.write(_head("503 Service Unavailable"))
                return
            task: Any = asyncio.current_task()
            self._open.add(task)
            task.add_done_callback(self._open.discard)
            writer.transport.set_write_buffer_limits(0)  # drained is sent
            request = await asyncio.wait_for(reader.readuntil(b"\r\n\r\n"), _TIMEOUT)
            status, path = _asked(request)
            writer.write(_head(status, "event-stream" if path == "/events" else "html"))
            if path == "/events":
                await self._tell(writer)
            elif path == "/":
                writer.write(self._page)
            await asyncio.wait_for(writer.drain(), _TIMEOUT)
        except (OSError, EOFError, asyncio.LimitOverrunError):
            writer.transport.abort()  # too slow, gone, or no browser
        finally:
            writer.close()

    async def _tell(self, writer: asyncio.StreamWriter) -> None:
        """Send events until the stream ends; the first has the last 30 s.

        Raises:
            TimeoutError: the browser reads nothing.
        """
        session = self._session
        last = -math.inf
        missed = 0
        vehicle = session.source.vehicle
        first: dict[str, Any] = {
            "vehicle": vehicle.name,
            "source": session.source.name,
            "weight": vehicle.weight,
            "arm": vehicle.arm_l,
            "rotors": vehicle.positions.tolist(),
        }
        while not writer.is_closing():
            if writer.transport.get_write_buffer_size():
                missed += 1
                session.tallies.counts["not shown"] += 1
                if missed * _EVERY > _TIMEOUT:
                    raise TimeoutError
            else:
                over = self._over.is_set()
                points = ",".join(text for t, text in self._points if t > last)
                last = self._points[-1][0] if self._points else last
                missed = 0
                ended = (session.ended or "the stream ended") if over else ""
                head = json.dumps({**first, "over": ended})[1:-1]
                writer.write(f'data: {{{head},{self._state},"points":[{points}]}}\n\n'.encode())
                first = {}
                if over:
                    return
            await asyncio.sleep(_EVERY)

    def _look(self) -> None:
        """Keep new estimates and the state, for all browsers."""
        session = self._session
        for one in session.since(self._points[-1][0] if self._points else -math.inf):
            numbers = [float(f"{x:.5g}") for x in (*one.wrench, *one.std)]
            self._points.append((one.t, json.dumps([round(one.t, 3), *numbers])))
        tallies = session.tallies
        state: dict[str, Any] = {}
        if session.output is not None:
            estimate = session.output.estimate
            state = {
                "position": estimate.position.tolist(),
                "quaternion": estimate.quaternion.tolist(),
                "status": "silent" if session.silence > SILENT else estimate.status,
            }
        state |= {
            "rates": tallies.hertz,
            "counts": tallies.found,
            "restarts": session.filter.restarts,
            "recorded": session.recorded,
            "latency": [x if x == x else None for x in tallies.latency.median_and_most],
        }
        self._state = json.dumps(state)[1:-1]


def _asked(request: bytes) -> tuple[str, str]:
    """Return the status for a request, and the path to serve; empty: none."""
    first, *lines = request.decode("latin-1").split("\r\n")
    fields = dict(line.lower().split(":", 1) for line in lines if ":" in line)
    words = first.split(" ")
    host = fields.get("host", "").strip()
    if host.partition(":")[0] not in _HOSTS:
        return "403 Forbidden", ""
    if len(words) != 3 or words[0] != "GET":
        return "405 Method Not Allowed", ""
    return ("200 OK", words[1]) if words[1] in ("/", "/events") else ("404 Not Found", "")


def _head(status: str, kind: str = "html") -> bytes:
    return _HEADERS.format(status=status, kind=f"text/{kind}; charset=utf-8").encode()
