"""``python -m studies.imu_logs``; ``--help`` lists what it takes."""

import argparse
from pathlib import Path

from windwrench.studies.imu_logs.imu_logs import run, save
from windwrench.studies.imu_logs.page import write_table

if __name__ == "__main__":
    parser = argparse.ArgumentParser(prog="python -m studies.imu_logs")
    parser.add_argument("--seeds", type=int, default=1, help="how often every effect is flown")
    parser.add_argument("--jobs", type=int, default=1, help="processes")
    parser.add_argument("--flights", type=int, default=None, help="only the first so many")
    parser.add_argument("--out", type=Path, default=Path("results/imu_logs"))
    parser.add_argument("--page", type=Path, default=None, help="page whose tables are made anew")
    given = parser.parse_args()
    outcomes = run(given.out, range(given.seeds), given.jobs, given.flights)
    save(outcomes, given.out / "imu_logs.json")
    print(write_table(outcomes, given.page))
