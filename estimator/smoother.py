"""The fixed-interval smoother: the wrench at every time from all of a log, before and after it.

The filter runs forwards; ``rauch_tung_striebel`` says how one goes back. A step's link needs 8 kB,
so only a block of steps is in memory at a time: the filter's memory is kept at the start of each
block, and the block is run again, to the same bits, on the way back.
"""

from __future__ import annotations

import struct

import numpy as np
from numpy.typing import ArrayLike

from ..runtime.compiled import compiled
from ..runtime.errors import InputError
from .estimate import (
    ESTIMATE_SIZE,
    EXCESS,
    MODEL,
    NIS,
    RESTARTS,
    STATE_SIZE,
    STATUS,
    WITHOUT_COVARIANCE,
    Array,
    WrenchEstimate,
)
from .filter_record import N
from .model_uncertainty import LOAD, follow_back, variances
from .rauch_tung_striebel import LINK, step_back, step_with_link
from .ukf import CALL, WrenchUKF, make_calls

_BLOCK = 1024  # steps in memory at a time: 10 MB


@compiled
def _forward_with_links(
    record: np.ndarray, events: np.ndarray, links: np.ndarray, numbers: Array, strains: Array
) -> None:
    f = record[0]
    for k in range(len(events)):
        event = events[k]
        f.z[:] = event.z  # a step brings its quaternion to length 1 in place
        step_with_link(f, f.z, event.parts, event.dt, event.voltage, links[1 + k])
        strains[k] = f.poses.strain
        numbers[k, STATUS], numbers[k, RESTARTS] = f.status, f.restarts
        numbers[k, EXCESS] = f.excess


@compiled
def _write(record: np.ndarray, numbers: Array, std: Array, k: int) -> None:
    f = record[0]
    widened = (1.0 + f.poses.strain) * np.diag(f.P)
    numbers[k, :STATE_SIZE], numbers[k, MODEL], std[k] = f.x, f.model, np.sqrt(widened)
    if numbers.shape[1] == ESTIMATE_SIZE:
        numbers[k, WITHOUT_COVARIANCE:] = f.P.flatten()
        numbers[k, WITHOUT_COVARIANCE :: N + 1] = widened


@compiled
def _backward(
    links: np.ndarray,
    events: np.ndarray,
    strains: Array,
    record: np.ndarray,
    numbers: Array,
    std: Array,
) -> None:
    """Write the smoothed estimates of a block, from the last, in ``record``, backwards. ``record``
    then holds the estimate before the block; its link is the first.

    Unlikely poses taken in widen smoothed estimates before and after them alike: the ``strains``
    (n,) of the filter fall backwards at the same rate.
    """
    f = record[0]
    for k in range(len(numbers) - 1, -1, -1):
        f.poses.strain = max(f.poses.strain, strains[k])
        variances(f.uncertain, f.load, f.model)
        _write(record, numbers, std, k)
        follow_back(f.load, links[k + 1].passed, links[k].load)
        step_back(f.x, f.P, links[k + 1], links[k].x)
        f.poses.strain -= min(events[k].dt / f.patience, 1.0) * f.poses.strain


class RecordingUKF(WrenchUKF):
    """A ``WrenchUKF`` that keeps its inputs, for the smoother. About 0.1 kB a call.

    ``events`` counts the kept calls; after a call, its estimate is event ``events - 1``.

    Arguments are those of ``WrenchUKF``. A pose that the gate refuses counts as not measured for
    the smoother, too.
    """

    _no_imu = "the smoother takes no inertial measurements"

    def _prepare(self) -> None:
        """Keep nothing yet."""
        self._kept = bytearray()  # of ``CALL``
        self._starts: dict[int, np.ndarray] = {}  # event: the memory (1,) after a reset

    @property
    def events(self) -> int:
        """How many calls were kept."""
        return len(self._kept) // CALL.itemsize

    def _begin(self) -> None:
        """Keep a start; no smoothing crosses one."""
        self._starts[self.events] = self.record.copy()
        self._kept += bytes(CALL.itemsize)

    def _run(self, parts: int, dt: float, voltage: float | None) -> WrenchEstimate:
        z = self._sample.z.tobytes()
        estimate = super()._run(parts, dt, voltage)
        volts = self._voltage if voltage is None else voltage
        self._kept += z + struct.pack("=qdd", parts, dt, volts)
        return estimate

    def keep(self, calls: np.ndarray) -> np.ndarray:
        """Keep calls (n,) that ``make_calls`` made, none of them of an IMU; return their events."""
        self._kept += calls.tobytes()
        return np.arange(self.events - len(calls), self.events)

    def smooth(self, at: ArrayLike | None = None, covariance: bool = False) -> WrenchEstimate:
        """Return the smoothed estimates (M,) after each event up to now, or after the events
        ``at``.

        NIS, status and restarts are those of the filter. Nothing is smoothed across a restart, nor
        where a covariance was held at a bound.

        Args:
            at: (M,) numbers of events, in any order, also several times; default: all.
            covariance: whether the whole covariances (18, 18) are wanted.

        Raises:
            InputError: the filter was not reset, or a number stops being finite.
        """
        if 0 not in self._starts:
            raise InputError("RecordingUKF: the first call must be a start of the filter, reset")
        events = np.frombuffer(bytes(self._kept), dtype=CALL)
        numbers = np.zeros((self.events, ESTIMATE_SIZE if covariance else WITHOUT_COVARIANCE))
        std = np.empty((self.events, N))
        begins = sorted(self._starts)
        for begin, end in zip(begins, [*begins[1:], self.events], strict=True):
            record, blocks = self._starts[begin].copy(), []
            for first in range(begin + 1, end, _BLOCK):
                here = slice(first, min(first + _BLOCK, end))
                blocks.append((here, record.copy()))
                calls, loads = events[here], np.empty((here.stop - first, *LOAD))
                make_calls(record, calls, np.arange(len(calls)), numbers[here], std[here], loads)
            links = np.zeros(1 + min(_BLOCK, end - begin), dtype=LINK)
            strains = np.empty(_BLOCK)
            for here, memory in reversed(blocks):
                links["x"][0], links["load"][0] = memory["x"][0], memory["load"][0]
                _forward_with_links(memory, events[here], links, numbers[here], strains)
                _backward(links, events[here], strains, record, numbers[here], std[here])
            _write(record, numbers, std, begin)
        finite = np.isfinite(numbers[:, :NIS]).all(axis=1) & np.isfinite(std).all(axis=1)
        if not finite.all():
            raise InputError(
                f"smooth: the estimate stops being finite at step {int(np.argmin(finite))}; "
                "expected rotor speeds and poses that the vehicle can fly"
            )
        wanted = slice(None) if at is None else np.asarray(at, dtype=np.int64)
        return WrenchEstimate(numbers[wanted], std[wanted])
