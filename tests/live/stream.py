"""Flights as streams: messages by arrival, with the faults that links have."""

import json
import os
import socket
import threading
from contextlib import contextmanager, suppress
from functools import cache
from types import SimpleNamespace
from unittest import mock

import numpy as np

from tests.support.programs import until
from tests.support.vehicles import VEHICLE
from windwrench.dynamics import load_vehicle
from windwrench.envs.recording import record_flight
from windwrench.identification.logs.flight_log import FlightLog
from windwrench.live.filtering import LiveSettings
from windwrench.live.outlets import Outlet
from windwrench.live.session import Session
from windwrench.live.sources.open import make_source
from windwrench.live.tallies import Tallies
from windwrench.runtime.errors import InputError

NED = np.array([1.0, -1.0, -1.0])
HALF = np.array([1.0, 1.0, -1.0, -1.0])
MOTORS = [3, 1, 0, 2]  # the kit's rotors that are PX4's motors 1 to 4


@cache
def flight(seconds=8.0, trajectory="excite", vehicle="ardrone2", imu=False):
    """The columns of a flight at 200 Hz."""
    return record_flight(
        load_vehicle(vehicle), trajectory=trajectory, seconds=seconds, seed=2, imu=imu
    )


def log_of(flown):
    return FlightLog(**flown, name="flight", source="flight")


def as_objects(flown):
    """Rows as JSON objects of this kit's columns."""
    names = ("px", "py", "pz", "qw", "qx", "qy", "qz", "omega1", "omega2", "omega3", "omega4")
    table = np.column_stack([flown["position"], flown["quaternion"], flown["rotor_speeds"]])
    return [
        {"t": t, **dict(zip(names, row, strict=True)), "vbat": v, "seq": i}
        for i, (t, row, v) in enumerate(
            zip(flown["t"].tolist(), table.tolist(), flown["voltage"].tolist(), strict=True)
        )
    ]


def rpm_of(flown, k):
    return [round(w * 30 / np.pi) for w in flown["rotor_speeds"][k][MOTORS]]


def send_rotors(mav, esc_status, us, flown, k):
    mav.send(esc_status(0, us, rpm_of(flown, k), [11.0] * 4, [1.0] * 4))


def send_odometry(mav, us, flown, k):
    pose = *flown["position"][k] * NED, flown["quaternion"][k] * HALF
    mav.odometry_send(us, 1, 12, *pose, *[0] * 6, *[[0.0] * 21] * 2, 0, 0, 0)


def as_lines(flown):
    return "".join(json.dumps(one) + "\n" for one in as_objects(flown))


@contextmanager
def standard_input(text, pieces=1):
    """Standard input is a pipe with a text, written in pieces."""
    data = text.encode() if isinstance(text, str) else text
    size = max(-(-len(data) // pieces), 1)
    read, write = os.pipe()

    def feed():
        with suppress(BrokenPipeError), os.fdopen(write, "wb", 0) as file:
            for i in range(0, len(data), size):
                file.write(data[i : i + size])

    feeder = threading.Thread(target=feed)
    feeder.start()
    with os.fdopen(read) as file, mock.patch("sys.stdin", file):
        yield
    feeder.join()


def wrench_of(outputs):
    """Estimates (n, 7): time, force, torque."""
    return np.array([[o.t, *o.estimate.force, *o.estimate.torque] for o in outputs])


class Kept:
    """A sink that keeps what comes, with ``does`` before each item."""

    name = "what is kept"
    lost = "not told"
    pause = 0.0
    held = 0

    def __init__(self, does=lambda: None):
        self.items = []
        self.does = does

    @property
    def rows(self):
        return len(self.items)

    def add(self, item):
        self.does()
        self.items.append(item)

    def idle(self):
        pass

    end = close = idle


class Pipeline:
    """Samples in, estimates out, by a session without a source and without time passing."""

    def __init__(self, **settings):
        self.tallies = Tallies()
        self.outputs = []
        source = SimpleNamespace(
            name="here", vehicle=VEHICLE, tallies=self.tallies, paced=True, send=lambda output: None
        )
        self.session = Session(
            source,
            LiveSettings(**settings),
            SimpleNamespace(sink=SimpleNamespace(rows=0)),
            SimpleNamespace(put=self.outputs.append),
        )
        self.session._unrecorded = self.rows = []

    def take(self, samples):
        for sample in samples:
            self.session.take(sample)
            self.session.watch.look(sample.arrival)
        return self

    def wrench(self):
        return wrench_of(self.outputs)


class Running:
    """A session of a source, in a thread of its own."""

    def __init__(self, text, vehicle=VEHICLE, log_map=None, kept=None, record=None, **settings):
        self.tallies = Tallies()
        self.kept = kept or Kept()
        self.failed = []
        self.outputs = self.kept.items
        self.source = make_source(text, vehicle, log_map, self.tallies)
        self.session = Session(
            self.source,
            LiveSettings(**{"wait": 0.0} | settings),
            record and record(self.tallies),
            Outlet(self.kept, self.tallies),
        )
        self.thread = threading.Thread(target=self._run, daemon=True)
        self.thread.start()

    def _run(self):
        try:
            self.session.run()
        except InputError as error:
            self.failed.append(str(error))

    def until(self, so):
        """Wait until it is so, or the stream has ended. A datagram may be lost, as where another
        program takes the same port.
        """
        until(lambda: so() or not self.thread.is_alive(), self.thread.join)

    def count(self, kind):
        """How many messages of a kind were taken."""
        return self.tallies.rates[kind].count if kind in self.tallies.rates else 0

    def taken(self, kind, count):
        self.until(lambda: self.count(kind) >= count)

    def end_by_itself(self):
        """Wait for the end of the stream; return why it failed."""
        self.thread.join()
        return self.end().failed[0]

    def end(self):
        self.session.stop()
        self.thread.join()
        self.tallies.counts.pop("stops", None)  # of the sender, on a busy machine
        return self

    def wrench(self):
        return wrench_of(self.outputs)


def free_port():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as one:
        one.bind(("127.0.0.1", 0))
        return one.getsockname()[1]
