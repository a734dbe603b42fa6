"""The admittance law of a measured jet: its gain, and what a vehicle with this law can follow.

The law flies a torque's profile over the place. Beside the profile count the wrench filter's lag,
the flight loop's answer to a velocity, and the hold between two decisions. The noise is a measured
one: of the torque as the filter shows it, and of the vehicle's place. The loop is flown many times,
in one dimension, behind fans of steady speeds.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..controllers.briefing import Air, FilterNoise
from ..controllers.flight import FlightGains
from ..controllers.observation import DECISION_PERIOD, MAX_COMMAND
from ..controllers.wrench_lag import axis_lag

Array = NDArray[np.float64]

HELD_SHARE = 0.8  # of the flights behind a fan that counts as followed
FLIGHT_TIME = 20.0  # s
EDGE_SHARE = 0.2  # of the largest torque, at the edge of the jet
MARGIN = math.pi / 6.0  # least phase margin of the loop, rad
SURE = 4.0  # standard deviations of the torque's peaks from zero
RISE_TIMES = np.round(np.geomspace(0.1, 10.0, 61), 3)  # s
_CROSSINGS = np.geomspace(0.3, 3.0, 21)  # rad/s, of the loops that are flown
_SHARES = np.linspace(0.3, 1.3, 11)  # of ``gain * largest torque``, speeds of the fans
_FLIGHTS = 120
_START = 0.1  # m, to either side of the axis
_LOST = 2.5  # m
_OMEGA = np.geomspace(0.01, 0.95 * math.pi / DECISION_PERIOD, 600)  # rad/s
_MOTOR_LAG = 0.04  # s, of the rotors


@dataclass(frozen=True)
class JetShape:
    """A torque's profile, for a law: places in m, torques in Nm; left is the lower place."""

    centre: float  # where the torque is zero
    slope: float  # Nm/m, the steepest between the peaks, over 0.2 m
    peaks: tuple[float, float]  # places of the largest torques
    torques: tuple[float, float]  # the least and the largest
    edges: tuple[float, float]  # places beyond which the torque is below a fifth of its peak

    @property
    def weaker(self) -> float:
        """The smaller one of the two largest torques, Nm."""
        return min(-self.torques[0], self.torques[1])


def shape_of(place: Array, torque: Array) -> JetShape | None:
    """Return the shape of a torque's profile (n,) that rises through zero between its extremes;
    None where it does not.
    """
    low, high = int(np.argmin(torque)), int(np.argmax(torque))
    if low >= high or torque[low] >= 0.0 or torque[high] <= 0.0:
        return None
    between = np.arange(low, high)
    crossings = between[(torque[between] < 0.0) & (torque[between + 1] >= 0.0)]
    k = int(crossings[np.argmin(np.abs(crossings - 0.5 * (low + high)))])
    centre = place[k] - torque[k] * (place[k + 1] - place[k]) / (torque[k + 1] - torque[k])
    ahead, behind = (np.interp(place[low : high + 1] + d, place, torque) for d in (0.1, -0.1))
    slope = float((ahead - behind).max()) / 0.2
    left = np.flatnonzero(torque[:low] > EDGE_SHARE * torque[low])
    right = np.flatnonzero(torque[high:] < EDGE_SHARE * torque[high])
    edges = (
        place[left[-1] + 1] if len(left) else place[0],
        place[high + right[0] - 1] if len(right) else place[-1],
    )
    return JetShape(
        float(centre),
        slope,
        (float(place[low]), float(place[high])),
        (float(torque[low]), float(torque[high])),
        (float(edges[0]), float(edges[1])),
    )


def no_jet(place: Array, torque: Array, std: Array) -> str:
    """Return why a profile (n,) with standard deviations allows no law; empty: it allows one."""
    i, j = int(np.argmin(torque / std)), int(np.argmax(torque / std))
    sure = -torque[i] / std[i], torque[j] / std[j]
    if max(sure) < SURE:
        return (
            "the torque about z is not distinguishable from zero: at most "
            f"{max(sure):.1f} standard deviations, {SURE:g} are needed"
        )
    if min(sure) < SURE:
        return (
            "the torque about z does not change its sign: the flight covers one side of a jet, "
            "or the vehicle's own torque hides the other"
        )
    shape = shape_of(place, torque)
    if shape is None:
        return (
            "the torque about z falls across the line from right to left, seen along the wind: "
            "no drag in a jet does so"
        )
    for end, peak, edge in zip((0, -1), (i, j), shape.edges, strict=True):
        size, inside = abs(torque[peak]), math.copysign(torque[end], torque[end] * torque[peak])
        if edge == place[end] and inside + 2.0 * std[end] > 0.9 * size:
            side = "lower" if end == 0 else "higher"
            return (
                f"the flight ends at {place[end]:.2f} m, before the torque falls on the {side} "
                "side: its largest value is not known. Fly farther out"
            )
    return ""


@dataclass(frozen=True, eq=False)
class FollowingLoop:
    """The loop of the law but for its gain and the jet, from decision to decision."""

    keep: Array  # (3, 3) of the filter's error
    enter: Array  # (3,) an even change of the torque's part in it
    carry: Array  # (7, 7) of the flight loop: set point, place, velocity, and the rest
    push: Array  # (7,) a commanded velocity's part
    noise: (
        Array  # (m, 2) measured noise of the felt torque, Nm, and of the place, m, a decision a row
    )

    def margins(self, gain: float) -> tuple[float, float, float]:
        """Return phase margin (rad), gain margin (a factor) and delay margin (s) of the loop whose
        gain times slope is ``gain`` (1/s).
        """
        answer = gain * self.response
        phase = np.unwrap(np.angle(answer))
        phase -= 2.0 * math.pi * round((phase[0] + 0.5 * math.pi) / (2.0 * math.pi))
        above = np.flatnonzero(np.abs(answer) >= 1.0)
        turned = np.flatnonzero(phase <= -math.pi)
        factor = 1.0 / abs(answer[turned[0]]) if len(turned) else math.inf
        margin = math.pi + float(phase[above[-1]])
        return margin, float(factor), margin / float(_OMEGA[above[-1]])

    @cached_property
    def response(self) -> Any:
        """Answer (n,) of the felt place to a commanded velocity at the frequencies ``_OMEGA``."""
        z = np.exp(1j * _OMEGA * DECISION_PERIOD)[:, None, None]
        felt = np.linalg.solve(z * np.eye(3) - self.keep, self.enter[:, None])[:, 2, 0]
        moved = np.linalg.solve(z * np.eye(7) - self.carry, self.push[:, None])[:, 1, 0]
        return (1.0 - felt * (z[:, 0, 0] - 1.0)) * moved


@lru_cache(maxsize=8)
def _flight_loop(gains: FlightGains) -> tuple[Array, Array]:
    """Return the flight loop along one axis from decision to decision: (7, 7), and of a command."""
    from scipy.linalg import expm

    # set point, place, velocity, integral; acceleration by the attitude, its rate, and the rotors'
    A = np.zeros((8, 8))
    A[0, 7] = 1.0
    A[1, 2] = A[2, 4] = A[4, 5] = 1.0
    A[3, :2] = 1.0, -1.0
    A[5, 6] = 1.0
    wanted = np.zeros(8)
    wanted[[0, 1, 2, 3, 7]] = (
        gains.position,
        -gains.position,
        -gains.velocity,
        gains.integral,
        gains.velocity,
    )
    turning = gains.attitude * wanted
    turning[4] -= gains.attitude
    turning[5] -= gains.rate
    A[6] = turning / _MOTOR_LAG
    A[6, 6] -= 1.0 / _MOTOR_LAG
    whole = expm(A * DECISION_PERIOD)
    return whole[:7, :7], whole[:7, 7]


def following_loop(
    inertia_z: float,
    filter_noise: FilterNoise,
    noise: Array | None = None,
    gains: FlightGains | None = None,
) -> FollowingLoop:
    """Return the loop of a vehicle with this inertia (kg m2), wrench filter and flight loop.

    Args:
        inertia_z: kg m2.
        filter_noise: of the wrench filter; settles its lag.
        noise: (m, 2) of the felt torque (Nm) and of the place (m), a row a decision; default: none.
        gains: of the flight loop; default: the kit's.
    """
    f = filter_noise
    steps = max(1, round(DECISION_PERIOD / f.period))
    lag = axis_lag(inertia_z, (f.torque, f.torque_walk, f.attitude), Air(), f.period, steps)
    carry, push = _flight_loop(gains or FlightGains())
    measured = np.zeros((1, 2)) if noise is None else noise
    return FollowingLoop(lag.keep, lag.enter, carry, push, measured)


def followed(
    loop: FollowingLoop,
    place: Array,
    torque: Array,
    shape: JetShape,
    gains: Array,
    speeds: Array,
    flights: int = _FLIGHTS,
    seed: int = 0,
) -> tuple[Array, Array]:
    """Fly the law behind fans of steady speeds. Each flight begins anywhere in the measured noise,
    with either sign; flights are the same for all gains and speeds.

    Args:
        loop: filter, flight loop and noise.
        place: (n,) m of the profile.
        torque: (n,) Nm; zero beyond.
        shape: of this profile.
        gains: (g,) m/s per Nm.
        speeds: (g, s) m/s.
        flights: of each.
        seed: of the noise.

    Returns:
        Share (g, s) of the flights that stay within the jet's edges for ``FLIGHT_TIME``, and the
        root-mean-square offset (g, s), m, as a mean over the flights; lost ones count at 2.5 m.
    """
    rng = np.random.default_rng(seed)
    size = (*speeds.shape, flights)
    state, error = np.zeros((7, *size)), np.zeros((3, *size))
    offset = np.broadcast_to(rng.uniform(-_START, _START, flights), size)
    state[:2] = offset
    sides, signs = rng.choice([-1.0, 1.0], (2, flights))
    first = rng.integers(len(loop.noise), size=flights)
    left, right = shape.edges[0] - shape.centre, shape.edges[1] - shape.centre
    at, decisions = place - shape.centre, round(FLIGHT_TIME / DECISION_PERIOD)
    axis, felt = np.zeros(size), np.interp(offset, at, torque, 0.0, 0.0)
    held, square = np.ones(size, dtype=np.bool_), np.zeros(size)
    for k in range(decisions):
        noise, drift = signs * loop.noise[(first + k) % len(loop.noise)].T
        shown = felt - error[2] + noise
        command = np.clip(-gains[:, None, None] * shown, -MAX_COMMAND, MAX_COMMAND)
        state = np.tensordot(loop.carry, state, 1) + loop.push[:, None, None, None] * command
        axis = axis + sides * speeds[..., None] * DECISION_PERIOD
        offset = state[1] + drift - axis
        true = np.interp(offset, at, torque, 0.0, 0.0)
        error = np.tensordot(loop.keep, error, 1)
        error += loop.enter[:, None, None, None] * (true - felt)
        felt = true
        held &= (offset >= left) & (offset <= right)
        square += np.minimum(np.abs(offset), _LOST) ** 2
    return held.mean(axis=2), np.sqrt(square / decisions).mean(axis=2)


@dataclass(frozen=True)
class AdmittanceDesign:
    """The law of a jet, and what it can follow."""

    gain: float  # m/s per Nm
    bound: float  # m/s, gain times the weaker one of the two largest torques
    fastest: float  # m/s of a fan that is followed in ``HELD_SHARE`` of the flights
    designed_for: float  # m/s, largest speed of the fans behind which the gain has the least offset
    offset: float  # m, root-mean-square, mean over these fans
    rise_time: float  # s, of the filter that the design is for
    phase_margin: float  # rad
    gain_margin: float
    delay_margin: float  # s
    rise_time_margin: float  # s, up to which the filter keeps the phase margin of ``MARGIN``


def design_admittance(
    loops: Mapping[float, FollowingLoop],
    rise_time: float,
    place: Array,
    torque: Array,
    shape: JetShape,
    speed: float | None = None,
) -> AdmittanceDesign | None:
    """Return the gain with the least offset behind fans of all speeds up to one, among those with a
    phase margin of ``MARGIN``, and what it can follow; None where no gain follows any fan.

    Args:
        loops: by the filter's rise time, s.
        rise_time: s, the one of them that flies.
        place: (n,) m of the profile.
        torque: (n,) Nm.
        shape: of the profile.
        speed: m/s, the largest of these fans; default: half of the fastest that any gain follows.
    """
    loop, flown = loops[rise_time], (place, torque, shape)
    crossings = np.array([c for c in _CROSSINGS if loop.margins(c)[0] >= MARGIN])
    if not len(crossings):
        return None
    gains = crossings / shape.slope
    fastest = fastest_followed(loop, *flown, gains)
    if fastest.max() <= 0.0:
        return None
    wanted = 0.5 * float(fastest.max()) if speed is None else speed
    alike = np.tile(wanted * np.linspace(0.0, 1.0, 5), (len(gains), 1))
    offsets = followed(loop, *flown, gains, alike, seed=1)[1].mean(axis=1)
    best = int(np.argmin(offsets))
    crossing, gain = float(crossings[best]), float(gains[best])
    kept = [rise for rise, one in loops.items() if one.margins(crossing)[0] >= MARGIN]
    return AdmittanceDesign(
        gain,
        min(gain * shape.weaker, MAX_COMMAND),
        float(fastest[best]),
        wanted,
        float(offsets[best]),
        rise_time,
        *loop.margins(crossing),
        max(kept),
    )


def fastest_followed(
    loop: FollowingLoop, place: Array, torque: Array, shape: JetShape, gains: Array
) -> Array:
    """Return the fastest fan (g,) m/s that each gain follows in ``HELD_SHARE`` of its flights."""
    speeds = np.minimum(gains * shape.weaker, MAX_COMMAND)[:, None] * _SHARES
    shares, _ = followed(loop, place, torque, shape, gains, speeds)
    return np.array([_fastest(*row) for row in zip(speeds, shares, strict=True)])


def _fastest(speeds: Array, shares: Array) -> float:
    """Return the speed at which the share of followed fans falls below ``HELD_SHARE``."""
    below = np.flatnonzero(shares < HELD_SHARE)
    if not len(below):
        return float(speeds[-1])
    k = int(below[0])
    if k == 0:
        return 0.0
    part = (shares[k - 1] - HELD_SHARE) / (shares[k - 1] - shares[k])
    return float(speeds[k - 1] + part * (speeds[k] - speeds[k - 1]))
