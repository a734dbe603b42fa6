"""By which reward does the return rank controllers as their RMSE after 3 s does?

``python -m windwrench.evidence.reward_ranking --out docs/results/board/rewards.json``: all laws of
the kit fly the same episodes of seven worlds (an hour on two cores). Kendall's tau is over the laws
of a world. A pair of laws differs clearly where its paired difference is over 2.02 standard errors.
"""

import argparse
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import kendalltau

from windwrench.envs.fan_tracking import LOST_OFFSET
from windwrench.evaluation.benchmark import Request, fly_all
from windwrench.evaluation.leaderboard import figures
from windwrench.evaluation.tasks import task_of
from windwrench.runtime.page_files import write_json

Array = NDArray[np.float64]
World = dict[str, Array]  # figures (laws, episodes) by name

_FAN = (
    "hover admittance ratio lead admittance-pid tracker-tuned tracker-informed-tuned tracker-lqg "
    "limit oracle sac-0 sac-1 sac-2 sac-3 sac-4 ppo-0 ppo-1 ppo-2 recurrent-imitation-0 "
    "recurrent-imitation-1 recurrent-imitation-2 recurrent-imitation-3 recurrent-imitation-4 "
    "imitation-0 td3-0 recurrent-ppo-0 sac-wide-0"
)
WORLDS = (
    ("FanTracking", "base"),
    ("FanTracking", "far"),
    ("FanTracking", "fast"),
    ("WindHover", "base"),
    ("WindHover", "noisy"),
    ("WindHover", "turbulent"),
    ("WindTrajectory", "base"),
)
_CLEAR = 2.02  # standard errors of a paired difference of 40 episodes, 95 %
# returns by name: of today's reward, and of 1 - error / 2.5 m less a cost of the squared change
RETURNS: dict[str, Callable[[World], Array]] = {
    "today": lambda world: world["return"],
    "error": lambda world: world["error"],
    "error, cost 0.001": lambda world: world["error"] - 0.001 * world["changes"],
    "error, cost 0.003": lambda world: world["error"] - 0.003 * world["changes"],
    "error, cost 0.01": lambda world: world["error"] - 0.01 * world["changes"],
}


def flown(task: str, scenario: str, episodes: int, seed: int) -> World:
    """Return the figures of all laws of a world."""
    known = task_of(task)
    laws = tuple(_FAN.split()) if task == "FanTracking" else (*known.laws, *known.policies())
    results = fly_all(Request(laws, (scenario,), episodes, seed, task))
    each = [results[law, scenario] for law in laws]
    counts = np.array([[len(e.time) for e in one] for one in each])
    return {
        "settled": figures(each, "rmse_settled"),
        "return": figures(each, "total_reward"),
        "error": np.array([[np.sum(1.0 - e.offset / LOST_OFFSET) for e in one] for one in each]),
        "changes": counts * figures(each, "command_activity"),
    }


def ranking(worlds: dict[str, World], resamples: int = 400) -> dict[str, Any]:
    """Return by reward Kendall's tau in each world, its mean with a 95 % interval over episodes,
    and how many clearly different pairs of laws the return orders otherwise.
    """
    rng = np.random.default_rng(0)
    found: dict[str, Any] = {}
    counts = {name: world["settled"].shape[1] for name, world in worlds.items()}
    draws = [
        {name: rng.integers(count, size=count - 1) for name, count in counts.items()}
        for _ in range(resamples)
    ]
    for name, of in RETURNS.items():
        taus = {key: _tau(world["settled"], of(world)) for key, world in worlds.items()}
        means = [
            np.mean([_tau(w["settled"][:, d[k]], of(w)[:, d[k]]) for k, w in worlds.items()])
            for d in draws
        ]
        pairs = np.sum([_otherwise(w["settled"], of(w)) for w in worlds.values()], axis=0)
        found[name] = {
            "tau": taus,
            "mean_tau": float(np.mean(list(taus.values()))),
            "mean_tau_ci95": np.quantile(means, [0.025, 0.975]).tolist(),
            "clear_pairs": int(pairs[0]),
            "ordered_otherwise": int(pairs[1]),
        }
    return found


def _tau(settled: Array, returns: Array) -> float:
    return float(kendalltau(settled.mean(axis=1), -returns.mean(axis=1))[0])


def _otherwise(settled: Array, returns: Array) -> tuple[int, int]:
    """Return the number of clearly different pairs of laws, and of those ordered otherwise."""
    difference = settled[:, None] - settled[None]
    error = difference.std(axis=2, ddof=1) / np.sqrt(settled.shape[1])
    mean, gained = difference.mean(axis=2), returns.mean(axis=1)
    clear = np.triu(np.abs(mean) > _CLEAR * error, 1)
    wrong = clear & ((mean > 0.0) == (gained[:, None] > gained[None]))
    return int(clear.sum()), int(wrong.sum())


def main() -> None:
    """Fly all worlds and write the ranking."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--episodes", type=int, default=40)
    parser.add_argument("--seed", type=int, default=6811)
    parser.add_argument("--out", type=Path, required=True)
    given = parser.parse_args()
    worlds = {f"{t} {s}": flown(t, s, given.episodes, given.seed) for t, s in WORLDS}
    told = {"episodes": given.episodes, "seed": given.seed}
    laws = {name: len(world["settled"]) for name, world in worlds.items()}
    write_json({**told, "laws": laws, "rewards": ranking(worlds)}, given.out)


if __name__ == "__main__":
    main()
