"""Wrench filters side by side: the single filter's own functions, compiled for lanes
(``runtime.vector_lanes``).

Filters of one vehicle without effects, as many as there are lanes, make a block. Between steps a
block is its estimates and covariances. The scratch of a step lies in one record for all blocks, so
that a few hundred filters stay in a core's cache.
"""

import math

import numpy as np
from numba import types

from ..dynamics.motion import rotor_wrench
from ..dynamics.rotation import quaternion_to_matrix
from ..runtime.addresses import address_of, numbers_at
from ..runtime.compiled import Record, compiled
from ..runtime.vector_lanes import WIDTH, LaneRecord, choose
from .filter_record import FILTER, fields_between
from .recovery import MEMORY
from .ukf import carry, correct, write_variances

# what a filter must not forget from one step to the next; first in both layouts
_KEPT = fields_between("x", "last_speeds")
_MEMORY = {"poses": LaneRecord(MEMORY, MEMORY.names or ())}
_WORK = LaneRecord(
    FILTER,
    (
        *_KEPT,
        "rotor_wrench",
        *fields_between("z", "innovation"),
        *fields_between("acceleration", "W"),
    ),
    ("body", "effect_wrench", *fields_between("gated", "period")),
    _MEMORY,
)
_BLOCK = LaneRecord(FILTER, _KEPT, nested=_MEMORY)
BLOCK_SIZE, STATE = _BLOCK.dtype.itemsize, _BLOCK.offset("x")  # bytes; where the estimates lie
_NUMBERS = BLOCK_SIZE // 8
_FIRST = STATE // (8 * WIDTH)  # of a filter's numbers: the first of its estimate

new_blocks = _BLOCK.zeros  # the memory of blocks between steps
columns = _BLOCK.columns  # blocks (n,) as numbers (n, m, WIDTH), those of a filter in one column
in_hand = _WORK.at  # for compiled code: the record of the block in hand at an address


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
        z[i] = choose(abs(z[i]) <= f.fastest, z[i], last[i])
        last[i] = z[i]


def _step_work(address: int) -> None:
    f = in_hand(address)
    _check(f)
    rotor_wrench(f.body, f.z, f.rotor_wrench)
    quaternion_to_matrix(f.x[3:7], f.rotation)
    carry(f, f.period)
    s = f.z
    with_position = math.isfinite(s[4] + s[5] + s[6])
    correct(f, s[4:11], with_position, math.isfinite(s[7] + s[8] + s[9] + s[10]))
    write_variances(f, f.S[0])


def step_address() -> int:
    """Return the address of the step of a block in hand, for ``call_at`` with the address of its
    record, compiled now if it was not: one machine code for all that step blocks.
    """
    return address_of(_step_work, types.void(types.int64))


@compiled
def take_up(kept: int, work: int) -> None:
    """Take the block whose estimates lie at ``kept`` in hand, in the record at ``work``."""
    numbers_at(work, (_NUMBERS,))[:] = numbers_at(kept, (_NUMBERS,))


@compiled
def put_down(kept: int, work: int) -> None:
    """Do the opposite."""
    numbers_at(kept, (_NUMBERS,))[:] = numbers_at(work, (_NUMBERS,))


def new_work(record: np.ndarray) -> np.ndarray:
    """Return the memory (1,) of a block in hand, of filters like the one in ``record`` (1,)."""
    work = _WORK.zeros(1)
    _WORK.share(work, record[0])
    return work


def write_lanes(blocks: np.ndarray, block: int, lanes: slice, record: np.ndarray) -> None:
    """Let filters in some lanes of a block stand where the one in ``record`` (1,) stands."""
    _BLOCK.write(blocks, block, lanes, record[0])
