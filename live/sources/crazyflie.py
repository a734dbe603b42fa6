"""A Crazyflie by its log, read with cflib over Crazyradio or USB.

``crazyflie:radio://0/80/2M/E7E7E7E7E7`` (``?period=10`` ms between samples, ``?imu=1`` for gyro and
accelerometer as well). One block of the log holds a row: position (``stateEstimate``), attitude
(``stateEstimateZ.quat``, in 32 bits: steps of 0.003 rad), the motors and the battery's voltage. The
motors are rpm where the firmware measures them (``rpm.m1``), else PWM (``motor.m1``), which the
vehicle's motor curve turns into thrust.

It only listens: no set point is ever sent, not even at the end, where cflib itself would send one
that stops the motors.
"""

import importlib
import logging
import queue
import threading
import time
from contextlib import suppress
from typing import Any

import numpy as np

from ...identification.logs.log_map import load_map
from ...runtime.errors import InputError
from ..field_map import FieldMap
from ..messages import Malformed, Sample
from .base import LARGEST_SHARE, Source, unwrapped

_FULL = 65_535.0  # PWM
_WRAP = 2**24  # ms, of a log's time stamps
_POSE = (
    *((f"stateEstimate.{axis}", "float") for axis in "xyz"),
    ("stateEstimateZ.quat", "uint32_t"),
)
_IMU = tuple((f"{sensor}.{axis}", "float") for sensor in ("gyro", "acc") for axis in "xyz")
_LONGEST = 1000  # rows that wait for us, 10 s
_CONNECTS = 20.0  # s


class CrazyflieLog(Source):
    """Rows of a Crazyflie's log."""

    kind, options = "crazyflie", ("period", "imu")

    library = "cflib"

    def _prepare(self) -> None:
        text, address = self.name, self.address
        self._uri = text.removeprefix("crazyflie:").partition("?")[0]
        if not address.scheme or not (address.host or address.path):
            raise InputError(
                f"{text}: expected the address of a Crazyflie, such as "
                "crazyflie:radio://0/80/2M/E7E7E7E7E7"
            )
        self._period = int(address.number("period", 10.0, least=10.0)) // 10 * 10
        self._imu = address.choice("imu", ("0", "1")) == "1"
        self._blocks: queue.SimpleQueue[tuple[Any, int]] = queue.SimpleQueue()  # and arrivals
        self.expected = f"log blocks every {self._period} ms"
        self._over = threading.Event()
        self._cf: Any = None
        self._stamps: dict[str, int] = {}  # ms, the newest of each block
        self._map = FieldMap(load_map("cflib"), self.vehicle, text)

    def open(self) -> None:
        """Connect and start the log.

        Raises:
            InputError: there is no such Crazyflie, or its firmware lacks a variable.
        """
        crtp: Any = importlib.import_module("cflib.crtp")
        crazyflie: Any = importlib.import_module("cflib.crazyflie")
        log: Any = importlib.import_module("cflib.crazyflie.log")
        for name in ("cflib.crazyflie", "cflib.crtp"):  # what it says comes as an error of ours
            logging.getLogger(name).setLevel(logging.CRITICAL)
        if not crtp.CLASSES:
            crtp.init_drivers()
        self._decompress = importlib.import_module("cflib.utils.encoding").decompress_quaternion
        answers: queue.SimpleQueue[str] = queue.SimpleQueue()  # why not; empty: it is connected
        self._cf = crazyflie.Crazyflie()
        self._cf.connected.add_callback(lambda uri: answers.put(""))
        self._cf.connection_failed.add_callback(
            lambda uri, message: answers.put(
                str(message or "").strip().partition("\n")[0][:300] or "no answer"
            )
        )
        self._cf.connection_lost.add_callback(self._lost)
        self._cf.open_link(self._uri)
        try:
            problem = answers.get(timeout=_CONNECTS)
        except queue.Empty:
            problem = f"no answer within {_CONNECTS:g} s"
        if problem:
            self.close()
            raise InputError(f"{self.name}: no Crazyflie there: {problem}")
        self._start(log)

    def _start(self, log: Any) -> None:
        toc = self._cf.log.toc
        measured = toc.get_element("rpm", "m1") is not None
        motors = "rpm" if measured else "motor"
        names = [*_POSE, *((f"{motors}.m{i}", "uint16_t") for i in range(1, 5))]
        blocks = [("row", [*names, ("pm.vbat", "FP16")])]
        if self._imu:
            blocks.append(("imu", list(_IMU)))
        for kind, variables in blocks:
            block = log.LogConfig(name=kind, period_in_ms=self._period)
            for name, fetched in variables:
                block.add_variable(name, fetched)
            block.data_received_cb.add_callback(self._take)
            try:
                self._cf.log.add_config(block)
                block.start()
            except (KeyError, AttributeError) as error:
                self.close()
                reason = error.args[0] if error.args else error
                raise InputError(f"{self.name}: the Crazyflie's log: {reason}") from error

    def _lost(self, uri: str, message: str) -> None:
        self.expected += f"; the link was lost: {str(message)[:200]}"
        self._over.set()

    def _stamp(self, kind: str, milliseconds: int) -> int:
        """Return a block's time in ms: its stamp begins at 0 again after 4.7 h."""
        last = self._stamps.get(kind, milliseconds)
        now = unwrapped(milliseconds, last, _WRAP)
        missed = round((now - last) / self._period) - 1
        if missed > 0:
            self.tallies.counts["lost"] += missed
        self._stamps[kind] = max(now, last)
        return now

    def _take(self, stamp: int, data: dict[str, Any], block: Any) -> None:
        """Take a block of the log, in cflib's thread."""
        if self._blocks.qsize() > _LONGEST:
            self.tallies.counts["lost"] += 1
        else:
            self._blocks.put(((block.name, stamp, data), time.monotonic_ns()))

    def decode(self, message: Any, arrival: int) -> Sample | None:
        """Return what a block holds."""
        kind, stamp, data = message
        if kind == "row":
            turn = self._decompress(data["stateEstimateZ.quat"])  # scalar last
            data |= {f"stateEstimate.q{x}": float(q) for x, q in zip("xyzw", turn, strict=True)}
        found = self._map.sample(kind, {"timestamp": self._stamp(kind, stamp), **data}, arrival)
        if (kind == "row") != found.has_pose:
            raise Malformed("no pose")
        curve = self.vehicle.motor_curve
        if found.command is not None and curve is not None and curve.command[1] > LARGEST_SHARE:
            low, high = curve.command  # PWM of its own
            found.command = np.clip((_FULL * found.command - low) / (high - low), 0.0, 1.0)
        return found

    def read(self, timeout: float) -> list[tuple[Any, int]] | None:
        """Return the blocks that have come."""
        came = []
        with suppress(queue.Empty):
            came.append(self._blocks.get(timeout=timeout))
            while True:
                came.append(self._blocks.get_nowait())
        return came if came or not self._over.is_set() else None

    def close(self) -> None:
        """Close the link, without the set point that cflib sends there."""
        if self._cf is None:
            return
        link, self._cf.link = self._cf.link, None
        if link is not None:
            link.close()
        self._cf.close_link()
        self._cf = None
