"""The inner loop of the trackers: each particle's likelihood of the filter's estimate."""

import math
from typing import Any

from ..dynamics.motion import Array
from ..runtime.compiled import compiled
from .jet_map import AXES, COUNT, FIRST, STEP
from .wrench_lag import ORDER

# a particle's memory: the jet's mean that it felt last, the filter's error, residuals, newest first
FELT, ERROR, PAST = 0, AXES, 4 * AXES
MEMORY = 4 * AXES + ORDER * AXES


@compiled
def weigh(
    place: Array,
    level: Array,
    memory: Array,
    own: tuple[float, float, float],
    seen: Array,
    model: Any,
    decision: int,
    out: Array,
) -> None:
    """Write the log-likelihood of an observation for each particle into ``out`` (n,), and carry
    its memory on.

    Args:
        place: (n,) m, of the fan.
        level: (n,) of the noise, 1: as expected.
        memory: (n, MEMORY).
        own: m, place of the vehicle, its velocity in m/s and its yaw rate in rad/s.
        seen: (AXES,) the estimated torque and forces.
        model: a ``SensorModel``.
        decision: of the episode; at the first, 0, the filter has settled on the jet where it is.
        out: (n,).
    """
    tables, keep, enter = model.tables, model.keep, model.enter
    order = min(decision, ORDER)
    regression, variance = model.regression[order], model.variance[order]
    y, velocity, yaw_rate = own
    for i in range(len(place)):
        m = memory[i]
        column = (y - place[i] - FIRST) / STEP
        column = min(max(column, 0.0), COUNT - 1.001)
        j = int(column)
        b = column - j
        left, right = tables[j], tables[j + 1]
        total = 0.0
        for a in range(AXES):
            mean = (1 - b) * left[0, a] + b * right[0, a]
            mean += velocity * ((1 - b) * left[1, a] + b * right[1, a])
            turning = yaw_rate * ((1 - b) * left[2, a] + b * right[2, a])
            deviation = level[i] * ((1 - b) * left[3, a] + b * right[3, a])
            e = ERROR + 3 * a
            if decision == 0:
                m[e] = m[e + 1] = m[e + 2] = 0.0
            else:
                change = mean - m[FELT + a]
                e0, e1, e2 = m[e], m[e + 1], m[e + 2]
                for k in range(3):
                    m[e + k] = (
                        keep[a, k, 0] * e0
                        + keep[a, k, 1] * e1
                        + keep[a, k, 2] * e2
                        + enter[a, k] * change
                    )
            m[FELT + a] = mean
            residual = (seen[a] - turning - mean + m[e + 2]) / deviation
            p = PAST + ORDER * a
            innovation = residual
            for k in range(ORDER):
                innovation -= regression[a, k] * m[p + k]
            for k in range(ORDER - 1, 0, -1):
                m[p + k] = m[p + k - 1]
            m[p] = residual
            total -= 0.5 * innovation * innovation / variance[a] + math.log(deviation)
        out[i] = total
