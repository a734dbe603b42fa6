"""rl-zoo3's own training script on the environment: a file of settings and one option.

Install:  pip install torch rl_zoo3 windwrench
Run:      python zoo.py 3000    (or the command that it prints)
"""

import csv
import subprocess
import sys
import tempfile
from pathlib import Path

SETTINGS = Path(__file__).with_name("zoo_sac.yml")


def main(steps=3000):
    """Train for ``steps`` decisions; return the returns of its episodes."""
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, "-m", "rl_zoo3.train", "--algo", "sac"]
        command += ["--env", "windwrench/FanTracking-v0", "--gym-packages", "windwrench"]
        command += ["--env-kwargs", "normalize:True", "--conf-file", str(SETTINGS)]
        command += ["-n", str(steps), "--eval-freq", "-1", "--seed", "0", "-f", folder]
        print(" ".join(command[1:]), flush=True)
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
        (monitor,) = Path(folder).rglob("0.monitor.csv")
        lines = monitor.read_text(encoding="utf-8").splitlines()[1:]
    return [float(row["r"]) for row in csv.DictReader(lines)]


if __name__ == "__main__":
    from report import report

    wanted = int(sys.argv[1])
    libraries = ("rl_zoo3", "stable_baselines3", "torch", "gymnasium")
    report("rl-zoo3, SAC", libraries, wanted, lambda: main(wanted))
