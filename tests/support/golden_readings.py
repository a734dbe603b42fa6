"""What the kit says of the conventions of known logs: named right, not named, or named wrong.

``python -m tests.support.golden_readings`` writes ``tests/golden/readings.json`` anew. An answer
that was right and certain must stay so, and none may become wrong and certain.
"""

import json
import re
import tempfile
import warnings
from dataclasses import replace
from functools import cache
from pathlib import Path

from numpy.random import default_rng

from tests.support import golden_logs
from tests.support.data_paths import DATA, EXCERPTS
from tests.support.golden_logs import path_of, vehicle_of
from tests.support.hostile_conventions import HOSTILE
from tests.support.paths import ROOT
from tests.support.random_tables import fields_of, flight, random_table, save
from windwrench.dynamics.vehicle_file import load_vehicle
from windwrench.identification import read_log
from windwrench.identification.logs.map_guess import guess_map
from windwrench.identification.logs.screening import LEAST_SECONDS, screen_log
from windwrench.identification.logs.text_table import is_table, open_table
from windwrench.identification.report.log_check import check_log
from windwrench.runtime.errors import InputError

GOLDEN = ROOT / "tests" / "golden" / "readings.json"
TABLES = 60
FLIGHTS = (  # vehicle, trajectory, seed, seconds
    ("ardrone2", "excite", 1, 15.0),
    ("crazyflie", "hover", 2, 10.0),
    ("hummingbird", "circle", 3, 14.0),
    ("crazyflie", "fast", 4, 14.0),
    ("ardrone2", "gentle", 5, 14.0),
    ("hummingbird", "yaw", 6, 14.0),
)
# an estimate asks the same of conventions, and notes what a diagnosis refuses of parts
ESTIMATED = ("as it is", "conjugate", "rotors late", "rotors early")
MEASURED = {  # logs that are written in other conventions, too
    "nanobench": EXCERPTS / "nanobench" / "B5_helix_fast_rep2.csv.gz",
    "crazyswarm2": EXCERPTS / "crazyswarm2" / "log202.csv.gz",
    "racer": DATA / "racer" / "flight_e.csv.gz",
    "labelled": DATA / "flights" / "labelled_03.csv.gz",
}


@cache
def flown(index):
    """Return one of the simulated flights."""
    return flight(*FLIGHTS[index])


def files():
    """Return the measured files by their names."""
    names = (case.rpartition(" ")[0] for case in golden_logs.cases())
    return {name: path_of(name) for name in names if not name.startswith("form/")}


def cases():
    """Return the names of all cases."""
    found = [f"file {name}" for name in files()]
    found += [f"table {name}" for name, path in files().items() if is_table(path)]
    found += [f"random {number}" for number in range(TABLES)]
    return found + [f"hostile {name}" for name in (*map(str, range(len(FLIGHTS))), *MEASURED)]


def recorded(case, every=1):
    """Return what is said of a case, of hostile conventions of each so many."""
    way, _, name = case.partition(" ")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        if way == "hostile":
            return _hostile(name, every)
        return {"file": _file, "table": _table, "random": _random}[way](name)


def _plain(text, folder):
    """Return a sentence without its paths and without a list of columns."""
    return text.replace(f"{folder}/", "").partition("; found t")[0]


def available(case):
    """Return whether a case's file is there."""
    way, _, name = case.partition(" ")
    if way == "hostile" and name in MEASURED:
        return MEASURED[name].exists()
    return way in ("random", "hostile") or name in files()


def _file(name):
    path = path_of(name)
    try:
        found = check_log(path, vehicle=vehicle_of(path))
    except InputError as error:
        return {"error": _plain(str(error), path.parent)}
    said = [d for d in found.doubts if not d.startswith("guessed")]
    return {
        "read_by": found.read_by,
        "doubts": [_plain(text, path.parent) for text in said],
    }


def _fields(guess):
    """Return the fields of a guessed map by their names, each with whether it is certain."""
    doubtful = {(r.section, r.field) for r in guess.doubts}
    return {
        "/".join(key): (str(value), key not in doubtful)
        for key, value in fields_of(guess.log_map).items()
    }


def _table(name):
    path = path_of(name)
    said = {}
    for way, model in (("alone", None), ("vehicle", vehicle_of(path))):
        try:
            guess = guess_map(open_table(path), model)
            if guess.missing:
                raise InputError(guess.lacks)
            found = _fields(guess)
        except InputError as error:
            said[way] = {"error": _plain(str(error), path.parent)}
        else:
            said[way] = {
                key: value if sure else f"{value} (a guess)" for key, (value, sure) in found.items()
            }
    return {"both": said["alone"]} if said["alone"] == said["vehicle"] else said


def random_case(number):
    """Return a flight's table in a random convention, and the vehicle by which it is guessed."""
    log = flown(number % len(FLIGHTS))
    written = random_table(log, default_rng(7000 + number))
    return written, load_vehicle(log.vehicle) if number // len(FLIGHTS) % 2 else None


def _random(name):
    written, vehicle = random_case(int(name))
    with tempfile.TemporaryDirectory() as folder:
        table = open_table(save(written, Path(folder) / "table.csv"))
        found = _fields(guess_map(table, vehicle))
    said = {"right": [], "right guess": [], "wrong guess": [], "wrong": []}
    true = {"/".join(key): value for key, value in fields_of(written.log_map).items()}
    for key in sorted(set(found) | set(true)):
        value, is_sure = found.get(key, (None, False))
        is_right = value == str(true.get(key))
        said[f"{'right' if is_right else 'wrong'}{'' if is_sure else ' guess'}"].append(key)
    return {verdict: " ".join(fields) for verdict, fields in said.items() if fields}


def _hostile(name, every):
    if name in MEASURED:
        vehicle = vehicle_of(MEASURED[name])
        log = read_log(MEASURED[name], vehicle=vehicle)
    else:
        log = replace(flown(int(name)), accelerometer=None, gyro=None, command=None)
        vehicle = load_vehicle(log.vehicle)
    log = replace(log, source="flight.csv")
    said = {"diagnosis": {}, "estimate": {}}
    for use, least, kinds in (
        ("diagnosis", LEAST_SECONDS, ("as it is", *HOSTILE)[::every]),
        ("estimate", None, ESTIMATED),
    ):
        for kind in kinds:
            make, words = HOSTILE.get(kind, (lambda same: same, "^$"))
            told = _screened(make(log), vehicle, least, words)
            said[use].setdefault(told, []).append(kind)
    return said


def _screened(log, vehicle, least, words):
    """Return whether a log's convention was named, or the sentence by which it was refused."""
    try:
        notes = screen_log(log, vehicle, least)[1]
    except InputError as error:
        text = str(error).removeprefix("flight.csv: ")
        return "named" if re.search(words, text) else text
    return "named" if any(re.search(words, note) for note in notes) else "passed"


def load_golden():
    """Return what was recorded, by the cases' names."""
    return json.loads(GOLDEN.read_bytes())


if __name__ == "__main__":
    lines = [f"{json.dumps(case)}: {json.dumps(recorded(case))}" for case in cases()]
    GOLDEN.write_text("{\n" + ",\n".join(lines) + "\n}\n", encoding="utf-8")
    print(f"wrote {len(lines)} cases to {GOLDEN}")
