"""Flights of a small quadrotor predicted half a second ahead by named coefficients.

The task is that of *Nonlinear System Identification for a Nano-drone Benchmark* (Control
Engineering Practice 172, 2026): from the state at a sample and the rotor speeds that follow, 50
steps of 10 ms. Its score is the mean over starts of the error's norm at each step, summed over the
steps.

The model: thrust, drag of turning rotors, inflow and translational lift; torque of rotors over
inertia, and a moment proportional to velocity (flapping). Two facts of these logs have names of
their own. The onboard filter states a horizontal velocity that is larger than the way it goes.
And the flights are closed loops: moments that nothing measures are answered by the rotors, so that
only a share of what rotors and velocity make turns the vehicle. That share, and the loop's damping
and stiffness, are one part, ``reacts``, which can be switched off.
"""

import math
import time
from collections import namedtuple
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import numpy as np
import typer
from numpy.typing import NDArray
from scipy.signal import butter, sosfiltfilt
from scipy.spatial.transform import Rotation

from windwrench import __version__
from windwrench.evidence.kept_results import DOCS
from windwrench.evidence.runner import start
from windwrench.identification.logs.text_table import open_table
from windwrench.identification.motion.smoothing import runs_of
from windwrench.runtime.errors import InputError
from windwrench.runtime.page_files import write_json
from windwrench.runtime.provenance import commit, made_by

Array = NDArray[np.float64]

STEP, STEPS = 0.01, 50  # s, and how many a prediction has
PAST = 20  # samples, of the option that knows them
MASS, ARM, GRAVITY = 0.045, 0.0353, 9.81  # kg, m, m/s2: as the benchmark states them
PUBLISHED_THRUST = 3.72e-8  # N/(rad/s)^2, the benchmark's own
_POLE_PAIRS = 6
_FASTEST = 4000.0  # rad/s: three samples of these logs are far above it, and broken
_ALOFT = 0.3  # m
_FRONT = np.array([1.0, -1.0, -1.0, 1.0])  # front-left, rear-left, rear-right, front-right
_LEFT = np.array([1.0, 1.0, -1.0, -1.0])
_SPIN = np.array([-1.0, 1.0, -1.0, 1.0])
_BAND = (3.0, 15.0)  # Hz: torque alone turns the vehicle there; below, the loop answers
_CLOCKS = np.arange(-0.04, 0.0401, 0.001)  # s, tried
STAYS, NAMED = "the state stays as it is, attitude turns on", "**named coefficients**"
QUANTITIES = ("position", "velocity", "attitude", "rate")
# of each quantity's error where the state stays as it is: the fit weighs them alike
_SIZES = np.array([0.24, 0.6, 0.12, 0.7])
_WEIGHTS = np.array([0.3, 1.0, 1.0, 1.0])


# of each coefficient: where the fit starts, its unit, and what it is
COEFFICIENTS: Mapping[str, tuple[float, str, str]] = {
    "thrust": (PUBLISHED_THRUST, "N/(rad/s)^2", "thrust of a rotor"),
    "rotor_drag": (2.5e-6, "N/(rad/s m/s)", "drag of a rotor along body x and y"),
    "inflow": (3e-6, "N/(rad/s m/s)", "loss of thrust in a climb"),
    "lift": (3e-3, "N/(m/s)^2", "translational lift"),
    "velocity_scale": (0.91, "1", "way gone over horizontal velocity"),
    "inertia": (3.4e-5, "kg m2", "inertia about x, from 3 to 15 Hz"),
    "pitch_share": (0.75, "1", "pitch over roll, for one torque"),
    "flapping": (1.1e-7, "Nm/(rad/s m/s)", "flapping moment of a rotor"),
    "reaction_torque": (12.0, "1/(kg m)", "reaction torque over thrust and inertia about z"),
    "unmeasured_moment": (30.0, "rad/s2", "reaction: unmeasured moment, rms"),
    "damping": (4.6, "1/s", "reaction: damping of roll and pitch"),
    "damping_excited": (-4.2, "1/s", "reaction: damping, change where all is measured"),
    "stiffness": (20.0, "1/s2", "reaction: stiffness to level, there"),
    "never_answered": (1.4, "rad/s2/(m/s)", "reaction: moment of velocity, never answered"),
    "yaw_damping": (5.0, "1/s", "reaction: damping of yaw"),
    "heading_stiffness": (9.0, "1/s2", "reaction: stiffness to heading 0"),
    "force_share": (0.0, "1", "past: share of the force left over"),
    "force_memory": (0.3, "s", "past: decay of the force"),
    "moment_share": (0.0, "1", "past: share of the moment left over"),
    "moment_memory": (0.3, "s", "past: decay of the moment"),
}
_named: Any = namedtuple  # mypy wants its names written out, here they are the table's
Numbers = _named("Numbers", tuple(COEFFICIENTS))
BEGIN = Numbers(*(begin for begin, *_ in COEFFICIENTS.values()))
PAST_NAMES = tuple(name for name, row in COEFFICIENTS.items() if row[2].startswith("past"))
FITTED = tuple(name for name in COEFFICIENTS if name not in ("inertia", *PAST_NAMES))


@dataclass(frozen=True, eq=False)
class Flight:
    """One flight in the air, n samples."""

    name: str
    path: str  # the benchmark's word for what was flown
    states: Array  # (n, 13) position, velocity, quaternion body to world, body rate
    speeds: Array  # (n, 4) rad/s
    clock: float  # s, by which motion comes behind the logged rotor speeds


class Starts(NamedTuple):
    """m starts: where they begin, what the rotors do, and what came."""

    flight: NDArray[np.intp]  # (m,)
    states: Array  # (m, 13)
    speeds: Array  # (m, STEPS + 1, 4) at the start and each step
    truth: Array  # (m, STEPS, 13)
    left: Array  # (m, 6) force (m/s2, world) and moment (rad/s2, body) left over before; or 0


def read_flight(path: Path) -> Flight:
    """Return the longest stretch of a file above 0.3 m; broken rotor speeds are interpolated.

    Raises:
        InputError: a column is missing, or nothing flies for 5 s.
    """
    names = ("x y z vx vy vz qw qx qy qz wx wy wz", "m4_erpm m3_erpm m2_erpm m1_erpm")
    motion, rotors = (text.split() for text in names)
    table = open_table(path).read([*motion, *rotors])
    states = np.column_stack([table[name] for name in motion])
    turn = 2.0 * math.pi / 60.0 / _POLE_PAIRS
    speeds = turn * np.column_stack([table[name] for name in rotors])
    rows = np.arange(len(speeds))
    for column in speeds.T:
        sound = column < _FASTEST  # False where there is no number
        column[:] = np.interp(rows, rows[sound], column[sound])
    first, last = max(
        runs_of(states[:, 2] > _ALOFT), key=lambda run: run[1] - run[0], default=(0, 0)
    )
    if (last - first) * STEP < 5.0:
        raise InputError(f"{path}: flies {(last - first) * STEP:.3g} s; expected at least 5 s")
    states, speeds = states[first:last], speeds[first:last]
    clock = _best_delay(_torques(speeds), np.gradient(states[:, 10:12], STEP, axis=0))
    return Flight(path.stem, path.stem.split("_")[0], states, speeds, clock)


def _torques(speeds: Array) -> Array:
    """Return roll and pitch torque (n, 2) in Nm, at the published thrust."""
    thrust = PUBLISHED_THRUST * np.square(speeds)
    return np.column_stack([thrust @ (ARM * _LEFT), thrust @ (-ARM * _FRONT)])


def _quick(x: Array) -> Array:
    sections = butter(3, [2.0 * STEP * f for f in _BAND], btype="bandpass", output="sos")
    return np.asarray(sosfiltfilt(sections, x, axis=0))


def _delayed(x: Array, delay: float) -> Array:
    turn = np.exp(-2j * math.pi * np.fft.rfftfreq(len(x), STEP) * delay)
    return np.fft.irfft(np.fft.rfft(x, axis=0) * turn[:, None], len(x), axis=0)


def _best_delay(torque: Array, turning: Array) -> float:
    """Return the delay (s) of torque at which turning follows it best from 3 to 15 Hz."""
    torque, turning = _quick(torque), _quick(turning)
    alike = [float(np.sum(_delayed(torque, delay) * turning)) for delay in _CLOCKS]
    return float(_CLOCKS[int(np.argmax(alike))])


def quick_inertia(flights: Sequence[Flight]) -> tuple[float, float]:
    """Return the inertia (kg m2) that torque shows from 3 to 15 Hz, where no loop answers, and its
    standard deviation over flights (jackknife). Torque and turning are both noisy, so that the
    inertia is the ratio of their sizes (the reduced major axis).
    """
    sizes = np.empty((len(flights), 2))
    for k, flight in enumerate(flights):
        torque = _delayed(_quick(_torques(flight.speeds)), flight.clock)
        turning = _quick(np.gradient(flight.states[:, 10:12], STEP, axis=0))
        sizes[k] = np.sum(np.square(torque)), np.sum(np.square(turning))
    whole = sizes.sum(axis=0)
    without = np.sqrt(np.divide(*(whole - sizes).T)) if len(sizes) > 1 else np.zeros(1)
    return float(np.sqrt(whole[0] / whole[1])), float(np.sqrt(len(sizes) - 1) * np.std(without))


def mean_clock(flights: Sequence[Flight]) -> float:
    """Return the mean s by which motion comes behind rotor speeds."""
    return float(np.mean([flight.clock for flight in flights]))


def _matrices(q: Array) -> Array:
    """Return the matrices (m, 3, 3) that take body to world axes, of quaternions (m, 4)."""
    w, x, y, z = q.T
    rows = [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)]
    rows += [2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)]
    rows += [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)]
    return np.stack(rows, axis=1).reshape(-1, 3, 3)


def _turned(q: Array, turn: Array) -> Array:
    """Return quaternions (m, 4) turned by rotation vectors (m, 3) in the body frame."""
    half = 0.5 * np.linalg.norm(turn, axis=1, keepdims=True)
    c, v = np.cos(half), 0.5 * np.sinc(half / math.pi) * turn
    scalar = q[:, :1] * c - np.sum(q[:, 1:] * v, axis=1, keepdims=True)
    return np.concatenate([scalar, q[:, :1] * v + c * q[:, 1:] + np.cross(q[:, 1:], v)], axis=1)


def _follow(c: Any, starts: Array, drive: Array, left: Array, reacts: bool) -> Array:
    """Return the states (m, steps, 13) that follow.

    ``drive`` (m, steps, 5): thrust over mass, the rotors' angular acceleration of the body, and the
    sum of rotor speeds.
    """
    steps = drive.shape[1]
    dt = STEP * STEPS / steps
    out = np.empty((len(starts), steps, 13))
    x, share = starts.copy(), np.ones((len(starts), 2))
    scale = np.array([c.velocity_scale, c.velocity_scale, 1.0])
    for h in range(steps):
        d, q = drive[:, h], x[:, 6:10]
        r = _matrices(q)
        vb = np.einsum("nji,nj->ni", r, x[:, 3:6])
        flap = c.flapping * d[:, 4:] / c.inertia * vb[:, 1::-1] * [1.0, -1.0]
        w = d[:, 1:4] + np.column_stack([flap, np.zeros(len(d))])
        if reacts:
            if h == 0:  # how strong measured moments are, against those that are not measured
                square = np.mean(np.square(drive[:, :, 1:3] + flap[:, None]), axis=1)
                share = square / (square + c.unmeasured_moment**2)
            tilt = r[:, 2, 1::-1] * [1.0, -1.0]
            w[:, :2] = share * (w[:, :2] - c.stiffness * tilt)
            w[:, :2] += c.never_answered * vb[:, 1::-1] * [1.0, -1.0]
            w[:, :2] -= (c.damping + share * c.damping_excited) * x[:, 10:12]
            w[:, 2] -= c.heading_stiffness * np.arctan2(r[:, 1, 0], r[:, 0, 0])
            w[:, 2] -= c.yaw_damping * x[:, 12]
        force = -c.rotor_drag * d[:, 4:] / MASS * vb
        lift = c.lift * np.sum(np.square(vb[:, :2]), axis=1) - c.inflow * d[:, 4] * vb[:, 2]
        force[:, 2] = d[:, 0] + lift / MASS
        w += c.moment_share * math.exp(-(h + 0.5) * dt / c.moment_memory) * left[:, 3:]
        middle = _turned(q, 0.5 * dt * (x[:, 10:] + 0.25 * dt * w))
        accel = np.einsum("nij,nj->ni", _matrices(middle), force) - [0.0, 0.0, GRAVITY]
        accel += c.force_share * math.exp(-(h + 0.5) * dt / c.force_memory) * left[:, :3]
        x[:, 6:10] = _turned(q, dt * (x[:, 10:] + 0.5 * dt * w))
        x[:, :3] += scale * dt * (x[:, 3:6] + 0.5 * dt * accel)
        x[:, 3:6] += dt * accel
        x[:, 10:] += dt * w
        out[:, h] = x
    return out


def predicted(c: Any, starts: Starts, reacts: bool = True, each: int = 1) -> Array:
    """Return the states (m, STEPS / each, 13) that coefficients predict, with or without the closed
    loop's reaction, in steps of ``each`` samples.
    """
    means = 0.5 * (starts.speeds[:, 1:] + starts.speeds[:, :-1])
    means = means.reshape(len(means), STEPS // each, each, 4).mean(axis=2)
    roll, pitch = ARM * _LEFT / c.inertia, -ARM * _FRONT * c.pitch_share / c.inertia
    mixing = np.column_stack([np.full(4, 1.0 / MASS), roll, pitch, -_SPIN * c.reaction_torque])
    thrust = c.thrust * np.square(means)
    drive = np.concatenate([thrust @ mixing, means.sum(axis=2, keepdims=True)], axis=2)
    return _follow(c, starts.states, drive, starts.left, reacts)


def errors(path: Array, truth: Array) -> Array:
    """Return the errors (m, steps, 4, 3) of ``QUANTITIES``; attitude as a rotation vector (rad)."""
    out = (path - truth)[..., [0, 1, 2, 3, 4, 5, 10, 11, 12, 10, 11, 12]]
    (aw, av), (bw, bv) = ((q[..., 6:7], q[..., 7:10]) for q in (truth, path))
    sign = np.sign(aw * bw + np.sum(av * bv, axis=-1, keepdims=True))
    out[..., 6:9] = 2.0 * sign * (aw * bv - bw * av - np.cross(av, bv))
    return np.asarray(out.reshape(*out.shape[:2], 4, 3))


def score(path: Array, truth: Array) -> Array:
    """Return the benchmark's score (4,): mean norms at each step, summed over the steps."""
    norms = np.linalg.norm(errors(path, truth), axis=-1)
    norms[..., 2] = 2.0 * np.arcsin(np.minimum(0.5 * norms[..., 2], 1.0))
    return np.asarray(norms.mean(axis=0).sum(axis=0))


def starts_of(
    flights: Sequence[Flight], every: int, clock: float | None = None, past: Any = None
) -> Starts:
    """Return the starts of flights.

    Args:
        flights: the flights.
        every: samples from start to start.
        clock: s, by which motion comes behind rotor speeds; None: each flight's own. No rotor speed
            from before a start is used.
        past: coefficients that predict the 0.2 s before each start, whose errors are left over.
    """
    parts = []
    for number, flight in enumerate(flights):
        first = np.arange(PAST, len(flight.states) - STEPS, every)
        rows = first[:, None] + np.arange(STEPS + 1)
        late = (flight.clock if clock is None else clock) / STEP
        left = np.zeros((len(first), 6))
        if past is not None:
            before = Starts(
                np.zeros(len(first), np.intp),
                flight.states[first - PAST],
                _speeds(flight, rows - PAST, late),
                flight.states[rows[:, 1:] - PAST],
                left,
            )
            off = before.truth[:, PAST - 1] - predicted(past, before)[:, PAST - 1]
            left = off[:, [3, 4, 5, 10, 11, 12]] / (PAST * STEP)
        truth = flight.states[rows[:, 1:]]
        speeds = _speeds(flight, rows, late)
        parts.append((np.full(len(first), number), flight.states[first], speeds, truth, left))
    return Starts(*(np.concatenate(x) for x in zip(*parts, strict=True)))


def _speeds(flight: Flight, rows: NDArray[np.intp], late: float) -> Array:
    """Return rotor speeds (m, STEPS + 1, 4) ``late`` samples before rows, held before the first."""
    at = np.maximum(rows - late, rows[:, :1])
    low = np.clip(np.floor(at).astype(np.intp), 0, len(flight.speeds) - 2)
    share = (at - low)[..., None]
    return np.asarray((1.0 - share) * flight.speeds[low] + share * flight.speeds[low + 1])


def fit(
    starts: Starts, names: Sequence[str], begin: Any, each: int = 2
) -> tuple[Any, dict[str, float]]:
    """Return the coefficients that predict all steps best, by damped Gauss-Newton, and their
    standard deviations over drawn flights (one step from here for each of 1000 draws).

    Errors count by their norm, not its square, as the score counts them: each norm is weighted by
    its inverse (at least half of the median's) in turn.

    Args:
        starts: of training flights.
        names: of the coefficients that are fitted.
        begin: where the fit starts; the others stay there.
        each: samples in a step of the integration.
    """
    truth = starts.truth[:, each - 1 :: each]
    flights = [starts.flight == number for number in np.unique(starts.flight)]
    here, damping = begin, 1e-3
    units = np.array([abs(COEFFICIENTS[name][0]) or 1.0 for name in names])

    def moved(step: Array) -> Any:
        return here._replace(
            **{n: getattr(here, n) + float(x) for n, x in zip(names, step * units, strict=True)}
        )

    def off(numbers: Any) -> tuple[Array, Array, float]:
        e = errors(predicted(numbers, starts, each=each), truth) / _SIZES[:, None]
        norms = np.linalg.norm(e, axis=-1)
        return e, norms, float(np.mean(norms @ _WEIGHTS))

    e, norms, loss = off(here)
    for _ in range(15):
        least = 0.5 * np.median(norms, axis=0)
        root = np.sqrt(_WEIGHTS / np.maximum(norms, least))[..., None]
        nothing = np.eye(len(names))
        slopes = np.array([root * (off(moved(1e-3 * row))[0] - e) / 1e-3 for row in nothing])
        residual = root * e
        grams = np.array([np.tensordot(s := slopes[:, f], s, ((1, 2, 3, 4),) * 2) for f in flights])
        gradients = np.array([np.tensordot(slopes[:, f], residual[f], 4) for f in flights])
        gram, before = grams.sum(axis=0), loss
        for _ in range(6):
            damped = gram + damping * np.diag(np.diag(gram))
            tried = moved(-np.linalg.solve(damped, gradients.sum(axis=0)))
            found = off(tried)
            if found[2] < loss:
                here, (e, norms, loss), damping = tried, found, max(damping / 6.0, 1e-6)
                break
            damping *= 8.0
        if before - loss < 1e-4 * before:
            break
    count = len(flights)
    drawn = np.random.default_rng(0).multinomial(count, np.full(count, 1.0 / count), 1000)
    steps = [np.linalg.solve(np.tensordot(w, grams, 1), w @ gradients) for w in drawn]
    return here, dict(zip(names, (np.std(steps, axis=0) * units).tolist(), strict=True))


def train(flights: Sequence[Flight]) -> tuple[Any, dict[str, float]]:
    """Return coefficients and their deviations: inertia first, then what the state at the sample
    predicts by, then what the past adds.
    """
    inertia, spread = quick_inertia(flights)
    numbers, deviations = fit(starts_of(flights, 60), FITTED, BEGIN._replace(inertia=inertia))
    begin = numbers._replace(force_share=0.5, moment_share=0.5)
    past, more = fit(starts_of(flights, 60, past=numbers), PAST_NAMES, begin)
    return past, {"inertia": spread} | deviations | more


def stays(starts: Starts) -> Array:
    """Return the states (m, STEPS, 13) if nothing changed but the attitude, which turns on."""
    out = np.repeat(starts.states[:, None], STEPS, axis=1)
    for h in range(STEPS):
        turned = Rotation.from_rotvec((h + 1) * STEP * starts.states[:, 10:13])
        attitude = Rotation.from_quat(starts.states[:, 6:10], scalar_first=True) * turned
        out[:, h, 6:10] = attitude.as_quat(scalar_first=True)
    return out


def published(starts: Starts) -> Array:
    """Return what the published thrust and mass predict if the rate stays as it is."""
    nothing = dict.fromkeys(("rotor_drag", "inflow", "lift", "flapping", "reaction_torque"), 0.0)
    still = BEGIN._replace(velocity_scale=1.0, pitch_share=0.0, inertia=math.inf, **nothing)
    return predicted(still, starts, reacts=False)


def judged(flights: Sequence[Flight], c: Any, clock: float) -> list[dict[str, Any]]:
    """Return the scores of flights that coefficients have not seen; ``clock`` (s) is that of the
    training flights.
    """
    rows = []
    for flight in flights:
        at_sample, own = starts_of([flight], 2, clock), starts_of([flight], 2)
        ways = {
            STAYS: stays(at_sample),
            "published thrust, rate stays": published(at_sample),
            "named coefficients, reaction off": predicted(c, at_sample, reacts=False),
            NAMED: predicted(c, at_sample),
            "the same, the flight's own rotor clock": predicted(c, own),
            "the same, with 0.2 s of past": predicted(c, starts_of([flight], 2, clock, c)),
        }
        scores = {way: score(path, at_sample.truth).tolist() for way, path in ways.items()}
        rows.append({"flight": flight.name, "path": flight.path, "scores": scores})
    return rows


def table(rows: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Return each way's mean scores over flights, with 95 % intervals of drawn flights."""
    rng, out = np.random.default_rng(0), []
    for way in rows[0]["scores"]:
        values = np.array([row["scores"][way] for row in rows])
        drawn = values[rng.integers(0, len(values), (2000, len(values)))].mean(axis=1)
        low, high = np.quantile(drawn, (0.025, 0.975), axis=0).tolist()
        out.append({"way": way, "mean": values.mean(axis=0).tolist(), "low": low, "high": high})
    return out


def section(result: Mapping[str, Any]) -> str:
    """Return what the page shows of a study's result, as Markdown."""
    head = "position m | velocity m/s | attitude rad | rate rad/s |\n" + "| --- " * 5 + "|"
    lines = [f"| path held out: named coefficients of what stays | {head}"]
    for path, rows in result["paths"].items():
        still, named = (
            next(row["mean"] for row in rows if row["way"] == w) for w in (STAYS, NAMED)
        )
        cells = " | ".join(f"{x:.3g} of {y:.3g}" for x, y in zip(named, still, strict=True))
        lines.append(f"| {path} | {cells} |")
    lines += ["", "| coefficient | value, 95 % | unit |", "| --- " * 3 + "|"]
    for c in result["coefficients"][: -len(PAST_NAMES)]:
        value = f"{c['value']:.3g} ± {1.96 * c['std']:.2g}"
        lines.append(f"| {c['what']} | {value} | {c['unit']} |")
    made = made_by("python -m evidence.nanodrone_benchmark", [result["commit"]], result["version"])
    return "\n".join([made, "", *lines, ""])


def study(
    data: Annotated[Path, typer.Option(help="Folder of the 13 training flights.")] = Path(
        "../shared/data/idsia"
    ),
    test: Annotated[
        list[Path] | None, typer.Option(help="Flights to predict, in place of the paths held out.")
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(help="Results file; default: the page's, if no flights are given."),
    ] = None,
) -> None:
    """Fit on the training flights, and predict each path from the others."""
    files = sorted(data.glob("*.parquet"))
    if not files:
        print(f"{data}: no flights (*.parquet); skipped")
        return
    code, flights, rows = commit(), [read_flight(path) for path in files], []
    result: dict[str, Any] = {"version": __version__, "commit": code, "paths": {}}
    for path in [] if test else dict.fromkeys(f.path for f in flights):
        seen, held = (
            [f for f in flights if (f.path == path) == is_held] for is_held in (False, True)
        )
        rows += judged(held, train(seen)[0], mean_clock(seen))
        result["paths"][path] = table(rows[-len(held) :])
    begun = time.process_time()
    c, deviations = train(flights)
    result["fit_s"], result["clock_s"] = time.process_time() - begun, mean_clock(flights)
    if test:
        rows = judged([read_flight(path) for path in test], c, result["clock_s"])
    result["all"], result["flights"] = table(rows), rows
    result["coefficients"] = [
        {"name": name, "value": value, "std": deviations[name], "unit": unit, "what": what}
        for (name, (_, unit, what)), value in zip(COEFFICIENTS.items(), c, strict=True)
    ]
    print(f"{section(result)}fit: {result['fit_s']:.1f} s of processor time")
    if out is not None or not test:
        write_json(result, out or DOCS / "identify" / "nanodrone.json")


if __name__ == "__main__":
    start(study)
