"""Wrench filters of many vehicles, stepped together.

Filters of one vehicle without effects stand side by side in the lanes of a vector unit. Filters of
different vehicles, or with declared effects, which remember, are
stepped one after the other in a compiled loop.
"""

from __future__ import annotations

from collections.abc import Sequence
from copy import deepcopy
from functools import partial
from typing import Any, Literal, Self

import numpy as np
from numpy.typing import ArrayLike

from .. import _core
from ..dynamics.effects.own import raise_errors
from ..dynamics.vehicle import Vehicle
from ..runtime.arguments import described, real_numbers
from ..runtime.errors import InputError, unknown_name
from .estimate import WITHOUT_COVARIANCE, Array, WrenchEstimate
from .recovery import N, Recovery
from .sample import convert
from .tuning import UKFTuning
from .ukf import WrenchUKF

_BATCHES: dict[str, Any] = {"double": _core.Batch, "single": _core.SingleBatch}


def _first_bad_quaternion(z: Array) -> int:
    """Return the first row of ``z`` (n, 11) whose quaternion is measured and no rotation, or -1."""
    square = np.sum(np.square(z[:, 7:11]), axis=1)
    bad = np.isfinite(square) & ((square < 0.81) | (square > 1.21))
    return int(np.argmax(bad)) if bad.any() else -1


class _Blocks:
    """Memory of ``count`` filters side by side, all like the one in ``record`` (1,), and their
    step.
    """

    def __init__(self, record: np.ndarray, count: int, precision: str) -> None:
        self._count = count
        self._batch = _BATCHES[precision](record.ctypes.data, count)

    def put(self, n: int, record: np.ndarray) -> None:
        self._batch.put(n, record.ctypes.data)

    def step(
        self, z: Array, _parts: int, _dt: float, _voltage: Array, out: Array, variances: Array
    ) -> None:
        self._batch.step(z, out, variances)

    @property
    def covariance(self) -> Array:
        out = np.empty((self._count, N, N))
        self._batch.covariance(out)
        return out


class _Records:
    """Memory of filters (n,), each with a record of its own, and their step; as ``_Blocks``."""

    def __init__(self, records: np.ndarray) -> None:
        self._records = records

    def put(self, n: int, record: np.ndarray) -> None:
        self._records[n] = record[0]

    def step(
        self, z: Array, parts: int, dt: float, voltage: Array, out: Array, variances: Array
    ) -> None:
        memory = self._records
        _core.step_many(memory.ctypes.data, memory.itemsize, z, parts, dt, voltage, out, variances)
        raise_errors()

    @property
    def covariance(self) -> Array:
        return np.array(self._records["P"])


class WrenchUKFBatch:
    """``WrenchUKF`` for ``count`` vehicles: the same numbers, bit for bit, for all of them in one
    call.

    Filters of one vehicle without declared effects cost less than half of single filters in a
    compiled loop; other filters cost the same (``python -m evidence.speed`` prints both).

    Args:
        vehicles: the declared vehicle of all, or a sequence of ``count``.
        count: how many; default: as many as ``vehicles`` lists, or one.
        tuning: for all filters; default: ``UKFTuning.for_vehicle`` of each.
        period: time between steps, s.
        gate: as of ``WrenchUKF``.
        recovery: as of ``WrenchUKF``.
        precision: "double", or "single" in less than two thirds of the time, for filters of one
            vehicle without declared effects.

    Raises:
        InputError: a count that does not fit, an argument that ``WrenchUKF`` refuses, or
            "single" for other filters.
    """

    def __init__(
        self,
        vehicles: Vehicle | Sequence[Vehicle],
        count: int | None = None,
        tuning: UKFTuning | None = None,
        period: float = 0.005,
        gate: float | None = None,
        recovery: Recovery | None = None,
        precision: Literal["double", "single"] = "double",
    ) -> None:
        if precision not in _BATCHES:
            raise unknown_name("precision", precision, _BATCHES, "WrenchUKFBatch")
        listed = [vehicles] if isinstance(vehicles, Vehicle) else list(vehicles)
        self.count = len(listed) if count is None else count
        if self.count < 1 or len(listed) not in (1, self.count):
            raise InputError(
                f"WrenchUKFBatch: expected one vehicle or one for each of {self.count}, got "
                f"{len(listed)}"
            )
        self._filters = [WrenchUKF(vehicle, tuning, period, gate, recovery) for vehicle in listed]
        self.period = self._filters[0].period
        self._precision = precision
        self._memory = self._new_memory()
        # the estimates and the variances of the error states
        self._now = np.zeros((self.count, WITHOUT_COVARIANCE)), np.zeros((self.count, N))
        self._voltage = np.resize([vehicle.voltage_ref for vehicle in listed], self.count).astype(
            np.float64
        )
        self._z = np.zeros((self.count, 11))

    def __repr__(self) -> str:
        names = ", ".join(dict.fromkeys(ukf.vehicle.name for ukf in self._filters))
        return f"<{type(self).__name__} of {self.count} x {names}: period {self.period:g} s>"

    def __copy__(self) -> Self:
        """Return filters with a memory of their own that stand where these stand."""
        return deepcopy(self)

    def __len__(self) -> int:
        """Return how many filters there are."""
        return self.count

    def _new_memory(self) -> _Blocks | _Records:
        first = self._filters[0].record
        if len(self._filters) == 1 and not any(
            first[f"{kind}_count"][0] for kind in ("wrench", "rotor", "sensing")
        ):
            return _Blocks(first, self.count, self._precision)
        if self._precision == "single":
            raise InputError(
                "WrenchUKFBatch: precision 'single' is for filters of one vehicle without effects"
            )
        return _Records(np.concatenate([self._of(n).record for n in range(self.count)]))

    def _of(self, n: int) -> WrenchUKF:
        """Return a single filter like number ``n``."""
        return self._filters[n if len(self._filters) > 1 else 0]

    def reset(
        self,
        position: ArrayLike,
        quaternion: ArrayLike,
        covariance: ArrayLike | None = None,
        velocity: ArrayLike = (0.0, 0.0, 0.0),
        angular_velocity: ArrayLike = (0.0, 0.0, 0.0),
    ) -> None:
        """Start at poses, without an external wrench; what is given without the first axis holds
        for all.

        Args:
            position: (n, 3) m, world.
            quaternion: (n, 4) body to world, scalar first.
            covariance: (n, 18, 18) as of ``WrenchUKF``; default: its default.
            velocity: (n, 3) m/s, world.
            angular_velocity: (n, 3) rad/s, body.

        Raises:
            InputError: a shape is wrong, or what ``WrenchUKF.reset`` refuses; the filters stay as
                they were.
        """
        parts = (
            ("position", position, (3,)),
            ("quaternion", quaternion, (4,)),
            ("covariance", covariance, (N, N)),
            ("velocity", velocity, (3,)),
            ("angular_velocity", angular_velocity, (3,)),
        )
        starts = [
            [None] * self.count if value is None else _rows(name, value, shape, self.count)
            for name, value, shape in parts
        ]
        memory = self._new_memory()
        numbers, variances = np.empty((self.count, WITHOUT_COVARIANCE)), np.empty((self.count, N))
        for n, start in enumerate(zip(*starts, strict=True)):
            ukf = self._of(n)
            try:
                ukf.reset(*start)
            except InputError as error:
                raise InputError(f"{error} (filter {n})") from None
            memory.put(n, ukf.record)
            numbers[n] = ukf.estimate.numbers[:WITHOUT_COVARIANCE]
            variances[n] = np.diag(ukf.covariance)
        self._memory, self._now = memory, (numbers, variances)

    @property
    def covariance(self) -> Array:
        """Covariances (n, 18, 18) of the error states, as of ``WrenchUKF``."""
        P, i = self._memory.covariance, np.arange(N)
        P[:, i, i] = self._now[1]
        return P

    @property
    def estimate(self) -> WrenchEstimate:
        """The estimates now."""
        numbers, variances = self._now
        return WrenchEstimate(numbers.copy(), partial(np.sqrt, variances))

    def step(
        self,
        rotor_speeds: ArrayLike,
        position: ArrayLike | None = None,
        quaternion: ArrayLike | None = None,
        voltage: ArrayLike | None = None,
    ) -> WrenchEstimate:
        """Predict over one period with the rotor speeds of that period, then take in the poses at
        its end.

        Args:
            rotor_speeds: (n, 4) rad/s.
            position: (n, 3) m, world; a row that is not finite was not measured; None: no row was.
            quaternion: (n, 4) body to world, scalar first; likewise.
            voltage: (n,) V, or one for all; default: ``voltage_ref``.

        Raises:
            InputError: a shape or type is wrong, a rotor speed is negative, or the length of a
                quaternion is not 1; the filters stay as they were.
        """
        z = self._z
        parts = convert(z, rotor_speeds, position, quaternion)
        bad = _first_bad_quaternion(z)
        if bad >= 0:
            raise InputError(
                f"step: quaternion must have length 1, got {np.linalg.norm(z[bad, 7:11]):g} "
                f"(filter {bad})"
            )
        volts = self._voltage if voltage is None else _rows("voltage", voltage, (), self.count)
        self._now = np.empty((self.count, WITHOUT_COVARIANCE)), np.empty((self.count, N))
        numbers, variances = self._now
        self._memory.step(z, parts, self.period, volts, numbers, variances)
        return WrenchEstimate(numbers, partial(np.sqrt, variances))


def _rows(name: str, value: ArrayLike, shape: tuple[int, ...], count: int) -> Array:
    """Return ``value`` as an array (count, *shape); what has no first axis is repeated.

    Raises:
        InputError: it cannot be.
    """
    array = real_numbers(value)
    if array is None or array.shape not in (shape, (count, *shape)):
        raise InputError(
            f"WrenchUKFBatch: {name} must be {(count, *shape)}, got {described(value)}"
        )
    return np.array(np.broadcast_to(array, (count, *shape)))
