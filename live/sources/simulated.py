"""The kit's own vehicle in the jet of a moving fan, flown in real time: no vehicle is needed.

``sim:SCENARIO`` flies a scenario of the fan-tracking task with the paper's admittance controller,
for as long as one watches. ``?seed=N`` draws another flight, ``?speed=X`` lets time pass X times as
fast (0: as fast as the machine computes).
"""

import math
import time

import numpy as np

from ...controllers import make_controller
from ...envs.fan_tracking import FanTrackingEnv
from ...envs.plant import NOISE, TICK
from ...envs.scenarios import SCENARIOS, draw_fan_path, find_scenario
from ...runtime.arrays import Array
from ...runtime.errors import InputError
from ..messages import SECOND, Measurement
from .base import WAITS, Source

_AT_ONCE = 0.05  # s of flight caught up at once, at most
DECISION_TICKS = round(1.0 / (TICK * FanTrackingEnv.decision_hz))
_BEHIND = 1.0  # s: after a longer delay the flight goes on from now


class Simulated(Source):
    """A vehicle flying in this process."""

    kind = "sim"
    options = ("seed", "speed")
    expected = "a flight of the plant"

    def _prepare(self) -> None:
        self._scenario = find_scenario(self.address.path or "base", SCENARIOS)
        self._speed = self.address.number("speed", 1.0)
        self.paced = self._speed == 1.0
        self.patience = 0.0 if self.paced else WAITS
        self._seed = int(self.address.number("seed", 0.0))
        self._controller = make_controller("admittance")
        self._rng = np.random.default_rng(self._seed)
        self._ticks = 0
        self._command = 0.0

    def _fan_path(self, t: Array) -> Array:
        """Return the fan's positions (n,), m, at times (n,), s: drawn anew from the same numbers,
        for a flight of any length.
        """
        return draw_fan_path(self._scenario, np.random.default_rng(self._seed), t)[1]

    def open(self) -> None:
        """Take off."""
        task = FanTrackingEnv(self._scenario, vehicle=self.vehicle, fan_path=self._fan_path)
        task.reset(seed=self._seed)
        self._controller.reset()
        self._loop = task.loop
        self._begun = time.monotonic_ns()  # when tick 0 was due

    def read(self, timeout: float) -> list[tuple[Measurement, int]] | None:
        """Fly up to the present time; return the measurements."""
        now = time.monotonic_ns()
        if self._speed == 0.0:
            return [self._tick() for _ in range(DECISION_TICKS)]
        passed = 1e-9 * (now - self._begun) * self._speed
        due = math.floor(passed / TICK) + 1 - self._ticks
        if due <= 0:
            wait = ((self._ticks * TICK) - passed) / self._speed
            time.sleep(min(max(wait, 0.0), timeout))
            return []
        if due * TICK > _BEHIND * max(self._speed, 1.0):
            self._begun += round((due - 1) * TICK / self._speed * SECOND)
            due = 1
        due = min(due, max(1, round(_AT_ONCE * max(self._speed, 1.0) / TICK)))
        return [self._tick() for _ in range(due)]

    def _tick(self) -> tuple[Measurement, int]:
        """Fly one tick; return its pose and rotor speeds, and their arrival, ns."""
        loop = self._loop
        arrival = time.monotonic_ns()
        phase = self._ticks % DECISION_TICKS
        if phase == 0:  # move the fan; the controller answers the wrench felt
            t = TICK * (self._ticks + np.arange(DECISION_TICKS, dtype=np.float64))
            self._fan_y = self._fan_path(t)
            x = loop.state
            observation = np.array([*x[16:19], *x[13:16], x[8], self._command], dtype=np.float32)
            self._command = float(self._controller(observation, None)[0])
            loop.setpoint[4] = self._command
        before = loop.unrounded.copy()
        external = loop.external.copy()
        loop.run(self._rng.standard_normal((1, NOISE)), self._fan_y[phase : phase + 1])
        if not loop.healthy():
            raise InputError(f"{self.name}: the simulated {self.vehicle.name} crashed")
        # rotor speeds at the instant of the pose: see ``envs.recording``
        speeds = 0.25 * before + 0.75 * loop.unrounded
        if self.vehicle.omega_lsb > 0:
            speeds = self.vehicle.omega_lsb * np.round(speeds / self.vehicle.omega_lsb)
        seen = loop.seen
        battery = loop.battery
        sample = Measurement(
            "row",
            round(self._ticks * TICK * SECOND),
            arrival,
            whole=True,
            position=loop.sample[4:7].copy() if seen else None,
            quaternion=loop.sample[7:11] / np.linalg.norm(loop.sample[7:11]) if seen else None,
            rotor_speeds=speeds,
            voltage=battery if battery > 0.0 else None,
            force=external[:3],
            torque=external[3:],
        )
        self._ticks += 1
        return sample, arrival
