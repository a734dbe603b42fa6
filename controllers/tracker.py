"""Trackers: controllers that estimate the fan's place and motion, and follow the fan.

Each tracker is a particle filter. A particle is a path of the fan. Its expected estimate is the
jet's mean at the vehicle's stations (effect ``fan_jet``) behind the filter's own lag. The
difference to the estimate is coloured noise of known covariance (``sensor_model``). A tracker knows
the observation and the ``briefing``: the declared vehicle, the fan, the pose's noise, the filter's
tuning, and the usual disturbance of a vehicle of this size. The controller has its own random
generator, with the same seed in each episode.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any, ClassVar

import numpy as np

from ..runtime.arrays import Array, Floats, Index, Single
from .axis_models import PLACE, SET_POINT, axis_models
from .axis_observer import AxisFilter, AxisObserver, WrenchProcess, axis_filter
from .briefing import PLACES, Air, Briefing
from .observation import DECISION_PERIOD, MAX_COMMAND
from .preview import preview, pushing
from .sensor_model import MEMORY, Sensing, sensor_model
from .wrench_lag import lags

_ALONG_Y, _LOOK = 1, 24  # commanded axis; decisions of preview in ``Limit``
# the wrench along y, N and Nm: standard deviations and correlation times (s)
_SIZES, _TIMES = (0.1, 0.01), (1.0, 0.5)
_MODEL = (0.05, 0.5)  # m/s2 and rad/s2 per root of a second, errors of the model
# standard deviations of place (m), speed (m/s) and estimated wrench (N, Nm)
_NOISE = (0.002, 0.02, 0.02, 0.002)
_SEED = 2016  # the generator's, the same in every episode
FEW = 0.5  # share of effective particles below which they are drawn anew
# a fan with a sudden change of velocity: a third of them stop, half turn round, the rest take any
# other velocity
STOP, TURN = 1 / 3, 1 / 2
_FEWEST = 8  # particles of a kind of motion whose covariance means something
_SMALLEST = 1e-12  # variance of particles of a kind


@dataclass(eq=False, kw_only=True)
class _Belief(ABC):
    """Base of the trackers: particles with weights, and their command.

    After a decision ``mean`` holds the belief: the fan's place from the vehicle (m) and its
    velocity (m/s); ``deviation`` is the standard deviation of the place (m).
    """

    gain: float  # 1/s, from the expected offset to a velocity
    damping: float  # share of the difference between the fan's velocity and the vehicle's own
    feed: float = 1.0  # share of the fan's expected velocity that is commanded at once
    level: float = 0.0  # logarithmic spread of the noise's size; 0: as the briefing says
    particles: int = 1000

    # a particle's numbers, (n, ...) each
    _arrays: ClassVar[tuple[str, ...]] = ("_level", "_memory", "_place", "_velocity")

    def __post_init__(self) -> None:
        self.particles = int(self.particles)
        self._briefing = Briefing()
        self.reset()

    def brief(self, briefing: Briefing) -> None:
        """From the next ``reset`` on, use the briefing's vehicle, sensors, fan and motions, but not
        its gusts.
        """
        self._briefing = nominal(briefing)

    def reset(self) -> None:
        """Forget the last episode."""
        n = self.particles
        self._rng = np.random.default_rng(_SEED)
        self._sensing = Sensing(sensor_model(self._briefing))
        self._level = np.exp(self.level * self._rng.standard_normal(n))
        self._memory = np.zeros((n, MEMORY))
        self._weight = np.zeros(n)  # logarithm
        self._fresh = np.empty(n)
        self._place = np.zeros(n)  # m, of the fan, from where the vehicle was at first
        self._velocity = np.zeros(n)  # m/s
        self.mean, self.deviation = (0.0, 0.0), float("nan")
        self._begin()

    @abstractmethod
    def _begin(self) -> None:
        """Draw particles for the first observation."""

    @abstractmethod
    def _move(self) -> None:
        """Carry particles on by one decision."""

    def _choose(self, chosen: Index) -> None:
        """Keep the chosen particles (n,)."""
        for name in self._arrays:
            setattr(self, name, getattr(self, name)[chosen])

    def __call__(self, observation: Floats, info: Mapping[str, Any] | None = None) -> Single:
        """Return the command (1,) m/s for an observation (8,)."""
        sensing = self._sensing
        sensing.look(observation)
        if sensing.count > 1:
            self._move()
        sensing.weigh(observation, self._place, self._level, self._memory, self._fresh)
        self._weight += self._fresh
        self._weight -= self._weight.max()
        shares = np.exp(self._weight)
        shares /= shares.sum()
        place, velocity = float(shares @ self._place), float(shares @ self._velocity)
        self.mean = place - sensing.own, velocity
        self.deviation = float(np.sqrt(shares @ (self._place - place) ** 2))
        command = self._command(observation, shares)
        if shares @ shares > 1.0 / (FEW * len(shares)):
            n = len(shares)
            even = (np.arange(n) + self._rng.random()) / n
            self._weight[:] = 0.0
            self._choose(np.minimum(np.searchsorted(np.cumsum(shares), even), n - 1))
        return np.array([command], dtype=np.float32)

    def _command(self, observation: Floats, shares: Array) -> float:
        """Return the velocity to command, m/s; ``shares`` (n,) are the particles' weights."""
        offset, velocity = self.mean
        command = (
            self.feed * velocity
            + self.gain * offset
            + self.damping * (velocity - self._sensing.velocity)
        )
        return min(max(command, -MAX_COMMAND), MAX_COMMAND)


def _velocity_after(
    before: Array,
    rng: np.random.Generator,
    acceleration: float = 0.025,
    jumps: float = 0.25,
    speed: float = 0.28,
) -> Array:
    """Return velocities (n,) m/s of unknown fans, one decision after ``before`` (n,). A fan rests,
    or its velocity drifts a little. Sometimes the velocity changes at once, to zero, to the
    opposite, or to any other. Defaults and units as in ``Tracker``.
    """
    n = len(before)
    drift = acceleration * np.sqrt(DECISION_PERIOD) * (before != 0.0)
    after: Array = before + drift * rng.standard_normal(n)
    jumped = np.flatnonzero(rng.random(n) < jumps * DECISION_PERIOD)
    kind, fresh = rng.random(len(jumped)), speed * rng.standard_normal(len(jumped))
    after[jumped] = np.where(kind < STOP, 0.0, np.where(kind < STOP + TURN, -before[jumped], fresh))
    return after


@dataclass(eq=False, kw_only=True)
class Tracker(_Belief):
    """A tracker without knowledge of the fan's motion: ``_velocity_after``."""

    gain: float = 2.5
    damping: float = 0.4
    acceleration: float = 0.025  # m/s, standard deviation of the velocity's drift over a second
    jumps: float = 0.25  # 1/s, how often the velocity changes at once
    speed: float = 0.28  # m/s, standard deviation of a fresh velocity
    reach: float = 1.6  # m, on either side, where the fan may be at first

    def _begin(self) -> None:
        rng, n = self._rng, self.particles
        self._place = rng.uniform(-self.reach, self.reach, n)
        self._velocity = np.where(rng.random(n) < STOP, 0.0, self.speed * rng.standard_normal(n))

    def _move(self) -> None:
        before = self._velocity
        self._velocity = _velocity_after(
            before, self._rng, self.acceleration, self.jumps, self.speed
        )
        self._place += 0.5 * DECISION_PERIOD * (before + self._velocity)


@dataclass(eq=False, kw_only=True)
class InformedTracker(_Belief):
    """Knows the family of the fan's motions (``briefing.Motions``) and learns the motion: a
    particle is a motion with its speed, travel and place at the start.

    New particles of a kind shrink towards their mean and spread again, at constant mean and
    covariance. See Liu and West, *Combined parameter and state estimation in simulation-based
    filtering*, 2001.
    """

    gain: float = 1.429
    damping: float = 0.407
    ahead: float = 0.08354  # s, preview of the commanded velocity
    spread: float = 0.1486  # share of their standard deviation, in particles drawn anew
    # 1/s, how often a particle leaves the family and moves as those of ``Tracker``; 0: never
    leave: float = 0.03
    _arrays = (*_Belief._arrays, "_kind", "_sign", "_side", "_motion", "_free")

    def _begin(self) -> None:
        rng, n, family = self._rng, self.particles, self._briefing.motions
        names = np.array([list(PLACES).index(name) for name in family.motions])
        self._kind = names[rng.integers(len(names), size=n)]
        self._sign = rng.choice([-1.0, 1.0], n)
        self._side = rng.choice([-1.0, 1.0], n)
        # speed, travel and offset at the start of each, within their bounds
        self._bounds = low, high = np.transpose([family.speed, family.travel, family.offset])
        self._motion = rng.uniform(low, high, (n, 3))
        self._free = np.zeros(n, dtype=bool)  # whether a particle left the family
        self._go(0.0)

    def _move(self) -> None:
        place, velocity = self._place, self._velocity
        self._go((self._sensing.count - 1) * DECISION_PERIOD)
        if self.leave <= 0.0:
            return
        self._free |= self._rng.random(len(place)) < self.leave * DECISION_PERIOD
        some = np.flatnonzero(self._free)
        before = velocity[some]
        after = _velocity_after(before, self._rng)
        self._velocity[some] = after
        self._place[some] = place[some] + 0.5 * DECISION_PERIOD * (before + after)

    def _go(self, time: float) -> None:
        """Set the particles' places at a time (s), and their velocities."""
        self._place = self._place_at(time)
        self._velocity = (self._place_at(time + self.ahead) - self._place) / self.ahead

    def _place_at(self, time: float) -> Array:
        """Return the places (n,) m, at a time (s), of the particles in the family."""
        speed, travel, offset = self._motion.T
        place: Array = self._side * offset
        for kind, place_after in enumerate(PLACES.values()):
            some = np.flatnonzero(self._kind == kind)
            place[some] += self._sign[some] * place_after(speed[some], travel[some], time)
        return place

    def _choose(self, chosen: Index) -> None:
        super()._choose(chosen)
        noise, keep = self._rng.standard_normal(self._motion.shape), np.sqrt(1.0 - self.spread**2)
        # speed and offset count with the sign that they are flown with
        motion = self._motion * np.column_stack([self._sign, np.ones(len(chosen)), self._side])
        for kind in range(len(PLACES)):
            some = np.flatnonzero((self._kind == kind) & ~self._free)
            if len(some) >= _FEWEST:
                mean = motion[some].mean(axis=0)
                apart = motion[some] - mean
                covariance = apart.T @ apart / len(some) + _SMALLEST * np.eye(3)
                drawn = noise[some] @ np.linalg.cholesky(covariance).T
                motion[some] = mean + keep * apart + self.spread * drawn
        self._sign, _, self._side = np.where(motion < 0.0, -1.0, 1.0).T
        motion[:, [0, 2]] = np.abs(motion[:, [0, 2]])
        low, high = self._bounds  # at which they are reflected
        motion = np.where(motion > high, 2.0 * high - motion, motion)
        motion = np.where(motion < low, 2.0 * low - motion, motion)
        self._motion = np.clip(motion, low, high)


@dataclass(eq=False, kw_only=True)
class _Regulated(_Belief):
    """A belief with the oracle's regulator along the expected path.

    Place and speed of the vehicle are observed. A Kalman filter of the flight loop
    (``axis_observer``) finds tilt, its rates, set point and wrench.
    """

    gain: float = 0.0  # the regulator has its own
    damping: float = 0.0
    effort: float = 3e-4  # as of ``Oracle``

    def reset(self) -> None:
        """Forget the last episode."""
        super().reset()
        self._observer, self._gain, self._ahead_gains = _regulator(self._briefing, self.effort)
        self._last = 0.0  # command

    @abstractmethod
    def _ahead(self, seconds: float) -> Array:
        """Return the fan's expected place after some time for each particle, (n,) m."""

    def _command(self, observation: Floats, shares: Array) -> float:
        sensing = self._sensing
        # every second decision, and evenly between
        knots = np.arange(0, _LOOK + 1, 2)
        expected = [float(shares @ self._ahead(k * DECISION_PERIOD)) for k in knots]
        path = np.interp(np.arange(_LOOK + 1), knots, expected)
        o = np.asarray(observation[:6], dtype=np.float64)
        felt = pushing(o[None])[_ALONG_Y][0]
        seen = np.array([sensing.own, sensing.velocity, *felt])
        off = self._observer.update(self._last, seen).copy()
        off[[PLACE, SET_POINT]] -= path[0]
        command = -float(self._gain @ off + self._ahead_gains @ np.diff(path))
        self._last = min(max(command, -MAX_COMMAND), MAX_COMMAND)
        return self._last


def _regulator(briefing: Briefing, effort: float) -> tuple[AxisObserver, Array, Array]:
    """Return an observer of the vehicle along y, the regulator's gain on its states (n,), and on
    the fan's coming moves (decisions,).
    """
    model = _own_motion(briefing)
    fan = np.zeros((len(model.A), 1))
    fan[[PLACE, SET_POINT]] = -1.0
    gain, ahead = preview(model.A, model.B[:, None], fan, effort, _LOOK)
    return AxisObserver(model), gain, ahead[:, 0]


@lru_cache(maxsize=16)
def _own_motion(briefing: Briefing) -> AxisFilter:
    """Return the Kalman filter of a briefed vehicle along y."""
    vehicle = briefing.vehicle
    axis = axis_models(vehicle)[_ALONG_Y].with_set_point()
    mass, inertia = vehicle.mass, float(vehicle.inertia[2, 2])
    _, force = lags(mass, inertia, briefing.noise, briefing.air, DECISION_PERIOD)
    wrench = WrenchProcess(_SIZES, _TIMES, DECISION_PERIOD * force.delay)
    return axis_filter(axis, DECISION_PERIOD, wrench, _MODEL, _NOISE)


@dataclass(eq=False, kw_only=True)
class TrackerLQG(_Regulated, Tracker):
    """The tracker without knowledge of the fan's motion, with the oracle's regulator.

    A sudden change stops the fan, reverses it or gives another velocity, so the expected velocity
    decays.
    """

    def _ahead(self, seconds: float) -> Array:
        rate = self.jumps * (1.0 + TURN)  # a stop costs a velocity, a turn two
        effective_seconds = -float(np.expm1(-rate * seconds)) / rate  # s of its velocity
        return np.asarray(self._place + self._velocity * effective_seconds)


@dataclass(eq=False, kw_only=True)
class Limit(_Regulated, InformedTracker):
    """The best possible controller from these measurements: the informed tracker with the true
    parameters of all random draws, gusts included, many particles, and the oracle's regulator.

    Against 2,000 particles and the regulator without an observer 6,000 and the observer are worth
    1.4 and 2.4 % on base and fast (.0812 to .0801 m, .1016 to .0992 m; 40 fresh episodes). A
    decision takes 2 to 3 ms. The law is not robust: worse than the trackers under an undeclared
    latency of 30 ms (.270 m), and 1 m off the jet in one of 40 episodes of fast.

    Tried on 40 fresh episodes: 20,000 particles change fast by +0.5 %, ``leave`` of 0.01 by +21 %,
    ``effort`` of 1e-4 by +2.5 %. One of 1e-3 changes fast by -1.7 % (-4.9 to 1.4), and base by
    -3.2 % (-5.4 to -1.2); on 40 more it changes base by +0.6 % (-1.8 to 3.0): no gain.

    The law is no entry of a leaderboard, but the end of the scale for laws with the wrench alone.
    It does not know the draws of ``varied`` or undeclared effects.
    """

    ahead: float = 0.12
    spread: float = 0.15
    particles: int = 6000
    leave: float = 0.0

    def brief(self, briefing: Briefing) -> None:
        """Take the whole briefing."""
        self._briefing = briefing

    def _ahead(self, seconds: float) -> Array:
        return self._place_at((self._sensing.count - 1) * DECISION_PERIOD + seconds)


def nominal(briefing: Briefing) -> Briefing:
    """Return a briefing with the gusts of the standard scenarios."""
    return replace(briefing, air=replace(briefing.air, turbulence=Air().turbulence))
