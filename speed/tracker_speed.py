"""How long a decision of a tracker takes: ``python -m windwrench.speed.tracker_speed``.

Each flies validation episodes of fan tracking once, then what it saw is decided on again, the
trackers in turn, and every decision is timed by processor time. The slowest are those that draw
particles anew.
"""

import argparse
import time
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..controllers import make_controller
from ..envs.fan_tracking import FanTrackingEnv
from ..evaluation.briefing import briefing_of
from ..evaluation.episodes import fly_episode

TRACKERS = ("tracker", "tracker-informed")
FIRST = 900_001  # seed, of validation


def measured(
    episodes: int = 5, rounds: int = 3, decisions: int = 250
) -> dict[str, NDArray[np.float64]]:
    """Return the times (ms) of all decisions of each tracker."""
    env = FanTrackingEnv("base")
    pilots: dict[str, Any] = {name: make_controller(name) for name in TRACKERS}
    seen = {
        name: [
            fly_episode(env, pilot, FIRST + k, decisions=decisions).observation
            for k in range(episodes)
        ]
        for name, pilot in pilots.items()
    }
    times: dict[str, list[float]] = {name: [] for name in TRACKERS}
    for _ in range(rounds):
        for name, pilot in pilots.items():
            pilot.brief(briefing_of(env))
            for flown in seen[name]:
                pilot.reset()
                for observation in flown:
                    begin = time.process_time()
                    pilot(observation)
                    times[name].append(1e3 * (time.process_time() - begin))
    return {name: np.array(each) for name, each in times.items()}


def main() -> None:
    """Print a row for each tracker."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--episodes", type=int, default=5)
    parser.add_argument("--rounds", type=int, default=3)
    given = parser.parse_args()
    print("| tracker | decisions | median (ms) | 99 % within (ms) |\n| - | -: | -: | -: |")
    for name, each in measured(given.episodes, given.rounds).items():
        print(f"| {name} | {len(each)} | {np.median(each):.2f} | {np.quantile(each, 0.99):.2f} |")


if __name__ == "__main__":
    main()
