"""CleanRL's SAC and PPO: the scripts of its wheel, run as they are with the shims they need.

The wheel (1.2.0) asks for Python below 3.11 and libraries of 2023; without its requirements it runs
on today's. The environment is ``normalize=True``: a network gets numbers of about 1.

Install:  pip install --no-deps --ignore-requires-python cleanrl==1.2.0
          pip install torch stable-baselines3 tensorboard windwrench
Run:      python cleanrl_scripts.py sac 3000    (or ppo)
"""

import functools
import re
import runpy
import sys
import tempfile
from contextlib import chdir, redirect_stdout
from importlib.util import find_spec
from io import StringIO
from pathlib import Path

import gymnasium
import old_gym
from gymnasium.vector import AutoresetMode, SyncVectorEnv

import windwrench  # noqa: F401  (registers the environment)

REQUIREMENTS = "requirements of 2023 (Python < 3.11, stable-baselines3 1.2.0) left out"
SHIMS = {
    "sac": [
        "a module `gym` 0.23 made of Gymnasium, which is what it became (`old_gym.py`)",
        REQUIREMENTS,
    ],
    "ppo": [
        "`TransformObservation` is told the space, which Gymnasium asks for since 1.0",
        "`SyncVectorEnv` with `AutoresetMode.SAME_STEP`, its only way before Gymnasium 1.0",
        "`final_info` as a list, as before Gymnasium 1.0",
        REQUIREMENTS,
    ],
}
NAME = "windwrench-normalized-v0"  # the scripts name a folder after it, so without a slash


class OldSyncVector(SyncVectorEnv):
    """Gymnasium's, with the restarts and the ``final_info`` that it had before 1.0."""

    def __init__(self, makers):
        super().__init__(makers, autoreset_mode=AutoresetMode.SAME_STEP)

    def step(self, actions):
        """Step; ``final_info`` becomes a list."""
        *found, infos = super().step(actions)
        last = infos.get("final_info")
        if last is not None:
            episode, done = last["episode"], infos["_final_info"]
            infos["final_info"] = [
                {"episode": {key: episode[key][i : i + 1] for key in ("r", "l")}} if over else None
                for i, over in enumerate(done)
            ]
        return *found, infos


def main(algorithm="sac", steps=3000):
    """Run a script for ``steps`` decisions; return the returns of its episodes."""
    script = {"sac": "sac_continuous_action", "ppo": "ppo_continuous_action"}[algorithm]
    path = Path(find_spec("cleanrl").submodule_search_locations[0]) / f"{script}.py"
    gymnasium.register(
        NAME,
        entry_point="windwrench.envs.fan_tracking:FanTrackingEnv",
        kwargs={"scenario": "base", "normalize": True},
        max_episode_steps=250,
    )
    given = ["--env-id", NAME, "--total-timesteps", str(steps), "--cuda", "False"]
    if algorithm == "sac":
        old_gym.install()
        given += ["--learning-starts", "500", "--buffer-size", "10000", "--gamma", "0.9"]
    else:
        gymnasium.vector.SyncVectorEnv = OldSyncVector
        new = gymnasium.wrappers.TransformObservation
        gymnasium.wrappers.TransformObservation = lambda env, f: new(env, f, env.observation_space)
        given += ["--num-steps", "500", "--gamma", "0.9"]
    told = StringIO()
    before, sys.argv = sys.argv, [str(path), *given]
    try:
        with tempfile.TemporaryDirectory() as folder, chdir(folder), redirect_stdout(told):
            runpy.run_path(str(path), run_name="__main__")
    finally:
        sys.argv = before
    return [float(r) for r in re.findall(r"episodic_return=\[?\s*([-\d.]+)", told.getvalue())]


if __name__ == "__main__":
    from report import report

    algorithm, steps = sys.argv[1], int(sys.argv[2])
    report(
        f"CleanRL, {algorithm.upper()}",
        ("cleanrl", "torch", "gymnasium"),
        steps,
        functools.partial(main, algorithm, steps),
        SHIMS[algorithm],
    )
