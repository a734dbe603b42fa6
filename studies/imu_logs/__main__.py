"""``python -m studies.imu_logs``; ``--help`` lists what it takes."""

import argparse
from pathlib import Path

from windwrench.studies.imu_logs.imu_logs import run, save, tasks
from windwrench.studies.imu_logs.page import tables
from windwrench.studies.imu_logs.sensors import LOGS
from windwrench.studies.page_tables import put_between

if __name__ == "__main__":
    parser = argparse.ArgumentParser(prog="python -m studies.imu_logs")
    parser.add_argument("--seeds", type=int, default=1, help="how often every effect is flown")
    parser.add_argument("--jobs", type=int, default=1, help="processes")
    parser.add_argument("--log", action="append", choices=tuple(LOGS), help="only this kind of log")
    parser.add_argument("--out", type=Path, default=Path("results/imu_logs"))
    parser.add_argument("--page", type=Path, default=None, help="page whose tables are made anew")
    given = parser.parse_args()
    wanted = tasks(range(given.seeds), given.log or tuple(LOGS))
    outcomes = run(given.out, wanted, given.jobs)
    save(outcomes, given.out / "imu_logs.json.gz")
    put_between(tables(outcomes), given.page)
    print(tables(outcomes))
