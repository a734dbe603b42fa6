"""Learning: policies trained, and the gains of designed controllers tuned."""

from functools import partial
from pathlib import Path
from typing import Any

from ..controllers.registry import STANDARD_TASK
from ..runtime.errors import InputError
from ..runtime.extras import need
from ..runtime.workers import every
from .running import expensive
from .terminal import command_line, console, results_folder, say, working


@expensive
def train(
    algorithm: str,
    scenario: str | None = None,
    task: str | None = None,
    observation: str | None = None,
    reward: str | None = None,
    imports: list[str] | None = None,
    seed: int = 0,
    steps: int | None = None,
    setting: list[str] | None = None,
    config: Path | None = None,
    cluster: str | None = None,
    out: Path = Path("results/train"),
) -> dict[str, Any]:
    """Train a policy, or tune a designed controller. An interrupted run resumes from its last
    checkpoint; tune starts anew.

    Example: windwrench train sac --scenario base --seed 0 --steps 60000 --out results/sac-0
    """
    from ..evaluation.rewards import find_reward
    from ..evaluation.tasks import import_files
    from ..training.configuration import load_config
    from ..training.run import Progress, read_progress
    from ..training.train import train as learn
    from ..training.training_envs import training_task

    need("stable_baselines3", "rl")
    if algorithm == "recurrent-ppo":
        need("sb3_contrib", "rl")
    import_files(imports or ())
    known = training_task(task or STANDARD_TASK)
    if reward is not None:
        find_reward(reward)
    values = [*(setting or []), *([f"steps={steps}"] if steps else [])]
    if algorithm == "tune":
        if cluster or reward or observation:
            raise InputError("train tune: takes no --cluster, --reward or --observation")
        values = [*([f"task={task}"] if task else []), *values]
        return _tune(load_config(algorithm, values, config), scenario or "base", seed, out)
    given = load_config(algorithm, values, config, task=task)
    scenario = scenario or known.flown_in
    known.scenario(scenario)
    if cluster:
        need("ray", "cluster")
    what: dict[str, Any] = {
        "task": task or STANDARD_TASK,
        "observation": observation,
        "reward": reward,
        "imports": tuple(imports or ()),
    }
    folder = results_folder(
        out,
        algorithm=given["algorithm"],
        **what,
        scenario=scenario,
        seed=seed,
        decisions=given["steps"],
        config=given,
    )
    told = f"{given['algorithm']}, {scenario}"
    with working(told, given["steps"]) as progress:

        def report(now: Progress) -> None:
            progress(text=f"{told}: validation {now.words(-1)}")
            figures = f"validation {now.words(-1)}, {now.lost[-1]} lost"
            console.print(f"{now.steps[-1]:8d} decisions: {figures}")

        if cluster:  # a run whose worker is lost resumes elsewhere, from its last checkpoint
            there = partial(learn, given, scenario, seed, **what)
            ((_, path),) = every(there, [folder.resolve()], cluster=cluster)
        else:
            path = learn(given, scenario, seed, folder, progress, report, **what)
    done = read_progress(folder)
    assert done is not None
    console.print(
        f"best: {done.words(done.best)} at {done.steps[done.best]} decisions; {done.seconds:.0f} s",
    )
    say(path, path.with_suffix(".json"), folder / "last.npz", folder / "progress.json")
    return {
        "policy": str(path),
        "validation_rmse_m": done.best_rmse,
        "seconds": done.seconds,
        "progress": done,
    }


def _tune(given: dict[str, Any], scenario: str, seed: int, out: Path) -> dict[str, Any]:
    need("optuna", "rl")
    from ..training.tune import check_request, keep_gains, tune

    task, law, trials, episodes = (
        given[name] for name in ("task", "controller", "trials", "episodes")
    )
    check_request(task, law, scenario, trials, episodes)
    folder = results_folder(
        out, task=task, controller=law, scenario=scenario, trials=trials, episodes=episodes
    )
    with working(f"{law}, {scenario}", trials) as progress:
        result = tune(law, scenario, trials, episodes, seed, progress, task)
    keep_gains(result, folder / "tuned.yaml", command_line())
    gains = ", ".join(f"{name} {value:.3g}" for name, value in result["gains"].items())
    console.print(
        f"{law} on {scenario}: {gains}: {result['rmse_m']:.3f} m over {episodes} validation "
        f"episodes (first gains: {result['default_rmse_m']:.3f} m)",
    )
    say(folder / "tuned.yaml")
    return result
