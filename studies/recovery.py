"""``python -m studies.recovery`` measures how a wrench filter recovers from gaps, jumps and wrong
attitudes, while poses are noisier than declared.

Flights are exact: a smooth path, and the rotor speeds that fly it under a constant external wrench
(differential flatness, Mellinger and Kumar, ICRA 2011). The vehicle is as declared, so a filter's
error is that of its poses alone.
"""

import itertools
import time
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from functools import cache
from typing import Annotated, Any, NamedTuple

import numpy as np
import typer
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from windwrench.dynamics import Vehicle, load_vehicle
from windwrench.envs.recording import draw_trajectory
from windwrench.estimator import (
    ConstantGainFilter,
    UKFTuning,
    WrenchEKF,
    WrenchEstimate,
    WrenchUKF,
)
from windwrench.studies.runner import start

Array = NDArray[np.float64]

FILTERS = {"ukf": WrenchUKF, "ekf": WrenchEKF, "constant-gain": ConstantGainFilter}
FLOWN = (("crazyflie", 100), ("crazyflie", 200), ("ardrone2", 200), ("hummingbird", 100))  # Hz
NOISES = (1.0, 1.5, 2.0, 3.0)  # of the declared deviation of a pose
EVENTS = {"nothing": 0.0, "gap": 1.0, "jump": 0.0, "tilt": 0.7}  # s
GATES = (None, 0.99, 0.9999)
BEFORE, AFTER = 6.0, 20.0  # s of good poses: six rise times, and the time that is judged
JUMP, TILT = 0.5, np.radians(45.0)  # m, rad
FORCE, TORQUE = 0.1, 0.05  # external, in weights, and in weights times arm

# An event costs a restart as it ends, or, of a jump behind a gate, once poses have lasted; one more
# corrects an attitude that was a guess
RESTARTS = 2
SETTLED = 2.0  # s after an event, two rise times: the force holds from here on
ERROR = 0.05  # of the weight, rms: the model that the default tuning expects misses 6 % a step
BEYOND, SHARE = 4.0, 0.02  # deviations; share of rows beyond, 300 times a normal number's

_MARGIN = 8  # half periods at the ends of a path, which derivatives use up
_FADE = 2.0  # s, in which a trajectory fades in


@dataclass(frozen=True, eq=False)
class Flight:
    """Rotor speeds (n, 4) of each period, and the pose at its end: position (n, 3) and attitudes
    (n,). ``wrench`` (6,) is the external torque and force, which last.
    """

    vehicle: Vehicle
    rate: float
    rotor_speeds: Array
    position: Array
    attitude: Rotation
    wrench: Array


@cache
def exact_flight(name: str, rate: float, seconds: float, seed: int = 0) -> Flight:
    """Return a gentle flight of a preset vehicle at so many poses a second."""
    vehicle, rng = load_vehicle(name), np.random.default_rng(seed)
    directions = rng.standard_normal((2, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    torque = TORQUE * vehicle.weight * vehicle.arm_l * directions[0]
    force = FORCE * vehicle.weight * directions[1]
    half, rows = 0.5 / rate, round(seconds * rate)
    t = _FADE + half * np.arange(2 * rows + 2 * _MARGIN + 1)
    path = draw_trajectory("gentle", rng, t)
    up = vehicle.mass * (path[:, 6:9] + [0.0, 0.0, vehicle.gravity]) - force
    thrust = np.linalg.norm(up, axis=1)
    z = up / thrust[:, None]
    y = np.cross(z, np.column_stack([np.cos(path[:, 9]), np.sin(path[:, 9]), 0.0 * t]))
    y /= np.linalg.norm(y, axis=1, keepdims=True)
    attitude = Rotation.from_matrix(np.stack([np.cross(y, z), y, z], axis=2))
    # angular velocity and acceleration by central differences
    turning = (attitude[:-2].inv() * attitude[2:]).as_rotvec() / (2.0 * half)
    rates = np.vstack([turning[:1], turning, turning[-1:]])
    momentum = rates @ vehicle.inertia
    torques = np.gradient(momentum, half, axis=0) + np.cross(rates, momentum)
    torques -= attitude.inv().apply(torque)
    squares = np.linalg.solve(vehicle.mixing, np.column_stack([thrust, torques]).T).T
    # rotor speeds hold from pose to pose: those of the middle
    poses = slice(_MARGIN + 2, _MARGIN + 2 * rows + 1, 2)
    speeds = np.sqrt(squares[_MARGIN + 1 : _MARGIN + 2 * rows : 2])
    if vehicle.omega_lsb > 0.0:
        speeds = vehicle.omega_lsb * np.round(speeds / vehicle.omega_lsb)
    wrench = np.concatenate([torque, force])
    return Flight(vehicle, rate, speeds, path[poses, :3], attitude[poses], wrench)


def measured(
    flight: Flight, noise: float | Array, rng: np.random.Generator
) -> tuple[Array, Rotation]:
    """Return positions (n, 3) and attitudes (n,) with ``noise`` times the declared deviation: a
    number, or one a row (n, 1).
    """
    mocap, shape = flight.vehicle.mocap, flight.position.shape
    position = flight.position + noise * mocap.sigma_pos_m * rng.standard_normal(shape)
    turns = noise * mocap.sigma_att_rad * rng.standard_normal(shape)
    return position, Rotation.from_rotvec(turns) * flight.attitude


def befall(
    event: str, begin: int, end: int, position: Array, attitude: Rotation, rng: np.random.Generator
) -> tuple[Array, Array]:
    """Return positions (n, 3) and quaternions (n, 4) to which an event happens in some rows."""
    away = rng.standard_normal(3)
    position, quaternion = position.copy(), attitude.as_quat(scalar_first=True)
    if event == "gap":
        position[begin:end], quaternion[begin:end] = np.nan, np.nan
    elif event == "jump":
        position[begin:] += JUMP * away / np.linalg.norm(away)
    elif event == "tilt":
        axis = np.array([away[0], away[1], 0.0]) / np.hypot(away[0], away[1])
        tilted = Rotation.from_rotvec(TILT * axis) * attitude[begin:end]
        quaternion[begin:end] = tilted.as_quat(scalar_first=True)
    return position, quaternion


def filter_of(
    kind: str, flight: Flight, gate: float | None, told: float = 1.0, first: int = 0
) -> WrenchUKF:
    """Return a filter with the default tuning, told ``told`` times the declared noise, that starts
    at the true pose of a flight.
    """
    period = 1.0 / flight.rate
    tuning = UKFTuning.for_vehicle(flight.vehicle, period)
    tuning = replace(
        tuning,
        position_noise=told * np.asarray(tuning.position_noise),
        attitude_noise=told * np.asarray(tuning.attitude_noise),
    )
    made: WrenchUKF = FILTERS[kind](flight.vehicle, tuning, period, gate)
    made.reset(flight.position[first], flight.attitude[first].as_quat(scalar_first=True))
    return made


def estimates(made: WrenchUKF, speeds: Array, position: Array, quaternion: Array) -> WrenchEstimate:
    """Return the estimates of a filter along a flight, as a series."""
    rows = zip(speeds, position, quaternion, strict=True)
    return WrenchEstimate(np.array([made.step(*row).numbers for row in rows]))


class Verdict(NamedTuple):
    """What good poses after an event make of a filter."""

    restarts: int
    error: float  # rms of the force from ``SETTLED`` on, in weights
    early: float  # the same from half of that
    beyond: float  # share of rows

    @property
    def failures(self) -> list[str]:
        """Which limits it exceeds."""
        limits = {
            "restarts": self.restarts > RESTARTS,
            "force": not self.error <= ERROR,
            "z": not self.beyond <= SHARE,
        }
        return [name for name, exceeded in limits.items() if exceeded]


def judged(flight: Flight, said: WrenchEstimate, begin: int) -> Verdict:
    """Judge the rows from the first good one on."""
    found = np.hstack([said.torque, said.force]) - flight.wrench
    z = np.abs(found[begin:] / said.std_wrench[begin:]).max(axis=1)
    missed = np.linalg.norm(found[begin:, 3:], axis=1) / flight.vehicle.weight
    settled = round(SETTLED * flight.rate)

    def rms(values: Array) -> float:
        return float(np.sqrt(np.mean(np.square(values))))

    return Verdict(
        int(said.restarts[-1] - said.restarts[begin - 1]),
        rms(missed[settled:]),
        rms(missed[settled // 2 :]),
        float(np.mean(~(z <= BEYOND))),
    )


class Combination(NamedTuple):
    """One of the 576: its numbers are places in ``FILTERS``, ``FLOWN``, ``NOISES``, ``EVENTS`` and
    ``GATES``.
    """

    filter: str
    vehicle: str
    noise: str
    event: str
    gate: str

    def __str__(self) -> str:
        return " ".join(self)


AXES: tuple[dict[str, Any], ...] = (
    {name: name for name in FILTERS},
    {f"{name}@{rate}": (name, rate) for name, rate in FLOWN},
    {f"x{noise:g}": noise for noise in NOISES},
    {name: name for name in EVENTS},
    {f"gate={gate:g}" if gate else "no-gate": gate for gate in GATES},
)


def combinations(only: str = "") -> Iterator[Combination]:
    """Yield those that hold all words of ``only``."""
    for words in itertools.product(*AXES):
        if set(only.split()) <= set(words):
            yield Combination(*words)


def flown(combination: Combination, seed: int, told: bool = False) -> Verdict:
    """Fly a combination and judge it; ``told``: the filter knows how noisy poses are."""
    kind, (name, rate), noise, event, gate = (
        axis[word] for axis, word in zip(AXES, combination, strict=True)
    )
    places = [list(axis).index(word) for axis, word in zip(AXES, combination, strict=True)]
    rng = np.random.default_rng([seed, *places])
    flight = exact_flight(name, rate, BEFORE + max(EVENTS.values()) + AFTER, seed)
    begin = round(BEFORE * rate)
    end = begin + round(EVENTS[event] * rate)
    rows = slice(0, end + round(AFTER * rate))
    position, quaternion = befall(event, begin, end, *measured(flight, noise, rng), rng)
    made = filter_of(kind, flight, gate, noise if told else 1.0)
    said = estimates(made, flight.rotor_speeds[rows], position[rows], quaternion[rows])
    return judged(flight, said, end)


def progress(tasks: Iterable[Any], count: int) -> Iterator[Any]:
    """Yield tasks, and tell every ten seconds how many are done."""
    began = told = time.monotonic()
    for done, task in enumerate(tasks):
        if time.monotonic() - told > 10.0 or not done:
            told = time.monotonic()
            print(f"{done} of {count}, {told - began:.0f} s", flush=True)
        yield task


def fly_combinations(only: str, seeds: int, told: bool, every: bool) -> None:
    """Fly the combinations, and print which fail."""
    tasks = [(c, seed) for seed in range(seeds) for c in combinations(only)]
    failed: Counter[str] = Counter()
    flown_with: Counter[str] = Counter()
    worst, fair = Verdict(0, 0.0, 0.0, 0.0), Verdict(0, 0.0, 0.0, 0.0)
    fair_failed = 0
    for c, seed in progress(tasks, len(tasks)):
        verdict = flown(c, seed)
        worst = Verdict(*map(max, worst, verdict))
        flown_with.update(c)
        failed.update(verdict.failures)
        if verdict.failures:
            failed.update((*c, "all"))
        line = f"{str(c):55} {_words(verdict)}"
        if told:
            baseline = flown(c, seed, told=True)
            fair = Verdict(*map(max, fair, baseline))
            fair_failed += bool(baseline.failures)
            line += f" | told: {_words(baseline)}"
        if every or verdict.failures:
            print(f"{line} {' '.join(verdict.failures)}", flush=True)
    print("\nbeyond the limits, of flights")
    for axis in AXES:
        for word in axis:
            if flown_with[word]:
                print(f"  {word:16} {failed[word]:4} of {flown_with[word]}")
    reasons = ", ".join(f"{failed[name]} by {name}" for name in ("restarts", "force", "z"))
    print(f"worst: {_words(worst)}")
    if told:
        print(f"told the noise: {fair_failed} beyond; worst: {_words(fair)}")
    print(f"{failed['all']} of {len(tasks)} combinations are beyond the limits: {reasons}.")


def _words(v: Verdict) -> str:
    return f"{v.restarts:4} restarts, force {v.error:.3f} ({v.early:.3f}), z {v.beyond:.3f}"


def study(
    only: Annotated[str, typer.Option(help="Words that combinations must hold.")] = "",
    seeds: Annotated[int, typer.Option(min=1, help="Flights of each combination.")] = 1,
    told: Annotated[bool, typer.Option(help="Also fly filters that are told the noise.")] = False,
    every: Annotated[bool, typer.Option(help="Print combinations within the limits, too.")] = False,
) -> None:
    """Fly, judge and print."""
    fly_combinations(only, seeds, told, every)


if __name__ == "__main__":
    start(study)
