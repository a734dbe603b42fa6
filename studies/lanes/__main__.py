"""``python -m studies.lanes`` flies designed laws on both plants, the same episodes, and puts the
table on ``docs/lanes.md``.

What was flown is kept in ``--out``, a file for each plant and law, and is not flown again.
"""

import argparse
import json
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from windwrench.controllers import make_controller
from windwrench.dynamics.motion import Array
from windwrench.envs.decision import LOST_OFFSET
from windwrench.envs.fan_tracking_vector import PLANTS, make_fan_tracking_vector
from windwrench.evaluation.episodes import DECISIONS, benchmark_seeds
from windwrench.evaluation.statistics import stratified_bootstrap
from windwrench.runtime.page_files import write_json
from windwrench.studies.page_tables import put_between, share, table

LAWS = ("hover", "admittance", "lead")
_TOGETHER = 100


def fly(plant: str, law: str, scenario: str, seeds: list[int]) -> tuple[Array, NDArray[np.bool_]]:
    """Return RMSE (n,), m, and whether the vehicle was lost (n,) of one episode a seed.

    A lost vehicle's remaining time counts at 2.5 m, as in the benchmark.
    """
    envs = make_fan_tracking_vector(len(seeds), plant, scenario=scenario)
    laws = [make_controller(law) for _ in seeds]
    seen, infos = envs.reset(seed=seeds)
    for one in laws:
        one.reset()
    offsets = np.full((DECISIONS, len(seeds)), LOST_OFFSET)
    flying = np.ones(len(seeds), dtype=np.bool_)
    for k in range(DECISIONS):
        actions = np.zeros((len(seeds), 1))
        for i in np.flatnonzero(flying).tolist():
            truth = {name: infos[name][i] for name in ("fan_y", "fan_velocity", "y", "offset")}
            actions[i] = laws[i](seen[i], truth)
        seen, _, lost, _, infos = envs.step(actions.astype(np.float32))
        offsets[k, flying] = np.minimum(np.abs(infos["offset"][flying]), LOST_OFFSET)
        flying &= ~lost
    envs.close()
    return np.asarray(np.sqrt(np.mean(offsets**2, axis=0))), (~flying).astype(np.float64)


def flown(plant: str, law: str, given: argparse.Namespace) -> tuple[Array, NDArray[np.bool_]]:
    """Return what ``fly`` does for all episodes, from the file where there is one."""
    path = given.out / f"{given.scenario}-{law}-{plant}.json"
    if path.exists():
        kept = json.loads(path.read_text(encoding="utf-8"))
        if len(kept["rmse"]) == given.episodes:
            return np.array(kept["rmse"]), np.array(kept["lost"])
    seeds = benchmark_seeds(0, given.episodes)
    parts = [
        fly(plant, law, given.scenario, seeds[k : k + _TOGETHER])
        for k in range(0, len(seeds), _TOGETHER)
    ]
    rmse, lost = (np.concatenate(column) for column in zip(*parts, strict=True))
    write_json({"rmse": rmse.tolist(), "lost": lost.tolist()}, path)
    print(f"{law} on {plant}: {np.mean(rmse):.4f} m, {lost.sum()} lost", flush=True)
    return rmse, lost


def _mean(rmse: Array) -> str:
    low, high = stratified_bootstrap(
        lambda stack: stack.mean(axis=(-2, -1)), rmse[None], tasks=True
    )
    return f"{rmse.mean():.4f} ({low:.4f}–{high:.4f})"


def row(law: str, given: argparse.Namespace) -> list[str]:
    """Return a law's row of the table."""
    (reference, lost), (lanes, also) = (flown(plant, law, given) for plant in PLANTS)
    return [
        law,
        _mean(reference),
        _mean(lanes),
        f"{np.abs(lanes - reference).max():.1e}",
        share(int(lost.sum()), len(lost)),
        share(int(also.sum()), len(also)),
        str(int((lost != also).sum())),
    ]


def main() -> None:
    """Fly, and write the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--episodes", type=int, default=1000)
    parser.add_argument("--scenario", default="base")
    parser.add_argument("--laws", default=",".join(LAWS))
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--page", type=Path)
    given = parser.parse_args()
    given.out.mkdir(parents=True, exist_ok=True)
    rows = [row(law, given) for law in given.laws.split(",")]
    head = (
        "law",
        "RMSE on MuJoCo, m",
        "RMSE in lanes, m",
        "largest difference of an episode, m",
        "lost on MuJoCo",
        "lost in lanes",
        "lost on one alone",
    )
    text = (
        f"{given.episodes} episodes of `{given.scenario}`, the same seeds on both plants; means "
        f"and their 95 % bootstrap intervals over episodes, counts with Wilson's.\n\n"
        f"{table(head, rows)}"
    )
    print(text)
    put_between(text, given.page)


if __name__ == "__main__":
    main()
