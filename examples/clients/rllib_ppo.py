"""RLlib's PPO on the environment, as examples/rllib.py has it.

Install:  pip install 'ray[rllib]' torch windwrench
Run:      python rllib_ppo.py 3000
"""

import importlib.util
import sys
from pathlib import Path


def main(steps=3000):
    """Train for ``steps`` decisions, 1000 an iteration; return the mean returns after each."""
    path = Path(__file__).parents[1] / "rllib.py"
    spec = importlib.util.spec_from_file_location("rllib_example", path)
    example = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(example)
    return [found["return"] for found in example.main(max(steps // 1000, 1), min(steps, 1000))]


if __name__ == "__main__":
    from report import report

    wanted = int(sys.argv[1])
    report("RLlib, PPO", ("ray", "torch", "gymnasium"), wanted, lambda: main(wanted))
