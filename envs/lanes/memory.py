"""The memory of closed loops side by side."""

from typing import Any

import numpy as np

from ...estimator.ukf_lanes import columns, new_blocks, step_address, write_lanes
from ..closed_loop import ClosedLoop
from ..plant import NOISE
from .flight import LOOPS


class Blocks:
    """Closed loops side by side, as many to a block as there are lanes, all standing where ``like``
    stands; settings of ``like`` are those of all but for what can vary from episode to episode.
    """

    def __init__(self, count: int, like: ClosedLoop) -> None:
        self.loops, self.filters = LOOPS.zeros(count), new_blocks(count)
        self._table = like.jet_table
        LOOPS.share(self.loops, _single(like))
        for block in range(count):
            self.put(block, slice(None), like)

    def __len__(self) -> int:
        """Return how many blocks there are."""
        return len(self.loops)

    def put(self, block: int, lanes: slice, loop: ClosedLoop) -> None:
        """Let some lanes of a block stand where a closed loop stands."""
        LOOPS.write(self.loops, block, lanes, _single(loop))
        write_lanes(self.filters, block, lanes, loop.ukf.record)

    def take(self, block: int, lane: int, other: "Blocks", source: int) -> None:
        """Let a lane of a block stand where the same lane of another's block stands."""
        for mine, theirs in (
            (LOOPS.columns(self.loops), LOOPS.columns(other.loops)),
            (columns(self.filters), columns(other.filters)),
        ):
            mine[block, :, lane] = theirs[source, :, lane]

    def given(self, block: int = 0) -> tuple[Any, ...]:
        """Return the first arguments of ``fly_blocks``, from a block on."""
        return (
            self.loops[block:].ctypes.data,
            self.filters[block:].ctypes.data,
            step_address(),
            *self._table,
        )


def _single(loop: ClosedLoop) -> dict[str, Any]:
    """Return what a closed loop's record and MuJoCo hold, by the names of ``LOOPS``."""
    qpos, qvel = loop.motion
    record = loop.record[0]
    return {
        "plant": record["plant"],
        "flight": record["flight"],
        "fan": record["fan"],
        "qpos": qpos[:7],
        "qvel": qvel[:6],
        "xfrc": np.zeros(6),
        "acceleration": np.zeros(6),
        "noise": np.zeros(NOISE),
        "none": np.zeros(6),
    }
