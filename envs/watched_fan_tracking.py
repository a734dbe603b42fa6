"""The fan-tracking environment with more in ``info``: what else an agent could be given to see."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..controllers.observation import MAX_COMMAND
from ..dynamics.vehicle import Vehicle
from ..estimator.observer import NonlinearObserver, ObserverTuning
from .closed_loop import ClosedLoop
from .fan import Fan
from .fan_tracking import FanTrackingEnv
from .plant import NOISE, TICK

Array = NDArray[np.float64]
TRUTH = frozenset({"force", "torque"})  # what every environment's ``info`` holds


class _Watched(ClosedLoop):
    """A closed loop beside which a nonlinear observer watches the same samples; the flight loop
    keeps to the filter.
    """

    observer: NonlinearObserver | None = None
    _speeds: Array = np.zeros(4)  # rotor speeds of the tick before

    def run(self, noise: Array, fan_y: Array | None = None, first: int = 0) -> None:
        """Run as ``ClosedLoop`` does, and show the observer every sample."""
        if self.observer is None:
            super().run(noise, fan_y, first)
            return
        for k in range(len(noise)):
            super().run(
                noise[k : k + 1], fan_y, 0 if fan_y is None else min(first + k, len(fan_y) - 1)
            )
            seen = (self.sample[4:7], self.sample[7:11]) if self.seen else (None, None)
            self.observer.step(self._speeds, *seen)
            self._speeds = self.sample[:4].copy()

    def reset(self, rng: np.random.Generator, position: Array, yaw: float = 0.0) -> None:
        """Hover as ``ClosedLoop`` does, and start the observer from the same measured pose."""
        super().reset(rng, position, yaw)
        self._speeds = self.sample[:4].copy()
        if self.observer is not None:
            self.observer.reset(self.sample[4:7].copy(), self.sample[7:11].copy())


class SensingFanTracking(FanTrackingEnv):
    """``FanTrackingEnv`` with more in ``info``.

    ``std_force``, ``std_torque``: the filter's standard deviations (3,) N and Nm. With
    ``observer``, also ``observer_force``, ``observer_torque``: what a nonlinear observer of the
    same rise time makes of the same samples.
    """

    def __init__(self, *args: Any, observer: bool = False, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self._observed = observer

    def _make_loop(self, vehicle: Vehicle, fan: Fan) -> ClosedLoop:
        loop = super()._make_loop(vehicle, fan)
        if self._observed:
            loop.__class__ = _Watched  # the same loop, watched
            assert isinstance(loop, _Watched)
            gain = 2.2 / self.scenario.rise_time
            loop.observer = NonlinearObserver(loop.ukf.vehicle, ObserverTuning(gain, gain), TICK)
        return loop

    def _decide(self, ticks: int) -> None:
        loop = self.loop
        if isinstance(loop, _Watched) and ticks > 0:
            # the observer must see every tick's sample: they are flown one by one, before the look
            # at what came of them
            e = self.episode[0]
            loop.setpoint[4] = min(max(self._command[0], -MAX_COMMAND), MAX_COMMAND)
            loop.run(self.np_random.standard_normal((ticks, NOISE)), self._fan_y, int(e["ticks"]))
            e["ticks"] += ticks
            ticks = 0
        super()._decide(ticks)

    def _info(self) -> dict[str, Any]:
        info, loop = super()._info(), self.loop
        assert loop is not None
        std = np.sqrt(np.diagonal(loop.covariance)[12:18])
        info["std_torque"], info["std_force"] = std[:3].copy(), std[3:].copy()
        if isinstance(loop, _Watched) and loop.observer is not None:
            estimate = loop.observer.estimate
            info["observer_force"], info["observer_torque"] = (
                estimate.force.copy(),
                estimate.torque.copy(),
            )
        return info


def scenario_env(
    scenario: str, sources: frozenset[str] = frozenset(), estimator: str = "ukf"
) -> FanTrackingEnv:
    """Return a scenario's environment, with what a policy must find in its ``info``.

    Args:
        scenario: name.
        sources: what ``info`` must hold, as ``controllers.features.Features.sources`` names it.
        estimator: ``ukf``, or ``constant-gain``, its fast stand-in.

    Raises:
        InputError: a name that does not exist.
    """
    if not sources - TRUTH:
        return FanTrackingEnv(scenario, estimator=estimator)
    observer = any(source.startswith("observer") for source in sources)
    return SensingFanTracking(scenario, observer=observer, estimator=estimator)
