"""The leaderboard: controllers on the same episodes, scored between hover (0) and oracle (1)."""

import math
import os
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..controllers import CONTROLLERS, Controller, make_controller
from ..controllers.own_file import is_file_name, load_controller
from ..controllers.shipped import shipped_policies
from ..controllers.trained_policy import TrainedPolicy, is_policy_path, load_policy
from ..envs.closed_loop import tick
from ..envs.fan_tracking import FanTrackingEnv
from ..envs.scenarios import get_scenario
from ..envs.watched_fan_tracking import scenario_env
from ..runtime.compiled import is_on_disk
from ..runtime.errors import unknown_name
from .episodes import (
    DECISIONS,
    FIRST_TEST_SEED,
    Episode,
    benchmark_seeds,
    check_episodes,
    fly_episode,
)
from .side_by_side import each_flown
from .side_by_side import write_leaderboard as write_leaderboard  # from here, too, as at first

_CHUNK = 5  # episodes that a worker flies at a time
_SAMPLE = 25  # decisions by which a duration is told
# what scores, wins and shares are relative to
_REFERENCES = ("hover", "admittance", "limit", "oracle")
_RESAMPLES = 4_000

Results = dict[tuple[str, str], list[Episode]]


@dataclass(frozen=True)
class Row:
    """One line of the leaderboard."""

    controller: str
    scenario: str
    episodes: int
    seed: int
    rmse_m: float  # mean over episodes
    rmse_ci95_m: tuple[float, float]  # bootstrap over episodes
    median_rmse_m: float
    lost_fraction: float
    score: float  # (hover - this) / (hover - oracle), of the means
    wins_over_admittance: float  # share of the paired episodes with a smaller RMSE
    # (admittance - this) / (admittance - limit), of the means: what of the way from the reference
    # law to the best that these measurements allow is gone
    share_of_limit: float


def make_pilot(name: str) -> Controller:
    """Return a new controller by its name or that of a policy that comes with the kit, by the path
    of a trained policy, or by FILE.py:CLASS of a file that is then run.

    Raises:
        InputError: no controller has this name, or the file holds none.
    """
    if is_file_name(name):
        controller: Controller = load_controller(name)
        return controller
    if is_policy_path(name):
        return load_policy(name)
    shipped = shipped_policies()
    if name in shipped:
        return load_policy(shipped[name])
    if name not in CONTROLLERS:
        raise unknown_name("controller", name, [*CONTROLLERS, *shipped])
    return make_controller(name)


def short_names(names: Sequence[str]) -> dict[str, str]:
    """Return what tables and pictures call controllers: a policy by the name of its file, with as
    many of its folders as it takes to tell it from the others.
    """
    parts = {
        name: Path(name).with_suffix("").parts if is_policy_path(name) else (name,)
        for name in names
    }
    shown = {}
    for name, own in parts.items():
        others = [other for key, other in parts.items() if key != name]
        length = 1
        while length < len(own) and any(other[-length:] == own[-length:] for other in others):
            length += 1
        shown[name] = "/".join(own[-length:])
    return shown


def check_request(
    controllers: Sequence[str], scenarios: Sequence[str], episodes: int, seed: int
) -> None:
    """Check what ``fly_all`` is asked for, before anything is flown.

    Raises:
        InputError: an unknown name, no episodes, or a seed out of range.
    """
    check_episodes(episodes, seed)
    for name in controllers:
        make_pilot(name)
    for name in scenarios:
        get_scenario(name)


def fly_all(
    controllers: Sequence[str],
    scenarios: Sequence[str],
    episodes: int,
    seed: int,
    jobs: int | None = None,
    advance: Callable[[int], None] = lambda count: None,
    cluster: str | None = None,
) -> Results:
    """Fly every controller, and the references, through every scenario on the same seeds.

    Args:
        controllers: names, of trained policies too, or their paths.
        scenarios: names.
        episodes: a scenario.
        seed: of the benchmark.
        jobs: processes; default: one a core. The results do not depend on it.
        advance: called with the number of episodes flown since the last call.
        cluster: address of a Ray cluster that flies, or ``local`` for one of its own on this
            machine; default: none.

    Raises:
        InputError: as ``check_request``.
    """
    check_request(controllers, scenarios, episodes, seed)
    wanted = list(dict.fromkeys([*controllers, *_REFERENCES]))
    seeds = benchmark_seeds(seed, episodes)
    tasks = [
        (controller, scenario, seeds[i : i + _CHUNK])
        for scenario in dict.fromkeys(scenarios)
        for controller in wanted
        for i in range(0, episodes, _CHUNK)
    ]
    # one episode first, so that soon there is something to count
    name, world, first = tasks[0]
    tasks[:1] = [(name, world, first[:1]), *([(name, world, first[1:])] if first[1:] else [])]
    results: Results = {(c, s): [] for s in scenarios for c in wanted}

    def compile_first() -> None:
        if not is_on_disk(tick):
            scenario_env(scenarios[0]).reset(seed=0)

    chunks = each_flown(_fly_chunk, tasks, jobs, cluster, compile_first)
    for (name, scenario, _), flown in chunks:
        results[name, scenario].extend(flown)
        advance(len(flown))
    return results


def sampled_seconds(
    controllers: Sequence[str], scenarios: Sequence[str], episodes: int, jobs: int | None = None
) -> float | None:
    """Return about how many s ``fly_all`` takes on this machine, by a part of an episode of each
    controller; None where nothing is compiled yet.
    """
    if not is_on_disk(tick):
        return None
    wanted = list(dict.fromkeys([*controllers, *_REFERENCES]))
    seconds = 0.0
    for name in wanted:
        controller = make_pilot(name)
        env = _environment_for(controller, scenarios[0])
        # the same flight first: it compiles or loads all that the second one calls
        fly_episode(env, controller, FIRST_TEST_SEED, decisions=_SAMPLE)
        begun = time.perf_counter()
        fly_episode(env, controller, FIRST_TEST_SEED, decisions=_SAMPLE)
        seconds += (time.perf_counter() - begun) * DECISIONS / _SAMPLE
    flights = len(set(scenarios)) * episodes
    return seconds * flights / min(jobs or os.cpu_count() or 1, flights)


def count_flights(controllers: Sequence[str], scenarios: Sequence[str], episodes: int) -> int:
    """Return how many episodes ``fly_all`` flies."""
    return len({*controllers, *_REFERENCES}) * len(set(scenarios)) * episodes


def _environment_for(controller: Controller, scenario: str) -> FanTrackingEnv:
    return scenario_env(
        scenario,
        controller.features.sources if isinstance(controller, TrainedPolicy) else frozenset(),
    )


def _fly_chunk(task: tuple[str, str, list[int]]) -> list[Episode]:
    name, scenario, seeds = task
    controller = make_pilot(name)
    env = _environment_for(controller, scenario)
    return [fly_episode(env, controller, seed) for seed in seeds]


def leaderboard(results: Results, controllers: Sequence[str], seed: int) -> list[Row]:
    """Return the leaderboard's rows, scenario by scenario, best first."""
    rows = []
    for scenario in dict.fromkeys(s for _, s in results):
        rmse = {
            c: np.array([e.rmse for e in flown])
            for (c, s), flown in results.items()
            if s == scenario
        }
        span = rmse["hover"].mean() - rmse["oracle"].mean()
        start = rmse["admittance"].mean()
        way = start - rmse["limit"].mean() if "limit" in rmse else math.nan
        some = []
        for name in dict.fromkeys(controllers):
            flown, values = results[name, scenario], rmse[name]
            ahead = values - rmse["admittance"]
            some.append(
                Row(
                    controller=name,
                    scenario=scenario,
                    episodes=len(flown),
                    seed=seed,
                    rmse_m=float(values.mean()),
                    rmse_ci95_m=_interval(values),
                    median_rmse_m=float(np.median(values)),
                    lost_fraction=float(np.mean([e.lost for e in flown])),
                    score=float((rmse["hover"].mean() - values.mean()) / span)
                    if span > 0
                    else math.nan,
                    wins_over_admittance=float(np.mean(ahead < 0) + 0.5 * np.mean(ahead == 0)),
                    share_of_limit=float((start - values.mean()) / way) if way > 0 else math.nan,
                )
            )
        rows.extend(sorted(some, key=lambda row: row.rmse_m))
    return rows


def _interval(values: np.ndarray) -> tuple[float, float]:
    """Return the 95 % percentile bootstrap interval of the mean."""
    rng = np.random.default_rng(0)
    means = values[rng.integers(len(values), size=(_RESAMPLES, len(values)))].mean(axis=1)
    low, high = np.quantile(means, [0.025, 0.975])
    return float(low), float(high)
