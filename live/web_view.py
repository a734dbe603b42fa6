"""The stream as a page in a browser on this machine: the vehicle, the force as an arrow, the last
30 s.

Served with Python's own HTTP server on 127.0.0.1 alone; the page asks for nothing from elsewhere. A
browser is told ten times a second what has come since, as server-sent events. Requests that name
another host are refused: no page of another site reads the stream by pointing its name at this
machine.
"""

import json
import math
import threading
import time
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from importlib import resources
from typing import Any

from ..runtime.errors import InputError
from .filtering import Output
from .session import SILENT, Session

_EVERY = 0.1  # s between two events
_HOSTS = ("127.0.0.1", "localhost")


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
        page = resources.files(__package__).joinpath("view.html").read_bytes()
        view = self

        class Handler(BaseHTTPRequestHandler):
            """Answers one request."""

            def do_GET(self) -> None:
                """Give the page, or the events."""
                host = self.headers.get("Host", "").rpartition(":")[0] or self.headers.get("Host")
                if host not in _HOSTS:
                    self.send_error(403)
                elif self.path == "/":
                    self._head("text/html; charset=utf-8", len(page))
                    self.wfile.write(page)
                elif self.path == "/events":
                    self._head("text/event-stream", None)
                    view._tell(self.wfile)
                else:
                    self.send_error(404)

            def _head(self, kind: str, length: int | None) -> None:
                self.send_response(200)
                self.send_header("Content-Type", kind)
                self.send_header("Cache-Control", "no-store")
                self.send_header(
                    "Content-Security-Policy",
                    "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; "
                    "connect-src 'self'",
                )
                if length is not None:
                    self.send_header("Content-Length", str(length))
                self.end_headers()

            def log_message(self, format: str, *args: Any) -> None:
                """Say nothing on the terminal."""

        try:
            self._server = ThreadingHTTPServer(("127.0.0.1", port), Handler)
        except OSError as error:
            raise InputError(
                f"--port {port}: no page can be served there: {error.strerror or error}; expected "
                "another, or 0 for any that is free"
            ) from error
        self._server.daemon_threads = True
        self.address = f"http://127.0.0.1:{self._server.server_address[1]}/"

    def __enter__(self) -> "WebView":
        self._thread = threading.Thread(target=self._server.serve_forever, daemon=True)
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._over.set()
        self._server.shutdown()
        self._server.server_close()

    def _tell(self, file: Any) -> None:
        """Send events until the browser goes or the stream ends; the first has the last 30 s."""
        source = self._session.source
        first: dict[str, Any] = {
            "vehicle": source.vehicle.name,
            "source": source.name,
            "weight": source.vehicle.weight,
            "arm": source.vehicle.arm_l,
            "rotors": source.vehicle.positions.tolist(),
        }
        last = -math.inf  # s, stream's time of the newest estimate that was sent
        try:
            while True:
                over = self._over.is_set()
                points = self._session.since(last)
                last = points[-1].t if points else last
                event = {**first, **self._state(points), "over": over}
                file.write(f"data: {json.dumps(event)}\n\n".encode())
                file.flush()
                first = {}
                if over:
                    return
                time.sleep(_EVERY)
        except OSError:  # the browser has gone
            return

    def _state(self, points: list[Output]) -> dict[str, Any]:
        now = self._session.snapshot()
        output = now.output
        if output is None:
            return {"points": []}
        estimate = output.estimate
        return {
            "points": [_point(one) for one in points],
            "position": estimate.position.tolist(),
            "quaternion": estimate.quaternion.tolist(),
            "status": "silent" if now.silence > SILENT else estimate.status,
            "rates": now.rates,
            "counts": now.counts,
            "restarts": now.restarts,
            "recorded": now.recorded,
            "latency": [x if x == x else None for x in now.latency_ms],
        }


def _point(output: Output) -> list[float]:
    """Return time, force, torque and their standard deviations."""
    values = [output.t, *output.wrench, *output.std]
    return [float(f"{x:.5g}") if i else round(x, 3) for i, x in enumerate(values)]
