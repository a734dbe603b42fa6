"""The study: practice flights, each diagnosed as measured and behind each filter."""

import json
import time
from collections.abc import Iterable, Mapping, Sequence
from concurrent.futures import as_completed
from pathlib import Path
from typing import Any

import numpy as np

from windwrench.dynamics import load_vehicle
from windwrench.dynamics.effects import names
from windwrench.identification.diagnosis import diagnose
from windwrench.identification.motion.noise_spectrum import noise_spectra, pose_was_filtered
from windwrench.runtime.errors import InputError
from windwrench.runtime.page_files import write_json
from windwrench.runtime.regular_files import read_json
from windwrench.runtime.whole_files import replaced
from windwrench.runtime.workers import workers
from windwrench.studies.filtered_logs.filters import FILTERS
from windwrench.studies.trials.practice_flights import practise, shown_in
from windwrench.studies.trials.scores import coefficient_errors, match

VEHICLE = "ardrone2"
EMPTY = ("excite", "fast", "hover")  # trajectories flown with nothing added
SECONDS = 25.0  # of each flight
_ATTEMPTS = 4  # draws of a flight that a flight loop may be unable to fly


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
    vehicle = load_vehicle(VEHICLE)
    for attempt in range(_ATTEMPTS):
        try:
            flown = practise(
                vehicle,
                "effect" if effect else "nothing",
                (effect,) if effect else (),
                "typical",
                trajectory,
                1000 * (seed + 1) + attempt,
                SECONDS,
            )
            break
        except InputError:
            continue
    else:
        return []
    truth = {e.name: dict(e.coefficients) for e in flown.effects}
    return [
        {
            "effect": effect,
            "trajectory": trajectory,
            "seed": seed,
            "filter": name,
            **_outcome(filtered(flown.log, flown.vehicle), flown.vehicle, truth),
        }
        for name, filtered in FILTERS.items()
    ]


def _outcome(log: Any, vehicle: Any, truth: Mapping[str, Mapping[str, float]]) -> dict[str, Any]:
    begun = time.perf_counter()
    spectra = {n.channel: (round(n.slope, 2), round(n.fall, 2)) for n in noise_spectra(log)}
    out: dict[str, Any] = {"detected": pose_was_filtered(log), "spectra": spectra}
    try:
        found = diagnose([log], vehicle)
    except InputError as error:
        return {**out, "refused": str(error), "effects": [], "errors": {}}
    effects: list[dict[str, Any]] = [
        {
            "name": e.name,
            "tentative": e.tentative,
            "indistinguishable_from": list(e.indistinguishable_from),
            "coefficients": dict(e.coefficients),
            "std": dict(e.std),
        }
        for e in found.effects
    ]
    pairs = match(effects, list(truth)) if effects else None
    own = [(e["name"], e["name"]) for e in effects if e["name"] in truth]
    return {
        **out,
        "verdict": found.verdict,
        "floor_force_rms_N": found.floor_force_rms,
        "effects": effects,
        "errors": {
            key: [round(x, 4) for x in error]
            for key, error in coefficient_errors(effects, truth, pairs or own).items()
            if np.isfinite(error).all()
        },
        "seconds": round(time.perf_counter() - begun, 1),
    }


def kind(outcome: Mapping[str, Any]) -> str:
    """Return what a diagnosis is: right or wrong, sure or tentative, silent (nothing named where
    something was added), or refused.
    """
    if "refused" in outcome:
        return "refused"
    effects, truth = outcome["effects"], [outcome["effect"]] if outcome["effect"] else []
    if not effects:
        return "silent" if truth else "right, sure"
    sure = [e for e in effects if not e["tentative"]]
    if any(not {e["name"], *e["indistinguishable_from"]} & set(truth) for e in sure):
        return "wrong, sure"
    right = match(effects, truth) is not None
    return (
        f"{'right' if right else 'wrong'}, {'sure' if len(sure) == len(effects) else 'tentative'}"
    )


def run(
    folder: Path, seeds: Sequence[int] = (0,), jobs: int = 1, most: int | None = None
) -> list[dict[str, Any]]:
    """Fly and diagnose what is not yet in the folder's ``flights.jsonl``; return all outcomes."""
    path = folder / "flights.jsonl"
    folder.mkdir(parents=True, exist_ok=True)
    done = {}
    if path.exists():
        for line in path.read_text(encoding="utf-8").splitlines():
            kept = json.loads(line)
            done[tuple(kept["flight"])] = kept["outcomes"]
    wanted = flights(seeds)[:most]
    pending = [flight for flight in wanted if flight not in done]
    if pending:
        with workers(jobs) as pool:
            running = {pool.submit(fly_and_diagnose, *flight): flight for flight in pending}
            for future in as_completed(running):
                flight = running[future]
                done[flight] = future.result()
                with path.open("a", encoding="utf-8") as file:
                    file.write(json.dumps({"flight": flight, "outcomes": done[flight]}) + "\n")
                print(f"{len(done)} of {len(wanted)} flights", flush=True)
    return [outcome for flight in wanted for outcome in done.get(flight, [])]


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
    for outcome in read_json(saved, "outcomes of this study"):
        flight = (outcome["effect"], outcome["trajectory"], outcome["seed"])
        by_flight.setdefault(flight, []).append(outcome)
    lines = [
        json.dumps({"flight": flight, "outcomes": found}) + "\n"
        for flight, found in by_flight.items()
        if [o["filter"] for o in found] == list(FILTERS)
    ]
    with replaced(path) as partial:
        partial.write_text("".join(lines), encoding="utf-8")


def save(outcomes: Sequence[Mapping[str, Any]], path: Path) -> None:
    """Write the outcomes as JSON."""
    path.parent.mkdir(parents=True, exist_ok=True)
    write_json(list(outcomes), path)
