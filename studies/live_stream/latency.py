"""How soon a pose's estimate is out: a sender that times the answers of ``windwrench live``."""

import json
import os
import select
import socket
import subprocess
import sys
import tempfile
import time
from typing import Any

import numpy as np

from windwrench.dynamics import load_vehicle
from windwrench.envs.recording import record_flight

_START = "from windwrench.cli import main; main()"
_ANSWERS = 30.0  # s that the first is waited for


def measure(seconds: float = 20.0, view: bool = False, record: bool = False) -> dict[str, Any]:
    """Send a flight at 200 Hz by UDP to ``windwrench live`` on this machine; return the times from
    sending a row to receiving its estimate, and those that the command itself reports, ms.

    Args:
        seconds: of flight.
        view: whether the page is served meanwhile.
        record: whether the flight is recorded meanwhile.
    """
    flown = record_flight(load_vehicle("ardrone2"), trajectory="gentle", seconds=seconds, seed=1)
    names = ("px", "py", "pz", "qw", "qx", "qy", "qz", "omega1", "omega2", "omega3", "omega4")
    table = np.column_stack([flown["position"], flown["quaternion"], flown["rotor_speeds"]])
    port = _free_port()
    words = [f"udp-json://127.0.0.1:{port}?reply=1", "--vehicle", "ardrone2", "--wait", "60"]
    words += ["--json", "--rate", "200", "--seconds", str(seconds - 0.5)]
    words += ["--view", "--port", "0"] if view else []
    log = os.path.join(tempfile.gettempdir(), f"windwrench-latency-{os.getpid()}.csv")
    words += ["--record", log] if record else []
    ours = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    ours.settimeout(0.0)
    with subprocess.Popen(
        [sys.executable, "-c", _START, "live", *words],
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
    ) as running:
        sent: dict[float, int] = {}
        times: list[float] = []

        def listen(until: int) -> None:
            while (left := until - time.monotonic_ns()) > 0:
                if not select.select([ours], [], [], 1e-9 * left)[0]:
                    return
                try:
                    answer = json.loads(ours.recv(4096))
                except (BlockingIOError, ConnectionError):
                    continue
                begin = sent.pop(answer["t"], None)
                if begin is not None:
                    times.append(1e-6 * (time.monotonic_ns() - begin))

        deadline = time.monotonic() + _ANSWERS
        while not times and time.monotonic() < deadline:  # until it listens
            _send(ours, port, flown["t"][0], names, table[0], sent)
            listen(time.monotonic_ns() + 50_000_000)
        times.clear()
        begin = time.monotonic_ns()
        for first in range(1, len(table)):
            due = begin + round(5_000_000 * first)
            listen(due)
            _send(ours, port, flown["t"][first], names, table[first], sent)
        listen(time.monotonic_ns() + 200_000_000)
        running.terminate() if running.poll() is None else None
        said = running.stdout.read() if running.stdout else ""
    if record:
        os.unlink(log)
    own = json.loads(said)["result"] if said.strip() else {}
    found = np.array(times)
    return {
        "rows": len(found),
        "page_served": view,
        "recorded": record,
        "there_and_back_ms": {
            "median": round(float(np.median(found)), 3),
            "p99": round(float(np.quantile(found, 0.99)), 3),
            "longest": round(float(found.max()), 3),
        },
        "arrival_to_estimate_ms": own.get("latency_ms"),
        "processor_ms": own.get("processor_ms"),
    }


def _send(
    ours: socket.socket,
    port: int,
    t: float,
    names: tuple[str, ...],
    row: Any,
    sent: dict[float, int],
) -> None:
    data = json.dumps({"t": float(t), **dict(zip(names, row.tolist(), strict=True))}).encode()
    sent[round(float(t), 9)] = time.monotonic_ns()
    ours.sendto(data, ("127.0.0.1", port))


def _free_port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as one:
        one.bind(("127.0.0.1", 0))
        return int(one.getsockname()[1])
