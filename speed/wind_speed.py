"""How fast the tasks in the wind fly on one core: ``python -m windwrench.speed.wind_speed``.

Simulated seconds a second of processor time, with the full filter; the median over rounds, and the
fastest. The fan-tracking environment is flown beside them, as a measure of the machine.
"""

import argparse
import statistics
import time
from collections.abc import Callable
from typing import Any

import gymnasium as gym
import numpy as np

_SECONDS = 8.0  # of flight in a round
CASES = (
    ("FanTracking", "base", 0.08),
    ("FanTracking2D", "base", 0.08),
    ("WindHover", "calm", 0.04),
    ("WindHover", "turbulent", 0.04),
    ("WindHover", "fan-wall", 0.04),
    ("WindHover", "base", 0.04),
    ("WindTrajectory", "base", 0.04),
)


def flying(task: str, scenario: str, period: float) -> Callable[[], float]:
    """Return what flies a round and returns how many times faster than real time it went."""
    env: Any = gym.make(
        f"windwrench:windwrench/{task}-v0", scenario=scenario, disable_env_checker=True
    ).unwrapped
    action = np.zeros(env.action_space.shape, dtype=np.float32)
    env.reset(seed=0)
    steps = round(_SECONDS / period)

    def run() -> float:
        env.reset(seed=0)
        begin = time.process_time()
        for _ in range(steps):
            env.step(action)
        return steps * period / (time.process_time() - begin)

    run()  # compiles
    return run


def measured(rounds: int = 5) -> list[dict[str, Any]]:
    """Return a row for each task and scenario, measured in turn, round by round."""
    runs = [flying(*case) for case in CASES]
    figures: list[list[float]] = [[] for _ in CASES]
    for _ in range(rounds):
        for run, kept in zip(runs, figures, strict=True):
            kept.append(run())
    return [
        {"task": task, "scenario": scenario, "median": statistics.median(f), "fastest": max(f)}
        for (task, scenario, _), f in zip(CASES, figures, strict=True)
    ]


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=5)
    print("| task | scenario | times real time, one core: median | fastest |\n| - | - | -: | -: |")
    for row in measured(parser.parse_args().rounds):
        print(f"| {row['task']} | {row['scenario']} | {row['median']:.0f} | {row['fastest']:.0f} |")


if __name__ == "__main__":
    main()
