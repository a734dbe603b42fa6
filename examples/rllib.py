"""The environment in RLlib: one line registers it, one iteration of PPO shows that it runs.

One iteration learns nothing yet; PPO needs some hundred thousand decisions here, and SAC learns
sooner.

Install:  pip install '.[cluster]' 'ray[rllib]' torch    (in a checkout)
Run:      python examples/rllib.py
"""

import ray
from ray.rllib.algorithms.ppo import PPOConfig

from windwrench.training.rllib import register_with_rllib


def main(iterations=1, steps=1000, scenario="base"):
    """Do some iterations of PPO with ``steps`` decisions each; print and return the return of an
    episode after each.
    """
    register_with_rllib()
    started_here = not ray.is_initialized()
    if started_here:
        ray.init(include_dashboard=False, log_to_driver=False, logging_level="error")
    config = (
        PPOConfig()
        .environment("windwrench", env_config={"scenario": scenario, "estimator": "constant-gain"})
        .env_runners(num_env_runners=0)  # more: as many processes that fly
        .training(
            train_batch_size_per_learner=steps,
            minibatch_size=min(250, steps),
            num_epochs=4,
            gamma=0.95,
        )
    )
    algorithm = config.build_algo()
    found = []
    for i in range(iterations):
        flown = algorithm.train()["env_runners"]
        found.append(
            {
                "decisions": int(flown["num_env_steps_sampled_lifetime"]),
                "return": float(flown["episode_return_mean"]),
            }
        )
        print(
            f"iteration {i}: {found[-1]['decisions']} decisions, {found[-1]['return']:.1f} of at "
            f"most 250 reward an episode"
        )
    algorithm.stop()
    if started_here:
        ray.shutdown()
    return found


if __name__ == "__main__":
    main()
