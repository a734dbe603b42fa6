"""The flight logs that the kit makes of every measured file and of a small file of each form.

``python -m tests.support.golden_logs`` writes ``tests/golden/logs.json`` anew. Do that only where a
change of a log is meant, and say in the commit which of the two numbers is right, and why.
"""

import json
import tempfile
import warnings
import zlib
from pathlib import Path

import numpy as np

from tests.fuzz.forms import forms, lay_out
from tests.support.data_paths import DATA, EXAMPLE, EXCERPTS
from tests.support.paths import ROOT
from windwrench.dynamics.vehicle_file import load_vehicle
from windwrench.identification import read_log
from windwrench.runtime.errors import InputError

GOLDEN = ROOT / "tests" / "golden" / "logs.json"
ENDINGS = (".csv", ".csv.gz", ".parquet", ".ulg", ".bin", ".bag", ".bbl")
ARRAYS = (
    *("t", "position", "quaternion", "rotor_speeds", "voltage", "force", "torque"),
    *("accelerometer", "gyro", "command", "valid"),
)
VEHICLES = {  # by folder; a path is that of a file beside the logs
    "crazypad": "crazyflie",
    "crazyswarm2": "crazyflie",
    "crazyswarm2_payload": "crazyflie",
    "crazyflie_imu": "crazyflie",
    "example": "crazyflie",
    "nanobench": "crazyflie",
    "idsia": "crazyflie",
    "flights": "vehicle.yaml",
    "racer": "vehicle.yaml",
}
MAPS = {  # a second way to read; one as a user writes it, of a table whose columns no reader knows
    "crazypad": "crazypad",
    "racer": "racer",
    "idsia": EXCERPTS / "written.yaml",
}
FORM_MAPS = {"crazyflie_csv": "cflib", "racer": "racer"}


def cases():
    """Return the names of all cases: ``ROOM/FOLDER/FILE`` and how it is read, behind a blank."""
    found = []
    for room, folder in (("shared", DATA), ("tests", EXCERPTS), ("shipped", EXAMPLE.parent)):
        for path in sorted(folder.glob("*/*")):
            is_log = path.name.lower().endswith(ENDINGS) or path.parent.name == "crazyflie_imu"
            is_bag = path.is_dir() and path.name.startswith("ros2_")
            if not (is_log or is_bag) or path.suffix in (".md", ".upstream"):
                continue
            if path.parent.name == "idsia" and "run1" not in path.name:
                continue
            name = f"{room}/{path.relative_to(folder)}"
            found += [f"{name} alone", f"{name} vehicle"]
            if path.parent.name in MAPS:
                found.append(f"{name} map")
    for name, form in forms().items():
        if form.file.startswith(("log", "flight")) and name not in ("topic map", "names"):
            found += [f"form/{name} alone", f"form/{name} vehicle"]
            if name in FORM_MAPS:
                found.append(f"form/{name} map")
    return found


def path_of(name):
    """Return the path of a measured file by its case's name."""
    room, _, rest = name.partition("/")
    return {"shared": DATA, "tests": EXCERPTS, "shipped": EXAMPLE.parent}[room] / rest


def vehicle_of(path):
    """Return the vehicle that flew a measured file, by its folder."""
    name = VEHICLES.get(path.parent.name, "ardrone2")
    return load_vehicle(path.parent / name if name.endswith(".yaml") else name)


def recorded(case):
    """Return what reading a case gives: a log in numbers, or an error line."""
    name, _, way = case.rpartition(" ")
    room, _, rest = name.partition("/")
    if room == "form":
        form = forms()[rest]
        with tempfile.TemporaryDirectory() as folder:
            path = lay_out(form, form.good(), Path(folder) / "log")
            flown = "crazyflie" if rest.startswith(("crazy", "nano")) else "ardrone2"
            return _recorded(path, way, load_vehicle(flown), FORM_MAPS.get(rest), Path(folder))
    path = path_of(name)
    return _recorded(path, way, vehicle_of(path), MAPS.get(path.parent.name), path.parent)


def _without_paths(text, folder):
    return text.replace(f"{folder}/", "").replace(f"{EXCERPTS}/", "")


def _recorded(path, way, vehicle, map_name, folder):
    flown = vehicle if way != "alone" else None
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            log = read_log(path, vehicle=flown, map=map_name if way == "map" else None)
    except InputError as error:
        return {"error": _without_paths(str(error), folder)}
    kept = {"vehicle": log.vehicle, "commanded": log.commanded, "arrays": {}}
    kept["notes"] = sorted(_without_paths(note, folder) for note in log.notes)
    arrays = {name: getattr(log, name) for name in ARRAYS}
    arrays |= {f"extra {name}": values for name, values in log.extra.items()}
    for name, values in arrays.items():
        if values is not None:
            kept["arrays"][name] = _summary(np.asarray(values, dtype=np.float64))
    return kept


def _summary(values):
    """Return shape, where numbers are finite, mean, root mean square, and a weighted sum in which
    each place counts for itself.
    """
    finite = np.isfinite(values)
    rows = int(finite.sum())
    summary = {"shape": list(values.shape), "finite": rows, "where": zlib.crc32(finite.tobytes())}
    if rows:
        flat = np.where(finite, values, 0.0).ravel()
        weights = np.cos(1.0 + 0.7 * np.arange(flat.size) % 11.0)
        rms = float(np.sqrt(np.sum(flat * flat) / rows))
        numbers = (flat.sum() / rows, rms, flat @ weights / rows)
        summary["numbers"] = [float(f"{x:.12g}") for x in numbers]
    return summary


def load_golden(whole=True):
    """Return what was recorded, by the cases' names; unless ``whole``, the name of another case
    stands for the same.
    """
    kept = json.loads(GOLDEN.read_bytes())
    if not whole:
        return kept
    return {case: kept[found] if isinstance(found, str) else found for case, found in kept.items()}


if __name__ == "__main__":
    kept = {}
    for case in cases():
        found = recorded(case)
        alike = f"{case.rpartition(' ')[0]} alone"
        kept[case] = alike if kept.get(alike) == found else found
    lines = [f"{json.dumps(case)}: {json.dumps(found)}" for case, found in kept.items()]
    GOLDEN.write_text("{\n" + ",\n".join(lines) + "\n}\n", encoding="utf-8")
    print(f"wrote {len(kept)} cases to {GOLDEN}")
