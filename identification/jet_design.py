"""The admittance law of a measured jet: its gain, and what a vehicle with this law can follow.

The law flies a torque's profile over the place. Beside the profile count the wrench filter's lag,
the flight loop's answer to a velocity, and the hold between two decisions. The noise is a measured
one: of the torque as the filter shows it, and of the vehicle's place. The loop is flown many times,
in one dimension, behind fans of steady speeds.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, cached_property
from typing import Any, NamedTuple

import numpy as np

from ..controllers.briefing import Air, FilterNoise
from ..controllers.flight import FlightGains
from ..controllers.observation import DECISION_PERIOD, MAX_COMMAND
from ..controllers.wrench_lag import lags
from ..runtime.plain_values import plain
from .logs.table import Array, ArrayPair, NamedNumbers, Pair

HELD_SHARE = 0.8  # of the flights behind a fan that counts as followed
FLIGHT_TIME = 20.0  # s
EDGE_SHARE = 0.2  # of the largest torque, at the edge of the jet
MARGIN = math.pi / 6.0  # least phase margin of the loop, rad
SURE = 5.0  # standard deviations of the torque's peaks from zero
RISE_TIMES = np.geomspace(0.1, 10.0, 61)  # s
_CROSSINGS = np.geomspace(0.3, 3.0, 21)  # rad/s, of the loops that are flown
_SHARES = np.linspace(0.0, 1.3, 14)  # of ``gain * largest torque``, speeds of the fans
_FLIGHTS = 120
_START, _LOST = 0.1, 2.5  # m, from the axis, at the start on either side, and at most
_OMEGA = np.geomspace(0.01, 0.95 * math.pi / DECISION_PERIOD, 600)  # rad/s
_CALM = np.zeros((1, 2))  # noise of no flight
_MOTOR_LAG = 0.04  # s, of the rotors


class JetShape(NamedTuple):
    """A torque's profile, for a law. Of two numbers the first is that of the lower places."""

    place: Array  # (n,) m along the line
    torque: Array  # (n,) Nm; zero beyond
    axis: float  # m, where the torque is zero
    slope: float  # Nm/m, the steepest over 0.2 m
    torques: Array  # (2,) Nm, the largest
    peaks: Array  # (2,) m, where they are; beyond, the fan is lost
    edges: Array  # (2,) m; beyond, the torque is below a fifth of the largest

    def bounds(self, gains: Array) -> Array:
        """Return the speeds (g,) m/s that gains (g,) ask for at the weaker peak, at most."""
        return np.asarray(np.minimum(gains * np.abs(self.torques).min(), MAX_COMMAND))


def shape_of(place: Array, torque: Array) -> JetShape | None:
    """Return the shape of a torque's profile (n,) that rises through zero between its extremes;
    None where it does not.
    """
    low, high = ends = np.array([np.argmin(torque), np.argmax(torque)])
    if low >= high or torque[low] >= 0.0 or torque[high] <= 0.0:
        return None
    rising = low + np.argmax(torque[low + 1 : high + 1] >= 0.0) + [0, 1]
    axis = np.interp(0.0, torque[rising], place[rising])
    around = [np.interp(place[low : high + 1] + d, place, torque) for d in (-0.1, 0.1)]
    left = low - np.argmin(np.append(torque[low::-1] < EDGE_SHARE * torque[low], False)) + 1
    right = high + np.argmin(np.append(torque[high:] > EDGE_SHARE * torque[high], False)) - 1
    slope = np.diff(around, axis=0).max() / 0.2
    return JetShape(place, torque, axis, slope, torque[ends], place[ends], place[[left, right]])


def no_jet(place: Array, torque: Array, std: Array) -> str:
    """Return why a profile (n,) with standard deviations allows no law; empty: it allows one."""
    sure = torque / std
    if (most := np.abs(sure).max()) < SURE:
        return (
            "the torque about z is not distinguishable from zero: at most "
            f"{most:.1f} standard deviations, {SURE:g} are needed"
        )
    if min(sure.max(), -sure.min()) < SURE:
        return "the torque about z does not change its sign: fly on both sides of a jet"
    shape = shape_of(place, torque)
    if shape is None:
        return "the torque about z falls across the line, where that of a jet's drag rises"
    for end, edge, size in zip((0, -1), shape.edges, shape.torques, strict=True):
        if edge == place[end] and torque[end] / size + 2.0 * std[end] / abs(size) > 0.9:
            return f"the torque has not fallen yet at {edge:.2f} m, where the flight ends: fly on"
    return ""


@dataclass(frozen=True, eq=False)
class FollowingLoop:
    """The loop of the law but for its gain and the jet, from decision to decision."""

    keep: Array  # (3, 3) of the filter's error
    enter: Array  # (3,) an even change of the torque's part in it
    # of the flight loop's states: (m, m), of a commanded velocity (m,), and the place (m,)
    carry: Array
    push: Array
    show: Array
    noise: Array  # (k, 2) of the felt torque, Nm, and of the place, m, a decision a row

    def margins(self, gain: float) -> Pair:
        """Return phase margin (rad) and delay margin (s) of the loop whose gain times slope is
        ``gain`` (1/s).
        """
        answer = gain * self.response
        phase = np.unwrap(np.angle(answer))
        crossed = np.flatnonzero(np.abs(answer) >= 1.0)[-1]
        # an integrator at first: a quarter turn behind
        turns = round(phase[0] / (2.0 * math.pi) + 0.25)
        margin = phase[crossed] - math.pi * (2 * turns - 1)
        return margin, margin / _OMEGA[crossed]

    @cached_property
    def response(self) -> Any:
        """Answer (n,) of the felt place to a commanded velocity at the frequencies ``_OMEGA``."""
        z = np.exp(1j * _OMEGA * DECISION_PERIOD)
        felt, moved = (
            np.linalg.solve(z[:, None, None] * np.eye(len(b)) - A, b[:, None])[..., 0]
            for A, b in ((self.keep, self.enter), (self.carry, self.push))
        )
        return (1.0 - felt[:, 2] * (z - 1.0)) * (moved @ self.show)


@cache
def _flight_loop() -> tuple[Array, Array, Array]:
    """Return the kit's flight loop along one axis, from decision to decision."""
    from scipy.signal import cont2discrete, tf2ss

    gains = FlightGains()
    answer = gains.attitude * np.array([gains.velocity, gains.position, gains.integral])
    rotors = np.polymul([_MOTOR_LAG, 1.0], [1.0, gains.rate, gains.attitude])
    closed = np.polyadd(np.append(rotors, [0.0, 0.0, 0.0]), answer)
    system = tf2ss(answer, np.append(closed, 0.0))  # a velocity moves the set point
    carry, push, show, *_ = cont2discrete(system, DECISION_PERIOD)
    return carry, push[:, 0], show[0]


def following_loop(
    inertia_z: float, filter_noise: FilterNoise, noise: Array = _CALM
) -> FollowingLoop:
    """Return the loop of a vehicle with this inertia (kg m2), wrench filter, and measured noise
    (k, 2), under the kit's flight loop.
    """
    lag, _ = lags(1.0, inertia_z, filter_noise, Air(), DECISION_PERIOD)  # whatever the mass
    return FollowingLoop(lag.keep, lag.enter, *_flight_loop(), noise)


def followed(
    loop: FollowingLoop, jet: JetShape, gains: Array, speeds: Array, seed: int = 0
) -> ArrayPair:
    """Fly the law behind fans of steady speeds. Each flight begins anywhere in the measured noise,
    with either sign; flights are the same for all gains and speeds.

    Args:
        loop: filter, flight loop and noise.
        jet: the torque's profile.
        gains: (g,) m/s per Nm.
        speeds: (g, s) m/s.
        seed: of the flights.

    Returns:
        Share (g, s) of the flights that stay within the jet's edges for ``FLIGHT_TIME``, and the
        root-mean-square offset (g, s), m, as a mean over the flights; lost ones count at 2.5 m.
    """
    rng, size = np.random.default_rng(seed), (*speeds.shape, _FLIGHTS)
    first = rng.integers(len(loop.noise), size=_FLIGHTS)
    sides, signs = rng.choice([-1.0, 1.0], (2, _FLIGHTS))
    start = rng.uniform(-_START, _START, _FLIGHTS)
    at, decisions = jet.place - jet.axis, round(FLIGHT_TIME / DECISION_PERIOD)
    left, right = jet.edges - jet.axis
    state, error = np.zeros((len(loop.push), *size)), np.zeros((3, *size))
    felt = np.broadcast_to(np.interp(start, at, jet.torque), size)
    held, square = np.ones(size, dtype=bool), np.zeros(size)
    for k in range(decisions):
        noise, drift = signs * loop.noise[(first + k) % len(loop.noise)].T
        wanted = -gains[:, None, None] * (felt - error[2] + noise)
        command = np.clip(wanted, -MAX_COMMAND, MAX_COMMAND)
        state = np.tensordot(loop.carry, state, 1) + np.multiply.outer(loop.push, command)
        fan = sides * speeds[..., None] * DECISION_PERIOD * (k + 1)
        offset = np.tensordot(loop.show, state, 1) + start + drift - fan
        true = np.interp(offset, at, jet.torque, 0.0, 0.0)
        error = np.tensordot(loop.keep, error, 1) + np.multiply.outer(loop.enter, true - felt)
        felt = true
        held &= (offset >= left) & (offset <= right)
        square += np.minimum(np.abs(offset), _LOST) ** 2
    return held.mean(axis=2), np.sqrt(square / decisions).mean(axis=2)


def fastest_followed(loop: FollowingLoop, jet: JetShape, gains: Array) -> Array:
    """Return the fastest fan (g,) m/s that each gain follows in ``HELD_SHARE`` of its flights."""
    speeds = jet.bounds(gains)[:, None] * _SHARES
    shares = np.minimum.accumulate(followed(loop, jet, gains, speeds)[0], axis=1)
    pairs = np.stack([shares, speeds], axis=1)[..., ::-1]
    return np.array([np.interp(HELD_SHARE, *pair) for pair in pairs])


def design_admittance(
    loop: FollowingLoop,
    lagging: Callable[[float], FollowingLoop],
    jet: JetShape,
    speed: float | None = None,
) -> NamedNumbers | None:
    """Return the gain with the least offset behind fans of all speeds up to one, among those with a
    phase margin of ``MARGIN``, and what it can follow; None where no gain follows any fan.

    Args:
        loop: that flies.
        lagging: the loop of a filter's rise time, s.
        jet: the torque's profile.
        speed: m/s, the largest of these fans; default: half of the fastest that any gain follows.
    """
    crossings = np.array([c for c in _CROSSINGS if loop.margins(c)[0] >= MARGIN])
    gains = crossings / jet.slope
    fastest = fastest_followed(loop, jet, gains)
    if not fastest.any():
        return None
    wanted = 0.5 * fastest.max() if speed is None else speed
    alike = np.tile(wanted * np.linspace(0.0, 1.0, 5), (len(gains), 1))
    offsets = followed(loop, jet, gains, alike, 1)[1].mean(axis=1)
    best = np.argmin(offsets)
    crossing = crossings[best]
    margin, delay = loop.margins(crossing)
    slow = [rise for rise in RISE_TIMES if lagging(rise).margins(crossing)[0] >= MARGIN]
    law: NamedNumbers = plain(
        {
            "gain": gains[best],
            "bound_m_s": jet.bounds(gains)[best],
            "fastest_fan_m_s": fastest[best],
            "designed_up_to_m_s": wanted,
            "offset_rms_m": offsets[best],
            "phase_margin_deg": math.degrees(margin),
            "delay_margin_s": delay,
            "largest_rise_time_s": max(slow, default=0.0),
        }
    )
    return law
