"""What is found of real faults: the comparisons and searches that the page counts."""

from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import binomtest

from windwrench import __version__
from windwrench.dynamics.vehicle_file import load_vehicle
from windwrench.identification.comparison.change import NOWHERE, Change, compare
from windwrench.identification.comparison.fault_channels import read_channels
from windwrench.identification.comparison.fault_detection import NOTHING, find_fault
from windwrench.identification.comparison.trim import trim_of_log
from windwrench.identification.comparison.words import fault_data
from windwrench.identification.logs.reading import read_log
from windwrench.runtime.errors import InputError
from windwrench.runtime.provenance import commit
from windwrench.studies.real_faults.flights import draw_flight
from windwrench.studies.real_faults.trims import draw_change

Report = Callable[[str, float], None]

# CrazyPAD's motors: m1 front-right, m2 rear-right, m3 rear-left, m4 front-left
PLACES = {
    "M1": "rotor 4 (front-right)",
    "M2": "rotor 3 (rear-right)",
    "M3": "rotor 2 (rear-left)",
    "M4": "rotor 1 (front-left)",
    "M1_M2": "right",
    "M2_M3": "rear",
    "M3_M4": "left",
    "M1_M4": "front",
}
_BINS = (0.0, 0.5, 0.8, 0.95, 1.0)


def run(data: Path, changes: int, flights: int, seed: int, report: Report) -> dict[str, Any]:
    """Run the study.

    Args:
        data: folder of the measured logs, with ``crazypad`` and ``motor_faults`` in it; what is
            absent is left out.
        changes: drawn comparisons.
        flights: simulated flights of each kind.
        seed: of the first.
        report: called with a part's name and the share that is done.
    """
    return {
        "version": __version__,
        "commit": commit(),
        "changes": changes,
        "flights": flights,
        "seed": seed,
        "crazypad": crazypad(data / "crazypad", report),
        "drawn_changes": drawn_changes(changes, seed, report),
        "motor_faults": motor_faults(data / "motor_faults", report),
        "drawn_faults": drawn_faults(flights, seed, report),
    }


def wilson(count: int, of: int) -> list[float]:
    """Return a share's 95 % interval, by Wilson's score."""
    if of == 0:
        return [0.0, 1.0]
    low, high = binomtest(count, of).proportion_ci(method="wilson")
    return [float(low), float(high)]


def truth_of(name: str) -> str:
    """Return the place that a CrazyPAD file's name tells.

    Raises:
        InputError: it tells none.
    """
    condition = name.split("__")[0]
    if condition.startswith("normal"):
        return NOWHERE
    words = condition.removeprefix("cut_propeller_").split("near_")[-1].split("_")
    motors = "_".join(word for word in words if word in ("M1", "M2", "M3", "M4"))
    if motors not in PLACES:
        raise InputError(f"{name}: its name tells no place; expected M1 to M4, or two neighbours")
    return PLACES[motors]


def crazypad(folder: Path, report: Report) -> list[dict[str, Any]]:
    """Compare every flight with the other normal flights of the same vehicle."""
    vehicle = load_vehicle("crazyflie")
    paths = sorted(folder.glob("*.csv.gz"))
    trims = {path.name: trim_of_log(read_log(path, "crazypad"), vehicle) for path in paths}
    rows = []
    for i, name in enumerate(trims):
        report("CrazyPAD", (i + 1) / len(trims))
        which = name.split("__")[1].split("_")[0]
        normal = [
            trim
            for other, trim in trims.items()
            if other.startswith("normal") and f"__{which}_" in other and other != name
        ]
        if normal:
            rows.append(_row(name, compare([trims[name]], normal)))
    return rows


def _row(name: str, change: Change) -> dict[str, Any]:
    """Return what a comparison says, beside the truth."""
    truth = truth_of(name)
    if_changed = max((p for p in change.places if p != NOWHERE), key=change.places.__getitem__)
    return {
        "flight": name.removesuffix(".csv.gz"),
        "truth": truth,
        "place": change.place,
        "probability": change.places[change.place],
        "if_changed": if_changed,
        "changed": 1.0 - change.places[NOWHERE],
        "sure": change.sure,
        "difference": change.difference.tolist(),
        "right": change.place == truth,
        "right_if_changed": truth == NOWHERE or if_changed == truth,
        "sure_and_wrong": change.sure and change.place != truth,
    }


def drawn_changes(count: int, seed: int, report: Report) -> dict[str, Any]:
    """Compare drawn sets of flights, and count how often each stated probability was right."""
    found: list[tuple[float, bool, str]] = []  # probability, right, truth
    said: list[tuple[float, bool, str]] = []  # and what was said
    for i in range(count):
        after, before, truth = draw_change(seed + i)
        change = compare(after, before)
        found.append((change.places[change.place], change.place == truth, truth))
        said.append((*found[-1][:2], change.place))
        report("drawn changes", (i + 1) / count)
    bins = []
    for low, high in pairwise(_BINS):
        inside = [(p, right) for p, right, _ in found if low < p <= high]
        right = sum(right for _, right in inside)
        bins.append(
            {
                "from": low,
                "to": high,
                "count": len(inside),
                "mean": float(np.mean([p for p, _ in inside])) if inside else None,
                "right": right,
                "ci95": wilson(right, len(inside)),
            }
        )
    sure = [(right, place) for p, right, place in said if p >= 0.95]
    return {
        "bins": bins,
        "sure": len(sure),
        "sure_of_a_wrong_place": sum(not right and place != NOWHERE for right, place in sure),
        "sure_of_nothing_and_wrong": sum(not right and place == NOWHERE for right, place in sure),
        "changed": sum(truth != NOWHERE for _, _, truth in found),
        "changed_right": sum(right for _, right, truth in found if truth != NOWHERE),
        "unchanged_right": sum(right for _, right, truth in found if truth == NOWHERE),
    }


def motor_faults(folder: Path, report: Report) -> list[dict[str, Any]]:
    """Search each ULog, and read from it what was commanded to fail, and when."""
    rows = []
    paths = sorted(folder.glob("*.ulg"))
    for i, path in enumerate(paths):
        channels, _ = read_channels(path)
        found = fault_data(find_fault(channels))
        found |= {"log": path.name, "commanded": commanded_fault(path)}
        rows.append(found)
        report("motor faults", (i + 1) / len(paths))
    return rows


def commanded_fault(path: Path) -> dict[str, Any] | None:
    """Return the motors that a log's topic ``rfly_ctrl_lxl`` commands to fail, what is left of
    them, and the interval (s) in which the command came: the topic's last sample without it and the
    first with it. None where the log has none.
    """
    from pyulog import ULog

    topics = ULog(str(path), ["rfly_ctrl_lxl"]).data_list
    for topic in topics:
        fields = topic.data
        on = np.flatnonzero(fields["mode"] != 0)
        if on.size and on[0] > 0:
            k = int(on[0])
            left = {f"PX4 motor {i + 1}": float(fields[f"controls[{i}]"][k]) for i in range(4)}
            return {
                "motors": {name: share for name, share in left.items() if share < 1.0},
                "between_s": [1e-6 * float(fields["timestamp"][j]) for j in (k - 1, k)],
            }
    return None


def drawn_faults(count: int, seed: int, report: Report) -> dict[str, Any]:
    """Search simulated flights: with a rotor fault, with none, with another force and torque."""
    rows = []
    kinds = (("fault", count), ("none", count // 2), ("other", count // 2))
    total = sum(n for _, n in kinds)
    for event, n in kinds:
        for i in range(n):
            rows.append(_searched(seed + i, event))
            report("drawn faults", len(rows) / total)
    return {"rows": rows}


def _searched(seed: int, event: str) -> dict[str, Any]:
    drawn = draw_flight(seed, event)
    row: dict[str, Any] = {"seed": seed, "event": event, "rotor": drawn.rotor, "loss": drawn.loss}
    try:
        found = find_fault(drawn.channels)
    except InputError as error:
        return row | {"refused": str(error)}
    rotor = found.likeliest if found.likeliest in ("1", "2", "3", "4") else None
    return row | {
        "likeliest": found.likeliest,
        "probability": found.probabilities[found.likeliest],
        "nothing": found.probabilities[NOTHING],
        "sure": found.sure,
        "named": None if rotor is None else int(rotor),
        "onset_error_s": found.onset[0] - drawn.onset if event != "none" else None,
        "onset_inside": bool(found.onset[1] <= drawn.onset <= found.onset[2]),
        "remaining": found.remaining[0],
        "remaining_inside": bool(found.remaining[1] <= 1.0 - drawn.loss <= found.remaining[2]),
    }
