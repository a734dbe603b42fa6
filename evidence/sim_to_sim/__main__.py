"""Do laws and policies of the kit keep their places in other people's simulators?

``python -m windwrench.evidence.sim_to_sim --out results/sim_to_sim``: every law flies the same
episodes of WindHover's ``base`` here and there, in the same winds, with the same noise. Here is the
kit's plant with the vehicle that the other simulator publishes. The table ranks by RMSE after 3 s.
Intervals of 95 % draw the episodes anew, the same ones for both places. The vehicle's drag is the
kit's in all places; the simulator's own drag on its velocity comes on top.
"""

from itertools import combinations
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from numpy.typing import NDArray
from scipy.stats import kendalltau, t

from windwrench.evaluation.episodes import benchmark_seeds
from windwrench.evaluation.statistics import (
    episode_bootstrap,
    hierarchical_draws,
    interval_of,
    mean,
    relative_change,
)
from windwrench.evidence.runner import Jobs, code_stamp, run_tasks, start
from windwrench.runtime.errors import unknown_name
from windwrench.runtime.page_files import write_json

from .episodes import HERE, fly
from .peers import PEERS, VEHICLES, vehicle_of
from .pilots import TAUGHT, pilot_of, taught_path

Array = NDArray[np.float64]
Figures = dict[str, Array]  # (episodes,) by name

LAWS = "hover,pid,pid-force,pid-wrench,indi,l1,lqg,linear,gru"
CHUNK = 10  # episodes of a task


def compared(here: dict[str, Figures], there: dict[str, Figures], weight: float) -> dict[str, Any]:
    """Return the rows of laws, best here first, and how far their order holds there."""
    laws = sorted(here, key=lambda law: float(here[law]["rmse"].mean()))
    places = {law: rank for rank, law in enumerate(sorted(there, key=_by(there)), start=1)}
    rows = []
    for rank, law in enumerate(laws, start=1):
        row: dict[str, Any] = {"law": Path(law).stem, "rank_here": rank, "rank_there": places[law]}
        for place, figures in (("here", here[law]), ("there", there[law])):
            rmse, force = figures["rmse"], figures["force"]
            row[place] = {
                "rmse": float(rmse.mean()),
                "ci95": episode_bootstrap(mean, rmse),
                "lost": int(figures["lost"].sum()),
                "force": float(np.nanmean(force)),
                "force_share": float(np.nanmean(force) / weight),
                "applied_share": float(np.nanmean(figures["applied"]) / weight),
            }
        pair = np.atleast_2d(there[law]["rmse"]), np.atleast_2d(here[law]["rmse"])
        draws = hierarchical_draws(relative_change, *pair)
        rows.append(
            row | {"change": float(relative_change(*pair)), "change_ci95": interval_of(draws)}
        )
    stacks = [np.array([place[law]["rmse"] for law in laws]) for place in (here, there)]
    return {"rows": rows, **ranking(*stacks)} if len(laws) > 1 else {"rows": rows}


def _by(place: dict[str, Figures]) -> Any:
    return lambda law: float(place[law]["rmse"].mean())


def ranking(here: Array, there: Array) -> dict[str, Any]:
    """Return how far two places order laws alike, by RMSE (laws, episodes) in each.

    A pair of laws is clear where both places tell it apart: Student's t, paired, 95 %.
    """
    rng, count = np.random.default_rng(0), here.shape[1]
    draws = rng.integers(count, size=(2000, count))
    taus = [_tau(here[:, d], there[:, d]) for d in draws]
    clear = reversed_ = 0
    for a, b in combinations(range(len(here)), 2):
        signs = [_sign(place[a] - place[b]) for place in (here, there)]
        clear += all(signs)
        reversed_ += signs[0] * signs[1] < 0
    tau = _tau(here, there)
    return {
        "tau": tau,
        "tau_ci95": interval_of(taus),
        "pairs": len(here) * (len(here) - 1) // 2,
        "clear_pairs": clear,
        "clear_pairs_reversed": reversed_,
    }


def _tau(here: Array, there: Array) -> float:
    return float(kendalltau(here.mean(axis=1), there.mean(axis=1))[0])


def _sign(difference: Array) -> int:
    """Return the sign of a mean difference (episodes,), 0 where it is not clear."""
    count = len(difference)
    error = difference.std(ddof=1) / np.sqrt(count)
    clear = abs(difference.mean()) > t.ppf(0.975, count - 1) * error
    return int(np.sign(difference.mean()) * clear)


def table(name: str, found: dict[str, Any]) -> str:
    """Return a simulator's table in Markdown."""
    lines = [
        f"| {name} | here (m) | there (m) | change | lost | force error |",
        "| - | - | - | - | -: | -: |",
    ]
    for row in found["rows"]:
        here, there, (low, high) = row["here"], row["there"], row["change_ci95"]
        rmses = " | ".join(
            f"{one['rmse']:.4f} ({one['ci95'][0]:.4f}-{one['ci95'][1]:.4f})"
            for one in (here, there)
        )
        lines.append(
            f"| {row['law']}, {row['rank_here']} -> {row['rank_there']} | {rmses} | "
            f"{100 * row['change']:+.0f} % ({100 * low:+.0f} to {100 * high:+.0f}) | "
            f"{here['lost']}, {there['lost']} | "
            f"{100 * here['force_share']:.1f}, {100 * there['force_share']:.1f} % |"
        )
    if "tau" in found:
        low, high = found["tau_ci95"]
        lines.append(
            f"\nKendall's tau {found['tau']:.2f} ({low:.2f} to {high:.2f}); "
            f"{found['clear_pairs_reversed']} of {found['clear_pairs']} clear pairs reversed."
        )
    return "\n".join(lines)


def study(
    out: Annotated[Path, typer.Option(help="Folder of results and taught policies.")] = Path(
        "results/sim_to_sim"
    ),
    simulators: Annotated[str, typer.Option(help="Names with commas.")] = "crazyflow,pybullet",
    laws: Annotated[str, typer.Option(help="Names with commas; also PPO's .zip.")] = LAWS,
    episodes: Annotated[int, typer.Option(min=1)] = 40,
    seed: Annotated[int, typer.Option(min=0, help="As of windwrench benchmark.")] = 0,
    jobs: Jobs = 1,
) -> None:
    """Fly, print the tables, and write OUT/sim_to_sim.json."""
    names, flown = simulators.split(","), laws.split(",")
    for name in names:
        if name not in PEERS:
            raise unknown_name("simulator", name, PEERS, "sim_to_sim: --simulators")
        vehicle = PEERS[name]().vehicle  # refuses what is not installed, before any flight
        for law in flown:
            if law in TAUGHT:
                taught_path(law, vehicle, out)
            pilot_of(law, vehicle, out)
    seeds = benchmark_seeds(seed, episodes)
    parts = [(seeds[i], min(CHUNK, episodes - i)) for i in range(0, episodes, CHUNK)]
    # the plant here is the same for all forms of a simulator
    places = list(dict.fromkeys((place, _kind(n)) for n in names for place in (HERE, n)))
    wanted = [
        (place, kind, law, str(out), *part)
        for part in parts
        for law in flown
        for place, kind in places
    ]
    stamp = code_stamp(
        *(f"sim_to_sim/{name}" for name in ("episodes", "flight", "peers", "pilots"))
    )
    results = run_tasks(fly, wanted, out / "episodes.jsonl", jobs, stamp)

    def figures(place: str, kind: str, law: str) -> Figures:
        rows = [row for part in parts for row in results[place, kind, law, str(out), *part]]
        return {name: np.array([row[name] for row in rows], dtype=np.float64) for name in rows[0]}

    found: dict[str, Any] = {"episodes": episodes, "seed": seed, "code": stamp}
    for name in names:
        kind = _kind(name)
        here, there = ({law: figures(place, kind, law) for law in flown} for place in (HERE, name))
        found[name] = compared(here, there, vehicle_of(VEHICLES[kind]).weight)
        print(f"\n{table(name, found[name])}")
    write_json(found, out / "sim_to_sim.json")


def _kind(name: str) -> str:
    return name.partition("-")[0]


if __name__ == "__main__":
    start(study)
