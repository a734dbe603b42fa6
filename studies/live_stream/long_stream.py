"""A stream of many hours, replayed faster than time: is memory flat, is nothing lost, and are the
estimates those of the offline filter?
"""

import math
import os
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from windwrench.dynamics import Vehicle, load_vehicle
from windwrench.estimator import WrenchUKF
from windwrench.estimator.row_steps import steps_between
from windwrench.identification.wrench_series import GATE
from windwrench.live.filtering import Output
from windwrench.live.messages import Sample
from windwrench.live.recorder import Recorder
from windwrench.live.session import Session, SessionSettings
from windwrench.live.tallies import Tallies

Array = NDArray[np.float64]

_SECOND = 1_000_000_000  # ns
_BLOCK = 500  # messages at once
_WAVE = 0.5, 4.0  # m and s, of the vehicle's climbs and descents
_PUSH = 0.05, 60.0  # of the weight, and s: a force along x that comes and goes


@dataclass(frozen=True)
class Faults:
    """What happens to messages on their way; shares of all."""

    lost: float = 0.0
    doubled: float = 0.0
    late: float = 0.0  # by up to 0.2 s
    silences: float = 0.0  # of 3 s, an hour


class Flight:
    """A source: a vehicle that climbs and descends under a force that comes and goes, for hours.

    Its motion and its rotor speeds follow from one another exactly, but for the noise of motion
    capture; so it can be drawn a block at a time and no seam is in it.

    Args:
        vehicle: that flies.
        rate_hz: of messages.
        hours: length.
        faults: of the link.
        seed: of noise and faults.
    """

    name, paced = "a long flight", False

    def __init__(
        self, vehicle: Vehicle, rate_hz: float, hours: float, faults: Faults, seed: int = 0
    ) -> None:
        self._vehicle, self._rate, self._faults = vehicle, rate_hz, faults
        self._count = round(3600.0 * hours * rate_hz) + 1
        self._rng = np.random.default_rng(seed)
        self._next = 0
        self._delayed: list[tuple[int, Sample]] = []  # until which message, and which
        self.sent = self.lost = self.doubled = self.delayed = 0

    def open(self) -> None:
        """Begin."""

    def receive(self, timeout: float) -> list[Sample] | None:
        """Return the next messages."""
        if self._next >= self._count and not self._delayed:
            return None
        numbers = np.arange(self._next, min(self._next + _BLOCK, self._count))
        self._next += _BLOCK
        samples = []
        for number, sample in zip(numbers.tolist(), self._rows(numbers), strict=True):
            while self._delayed and self._delayed[0][0] <= number:
                samples.append(self._delayed.pop(0)[1])
            samples += self._through(number, sample)
        if self._next >= self._count:
            samples += [sample for _, sample in self._delayed]
            self._delayed = []
        return samples

    def _rows(self, numbers: NDArray[np.int64]) -> list[Sample]:
        vehicle, rng = self._vehicle, self._rng
        t = numbers / self._rate
        size, period = _WAVE
        w = 2.0 * math.pi / period
        height = 1.5 + size * np.sin(w * t)
        thrust = vehicle.mass * (vehicle.gravity - size * w * w * np.sin(w * t))
        push = _PUSH[0] * vehicle.weight * np.sin(2.0 * math.pi * t / _PUSH[1])
        # held in place against the push by its tilt about y
        tilt = np.arctan2(-push, thrust)
        speeds = np.sqrt(np.hypot(thrust, push) / np.sum(vehicle.k))
        position = np.column_stack([np.zeros_like(t), np.zeros_like(t), height])
        position += vehicle.mocap.sigma_pos_m * rng.standard_normal(position.shape)
        half = 0.5 * (tilt + vehicle.mocap.sigma_att_rad * rng.standard_normal(len(t)))
        samples = []
        for i, number in enumerate(numbers.tolist()):
            samples.append(
                Sample(
                    "row",
                    round(number * _SECOND / self._rate),
                    time.monotonic_ns(),
                    whole=True,
                    position=position[i],
                    quaternion=np.array([math.cos(half[i]), 0.0, math.sin(half[i]), 0.0]),
                    rotor_speeds=np.full(4, speeds[i]),
                )
            )
        return samples

    def _through(self, number: int, sample: Sample) -> list[Sample]:
        """Return what of a message comes through now."""
        faults = self._faults
        chance = float(self._rng.random())
        if chance < faults.lost or (
            faults.silences > 0.0
            and (number / self._rate) % (3600.0 / faults.silences) > 3600.0 / faults.silences - 3.0
        ):
            self.lost += 1
            return []
        self.sent += 1
        if chance < faults.lost + faults.doubled:
            self.doubled += 1
            return [sample, sample]
        if chance < faults.lost + faults.doubled + faults.late:
            until = number + int(self._rng.integers(1, max(2, int(0.2 * self._rate))))
            self._delayed.append((until, sample))
            self._delayed.sort(key=lambda one: one[0])
            self.delayed += 1
            return []
        return [sample]

    def send(self, output: Output) -> None:
        """Say nothing."""

    def close(self) -> None:
        """End."""

    def expected(self) -> str:
        """Return what must come."""
        return "a flight"


class Offline:
    """The filter of `windwrench estimate`, beside the stream: its loop over the rows of a log."""

    def __init__(self, vehicle: Vehicle, period: float) -> None:
        self._ukf = WrenchUKF(vehicle, period=period, gate=GATE)
        self._period = period
        self._before: tuple[float, Array] | None = None
        self.largest = 0.0  # N and Nm, difference

    def compare(self, output: Output) -> None:
        """Step to a row, and compare with what the stream made of it."""
        row = output.row
        if self._before is None:
            self._ukf.reset(row.position, row.quaternion)  # type: ignore[arg-type]
        else:
            t, speeds = self._before
            mean = 0.5 * (speeds + row.rotor_speeds)
            for step in steps_between(row.t - t, self._period):
                self._ukf.predict(mean, step)
            self._ukf.correct(row.position, row.quaternion)
        self._before = row.t, row.rotor_speeds
        difference = np.abs(self._ukf.estimate.state[13:19] - output.estimate.state[13:19])
        self.largest = max(self.largest, float(difference.max()))


def resident() -> float:
    """Return the memory that this process has in use, MB."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 1e6


def run_long(
    hours: float,
    rate_hz: float,
    faults: Faults,
    record: Path | None = None,
    report: Callable[[float], None] = lambda share: None,
) -> dict[str, Any]:
    """Run a long stream; return what became of it.

    Args:
        hours: length.
        rate_hz: of messages.
        faults: of the link; with late ones nothing is compared with the offline filter.
        record: log to write meanwhile.
        report: called now and then with the share that is done.
    """
    vehicle = load_vehicle("ardrone2")
    tallies = Tallies()
    source = Flight(vehicle, rate_hz, hours, faults)
    offline = Offline(vehicle, 1.0 / rate_hz)
    memory: list[tuple[float, float]] = []  # s and MB
    total, done, due = 3600.0 * hours, [0], [0.0]

    def tell(output: Output) -> None:
        done[0] += 1
        if faults.late == 0.0:
            offline.compare(output)
        if output.t >= due[0]:
            memory.append((output.t, resident()))
            report(output.t / total)
            due[0] += total / 48.0

    recorder = None if record is None else Recorder(record, vehicle, tallies, 0.3, True)
    session = Session(source, vehicle, tallies, None, recorder, SessionSettings(wait=0.0), tell)
    begin = time.process_time()
    session.run()
    spent = time.process_time() - begin
    t, mb = np.array(memory).T
    settled = t > 0.1 * total  # of what is loaded at first
    slope = float(np.polyfit(t[settled] / 3600.0, mb[settled], 1)[0]) if settled.sum() > 2 else 0.0
    return {
        "hours": hours,
        "rate_hz": rate_hz,
        "messages_sent": source.sent + source.doubled,
        "lost_on_the_way": source.lost,
        "doubled_on_the_way": source.doubled,
        "late_on_the_way": source.delayed,
        "estimates": done[0],
        "counts": {name: n for name, n in tallies.counts.items() if n},
        "restarts": session.filter.restarts,
        "largest_difference_from_offline": offline.largest if faults.late == 0.0 else None,
        "recorded_rows": None if recorder is None else recorder.rows,
        "memory_MB": {
            "after_a_tenth": round(float(mb[settled][0]), 1) if settled.any() else None,
            "at_the_end": round(float(mb[-1]), 1),
            "growth_per_hour": round(slope, 4),
        },
        "times_faster_than_time": round(total / spent, 1),
    }
