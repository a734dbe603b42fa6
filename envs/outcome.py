"""What the fan-tracking task makes of a closed loop after a decision: the observation, and the truth behind it."""

import math

import numpy as np

from ..controllers.observation import MAX_COMMAND, OBSERVATION_SIZE
from ..dynamics.motion import Array
from ..estimator.direct import released
from .closed_loop import FASTEST
from .plant import TICK

LOST_OFFSET = 2.5  # m
_AWAY = 1.0  # m, off its height or its distance
_UPRIGHT = 0.34  # cosine of 70 degrees

# largest size of an observation's numbers
LIMITS = (10.0, 10.0, 10.0, 1.0, 1.0, 1.0, 5.0, MAX_COMMAND)

# one environment's decision; the names are those of ``info``
OUTCOME = np.dtype([
    ("observation", "f4", (OBSERVATION_SIZE,)),
    ("reward_tracking", "f8"),
    ("reward_change", "f8"),
    ("fan_y", "f8"),
    ("fan_velocity", "f8"),
    ("y", "f8"),
    ("offset", "f8"),
    ("force", "f8", (3,)),
    ("torque", "f8", (3,)),
    ("time", "f8"),
    ("lost", "?"),
])
INFO = OUTCOME.names[1:]  # type: ignore[index]


@released
def look(loops: np.ndarray, qpos: Array, qvel: Array, fan_y: Array, ticks: int, distance: float, height: float,
         command: float, outcomes: np.ndarray) -> None:
    """Write what there is to see ``ticks`` after the start into ``outcomes[0]``, all but the reward.

    ``fan_y`` (n,) m is the fan's path, ``distance`` and ``height`` (m) where the vehicle started, ``command`` (m/s) the last.
    """
    out, x, external = outcomes[0], loops[0].filter.x, loops[0].plant.external
    for i in range(OBSERVATION_SIZE):
        value = x[16 + i] if i < 3 else x[10 + i] if i < 6 else x[8] if i == 6 else command
        out.observation[i] = min(max(value, -LIMITS[i]), LIMITS[i]) if math.isfinite(value) else 0.0
    k = min(ticks, len(fan_y) - 1)
    out.fan_y = fan_y[max(k - 1, 0)]
    out.fan_velocity = (fan_y[k] - fan_y[k - 1]) / TICK if k > 0 else 0.0
    out.y = qpos[1]
    out.offset = qpos[1] - out.fan_y
    for i in range(3):
        out.force[i] = external[i]
        out.torque[i] = external[3 + i]
    out.time = ticks * TICK
    flying = math.isfinite(x[:19].sum()) and 1.0 - 2.0 * (qpos[4] * qpos[4] + qpos[5] * qpos[5]) >= _UPRIGHT
    for i in range(6):
        flying = flying and abs(qvel[i]) < FASTEST
    # all of them such that a number that is none counts as lost
    out.lost = not (flying and abs(out.offset) <= LOST_OFFSET and abs(qpos[0] - distance) <= _AWAY
                    and abs(qpos[2] - height) <= _AWAY)
