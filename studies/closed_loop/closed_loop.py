"""The loop closed in flight: an effect that nobody declared is flown, named, declared, and the fan
followed once more.

For each effect: a vehicle that has it flies a trajectory in which it shows; its log is diagnosed
against the declared vehicle; the named effects go into the model of filter and flight loop; and the
fan-tracking benchmark is flown with the declared model, with the amended one and, as a bound, with
the exact one. The true vehicle has the effect each time, and the episodes are paired: the same
seeds, so the same fan, gusts, disturbance and sensor noise.
"""

import hashlib
import json
import os
import re
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, wait
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from windwrench import __version__
from windwrench.controllers import make_controller
from windwrench.dynamics.effects import get
from windwrench.dynamics.vehicle import EffectSetting, Vehicle
from windwrench.dynamics.vehicle_file import dump_vehicle
from windwrench.envs.fan_tracking import FanTrackingEnv
from windwrench.evaluation.episodes import benchmark_seeds, fly_episode
from windwrench.identification.diagnosis import diagnose
from windwrench.paper.result import Progress
from windwrench.runtime.errors import InputError
from windwrench.runtime.page_files import write_json
from windwrench.runtime.provenance import commit
from windwrench.runtime.workers import shared_dict, workers
from windwrench.studies.code_stamp import code_stamp
from windwrench.studies.trials.practice_flights import fly_practice, shown_in

Array = NDArray[np.float64]

DEFAULT_EFFECTS = (
    "com_offset",
    "mass",
    "rotor_drag",
    "inflow_thrust",
    "battery_sag",
    "rotor_efficiency",
    "motor_lag",
    "thrust_axis_tilt",
    "world_tilt",
    "constant_torque",
)
SECONDS = 60.0  # of the flight that is diagnosed
CONTROLLER, SCENARIO = "admittance", "base"
MODELS = ("declared", "amended", "exact")  # what filter and flight loop know
_RESAMPLES = 4_000
MARGIN = 0.01  # of a ratio: paired episodes resolve changes far too small to matter
_DIAGNOSIS = 0.4  # share of the work on an effect


@dataclass(frozen=True)
class Measure:
    """A figure of an episode that is compared: smaller is better."""

    key: str
    title: str
    unit: str
    factor: float  # from SI to the unit that is shown
    axes: tuple[int, ...] = ()  # of the wrench, whose error it is


MEASURES = (
    Measure("force_error_N", "force error", "mN", 1e3, (0, 1, 2)),
    Measure("torque_error_Nm", "torque error", "mNm", 1e3, (3, 4, 5)),
    Measure("yaw_torque_error_Nm", "yaw torque error", "mNm", 1e3, (5,)),
    Measure("tracking_m", "tracking RMSE", "m", 1.0),
)


@dataclass(frozen=True)
class Request:
    """What is asked for: one effect of one vehicle."""

    effect: EffectSetting
    vehicle: Vehicle  # as declared
    episodes: int
    seed: int
    seconds: float = SECONDS

    @property
    def name(self) -> str:
        """Name of its result file: the effect, and its coefficients where they are not the
        library's typical ones.
        """
        size = 1 if self.vehicle.mass < 0.1 else 0
        given = dict(self.effect.coefficients)
        if given == {c.name: c.typical[size] for c in get(self.effect.name).coefficients}:
            return self.effect.name
        return re.sub(
            r"[^\w.,=+-]",
            "_",
            f"{self.effect.name}_" + ",".join(f"{k}={v:g}" for k, v in given.items()),
        )

    def as_json(self) -> dict[str, Any]:
        """Return it as JSON: a result that was kept answers the same request or is made anew."""
        digest = hashlib.sha256(dump_vehicle(self.vehicle).encode()).hexdigest()[:16]
        return {
            "effect": self.effect.name,
            "coefficients": dict(self.effect.coefficients),
            "vehicle": self.vehicle.name,
            "vehicle_digest": digest,
            "episodes": self.episodes,
            "seed": self.seed,
            "seconds": self.seconds,
            "controller": CONTROLLER,
            "scenario": SCENARIO,
            "version": __version__,
            "code": code_stamp("closed_loop/closed_loop", "trials/practice_flights"),
        }


def check_requests(requests: Sequence[Request]) -> None:
    """Check what ``close_loops`` is asked for, before anything is flown.

    Raises:
        InputError: no episodes, a seed out of range, the same effect twice, or one that its vehicle
            declares or cannot show.
    """
    if len({r.name for r in requests}) < len(requests):
        raise InputError(
            "close-loop: --effect: the same effect with the same coefficients is given twice"
        )
    for r in requests:
        if r.episodes < 1:
            raise InputError(f"close-loop: --episodes must be at least 1, got {r.episodes}")
        if not 0 <= r.seed < 2**32:
            raise InputError(f"close-loop: --seed must lie between 0 and 4294967295, got {r.seed}")
        if any(e.name == r.effect.name for e in r.vehicle.effects):
            raise InputError(
                f"close-loop: --effect {r.effect.name}: {r.vehicle.name} declares it already; "
                f"expected an effect "
                "that nobody declared"
            )
        if r.effect.name == "ceiling_effect" and not np.isfinite(r.vehicle.ceiling_z):
            raise InputError(
                f"close-loop: --effect ceiling_effect: {r.vehicle.name} states no ceiling; "
                f"expected ceiling_z in "
                "the vehicle's file"
            )


def fly_episodes(
    model: Vehicle,
    truth: Vehicle,
    effect: EffectSetting,
    seeds: Sequence[int],
    each: Callable[[], None] = lambda: None,
) -> dict[str, list[Any]]:
    """Fly the benchmark's episodes with a model of the vehicle; return tracking and wrench errors,
    a number an episode.

    The true wrench that an estimate is held against is the jet's and that of the unmodelled
    disturbance of the actuators. The share of the vehicle's own effects is no part of it, whatever
    the model: what of it is in the estimate is error. Root-mean-square over the three axes (yaw
    torque: the world's vertical alone) and over the decisions that were flown. Force is in the
    world frame; torque too, about the true centre of mass.

    Args:
        model: what filter and flight loop know.
        truth: the vehicle before the effect.
        effect: that the true vehicle has besides.
        seeds: of the episodes.
        each: called after each episode.
    """
    env = FanTrackingEnv(SCENARIO, vehicle=model, truth=truth, effects=(effect,))
    controller = make_controller(CONTROLLER)
    out: dict[str, list[Any]] = {
        key: [] for key in (*(m.key for m in MEASURES), "mean_offset_m", "lost")
    }
    for seed in seeds:
        errors: list[Array] = []

        def keep(info: Mapping[str, Any], errors: list[Array] = errors) -> None:
            loop = env.loop
            assert loop is not None
            x = loop.state
            errors.append(np.concatenate([x[16:19], x[13:16]]) - loop.jet - loop.disturbance)

        episode = fly_episode(env, controller, seed, keep)
        error = np.array(errors)
        error = error[
            np.isfinite(error).all(axis=1)
        ]  # a filter that has lost the vehicle ends its episode so
        for measure in MEASURES[:3]:
            out[measure.key].append(float(np.sqrt(np.mean(np.square(error[:, measure.axes])))))
        out["tracking_m"].append(episode.rmse)
        out["mean_offset_m"].append(float(np.mean(episode.y - episode.fan_y)))
        out["lost"].append(episode.lost)
        each()
    env.close()
    return out


def interval_of_mean(values: Sequence[float]) -> tuple[float, float]:
    """Return the 95 % percentile bootstrap interval, over episodes, of a mean."""
    means = np.asarray(values)[_resampled(len(values))].mean(axis=1)
    low, high = np.quantile(means, [0.025, 0.975])
    return float(low), float(high)


def ratio_of_means(
    before: Sequence[float], after: Sequence[float]
) -> tuple[float, tuple[float, float]]:
    """Return mean after by mean before over paired episodes, and its 95 % percentile bootstrap
    interval.
    """
    b, a = np.asarray(before), np.asarray(after)
    rows = _resampled(len(b))
    low, high = np.quantile(a[rows].mean(axis=1) / b[rows].mean(axis=1), [0.025, 0.975])
    return float(a.mean() / b.mean()), (float(low), float(high))


def _resampled(count: int) -> NDArray[np.intp]:
    return np.random.default_rng(0).integers(count, size=(_RESAMPLES, count))


def verdict(interval: Sequence[float]) -> str:
    """Return what the interval of a ratio says: ``falls`` or ``rises`` by at least 1 %, or
    ``unchanged``.
    """
    return (
        "falls"
        if interval[1] < 1.0 - MARGIN
        else "rises"
        if interval[0] > 1.0 + MARGIN
        else "unchanged"
    )


def close_loop(request: Request, progress: Progress = lambda share: None) -> dict[str, Any]:
    """Fly, diagnose, amend and fly again for one effect; return the result as JSON.

    Raises:
        InputError: the flight loop cannot fly the vehicle with this effect.
    """
    effect, vehicle = request.effect, request.vehicle
    trajectory = shown_in(effect.name)[0]
    try:
        log = fly_practice(vehicle, (effect,), trajectory, request.seconds, request.seed)
    except InputError as error:
        raise InputError(f"close-loop: --effect {request.name}: {error}") from error
    asked = 0

    def report(text: str) -> None:
        nonlocal asked
        asked += 1
        progress(_DIAGNOSIS * (1.0 - 0.95**asked))

    found = diagnose([log], vehicle, report=report)
    seeds = benchmark_seeds(request.seed, request.episodes)
    exact = vehicle.with_effects(*vehicle.effects, effect)
    flown = 0

    def each() -> None:
        nonlocal flown
        flown += 1
        progress(_DIAGNOSIS + (1.0 - _DIAGNOSIS) * flown / (len(MODELS) * len(seeds)))

    episodes = {
        name: fly_episodes(model, vehicle, effect, seeds, each)
        for name, model in zip(MODELS, (vehicle, found.amended, exact), strict=True)
    }
    result: dict[str, Any] = _plain(
        {
            "name": request.name,
            "request": request.as_json(),
            "trajectory": trajectory,
            "diagnosis": {
                "verdict": found.verdict,
                "remainder": found.remainder,
                "effects": [
                    {
                        "name": e.name,
                        "coefficients": e.coefficients,
                        "std": e.std,
                        "units": e.units,
                        "tentative": e.tentative,
                        "indistinguishable_from": e.indistinguishable_from,
                    }
                    for e in found.effects
                ],
            },
            "summary": {
                m.key: _summary({name: flights[m.key] for name, flights in episodes.items()})
                for m in MEASURES
            },
            "mean_offset_m": {
                name: float(np.mean(flights["mean_offset_m"])) for name, flights in episodes.items()
            },
            "lost": {name: sum(flights["lost"]) for name, flights in episodes.items()},
            "seeds": seeds,
            "episodes": episodes,
        }
    )
    return result


def _summary(values: Mapping[str, Sequence[float]]) -> dict[str, Any]:
    """Return means with their intervals, and the ratio of amended to declared."""
    ratio, interval = ratio_of_means(values["declared"], values["amended"])
    return {
        **{
            name: {"mean": float(np.mean(some)), "ci95": interval_of_mean(some)}
            for name, some in values.items()
        },
        "ratio": ratio,
        "ratio_ci95": interval,
        "verdict": verdict(interval),
    }


def _plain(value: Any) -> Any:
    """Return a value as JSON, with numbers to eight digits: the last bits depend on a machine's
    libraries.
    """
    if isinstance(value, Mapping):
        return {str(k): _plain(v) for k, v in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(v) for v in value]
    if isinstance(value, (float, np.floating)):
        return float(f"{float(value):.8g}") if np.isfinite(value) else None
    return value


def close_loops(
    requests: Sequence[Request],
    folder: Path,
    jobs: int | None = None,
    report: Callable[[Mapping[str, float]], None] = lambda shares: None,
) -> list[dict[str, Any]]:
    """Close the loop for every effect, side by side; keep each result as ``NAME.json`` in the
    folder as soon as it is there.

    An effect whose result of the same request, by the same code, lies there already is not flown
    again, so that an interrupted run goes on where it stopped. The results do not depend on
    ``jobs``.

    Args:
        requests: one an effect.
        folder: for the results.
        jobs: processes; default: one a core.
        report: called now and then with the share that is done of each effect.

    Raises:
        InputError: as ``check_requests`` and ``close_loop``.
    """
    check_requests(requests)
    folder.mkdir(parents=True, exist_ok=True)
    pending = [r for r in requests if _kept(r, folder) is None]
    shares = {r.name: float(r not in pending) for r in requests}
    jobs = min(jobs or os.cpu_count() or 1, len(pending))
    report(shares)
    if jobs == 1:
        for request in pending:

            def progress(share: float, name: str = request.name) -> None:
                shares[name] = share
                report(shares)

            _close_and_keep(request, folder, progress)
    elif jobs > 1:
        _side_by_side(pending, folder, jobs, shares, report)
    report({r.name: 1.0 for r in requests})
    results = [_kept(r, folder) for r in requests]
    return [result for result in results if result is not None]


def _side_by_side(
    pending: Sequence[Request],
    folder: Path,
    jobs: int,
    shares: dict[str, float],
    report: Callable[[Mapping[str, float]], None],
) -> None:
    with shared_dict(shares) as shared, workers(jobs) as pool:
        waiting: set[Future[None]] = {
            pool.submit(_close_and_share, request, folder, shared) for request in pending
        }
        while waiting:
            done, waiting = wait(waiting, timeout=0.3, return_when=FIRST_COMPLETED)
            report(dict(shared))
            for future in done:
                future.result()


def _close_and_share(request: Request, folder: Path, shared: Any) -> None:
    _close_and_keep(request, folder, lambda share: shared.__setitem__(request.name, share))


def _close_and_keep(request: Request, folder: Path, progress: Progress) -> None:
    code = commit()  # before the flights: the code that flies
    result = {"commit": code, **close_loop(request, progress)}
    write_json(result, folder / f"{request.name}.json")


def _kept(request: Request, folder: Path) -> dict[str, Any] | None:
    try:
        kept = json.loads((folder / f"{request.name}.json").read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None
    return (
        kept
        if isinstance(kept, dict) and kept.get("request") == _plain(request.as_json())
        else None
    )
