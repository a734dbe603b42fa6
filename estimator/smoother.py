"""The fixed-interval smoother: the wrench at every time from all of a log, before and after it.

Rauch, Tung and Striebel, *Maximum likelihood estimates of linear dynamic systems*, AIAA Journal
3(8), 1965; for sigma points Sarkka, *Unscented Rauch-Tung-Striebel smoother*, IEEE TAC 53(3), 2008.
P is the filter's covariance before a prediction, P- the covariance after, C the cross covariance of
both errors. Given the estimate after, the estimate before has

    gain G = C P-^-1 and covariance K = P - G P- G',

    x_s = x + G (x_s' - x-'),  P_s = K + G P_s' G',

a prime being the later time. Differences of states are error states (rho, omega, x, v, torque,
force) with the world-frame MRP of (24) and (25). K is a conditional covariance and P_s a sum of two
positive matrices, so nothing is subtracted on the way back. C comes from the sigma points of the
filter's own prediction. S are the columns of the root of P, H half differences after the step. C is
``S' H`` plus the linear part ``M A'``, exactly as from 61 points.

``G = 0, K = P`` cuts: later measurements say nothing about earlier states. A restart cuts. A
covariance held at a bound cuts, too: it shares no probability distribution with the covariance
before.

A step's link, ``core/smoother.hpp``, needs 6 kB. So only a block of steps is in memory at a time:
the filter's memory is kept at the start of each block, and the block is run again, to the same
bits, on the way back.
"""

from __future__ import annotations

import struct

import numpy as np
from numpy.typing import ArrayLike

from .. import _core
from ..dynamics.effects.own import raise_errors
from ..runtime.errors import InputError
from .estimate import ESTIMATE_SIZE, NIS, WITHOUT_COVARIANCE, WrenchEstimate
from .model_uncertainty import LOAD
from .recovery import N
from .ukf import CALL, WrenchUKF, make_calls

_BLOCK = 1024  # steps in memory at a time: 6 MB


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
            smoothed = record.ctypes.data
            for here, memory in reversed(blocks):
                calls = events[here].view(np.uint8)
                address = memory.ctypes.data
                _core.smooth_block(address, smoothed, calls, numbers[here], std[here])
            _core.write_smoothed(smoothed, begin, numbers, std)
            raise_errors()
        finite = np.isfinite(numbers[:, :NIS]).all(axis=1) & np.isfinite(std).all(axis=1)
        if not finite.all():
            raise InputError(
                f"smooth: the estimate stops being finite at step {int(np.argmin(finite))}; "
                "expected rotor speeds and poses that the vehicle can fly"
            )
        wanted = slice(None) if at is None else np.asarray(at, dtype=np.int64)
        return WrenchEstimate(numbers[wanted], std[wanted])
