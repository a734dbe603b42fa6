"""Learning: policies trained, and the gains of designed controllers tuned."""

import shlex
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any

import typer
from rich import box
from rich.table import Table

from .running import expensive
from .terminal import Out, console, offering, progress_bar, results_folder, say


def algorithm_names() -> list[str]:
    """Return the algorithms that ``train`` knows."""
    return ["sac", "ppo", "recurrent-ppo", "td3", "recurrent-imitation"]


def world_names() -> list[str]:
    """Return what can be trained in."""
    from ..envs.scenarios import SCENARIOS
    from ..training.training_envs import TIERS

    return [*SCENARIOS, *TIERS]


Scenario = Annotated[
    str,
    typer.Option(
        "--scenario",
        help="Training scenario, or wide: all scenarios mixed.",
        autocompletion=offering(world_names),
    ),
]
Seed = Annotated[int, typer.Option("--seed", min=0, help="Random seed.")]
Steps = Annotated[
    int | None,
    typer.Option(
        "--steps",
        min=1,
        help="Number of decisions (environment steps); default: the configuration's.",
    ),
]
Settings = Annotated[
    list[str] | None,
    typer.Option(
        "--set", help="Configuration value KEY=VALUE, such as learner.gamma=0.98; may be repeated."
    ),
]
ConfigFile = Annotated[
    Path | None,
    typer.Option("--config", help="YAML file of configuration values that replace the defaults."),
]


@expensive
def train(
    algorithm: Annotated[
        str,
        typer.Argument(
            help="Learning algorithm: sac, ppo, recurrent-ppo, td3 or recurrent-imitation.",
            autocompletion=offering(algorithm_names),
        ),
    ],
    scenario: Scenario = "base",
    seed: Seed = 0,
    steps: Steps = None,
    setting: Settings = None,
    config: ConfigFile = None,
    seeds: Annotated[
        int,
        typer.Option(
            min=1, help="Number of runs, with seeds counted from --seed, each in its own folder."
        ),
    ] = 1,
    search: Annotated[
        list[str] | None,
        typer.Option(help="Values to compare, KEY=VALUE|VALUE|..., one run each; may be repeated."),
    ] = None,
    cluster: Annotated[
        str | None, typer.Option(help="Address of a Ray cluster to train on, or local.")
    ] = None,
    out: Out = Path("results/train"),
) -> dict[str, Any]:
    """Train a policy. An interrupted run resumes from its last checkpoint, or, of
    recurrent-imitation, starts anew.

    Example: windwrench train sac --scenario base --seed 0 --steps 60000 --out results/sac-0
    """
    from ..runtime.errors import unknown_name
    from ..runtime.extras import need

    if algorithm not in algorithm_names():
        raise unknown_name("algorithm", algorithm, algorithm_names())
    need("stable_baselines3", "rl")
    if algorithm == "recurrent-ppo":
        need("sb3_contrib", "rl")
    if seeds > 1 or search or cluster:
        return _sweep(
            algorithm,
            scenario,
            range(seed, seed + seeds),
            steps,
            setting,
            search or [],
            config,
            cluster,
            out,
        )
    from ..training.algorithms import run_training as work

    return _learn(work, algorithm, scenario, seed, steps, setting, config, out)


def _sweep(
    algorithm: str,
    scenario: str,
    seeds: range,
    steps: int | None,
    setting: list[str] | None,
    search: list[str],
    config: Path | None,
    cluster: str | None,
    out: Path,
) -> dict[str, Any]:
    from ..runtime.extras import need
    from ..training.sweep import jobs_of, run_job, run_jobs
    from ..training.training_envs import check_training_env

    check_training_env(scenario)
    if cluster:
        need("ray", "cluster")
    overrides = [*(setting or []), *([f"steps={steps}"] if steps else [])]
    jobs = jobs_of(algorithm, scenario, seeds, overrides, search, config)
    folder = results_folder(out, runs=[job.name for job in jobs], cluster=cluster)
    with progress_bar() as progress:
        task = progress.add_task(f"{algorithm}, {scenario}", total=None if cluster else len(jobs))
        if cluster:
            found = run_jobs(jobs, folder, cluster)
        else:
            found = []
            for job in jobs:
                found.append(run_job(job, folder))
                progress.advance(task)
    table = Table("run", "validation RMSE (m)", "minutes", box=box.SIMPLE_HEAD)
    for one in sorted(found, key=lambda r: float(r["validation_rmse_m"])):
        table.add_row(one["run"], f"{one['validation_rmse_m']:.3f}", f"{one['seconds'] / 60:.1f}")
    console.print(table)
    say(*(Path(one["policy"]) for one in found))
    return {"runs": found}


@expensive
def imitate(
    scenario: Scenario = "base",
    seed: Seed = 0,
    steps: Steps = None,
    setting: Settings = None,
    config: ConfigFile = None,
    out: Out = Path("results/imitate"),
) -> dict[str, Any]:
    """Train a policy to imitate the oracle. With DAgger, from what a policy may observe.

    Example: windwrench imitate --scenario base --seed 0 --out results/imitation-0
    """
    from ..runtime.extras import need

    need("torch", "rl")
    from ..training.algorithms import run_training as work

    return _learn(work, "imitation", scenario, seed, steps, setting, config, out)


def _learn(
    work: Callable[..., Path],
    algorithm: str,
    scenario: str,
    seed: int,
    steps: int | None,
    setting: list[str] | None,
    config: Path | None,
    out: Path,
) -> dict[str, Any]:
    from ..training.configuration import load_config
    from ..training.train import Progress, read_progress
    from ..training.training_envs import check_training_env

    check_training_env(scenario)
    given = load_config(
        algorithm, [*(setting or []), *([f"steps={steps}"] if steps else [])], config
    )
    folder = results_folder(
        out,
        algorithm=algorithm,
        scenario=scenario,
        seed=seed,
        decisions=given["steps"],
        config=given,
    )
    with progress_bar() as progress:
        task = progress.add_task(f"{algorithm}, {scenario}", total=given["steps"])

        def report(now: Progress) -> None:
            progress.update(
                task, description=f"{algorithm}, {scenario}: validation RMSE {now.rmse_m[-1]:.3f} m"
            )
            console.print(
                f"{now.steps[-1]:8d} decisions: validation RMSE {now.rmse_m[-1]:.3f} m, "
                f"{now.lost[-1]} lost",
                highlight=False,
            )

        path = work(
            given,
            scenario,
            seed,
            folder,
            lambda done: progress.update(task, completed=done),
            report,
        )
    done = read_progress(folder)
    assert done is not None
    console.print(
        f"best: {done.best_rmse:.3f} m at {done.steps[done.best]} decisions; {done.seconds:.0f} s",
        highlight=False,
    )
    say(path, path.with_suffix(".json"), folder / "last.npz", folder / "progress.json")
    return {
        "policy": str(path),
        "validation_rmse_m": done.best_rmse,
        "seconds": done.seconds,
        "progress": done,
    }


def tunable_names() -> list[str]:
    """Return the controllers that have gains to tune."""
    from ..controllers import LAWS

    return list(LAWS)


@expensive
def tune(
    law: Annotated[
        str,
        typer.Argument(
            help="Controller: admittance, ratio, lead, admittance-pid, tracker, tracker-informed.",
            metavar="CONTROLLER",
            autocompletion=offering(tunable_names),
        ),
    ],
    scenario: Scenario = "base",
    trials: Annotated[int, typer.Option(min=1, help="Number of sets of gains to try.")] = 30,
    episodes: Annotated[
        int, typer.Option(min=1, help="Number of validation episodes per set of gains.")
    ] = 60,
    seed: Annotated[int, typer.Option(min=0, help="Random seed.")] = 0,
    out: Out = Path("results/tune"),
) -> dict[str, Any]:
    """Tune the gains of a designed controller. Search on validation episodes, write tuned.yaml.

    Example: windwrench tune admittance --scenario fast --trials 30 --episodes 60
    """
    from ..runtime.extras import need
    from ..training.seeds import validation_seeds
    from ..training.training_envs import check_training_env

    need("optuna", "rl")
    from ..training.tune import check_law, keep_gains
    from ..training.tune import tune as search

    check_law(law)
    check_training_env(scenario)
    validation_seeds(episodes)
    folder = results_folder(out, law=law, scenario=scenario, trials=trials, episodes=episodes)
    with progress_bar() as progress:
        task = progress.add_task(f"{law}, {scenario}", total=trials)
        found = search(
            law,
            scenario,
            trials,
            episodes,
            seed,
            lambda done: progress.update(task, completed=done),
        )
    keep_gains(found, folder / "tuned.yaml", shlex.join(["windwrench", *sys.argv[1:]]))
    gains = ", ".join(f"{name} {value:.3g}" for name, value in found["gains"].items())
    console.print(
        f"{law} on {scenario}: {gains}: {found['rmse_m']:.3f} m over {episodes} validation "
        f"episodes "
        f"(default gains: {found['default_rmse_m']:.3f} m)",
        highlight=False,
    )
    say(folder / "tuned.yaml")
    return found
