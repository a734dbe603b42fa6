"""Stable-baselines3 with body rates and thrust as actions: a Crazyflie holds its place in the wind.

``python -m windwrench.evidence.rates_learning`` trains PPO and SAC on
the task ``CrazyflieRates`` as ``windwrench train`` does, and flies the best policy of each run
through the test episodes of ``windwrench benchmark --seed 6900``. The kit's laws fly the same
winds, references and noise with the same vehicle by accelerations beside the flight loop
(``CrazyflieHover``). A finished run is kept in ``--work`` and not
repeated. Processor time counts
the whole run: compiling, training and validation.
"""

import shutil
import time
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from numpy.typing import NDArray

from windwrench.controllers.trained_policy import load_policy
from windwrench.envs import WindHoverEnv
from windwrench.evaluation.episodes import Episode, benchmark_seeds, fly_episode
from windwrench.evaluation.statistics import hierarchical_bootstrap, mean, relative_change
from windwrench.evaluation.tasks import make_pilot, task_of
from windwrench.evidence.runner import Jobs, code_stamp, run_tasks, start
from windwrench.runtime.page_files import write_json
from windwrench.training.configuration import load_config
from windwrench.training.train import train

Array = NDArray[np.float64]


class CrazyflieHover(WindHoverEnv):
    """The task of the kit's laws, with a Crazyflie."""

    vehicle = "crazyflie"


class CrazyflieRates(CrazyflieHover):
    """The same with body rates and thrust as actions."""

    action, observation = "rates", "wrench"


LAWED, LEARNED = f"{__file__}:CrazyflieHover", f"{__file__}:CrazyflieRates"
LAWS = ("hover", "pid", "pid-force", "pid-wrench", "indi", "l1", "lqg", "oracle")
RIVAL = "lqg"
SCENARIO = "base"
SEEDS = (0, 1)
# beside training/configs: for SAC SB3's own numbers, where those of the tasks suit accelerations
SETTINGS: dict[str, tuple[str, ...]] = {
    "ppo": ("estimator=ukf-lanes",),
    "sac": (
        "learner.learning_rate=0.0003",  # SB3's own
        "learning_rate_end=0.0003",
        "learner.gamma=0.99",  # SB3's own: 4 s; from a rate to a place there are three integrals
        "learner.ent_coef=auto",  # SB3's own
        "learner.train_freq=1",  # SB3's own: a gradient step for the decisions of 4 environments
        "estimator=ukf-lanes",
        "validation={every: 50000, episodes: 10}",
        "checkpoint=1000000",  # none on the way
    ),
}
STEPS = {"ppo": 2_000_000, "sac": 100_000}
FIGURES = ("rmse_settled", "rmse_transient", "total_reward", "command_activity", "lost")


def trained(algorithm: str, seed: int, steps: int, work: str) -> dict[str, Any]:
    """Train one policy; return its figures and its path, relative to ``work``."""
    folder = Path(work) / f"{algorithm}-{seed}"
    shutil.rmtree(folder, ignore_errors=True)  # half a run would not tell its processor time
    folder.mkdir(parents=True)
    settings = [*SETTINGS[algorithm], f"steps={steps}"]
    config = load_config(algorithm, settings, task=LEARNED)
    began, used = time.perf_counter(), time.process_time()
    validations: list[tuple[int, float, int, float]] = []

    def report(now: Any) -> None:
        figures = now.steps[-1], now.rmse_m[-1], now.lost[-1], time.process_time() - used
        print(algorithm, seed, figures, flush=True)
        validations.append(figures)

    path = train(config, SCENARIO, seed, folder, report=report, task=LEARNED)
    return {
        "policy": path.relative_to(work).as_posix(),
        "steps": validations[-1][0],
        "cpu_s": time.process_time() - used,
        "wall_s": time.perf_counter() - began,
        "validations": validations,  # decisions, RMSE after 3 s in m, lost, processor time in s
    }


def flown(
    controller: str, task: str, episodes: int, seed: int, weights: str
) -> dict[str, list[float]]:
    """Return the figures of a controller's test episodes, in order of their seeds. ``weights`` is
    the digest of a policy's: another policy of the same path is flown anew.

    ``rotor_activity`` is the mean squared change of a rotor's true speed from decision to decision
    (40 ms), over the square of its speed in hover: laws and policies have different commands.
    """
    env, pilot = task_of(task).make(SCENARIO), make_pilot(controller, task)
    found: dict[str, list[float]] = {name: [] for name in (*FIGURES, "rotor_activity")}
    for each in benchmark_seeds(seed, episodes):
        episode, activity = _flight(env, pilot, each)
        for name in FIGURES:
            found[name].append(float(getattr(episode, name)))
        found["rotor_activity"].append(activity)
    return found


def _flight(env: Any, pilot: Any, seed: int) -> tuple[Episode, float]:
    world, speeds = env.unwrapped, []

    def note(info: dict[str, Any]) -> None:
        speeds.append(world.loop.record[0]["plant"]["speeds"].copy())

    episode = fly_episode(env, pilot, seed, note)
    changes = np.diff(np.array(speeds), axis=0) / world.vehicle.hover_rate
    return episode, float(np.mean(changes**2)) if len(changes) else 0.0


def row(runs: list[dict[str, list[float]]], rival: dict[str, list[float]]) -> dict[str, Any]:
    """Return a table's row: means over policies and episodes, 95 % intervals over both."""
    figures = {name: np.array([run[name] for run in runs]) for name in runs[0]}
    settled, other = figures["rmse_settled"], np.array([rival["rmse_settled"]])
    return {
        **{name: float(values.mean()) for name, values in figures.items()},
        "lost": int(figures["lost"].sum()),
        "flights": int(settled.size),
        "rmse_settled_median": float(np.median(settled)),
        "lost_by_seed": figures["lost"].sum(axis=1).tolist(),
        "rmse_settled_by_seed": settled.mean(axis=1).tolist(),
        "rmse_settled_ci95": hierarchical_bootstrap(mean, settled),
        "total_reward_ci95": hierarchical_bootstrap(mean, figures["total_reward"]),
        "over_rival": float(relative_change(settled, other)),
        "over_rival_ci95": hierarchical_bootstrap(relative_change, settled, other),
    }


def study(
    out: Path = Path("docs/results/rates.json"),
    work: Path = Path("results/rates"),
    algorithms: Annotated[str, typer.Option(help="Names with commas.")] = "ppo,sac",
    episodes: int = 40,
    seed: int = 6900,
    steps: Annotated[int, typer.Option(help="Of each run, for a trial; 0: the study's.")] = 0,
    jobs: Jobs = 1,
) -> None:
    """Train, fly and write the table."""
    names = algorithms.split(",")
    work = work.resolve()
    wanted = [(a, s, steps or STEPS[a], str(work)) for a in names for s in SEEDS]
    runs = run_tasks(trained, wanted, work / "runs.jsonl", jobs)
    flyers: dict[str, list[tuple[str, str, str]]] = {law: [(law, LAWED, "")] for law in LAWS}
    flyers["no command"] = [("hover", LEARNED, "")]
    for name in names:
        paths = [str(work / run["policy"]) for task, run in runs.items() if task[0] == name]
        flyers[name] = [(path, LEARNED, load_policy(path).card["sha256"]) for path in paths]
    flights = {
        name: [(path, task, episodes, seed, digest) for path, task, digest in some]
        for name, some in flyers.items()
    }
    every = [one for some in flights.values() for one in some]
    boards = run_tasks(flown, every, work / "flights.jsonl", jobs, code_stamp("rates_learning"))
    (rival,) = (boards[one] for one in flights[RIVAL])
    found = {name: row([boards[one] for one in some], rival) for name, some in flights.items()}
    kept = ("steps", "cpu_s", "wall_s", "validations")
    for name in names:
        some = [run for task, run in runs.items() if task[0] == name]
        found[name]["runs"] = [{key: run[key] for key in kept} for run in some]
    settings = {name: load_config(name, SETTINGS[name], task=LEARNED) for name in names}
    write_json({"episodes": episodes, "seed": seed, "rows": found, "settings": settings}, out)
    print(table(found))


def table(rows: dict[str, Any]) -> str:
    """Return the rows as a Markdown table, worst first."""
    lines = [
        "| law or learner | RMSE after 3 s (m), 95 % | median | lost | return | rotors |",
        "| - | - | -: | -: | -: | -: |",
    ]
    for name, r in sorted(rows.items(), key=lambda item: -item[1]["rmse_settled"]):
        low, high = r["rmse_settled_ci95"]
        lines.append(
            f"| {name} | {r['rmse_settled']:.3f} ({low:.3f}-{high:.3f}) | "
            f"{r['rmse_settled_median']:.4f} | "
            f"{r['lost']} of {r['flights']} | {r['total_reward']:.0f} | "
            f"{1e4 * r['rotor_activity']:.1f} |"
        )
    return "\n".join(lines)


if __name__ == "__main__":
    start(study)
