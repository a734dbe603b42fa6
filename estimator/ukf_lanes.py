"""Wrench filters side by side: the single filter's own functions, compiled for lanes
(``runtime.vector_lanes``).

Filters of one vehicle without effects, as many as there are lanes, make a block. Between steps a
block is its estimates and covariances; what it works on in a step lies in one record for all
blocks, so that a few hundred filters stay in a core's cache.
"""

import math
from typing import Any

import numpy as np
from numba import types

from ..dynamics.motion import rotor_wrench
from ..dynamics.rotation import quaternion_to_matrix
from ..runtime.addresses import address_of, call_at
from ..runtime.compiled import Record, compiled, compiled_without_gil
from ..runtime.vector_lanes import WIDTH, LaneRecord, choose
from .estimate import STATE_SIZE, Array
from .filter_record import FILTER, N
from .ukf import carry, correct

_KEPT = (  # what a filter must not forget from one step to the next
    "x",
    "P",
    "status",
    "restarts",
    "last_speeds",
    "gap",
    "seen",
    "doubted",
    "refused",
    "lasting",
    "in_row",
    "jumps",
)
_SHARED = (
    "body",
    "motor_torque",
    "torque_walk",
    "thrust",
    "force_walk",
    "noise",
    "kappa",
    "period",
    "gated",
    "alarm",
    "restart_at",
    "patience",
    "prior",
    "reason",
    "lost",
    "push",
    "response",
    "effect_wrench",
)
_WORK = LaneRecord(
    FILTER,
    (
        *_KEPT,
        "z",
        "rotor_wrench",
        "acceleration",
        "rotation",
        "centre_rotation",
        "S",
        "M",
        "Z",
        "H",
        "E",
        "error",
        "next",
        "rho",
        "B",
        "mean",
        "point",
        "centre",
        "q",
        "L",
        "scales",
        "W",
        "innovation",
    ),
    _SHARED,
)
_BLOCK = LaneRecord(FILTER, _KEPT)
_work_at, _block_at = _WORK.at, _BLOCK.at
BLOCK_SIZE, STATE = _BLOCK.dtype.itemsize, _BLOCK.offset("x")  # bytes; where the estimates lie


@compiled
def _check(f: Record) -> None:
    """Do with ``f.z`` what ``check_sample`` does with a single sample whose quaternion is that of a
    rotation, or missing.
    """
    z, last = f.z, f.last_speeds
    scale = 1.0 / math.sqrt(z[7] * z[7] + z[8] * z[8] + z[9] * z[9] + z[10] * z[10])
    for i in range(7, 11):
        z[i] *= scale
    for i in range(4):
        z[i] = choose(math.isfinite(z[i]), z[i], last[i])
        last[i] = z[i]


@compiled
def _move_estimate(source: Record, target: Record) -> None:
    for i in range(STATE_SIZE):
        target.x[i] = source.x[i]
    for i in range(N):
        for j in range(N):
            target.P[i, j] = source.P[i, j]
    for i in range(4):
        target.last_speeds[i] = source.last_speeds[i]
    for i in range(7):
        target.seen[i] = source.seen[i]
        target.doubted[i] = source.doubted[i]
    for k in range(2):
        for i in range(6):
            target.jumps[k, i] = source.jumps[k, i]
    for i in range(3):
        target.gap[i] = source.gap[i]
    target.status, target.restarts = source.status, source.restarts
    target.refused, target.lasting = source.refused, source.lasting
    target.in_row = source.in_row


def _step_work(address: int) -> None:
    f = _work_at(address)
    _check(f)
    rotor_wrench(f.body, f.z, f.rotor_wrench)
    quaternion_to_matrix(f.x[3:7], f.rotation)
    carry(f, f.period)
    s = f.z
    correct(
        f,
        s[4:7],
        s[7:11],
        math.isfinite(s[4] + s[5] + s[6]),
        math.isfinite(s[7] + s[8] + s[9] + s[10]),
    )


def step_address() -> int:
    """Return the address of the step of a block in hand, for ``call_at`` with the address of its
    record, compiled now if it was not: one machine code for all that step blocks.
    """
    return address_of(_step_work, types.void(types.int64))


@compiled
def take_up(kept: int, work: int) -> None:
    """Take the block whose estimates lie at ``kept`` in hand, in the record at ``work``."""
    _move_estimate(_block_at(kept), _work_at(work))


@compiled
def put_down(kept: int, work: int) -> None:
    """Do the opposite."""
    _move_estimate(_work_at(work), _block_at(kept))


@compiled
def in_hand(work: int) -> Record:
    """Return the record of the block in hand at an address."""
    return _work_at(work)


@compiled_without_gil
def _step_blocks(
    step: int,
    work: int,
    work_z: Array,
    blocks: int,
    kept: tuple[Array, Array, Array],
    z: Array,
    out: Array,
) -> None:
    estimates, status, restarts = kept
    count = len(z)
    for b in range(len(estimates)):
        take_up(blocks + b * BLOCK_SIZE, work)
        for lane in range(WIDTH):
            n = min(WIDTH * b + lane, count - 1)  # lanes to spare do what the last filter does
            for i in range(11):
                work_z[i, lane] = z[n, i]
        call_at(step, work)
        put_down(blocks + b * BLOCK_SIZE, work)
        for lane in range(min(WIDTH, count - WIDTH * b)):
            for i in range(STATE_SIZE):
                out[WIDTH * b + lane, i] = estimates[b, i, lane]
            out[WIDTH * b + lane, STATE_SIZE] = status[b, lane]
            out[WIDTH * b + lane, STATE_SIZE + 1] = restarts[b, lane]


def new_blocks(count: int) -> np.ndarray:
    """Return the memory of ``count`` blocks between steps."""
    return _BLOCK.zeros(count)


def new_work(record: np.ndarray) -> np.ndarray:
    """Return the memory (1,) of a block in hand, of filters like the one in ``record`` (1,)."""
    work = _WORK.zeros(1)
    _WORK.share(work, record[0])
    return work


def write_lanes(blocks: np.ndarray, block: int, lanes: slice, record: np.ndarray) -> None:
    """Let filters in some lanes of a block stand where the one in ``record`` (1,) stands."""
    _BLOCK.write(blocks, block, lanes, record[0])


def columns(blocks: np.ndarray) -> np.ndarray:
    """Return blocks (n,) as numbers (n, m, WIDTH), those of a filter in one column."""
    return _BLOCK.columns(blocks)


def estimates_of(blocks: np.ndarray, count: int) -> Array:
    """Return the estimated states (count, 20) of the first filters of blocks."""
    return _each(blocks, "x")[:count]


def _each(blocks: np.ndarray, name: str) -> Array:
    return np.concatenate(list(np.moveaxis(blocks[name], -1, 1)))


class Blocks:
    """Memory of ``count`` filters side by side, all like the one in ``record`` (1,), and their
    step.
    """

    def __init__(self, record: np.ndarray, count: int) -> None:
        self.count = count
        self._blocks = new_blocks(-(-count // WIDTH))
        self._work = new_work(record)

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(
            state, _blocks=_BLOCK.like(state["_blocks"]), _work=_WORK.like(state["_work"])
        )

    def put(self, n: int, record: np.ndarray) -> None:
        """Let filter ``n`` stand where the one in ``record`` stands, and with the last the lanes to
        spare.
        """
        lanes = slice(n % WIDTH, None if n == self.count - 1 else n % WIDTH + 1)
        write_lanes(self._blocks, n // WIDTH, lanes, record)

    def step(self, z: Array, _parts: int, _dt: float, _voltage: Array, out: Array) -> None:
        """Step all: samples (n, 11), NaN where nothing was measured; estimates (n, 22), written."""
        kept = self._blocks["x"], self._blocks["status"], self._blocks["restarts"]
        _step_blocks(
            step_address(),
            self._work.ctypes.data,
            self._work["z"][0],
            self._blocks.ctypes.data,
            kept,
            z,
            out,
        )

    @property
    def state(self) -> Array:
        """Estimates, status and count of restarts (n, 22)."""
        return np.column_stack([self._each(name) for name in ("x", "status", "restarts")])

    @property
    def covariance(self) -> Array:
        """Covariances (n, 18, 18)."""
        return self._each("P")

    def _each(self, name: str) -> Array:
        return _each(self._blocks, name)[: self.count]
