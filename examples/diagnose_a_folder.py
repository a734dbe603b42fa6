"""Diagnose every log of a folder, in as many processes as there are cores, and write one table.

A log that is refused has its error in the table, and the others go on.

Install:  pip install .    (in a checkout)
Logs:     windwrench record --effect rotor_drag --seconds 30 --out results/logs/drag.csv    (some,
of one vehicle) Run:      python examples/diagnose_a_folder.py results/logs ardrone2
"""

import csv
import os
import sys
from functools import partial
from pathlib import Path

from windwrench.dynamics import InputError, load_vehicle
from windwrench.identification.diagnosis import diagnose
from windwrench.identification.logs.reading import read_log
from windwrench.runtime.workers import every

COLUMNS = ("log", "verdict", "effects", "force_before_N", "force_after_N", "error")


def diagnose_one(path, vehicle):
    """Return the row of one log; ``vehicle`` is a preset's name or the path of a vehicle file."""
    row = dict.fromkeys(COLUMNS, "")
    row["log"] = path.name
    try:
        model = load_vehicle(vehicle)
        found = diagnose([read_log(path, vehicle=model)], model)
    except InputError as error:
        row["error"] = str(error)
        return row
    row["verdict"] = found.verdict
    row["effects"] = "; ".join(
        effect.name
        + (" (tentative)" if effect.tentative else "")
        + ": "
        + ", ".join(
            f"{name} = {value:.3g} {effect.units[name]}"
            for name, value in effect.coefficients.items()
        )
        for effect in found.effects
    )
    row["force_before_N"], row["force_after_N"] = (
        f"{found.before.force_rms:.4f}",
        f"{found.after.force_rms:.4f}",
    )
    return row


def main(folder="results/logs", vehicle="ardrone2", out=None):
    """Diagnose all CSV logs in ``folder``; write, print and return the table (default:
    ``folder/diagnoses/summary.csv``).
    """
    logs = sorted(Path(folder).glob("*.csv"))
    if not logs:
        raise InputError(f"{folder}: holds no .csv file; expected a folder of flight logs")
    load_vehicle(vehicle)  # a mistake in the vehicle is no log's
    work = partial(diagnose_one, vehicle=vehicle)
    found = dict(every(work, logs, min(len(logs), len(os.sched_getaffinity(0)))))
    rows = [found[log] for log in logs]
    table = Path(out) if out else Path(folder) / "diagnoses" / "summary.csv"
    table.parent.mkdir(parents=True, exist_ok=True)
    with open(table, "w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, COLUMNS)
        writer.writeheader()
        writer.writerows(rows)
    for row in rows:
        print(
            f"{row['log']}: {row['error'] or row['verdict']}"
            + (f": {row['effects']}" if row["effects"] else "")
        )
    print(table)
    return rows


if __name__ == "__main__":
    main(*sys.argv[1:])
