"""``python -m evidence.recovery`` measures how wrench filters recover from gaps, jumps and wrong
attitudes, while poses are noisier than declared.

Flights are exact: a smooth path, and the rotor speeds that fly it under an external wrench that
lasts (differential flatness: Mellinger and Kumar, ICRA 2011). The vehicle is as declared, so poses
alone make a filter's error.
"""

import itertools
import json
import math
import time
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Annotated, Any, NamedTuple

import numpy as np
import typer
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation
from scipy.stats import chi2

from windwrench import __version__
from windwrench.dynamics import Vehicle, load_vehicle
from windwrench.envs.recording import draw_trajectory
from windwrench.estimator import ConstantGainFilter, UKFTuning, WrenchEstimate, WrenchUKF
from windwrench.evidence.kept_results import DOCS
from windwrench.evidence.runner import start
from windwrench.runtime.page_files import write_json
from windwrench.runtime.provenance import commit

Array = NDArray[np.float64]
Words = tuple[str, ...]  # what a flight is: one key of each axis
# errors (n, 6) of position and attitude from the true ones (n, 6), in declared deviations
Errors = Callable[[np.random.Generator, Array], Array]

RESULTS = "results/recovery.json"  # below docs/
BEFORE, AFTER = 6.0, 20.0  # s of good poses: six rise times, and the time that is judged
JUMP, TILT = 0.5, math.radians(45.0)  # m, rad
FORCE, TORQUE = 0.1, 0.05  # external, in weights, and in weights times arm
CHANGE = 3.0  # times the declared noise: where noise changes
STEP = 4.0  # declared deviations: of poses in steps, whose error then is 1.5 times the declared

# Limits. An event costs one restart as it ends or, behind a gate, once poses have lasted; one more
# corrects an attitude that was a guess.
RESTARTS = 2
SETTLED = 2.0  # s after an event, two rise times: the force holds from here on
ERROR = 0.05  # of the weight, rms: as much as the default tuning lets a step's thrust miss
BEYOND, SHARE = 4.0, 0.02  # deviations; share of rows: a normal wrench's is 4e-4
SEQUENCES = 157  # of wrong attitudes
WRONG = 6.0  # deviations after wrong attitudes: a normal wrench's share is 1e-8

_MARGIN = 8  # half periods at the ends of a path, which derivatives use up
_FADE = 2.0  # s, in which a trajectory fades in
_QUIET, _QUIET_ROWS = 60.0, 30_000  # s and rows, at most, of a flight without an event


def normal(size: float | Sequence[float]) -> Errors:
    """Return normal errors of ``size`` times the declared deviation, one number or six."""
    return lambda rng, true: np.asarray(size) * rng.standard_normal(true.shape)


def student(rng: np.random.Generator, true: Array) -> Array:
    """Return errors with the declared deviation and heavy tails: Student's, 3 degrees of
    freedom.
    """
    return rng.standard_t(3.0, true.shape) / math.sqrt(3.0)


def changing(rng: np.random.Generator, true: Array) -> Array:
    """Return normal errors that are ``CHANGE`` times as large from half of a flight to three
    quarters.
    """
    share = np.arange(len(true)) / len(true)
    size = np.where((share >= 0.5) & (share < 0.75), CHANGE, 1.0)
    return size[:, None] * rng.standard_normal(true.shape)


def quantised(rng: np.random.Generator, true: Array) -> Array:
    """Return the errors of noisy poses that are rounded to ``STEP``."""
    return STEP * np.round((true + rng.standard_normal(true.shape)) / STEP) - true


FILTERS = {"ukf": WrenchUKF, "constant-gain": ConstantGainFilter}
FLOWN = dict.fromkeys(("crazyflie@100", "crazyflie@200", "ardrone2@200", "hummingbird@100"))
NOISES = {f"x{size:g}": normal(size) for size in (1.0, 1.5, 2.0, 3.0)}
EVENTS = {"nothing": 0.0, "gap": 1.0, "jump": 0.0, "tilt": 0.7}  # s
GATES = {"no-gate": None, "gate=.99": 0.99, "gate=.9999": 0.9999}
TAILS = {
    "student": student,
    "changing": changing,
    "position-x3": normal((3.0, 3.0, 3.0, 1.0, 1.0, 1.0)),
    "attitude-x3": normal((1.0, 1.0, 1.0, 3.0, 3.0, 3.0)),
    "quantised": quantised,
}
VEHICLES = ("crazyflie", "ardrone2", "hummingbird")
RATES = dict.fromkeys(f"{v}@{hz}" for v in VEHICLES for hz in (50, 100, 200, 500, 1000))
QUIET_NOISES = {f"x{size:g}": normal(size) for size in (1.0, 1.5, 2.0, 3.0, 4.0, 5.0)}


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

    def row(self, seconds: float) -> int:
        """Return the first row after so many seconds."""
        return round(seconds * self.rate)


@lru_cache(maxsize=4)
def exact_flight(flown: str, seconds: float, seed: int = 0) -> Flight:
    """Return a gentle flight of a preset at so many poses a second: ``crazyflie@100``."""
    name, rate = flown.split("@")
    vehicle, half, rng = load_vehicle(name), 0.5 / float(rate), np.random.default_rng(seed)
    directions = rng.standard_normal((2, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    torque = TORQUE * vehicle.weight * vehicle.arm_l * directions[0]
    force = FORCE * vehicle.weight * directions[1]
    end = _MARGIN + 2 * round(seconds * float(rate))
    t = _FADE + half * np.arange(end + _MARGIN, dtype=np.float64)
    path = draw_trajectory("gentle", rng, t)
    lift = vehicle.mass * (path[:, 6:9] + [0.0, 0.0, vehicle.gravity]) - force
    thrust = np.linalg.norm(lift, axis=1)
    z = lift / thrust[:, None]
    y = np.cross(z, np.column_stack([np.cos(path[:, 9]), np.sin(path[:, 9]), 0.0 * t]))
    y /= np.linalg.norm(y, axis=1, keepdims=True)
    attitude = Rotation.from_matrix(np.stack([np.cross(y, z), y, z], axis=2))
    rates = np.zeros_like(z)
    rates[1:-1] = (attitude[:-2].inv() * attitude[2:]).as_rotvec() / (2.0 * half)
    momentum = rates @ vehicle.inertia
    torques = np.gradient(momentum, half, axis=0) + np.cross(rates, momentum)
    torques -= attitude.inv().apply(torque)
    squares = np.linalg.solve(vehicle.mixing, np.column_stack([thrust, torques]).T).T
    speeds = np.sqrt(squares[_MARGIN + 1 : end : 2])  # of the middle of each period
    if vehicle.omega_lsb > 0.0:
        speeds = vehicle.omega_lsb * np.round(speeds / vehicle.omega_lsb)
    poses = slice(_MARGIN + 2, end + 1, 2)
    wrench = np.concatenate([torque, force])
    return Flight(vehicle, float(rate), speeds, path[poses, :3], attitude[poses], wrench)


def measured(flight: Flight, errors: Errors, rng: np.random.Generator) -> tuple[Array, Rotation]:
    """Return measured positions (n, 3) and attitudes (n,)."""
    mocap = flight.vehicle.mocap
    true = [flight.position / mocap.sigma_pos_m, flight.attitude.as_rotvec() / mocap.sigma_att_rad]
    drawn = errors(rng, np.hstack(true))
    turns = Rotation.from_rotvec(mocap.sigma_att_rad * drawn[:, 3:])
    return flight.position + mocap.sigma_pos_m * drawn[:, :3], turns * flight.attitude


def befall(
    event: str, begin: int, end: int, position: Array, attitude: Rotation, rng: np.random.Generator
) -> tuple[Array, Array]:
    """Return positions (n, 3) and quaternions (n, 4) to which an event happens in some rows; a
    jump lasts.
    """
    away = rng.standard_normal(3)
    position, quaternion = position.copy(), attitude.as_quat(scalar_first=True)
    if event == "gap":
        position[begin:end], quaternion[begin:end] = np.nan, np.nan
    elif event == "jump":
        position[begin:] += JUMP * away / np.linalg.norm(away)
    elif event == "tilt":
        axis = away * [1.0, 1.0, 0.0]
        tilt = Rotation.from_rotvec(TILT * axis / np.linalg.norm(axis))
        quaternion[begin:end] = (tilt * attitude[begin:end]).as_quat(scalar_first=True)
    return position, quaternion


def estimated(
    kind: str,
    flight: Flight,
    position: Array,
    quaternion: Array,
    gate: float | None = None,
) -> WrenchEstimate:
    """Return the series of estimates of a filter with the default tuning along measured poses."""
    period = 1.0 / flight.rate
    tuning = UKFTuning.for_vehicle(flight.vehicle, period)
    made = FILTERS[kind](flight.vehicle, tuning, period, gate)
    made.reset(flight.position[0], flight.attitude[0].as_quat(scalar_first=True))
    rows = zip(flight.rotor_speeds[: len(position)], position, quaternion, strict=True)
    return WrenchEstimate(np.array([made.step(*row).numbers for row in rows]))


def missed(flight: Flight, said: WrenchEstimate) -> tuple[Array, Array]:
    """Return the largest deviation of the wrench's parts, as stated, and the force's error in
    weights, of each row.
    """
    off = np.hstack([said.torque, said.force]) - flight.wrench
    z = np.abs(off / said.std_wrench).max(axis=1)
    return z, np.linalg.norm(off[:, 3:], axis=1) / flight.vehicle.weight


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


class Verdict(NamedTuple):
    """What good poses after an event make of a filter."""

    restarts: float = 0
    error: float = 0.0  # rms of the force from ``SETTLED`` on, in weights
    early: float = 0.0  # the same from half of that on
    beyond: float = 0.0  # share of rows

    @property
    def failures(self) -> list[str]:
        """Which limits it exceeds."""
        exceeded = {
            "restarts": self.restarts > RESTARTS,
            "force": not self.error <= ERROR,
            "z": not self.beyond <= SHARE,
        }
        return [name for name, fails in exceeded.items() if fails]

    def __str__(self) -> str:
        return (
            f"{self.restarts:4} restarts, force {self.error:.3f} (from {SETTLED / 2:g} s on "
            f"{self.early:.3f}), z {self.beyond:.3f}"
        )


def judged(flight: Flight, said: WrenchEstimate, begin: int) -> Verdict:
    """Judge the rows from the first good one on."""
    z, error = missed(flight, said)
    settled = flight.row(SETTLED)
    return Verdict(
        int(said.restarts[-1] - said.restarts[begin - 1]),
        _rms(error[begin + settled :]),
        _rms(error[begin + settled // 2 :]),
        float(np.mean(~(z[begin:] <= BEYOND))),
    )


def named(axes: Iterable[Iterable[str]], only: str) -> list[Words]:
    """Return the flights of some axes that hold all words of ``only``."""
    wanted = set(only.split())
    return [words for words in itertools.product(*axes) if wanted <= set(words)]


def drawing(words: Words, seed: int) -> np.random.Generator:
    """Return what draws a flight's noise: the same whichever others are flown."""
    return np.random.default_rng([seed, *" ".join(words).encode()])


def fly_combination(words: Words, seed: int = 0) -> Verdict:
    """Fly and judge filter, vehicle, noise, event and gate."""
    kind, flown, noise, event, gate = words
    rng = drawing(words, seed)
    flight = exact_flight(flown, BEFORE + max(EVENTS.values()) + AFTER, seed)
    begin, end = flight.row(BEFORE), flight.row(BEFORE + EVENTS[event])
    pose = measured(flight, (NOISES | TAILS)[noise], rng)
    position, quaternion = befall(event, begin, end, *pose, rng)
    rows = slice(0, end + flight.row(AFTER))
    said = estimated(kind, flight, position[rows], quaternion[rows], GATES[gate])
    return judged(flight, said, end)


def progress(tasks: Sequence[Any]) -> Iterator[Any]:
    """Yield tasks, and tell every ten seconds how many are done."""
    began = said = time.monotonic()
    for done, task in enumerate(tasks):
        if done == 0 or time.monotonic() - said > 10.0:
            said = time.monotonic()
            print(f"{done} of {len(tasks)}, {said - began:.0f} s", flush=True)
        yield task


def combinations(noises: Mapping[str, Errors], only: str, seeds: int) -> dict[str, Any]:
    """Fly all combinations and print those beyond a limit; return counts and the worst figures."""
    axes = (FILTERS, FLOWN, noises, EVENTS, GATES)
    tasks = [(words, seed) for seed in range(seeds) for words in named(axes, only)]
    reasons, beyond, worst = Counter[str](), 0, Verdict()
    for words, seed in progress(tasks):
        verdict = fly_combination(words, seed)
        worst = Verdict(*map(max, worst, verdict))
        reasons.update(verdict.failures)
        if verdict.failures:
            beyond += 1
            print(f"{' '.join(words):50} {verdict}: {', '.join(verdict.failures)}", flush=True)
    return {
        "flights": len(tasks),
        "beyond": beyond,
        "reasons": dict(reasons),
        "worst": worst._asdict(),
    }


def turned(rng: np.random.Generator, attitude: Rotation) -> tuple[str, Rotation]:
    """Return some attitudes (n,) as they are measured where markers are taken for each other or
    yaw is half a turn off, for good or sample by sample; and in words what happens.
    """
    kind = str(rng.choice(["swap", "flip", "flicker"]))
    if kind == "swap":
        degrees = float(rng.choice([90.0, 120.0, 180.0]))
        name = str(rng.choice(["z", "z", "x", "y", "xyz"]))
        axis = np.array([letter in name for letter in "xyz"], dtype=np.float64)
        swap = Rotation.from_rotvec(math.radians(degrees) * axis / np.linalg.norm(axis))
        return f"swap {degrees:g} {name}", attitude * swap
    yaw = np.where(kind == "flip", 1.0, rng.integers(0, 2, len(attitude)))
    return kind, Rotation.from_rotvec(math.pi * yaw[:, None] * [0.0, 0.0, 1.0]) * attitude


class Claim(NamedTuple):
    """Largest deviation of the wrench, as stated, and largest error of the force in weights."""

    z: float = 0.0
    error: float = 0.0


def fly_wrong_attitudes(seed: int) -> tuple[str, Claim, Claim]:
    """Fly a drawn filter without a gate through wrong attitudes of .1 to 1.5 s; return what
    happens, and what it claims meanwhile and later: from ``SETTLED`` to twice that after them.
    """
    rng = np.random.default_rng([seed, SEQUENCES])
    kind, flown, noise = (str(rng.choice(list(axis))) for axis in (FILTERS, FLOWN, NOISES))
    seconds = math.exp(rng.uniform(math.log(0.1), math.log(1.5)))
    flight = exact_flight(flown, BEFORE + 1.5 + 2.0 * SETTLED)
    begin, end = flight.row(BEFORE), flight.row(BEFORE + seconds)
    position, attitude = measured(flight, NOISES[noise], rng)
    quaternion = attitude.as_quat(scalar_first=True)
    words, wrong = turned(rng, attitude[begin:end])
    quaternion[begin:end] = wrong.as_quat(scalar_first=True)
    z, error = missed(flight, estimated(kind, flight, position, quaternion))
    later = slice(end + flight.row(SETTLED), end + flight.row(2.0 * SETTLED))
    meanwhile, after = (
        Claim(float(z[rows].max()), float(error[rows].max())) for rows in (slice(begin, end), later)
    )
    return f"{kind} {flown} {noise} {words} {seconds:.2f} s", meanwhile, after


def wrong_attitudes(seeds: int) -> dict[str, Any]:
    """Fly sequences of wrong attitudes; return how many wrenches are off by more than they say."""
    count = seeds * SEQUENCES
    wrong = [0, 0]
    for seed in progress(range(count)):
        words, *claims = fly_wrong_attitudes(seed)
        wrong = [n + (not claim.z <= WRONG) for n, claim in zip(wrong, claims, strict=True)]
        if not max(claim.z for claim in claims) <= WRONG:
            off = ", ".join(f"z {claim.z:.1f} force {claim.error:.2f}" for claim in claims)
            print(f"{seed:4} {words:50} meanwhile and later: {off}", flush=True)
    return {"flights": count, "meanwhile": wrong[0], "later": wrong[1]}


def poisson_band(count: int, hours: float) -> tuple[float, float]:
    """Return the 95 % interval of a rate per hour of which ``count`` were seen."""
    low = chi2.ppf(0.025, 2 * count) / 2.0 if count else 0.0
    return float(low) / hours, float(chi2.ppf(0.975, 2 * count + 2)) / 2.0 / hours


def quiet_flights(only: str, seeds: int) -> dict[str, tuple[int, float]]:
    """Fly without an event; return restarts and hours flown by each size of the noise."""
    axes = (FILTERS, RATES, QUIET_NOISES, GATES)
    restarts, hours = Counter[str](), dict.fromkeys(QUIET_NOISES, 0.0)
    for seed, words in progress(list(itertools.product(range(seeds), named(axes, only)))):
        kind, flown, noise, gate = words
        seconds = min(_QUIET, _QUIET_ROWS / float(flown.split("@")[1]))
        flight = exact_flight(flown, seconds, seed)
        position, attitude = measured(flight, QUIET_NOISES[noise], drawing(words, seed))
        quaternion = attitude.as_quat(scalar_first=True)
        said = estimated(kind, flight, position, quaternion, GATES[gate])
        restarts[noise] += int(said.restarts[-1])
        hours[noise] += seconds / 3600.0
    return {noise: (restarts[noise], flown) for noise, flown in hours.items() if flown}


def study(
    only: Annotated[str, typer.Option(help="Words that a flight must hold: 'ukf x3 gap'.")] = "",
    seeds: Annotated[int, typer.Option(min=1, help="Flights of each kind.")] = 1,
) -> None:
    """Fly and judge all parts; keep the results where all flights were flown."""
    code = commit()
    result = {
        "version": __version__,
        "commit": code,
        "combinations": combinations(NOISES, only, seeds),
        "tails": combinations(TAILS, only, seeds),
        "attitudes": wrong_attitudes(seeds),
        "quiet": quiet_flights(only, seeds),
    }
    print(json.dumps(result, indent=1))
    if not only:
        write_json(result, DOCS / RESULTS)


if __name__ == "__main__":
    start(study)
