"""The study: practice flights, each diagnosed as measured and behind each filter."""

import gzip
import json
import time
import zlib
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from windwrench.dynamics import Vehicle, load_vehicle
from windwrench.dynamics.effects import names
from windwrench.identification import FlightLog
from windwrench.identification.diagnosis import diagnose
from windwrench.identification.motion.noise_spectrum import noise_spectra, pose_was_filtered
from windwrench.runtime.errors import InputError
from windwrench.runtime.file_limits import LIMITS
from windwrench.runtime.page_files import write_json
from windwrench.runtime.regular_files import read_bytes
from windwrench.runtime.whole_files import replaced
from windwrench.studies.filtered_logs.filters import FILTERS
from windwrench.studies.resumed_tasks import run_tasks
from windwrench.studies.scored_flights import Truth, fly, refused, scored, truth_of
from windwrench.studies.trials.practice_flights import shown_in

VEHICLE = "ardrone2"
EMPTY = ("excite", "fast", "hover")  # trajectories flown with nothing added
SECONDS = 25.0  # of each flight


def flights(seeds: Iterable[int] = (0,)) -> list[tuple[str, str, int]]:
    """Return the flights: the added effect (empty: none), the trajectory and the seed."""
    return [
        flight
        for seed in seeds
        for flight in (
            *(("", trajectory, seed) for trajectory in EMPTY),
            *((name, shown_in(name)[0], seed) for name in names()),
        )
    ]


def fly_and_diagnose(effect: str, trajectory: str, seed: int) -> list[dict[str, Any]]:
    """Return what is found on one flight, once for each filter."""
    flown = fly(load_vehicle(VEHICLE), effect, trajectory, 1000 * (seed + 1), SECONDS)
    if flown is None:
        return []
    return [
        {
            "effect": effect,
            "trajectory": trajectory,
            "seed": seed,
            "filter": name,
            **_outcome(filtered(flown.log, flown.vehicle), flown.vehicle, truth_of(flown)),
        }
        for name, filtered in FILTERS.items()
    ]


def _outcome(log: FlightLog, vehicle: Vehicle, truth: Truth) -> dict[str, Any]:
    begun = time.perf_counter()
    spectra = {n.channel: (round(n.slope, 2), round(n.fall, 2)) for n in noise_spectra(log)}
    out: dict[str, Any] = {"detected": pose_was_filtered(log), "spectra": spectra}
    try:
        found = diagnose([log], vehicle)
    except InputError as error:
        return {**out, **refused(error)}
    return {
        **out,
        **scored(found, truth),
        "floor_force_rms_N": found.floor_force_rms,
        "seconds": round(time.perf_counter() - begun, 1),
    }


def run(
    folder: Path, seeds: Sequence[int] = (0,), jobs: int = 1, most: int | None = None
) -> list[dict[str, Any]]:
    """Fly and diagnose what is not yet in the folder's ``flights.jsonl``; return all outcomes."""
    done = run_tasks(fly_and_diagnose, flights(seeds)[:most], folder / "flights.jsonl", jobs)
    return [outcome for outcomes in done.values() for outcome in outcomes]


def resume(folder: Path, saved: Path) -> None:
    """Begin a folder with outcomes that were saved, unless it has its own; only flights that have
    an outcome for each filter count as done.

    Raises:
        InputError: they cannot be read.
    """
    path = folder / "flights.jsonl"
    if path.exists():
        return
    by_flight: dict[tuple[str, str, int], list[Any]] = {}
    for outcome in read_saved(saved):
        flight = (outcome["effect"], outcome["trajectory"], outcome["seed"])
        by_flight.setdefault(flight, []).append(outcome)
    lines = [
        json.dumps({"task": flight, "result": found}) + "\n"
        for flight, found in by_flight.items()
        if [o["filter"] for o in found] == list(FILTERS)
    ]
    with replaced(path) as partial:
        partial.write_text("".join(lines), encoding="utf-8")


def read_saved(path: Path) -> list[dict[str, Any]]:
    """Return outcomes that ``save`` wrote.

    Raises:
        InputError: they cannot be read.
    """
    what = "outcomes of this study, gzipped"
    try:
        outcomes: list[dict[str, Any]] = json.loads(
            gzip.decompress(read_bytes(path, what, LIMITS.json_text))
        )
    except (OSError, EOFError, zlib.error, ValueError) as error:
        raise InputError(f"{path}: cannot be read as {what}: {error}") from error
    return outcomes


def save(outcomes: Sequence[Mapping[str, Any]], path: Path) -> None:
    """Write the outcomes as gzipped JSON; ``path`` ends with ``.json.gz``."""
    path.parent.mkdir(parents=True, exist_ok=True)
    write_json(list(outcomes), path)
