"""The commands of a law with knowledge of the future: the teacher of ``FanTracking``.

After a flight the fan's motion is known. The oracle's regulator with preview
(``controllers.preview``) gives the best command of each decision for the fan's future places. The
mean of these commands, given the observations so far, is the best causal command (certainty
equivalence): a recurrent network fitted to them learns this mean. The network also learns the fan's
offset and velocity, for its memory alone.
"""

from typing import Any

import numpy as np

from ..controllers.axis_models import PLACE, SET_POINT, tilting
from ..controllers.features import Features, History
from ..controllers.flight import FlightGains
from ..controllers.observation import DECISION_PERIOD, MAX_COMMAND
from ..controllers.preview import Oracle, lasting, preview
from ..envs.fan_tracking import FanTrackingEnv
from ..envs.lanes.vector import TaskLanes
from ..envs.observations import as_numbers
from ..runtime.arrays import Array, Mask, Single

AHEAD = 24  # decisions with known places of the fan, for a command
# largest taught command, m/s: a fan far away on an unknown side needs a mean far beyond 1
_LIMIT = 2.5 * MAX_COMMAND
_COUNTS = 10  # decisions flown until a command counts
_LEAD = 2.0  # 1/s, gain of the law with sight of the fan that flies the first round
_VELOCITY = 3  # decisions, over which the fan's velocity is taught
_ALONG_Y = 1
FEATURES = Features(("torque_z", "force_x", "force_y", "velocity_y", "command", "path_y"), 3)


class FanHindsight:
    """FanTracking: scaled frames, and the best command in hindsight.

    A law with sight of the fan flies the first round.
    """

    decisions = FanTrackingEnv.decisions()
    period = DECISION_PERIOD
    largest = MAX_COMMAND

    def __init__(self, features: Features | None = FEATURES) -> None:
        """Take a policy's inputs; None: the scaled observation."""
        self._features = features
        self._oracle = oracle = Oracle()
        model = Oracle.steps(oracle.vehicle)[_ALONG_Y]
        self._gain, self._ahead = preview(*model, oracle.effort, AHEAD)

    def begin(self, envs: TaskLanes, leads: bool) -> None:
        """Start an episode in each of ``envs``."""
        self._envs = envs
        self._history = History(self._features or FEATURES, envs.num_envs)
        self._set_point: Any = None  # (n,) m
        self._flown: list[tuple[Array, ...]] = []

    def look(self, observations: Single, infos: dict[str, Any]) -> tuple[Single, Array]:
        """Return frames (n, quantities), and the commands (n, 1) of the law with sight."""
        if self._features is None:
            seen: Single = observations / as_numbers(self._envs.task.bounds()[1] or 1.0)
        else:
            remember = self._history.push if self._flown else self._history.restart
            remember(self._features.frames(observations))
            seen = self._history.flat()
        fan = infos["fan_y"]
        places = infos["y"]
        if self._set_point is None:
            self._set_point = places.copy()
        else:
            step = DECISION_PERIOD * infos["command"][:, 0]
            ahead = self._set_point + step - places
            # a set point too far ahead of its vehicle waits (``core/flight_loop.hpp``)
            moves = (np.abs(ahead) <= FlightGains.leash) | (ahead * step <= 0.0)
            self._set_point = self._set_point + np.where(moves, step, 0.0)
        felt = infos["force"][:, _ALONG_Y], tilting(infos["torque"])[_ALONG_Y]
        self._flown.append((self._own(infos), np.column_stack(felt), fan.copy()))
        wanted = infos["fan_velocity"] + _LEAD * (fan - places)
        return seen, wanted[:, None]

    def _own(self, infos: dict[str, Any]) -> Array:
        """Return the states (n, 7) of the vehicles along y."""
        truth = self._envs.truth()
        still = np.zeros_like(truth["velocity"])
        place = still + infos["y"][:, None]
        state = self._oracle.along(truth, place, truth["velocity"], still)[_ALONG_Y]
        return np.column_stack([state, self._set_point])

    def taught(self, in_flight: Mask) -> tuple[Array, Mask]:
        """Return the best command, the fan's offset (m) and its velocity (m/s), (decisions, n, 3),
        and weights (decisions, n).
        """
        places, felt, fan = (np.array(each) for each in zip(*self._flown, strict=True))
        now = np.arange(self.decisions)
        later = np.minimum(now[:, None] + np.arange(AHEAD + 1), self.decisions)
        off = places[:-1].copy()
        off[..., [PLACE, SET_POINT]] -= fan[:-1, :, None]
        moves = np.diff(fan[later], axis=1)  # (decisions, AHEAD, n)
        rests = lasting(np.ones(1), AHEAD, self.period)[:, 0] @ self._ahead[:, :-1]
        best = -(off @ self._gain + felt[:-1] @ rests)
        best -= np.einsum("kan,a->kn", moves, self._ahead[:, -1])
        velocity = moves[:, :_VELOCITY].mean(axis=1) / self.period
        best = np.clip(best, -_LIMIT, _LIMIT)
        truth = np.stack([best, -off[..., PLACE], velocity], axis=-1)
        return truth, in_flight[np.minimum(now + _COUNTS, self.decisions)] & (
            now + _COUNTS <= self.decisions
        )[:, None]
