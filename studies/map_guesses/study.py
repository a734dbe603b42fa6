"""The study: random tables, the map that is guessed for each, and which of its fields are wrong."""

import tempfile
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import binomtest

from windwrench.dynamics import load_vehicle
from windwrench.identification.logs.layout_guess import open_any_table
from windwrench.identification.logs.log_map import Commands, LogMap, Rotors
from windwrench.identification.logs.map_guess import Guess, guess_map
from windwrench.runtime.errors import InputError
from windwrench.studies.map_guesses.random_tables import (
    TRAJECTORIES,
    VEHICLES,
    flight,
    random_table,
    save,
)

Field = tuple[str, str]


def fields_of(m: LogMap) -> dict[Field, Any]:
    """Return what a map's fields mean, each once, however they are written."""
    out: dict[Field, Any] = {
        ("time", "column"): m.time.column,
        ("time", "unit"): m.time.unit,
    }
    if m.position is not None:
        out |= {
            ("world", ""): m.world,
            ("body", ""): m.body,
            ("position", "columns"): m.position.columns,
            ("position", "unit"): m.position.unit,
        }
    if (a := m.attitude) is not None:
        out["attitude", "sense"] = a.sense
        if a.euler:
            out |= {
                ("attitude", "columns"): a.columns,
                ("attitude", "euler"): a.euler,
                ("attitude", "unit"): a.unit,
                ("attitude", "signs"): a.signs or (1, 1, 1),
            }
        else:
            out["attitude", "order"] = tuple(a.columns[a.order.index(x)] for x in "wxyz")
    for name in ("rotors", "commands"):
        part = getattr(m, name)
        if part is not None:
            out |= {
                (name, "columns"): tuple(sorted(part.columns)),
                (name, "unit"): part.unit,
                (name, "order"): tuple(part.columns[i - 1] for i in part.order),
            }
            if isinstance(part, Rotors):
                out[name, "pole_pairs"] = part.pole_pairs
            if isinstance(part, Commands):
                out[name, "range"] = part.range
    for name in ("accelerometer", "gyro"):
        part = getattr(m, name)
        if part is not None:
            out |= {
                (name, "columns"): part.columns,
                (name, "unit"): part.unit,
                (name, "body"): part.body or m.body,
            }
    if m.battery is not None:
        out |= {
            ("battery", "column"): m.battery.columns,
            ("battery", "unit"): m.battery.unit,
        }
    return out


def judge(guess: Guess, truth: LogMap) -> tuple[list[Field], list[Field]]:
    """Return the fields that are wrong and marked as guesses (or whose columns are listed as not
    used), and those that are wrong and marked as certain.
    """
    doubtful = {(r.section, r.field) for r in guess.doubts}
    found, true = fields_of(guess.log_map), fields_of(truth)
    flagged: list[Field] = []
    silent: list[Field] = []
    motors = {"rotors", "commands"}
    for key in sorted(set(found) | set(true)):
        if found.get(key) == true.get(key):
            continue
        section = key[0]
        if key not in found:
            # a channel that was not found is listed among the columns that are not used
            other = next((s for s in motors if (s, "unit") in found), "")
            unsure = section not in motors or (other, "unit") in doubtful
            (flagged if unsure else silent).append(key)
        elif key in doubtful or (section in motors and (section, "unit") in doubtful):
            flagged.append(key)
        else:
            silent.append(key)
    return flagged, silent


def run(count: int, seed: int, told: bool, report: Callable[[float], None]) -> dict[str, Any]:
    """Return how many of ``count`` random tables are guessed right, flagged or silently wrong.

    Args:
        count: tables.
        seed: of everything random.
        told: whether the vehicle is given.
        report: called with the share that is done.
    """
    rng = np.random.default_rng(seed)
    flights = [flight(v, t, seed + i) for i, v in enumerate(VEHICLES) for t in TRAJECTORIES]
    outcomes: Counter[str] = Counter()
    wrong: Counter[str] = Counter()
    silently: list[str] = []
    with tempfile.TemporaryDirectory() as folder:
        for k in range(count):
            report(k / count)
            log = flights[int(rng.integers(len(flights)))]
            written = random_table(log, rng)
            path = save(written, Path(folder) / "table.csv")
            try:
                table, layout = open_any_table(path)
                guess = guess_map(table, layout, load_vehicle(log.vehicle) if told else None)
            except InputError as error:
                outcomes["refused"] += 1
                wrong[f"refused: {str(error)[-80:]}"] += 1
                continue
            flagged, silent = judge(guess, written.log_map)
            wrong.update(
                f"{a}.{b} {'flagged' if (a, b) in flagged else 'silent'}"
                for a, b in (*flagged, *silent)
            )
            if silent:
                outcomes["silently wrong"] += 1
                silently.append(f"{k} {log.name}: {silent}: {written.log_map}")
            elif flagged:
                outcomes["wrong and flagged"] += 1
            elif guess.doubts:
                outcomes["right, with doubts"] += 1
            else:
                outcomes["right and certain"] += 1
    return {
        "tables": count,
        "vehicle_given": told,
        "outcomes": {name: [n, *interval(n, count)] for name, n in sorted(outcomes.items())},
        "silently_wrong_interval": [
            outcomes["silently wrong"],
            *interval(outcomes["silently wrong"], count),
        ],
        "fields": dict(wrong.most_common()),
        "silent": silently,
    }


def interval(count: int, whole: int) -> tuple[float, float]:
    """Return the 95 % interval (Wilson) of a share."""
    low, high = binomtest(count, whole).proportion_ci(method="wilson")
    return round(float(low), 4), round(float(high), 4)
