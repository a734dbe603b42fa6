"""Learning: policies trained, and the gains of designed controllers tuned."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from ..runtime.errors import InputError
from ..runtime.extras import need
from .running import expensive
from .terminal import command_line, console, results_folder, say, show_table, working


@expensive
def train(
    algorithm: str,
    scenario: str = "base",
    seed: int = 0,
    steps: int | None = None,
    setting: list[str] | None = None,
    config: Path | None = None,
    seeds: int = 1,
    search: list[str] | None = None,
    cluster: str | None = None,
    out: Path = Path("results/train"),
) -> dict[str, Any]:
    """Train a policy, or tune a designed controller. An interrupted run resumes from its last
    checkpoint, or, of imitation and tune, starts anew.

    Example: windwrench train sac --scenario base --seed 0 --steps 60000 --out results/sac-0
    """
    need("stable_baselines3", "rl")
    if algorithm == "recurrent-ppo":
        need("sb3_contrib", "rl")
    overrides = [*(setting or []), *([f"steps={steps}"] if steps else [])]
    several = seeds > 1 or bool(search or cluster)
    if algorithm == "tune":
        if several:
            raise InputError("train tune: expected no --seeds, --search or --cluster")
        return _tune(scenario, seed, overrides, config, out)
    from ..training.training_envs import check_training_env

    check_training_env(scenario)
    if several:
        runs = range(seed, seed + seeds)
        return _sweep(algorithm, scenario, runs, overrides, search or [], config, cluster, out)
    return _learn(algorithm, scenario, seed, overrides, config, out)


def _sweep(
    algorithm: str,
    scenario: str,
    seeds: range,
    overrides: Sequence[str],
    search: list[str],
    config: Path | None,
    cluster: str | None,
    out: Path,
) -> dict[str, Any]:
    from ..training.sweep import jobs_of, run_job, run_jobs

    if cluster:
        need("ray", "cluster")
    jobs = jobs_of(algorithm, scenario, seeds, overrides, search, config)
    folder = results_folder(out, runs=[job.name for job in jobs], cluster=cluster)
    with working(f"{algorithm}, {scenario}", len(jobs)) as progress:
        if cluster:
            found = run_jobs(jobs, folder, cluster)
        else:
            found = []
            for job in jobs:
                found.append(run_job(job, folder))
                progress(more=1)
    best_first = sorted(found, key=lambda run: float(run["validation_rmse_m"]))
    show_table(
        ("run", "validation RMSE (m)", "minutes"),
        [
            (run["run"], f"{run['validation_rmse_m']:.3f}", f"{run['seconds'] / 60:.1f}")
            for run in best_first
        ],
    )
    say(*(Path(one["policy"]) for one in found))
    return {"runs": found}


def _learn(
    algorithm: str,
    scenario: str,
    seed: int,
    overrides: Sequence[str],
    config: Path | None,
    out: Path,
) -> dict[str, Any]:
    from ..training.configuration import load_config
    from ..training.run import Progress, read_progress
    from ..training.train import train

    given = load_config(algorithm, overrides, config)
    folder = results_folder(
        out,
        algorithm=algorithm,
        scenario=scenario,
        seed=seed,
        decisions=given["steps"],
        config=given,
    )
    with working(f"{algorithm}, {scenario}", given["steps"]) as progress:

        def report(now: Progress) -> None:
            told = f"validation RMSE {now.rmse_m[-1]:.3f} m"
            progress(text=f"{algorithm}, {scenario}: {told}")
            console.print(f"{now.steps[-1]:8d} decisions: {told}, {now.lost[-1]} lost")

        path = train(
            given,
            scenario,
            seed,
            folder,
            progress,
            report,
        )
    done = read_progress(folder)
    assert done is not None
    console.print(
        f"best: {done.best_rmse:.3f} m at {done.steps[done.best]} decisions; {done.seconds:.0f} s",
    )
    say(path, path.with_suffix(".json"), folder / "last.npz", folder / "progress.json")
    return {
        "policy": str(path),
        "validation_rmse_m": done.best_rmse,
        "seconds": done.seconds,
        "progress": done,
    }


def _tune(
    scenario: str, seed: int, overrides: Sequence[str], config: Path | None, out: Path
) -> dict[str, Any]:
    from ..training.configuration import load_config

    need("optuna", "rl")
    from ..training.tune import check_request, keep_gains, tune

    given = load_config("tune", overrides, config)
    task, law, trials, episodes = (
        given[name] for name in ("task", "controller", "trials", "episodes")
    )
    check_request(task, law, scenario, trials, episodes)
    folder = results_folder(
        out, task=task, controller=law, scenario=scenario, trials=trials, episodes=episodes
    )
    with working(f"{law}, {scenario}", trials) as progress:
        found = tune(law, scenario, trials, episodes, seed, progress, task)
    keep_gains(found, folder / "tuned.yaml", command_line())
    gains = ", ".join(f"{name} {value:.3g}" for name, value in found["gains"].items())
    console.print(
        f"{law} on {scenario}: {gains}: {found['rmse_m']:.3f} m over {episodes} validation "
        f"episodes (first gains: {found['default_rmse_m']:.3f} m)",
    )
    say(folder / "tuned.yaml")
    return found
