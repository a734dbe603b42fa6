"""Training a policy with stable-baselines3."""

from collections.abc import Callable, Sequence
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import Any

from ..controllers.registry import STANDARD_TASK
from ..controllers.trained_policy import TaskPolicy, TrainedPolicy
from ..evaluation.rewards import WeightedTerms, find_reward
from ..evaluation.tasks import import_files, task_of
from .configuration import Config, features_of
from .run import Progress, Run, progress_from
from .seeds import training_seed
from .training_envs import make_training_envs


def train(
    config: Config,
    scenario: str,
    seed: int,
    folder: Path,
    advance: Callable[[int], None] = lambda steps: None,
    report: Callable[[Progress], None] = lambda progress: None,
    stop_after: int | None = None,
    task: str = STANDARD_TASK,
    reward: str | None = None,
    imports: Sequence[str] = (),
    observation: str | None = None,
) -> Path:
    """Train a policy; return the path of the best one on the validation episodes.

    ``folder`` holds ``best.npz`` and ``last.npz`` with their cards, ``progress.json``,
    ``training.json``, TensorBoard's events, and ``checkpoint.pt``. A killed run resumes from its
    last checkpoint at the next call. Its policies equal those of an undisturbed run, bit for bit.

    Args:
        config: as of ``load_config``.
        scenario: scenario or tier to train in.
        seed: the run's.
        folder: for its files.
        advance: called with the number of decisions so far (over all environments).
        report: called after each validation.
        stop_after: decisions before an early return, at the next checkpoint; for tests.
        task: a name, as of ``evaluation.tasks.task_of``. FanTracking's policies see the features of
            the configuration, those of other tasks the observation.
        reward: one's own, as of ``evaluation.rewards.find_reward``; None: the configuration's in
            FanTracking, else the task's.
        imports: Python files that register a task, a scenario or a reward.
        observation: one of ``OBSERVATIONS``, seen in place of the task's own, or of features.

    Raises:
        InputError: an unknown name, a folder with another run, or a task without such a learner.
    """
    import_files(imports)
    standard = task == STANDARD_TASK and observation is None
    run = Run(config, scenario, seed, folder, task, reward, observation)
    from .checkpoint import load_checkpoint, save_checkpoint
    from .learners import make_learner, weights_of
    from .vec_env import FeatureVecEnv

    algorithm = config["algorithm"]
    whole = config["steps"]
    features = features_of(config) if standard else None
    envs = make_training_envs(
        scenario, config["environments"], config["estimator"], task, observation
    )
    chosen_reward = (
        find_reward(reward) if reward else WeightedTerms(config["reward"]) if standard else None
    )
    env = FeatureVecEnv(envs, features, partial(training_seed, seed), chosen_reward)
    seen = {} if standard else task_of(task).units(envs, run.judge)
    learner = make_learner(config, env, seed)
    learner.set_logger(_logger(folder))
    checkpoint = folder / "checkpoint.pt"
    if checkpoint.exists():
        run.progress = progress_from(load_checkpoint(learner, env, checkpoint), checkpoint)
    every = config["validation"]["every"]
    between = config["checkpoint"]

    def follow(collecting: dict[str, Any], _: dict[str, Any]) -> bool:
        """Tell the decisions so far, and the RMSE of finished training episodes."""
        advance(learner.num_timesteps)
        for info in collecting["infos"]:
            if "rmse" in info:
                learner.logger.record_mean("rollout/rmse_m", info["rmse"])
        return True

    while (done := learner.num_timesteps) < whole:
        validated = done // every
        target = min((validated + 1) * every, (done // between + 1) * between, whole)
        learner.learn(target - done, callback=follow, reset_num_timesteps=False, log_interval=4)
        done = learner.num_timesteps
        if done // every > validated or done >= whole:
            kind = TrainedPolicy if standard else TaskPolicy
            policy = kind(run.card(done) | seen, weights_of(learner, algorithm))
            run.take_stock(policy)
            report(run.progress)
            learner.logger.record("validation/rmse_m", run.progress.rmse_m[-1])
            learner.logger.record("validation/lost", run.progress.lost[-1])
            learner.logger.dump(done)
        else:
            run.write_progress()
        if done // between > (done - 1) // between or done >= whole:
            save_checkpoint(learner, env, asdict(run.progress), checkpoint)
            if stop_after is not None and done >= stop_after:
                break
    env.close()
    return run.best


def _logger(folder: Path) -> Any:
    from stable_baselines3.common.logger import configure

    try:
        import torch.utils.tensorboard  # noqa: F401
    except ImportError:
        return configure(str(folder), ["csv"])
    return configure(str(folder / "tensorboard"), ["tensorboard"])
