"""Flights as streams: messages by arrival, with the faults that links have."""

import json
from functools import cache

import numpy as np

from windwrench.dynamics import load_vehicle
from windwrench.envs.recording import record_flight
from windwrench.identification.logs.flight_log import FlightLog
from windwrench.live.clocks import Clocks
from windwrench.live.filtering import LiveFilter, LiveSettings
from windwrench.live.rows import Joiner
from windwrench.live.tallies import Tallies


@cache
def flight(seconds=8.0, trajectory="excite", vehicle="ardrone2", imu=False):
    """The columns of a flight at 200 Hz."""
    return record_flight(
        load_vehicle(vehicle), trajectory=trajectory, seconds=seconds, seed=2, imu=imu
    )


def log_of(flown):
    return FlightLog(
        flown["t"],
        flown["position"],
        flown["quaternion"],
        flown["rotor_speeds"],
        flown.get("voltage"),
        name="flight",
        source="flight",
    )


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


def as_csv(flown):
    objects = as_objects(flown)
    lines = [",".join(objects[0])]
    lines += [",".join(repr(value) for value in one.values()) for one in objects]
    return "\n".join(lines) + "\n"


class Pipeline:
    """Samples in, estimates out, without a source and without time passing."""

    def __init__(self, vehicle="ardrone2", paced=True, **settings):
        self.vehicle = load_vehicle(vehicle) if isinstance(vehicle, str) else vehicle
        self.tallies = Tallies()
        self.filter = LiveFilter(self.vehicle, self.tallies, LiveSettings(**settings))
        self.clocks = Clocks(self.tallies, self.filter.settings.horizon, paced)
        self.joiner = Joiner(self.vehicle, self.tallies)
        self.rows, self.outputs = [], []

    def take(self, samples):
        for sample in samples:
            t = self.clocks.time(sample)
            row = None if t is None else self.joiner.take(sample, t)
            if row is not None:
                self.rows.append(row)
                self.outputs += self.filter.take(row)
        return self

    def wrench(self):
        """Estimates (n, 7): time, force, torque."""
        return np.array([[o.t, *o.estimate.force, *o.estimate.torque] for o in self.outputs])


def dumps(objects):
    return [json.dumps(one).encode() for one in objects]
