"""Flights whose truth is known, diagnosed and ranked: of this project's plant, and of a simulator
that was written apart from it and is read from its own file.
"""

import importlib.util
import sys
import tempfile
import time
from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from windwrench.dynamics import load_vehicle
from windwrench.dynamics.effects import Need, names, needing
from windwrench.dynamics.vehicle import Vehicle
from windwrench.evidence.scoring import EQUIVALENTS, STAND_INS
from windwrench.evidence.trials.logged_poses import FILTERS, LOGS
from windwrench.evidence.trials.outsiders import OUTSIDERS
from windwrench.evidence.trials.practice_flights import of_mass, practise, shown_in
from windwrench.identification.diagnosis import diagnose
from windwrench.identification.logs.flight_log import FlightLog
from windwrench.runtime.errors import InputError

# how a flight is logged: as measured, by its IMU, or behind one of the filters in turn
WAYS_TO_LOG = ("pose", *LOGS, "filtered")
KINDS = ("single", "third", "pair", "nothing", "outsider", "left out")
# of ten flights of the project's own simulator
OF_TEN = (
    "single",
    "third",
    "pair",
    "nothing",
    "left out",
    "outsider",
    "single",
    "nothing",
    "single",
    "left out",
)
_ATTEMPTS = 4  # at a flight that crashes
_GUST_TIMES = (0.1, 2.0)  # s, between which a gust's duration is drawn
_STRONGEST_GUSTS = 3.0  # times the background's
_MASSES = (0.1, 2.0)  # kg, between which a vehicle of half the flights lies
# share of the log's pose noise that the flight loop sees, on half the flights: it has a gyro
_SEEN_BY_GYRO = 0.1
_NOISES = ((1e-3, 0.3), (1e-3, 0.3), (0.5e-3, 0.15), (2e-3, 0.5))  # m and degrees, as its own
_TURBULENCE = (0.015, 3e-4, 0.25)  # N, Nm and s, as its own
Flown = tuple[FlightLog, Vehicle, dict[str, Any], str, str]
# what the other simulator calls no effect of a library, and this library has
_KNOWN = {"pendulum payload 30 g on 0.5 m tether": "slung_payload"}
# an Ornstein-Uhlenbeck force is a disturbance, and nothing is missing
_GUSTS = ("OU gust force, 1.5 s correlation, 0.14 N rms",)
# and which effect of the library acts beside what it has not: a Gaussian jet that turns nothing. As
# this library's jet it is 40 nats less likely than as a steady wind, from the true place on
_BESIDE = {"localised fan jet through body drag": "body_drag"}


def recorded(simulator: str, kind: str, number: int, way: str = "pose") -> dict[str, Any]:
    """Return what the diagnosis says of one flight, and its truth, as JSON; only why it was
    refused, where it was.

    Args:
        simulator: "own", or the file of the other one.
        kind: one of ``KINDS``; of the other simulator "catalogue" or "left out".
        number: the seed of a flight, or its place in the other simulator's catalogues, one seed
            after the other.
        way: one of ``WAYS_TO_LOG``; the other simulator has no IMU.
    """
    if simulator == "own":
        log, vehicle, truth, outsider, flown = _own(kind, number, way in LOGS)
    else:
        log, vehicle, truth, outsider, flown = _other(Path(simulator), number)
    if way in LOGS:
        log = LOGS[way](log, number)
    elif way == "filtered":
        name = list(FILTERS)[1:][number % (len(FILTERS) - 1)]
        log, flown = FILTERS[name](log, vehicle), f"{flown}, {name}"
    left_out: list[str] = []
    if kind == "left out":
        alike = {**EQUIVALENTS, **STAND_INS}
        left_out = [e for t in truth for e in (t, *alike.get(t, ()))]
    return diagnosed(log, vehicle, truth, outsider, flown, left_out)


def diagnosed(
    log: FlightLog,
    vehicle: Vehicle,
    truth: Mapping[str, Any],
    outsider: str,
    flown: str,
    left_out: Sequence[str],
) -> dict[str, Any]:
    """Return what the diagnosis says of one flight; arguments as of its record."""
    begun = time.process_time()
    try:
        found = diagnose([log], vehicle, without=left_out)
    except InputError as error:
        return {"refused": str(error)}
    ended = time.process_time()
    lost = set(found.needs_pose)
    if "filtered pose" in found.doubts or any("were filtered before" in x for x in found.notes):
        lost |= needing(Need.FAST_MOTION)
    stated, ranking = found.probabilities, found.ranking
    assert ranking is not None
    return {
        "flown": flown,
        "truth": truth,
        "outsider": outsider,
        "left_out": list(left_out),
        "hidden": sorted(lost & set(truth)),
        "named": [
            {
                "name": e.name,
                "tentative": e.tentative,
                "indistinguishable_from": list(e.indistinguishable_from),
                "coefficients": {k: float(f"{v:.5g}") for k, v in e.coefficients.items()},
                "std": {k: float(f"{v:.5g}") for k, v in e.std.items()},
                "probability": round(stated.names[e.name], 4),
                "worth": float(f"{e.evidence.get('size_over_what_is_left', 0.0):.3g}"),
            }
            for e in found.effects
        ],
        "unknown": round(stated.unknown, 4),
        "remainder": found.remainder,
        "signs": {
            "structure": round(ranking.structure, 3),
            "push": bool(found.pushes),
        },
        "tempering": round(ranking.tempering, 4),
        "cpu_s": round(ended - begun, 2),
    }


def _own(kind: str, number: int, imu: bool) -> Flown:
    rng = np.random.default_rng((number, len(kind)))
    vehicle = load_vehicle("ardrone2")
    if rng.random() < 0.5:
        vehicle = of_mass(vehicle, float(np.exp(rng.uniform(*np.log(_MASSES)))))
    seen = _SEEN_BY_GYRO if rng.random() < 0.5 else 1.0
    gust_time = float(np.exp(rng.uniform(*np.log(_GUST_TIMES))))
    turbulence = float(rng.uniform(0.0, _STRONGEST_GUSTS))
    what = {"third": "effect", "single": "effect", "left out": "effect"}.get(kind, kind)
    pool = tuple(OUTSIDERS) if kind == "outsider" else names()
    for attempt in range(_ATTEMPTS):
        added = () if what in ("pair", "nothing") else (str(rng.choice(pool)),)
        path = shown_in(added[0])[0] if added else None
        try:
            p = practise(
                vehicle,
                what,
                added,
                "small" if kind == "third" else "typical",
                path,
                10 * number + attempt,
                60.0,
                turbulence,
                imu=imu,
                gust_time=gust_time,
                seen=seen,
            )
        except InputError:
            continue
        truth = {e.name: dict(e.coefficients) for e in p.effects}
        flown = f"{p.trajectory}, gusts of {turbulence:.1f} and {gust_time:.2f} s, "
        flown += f"{vehicle.mass:.3g} kg, {'gyro' if seen < 1.0 else 'pose'} in the loop"
        return p.log, p.vehicle, truth, p.outsider or "", flown
    raise InputError(f"no flight loop flies {kind} {number}")


@cache
def simulator_at(path: Path) -> ModuleType:
    """Return the other simulator.

    Raises:
        InputError: no such file.
    """
    spec = importlib.util.spec_from_file_location("other_simulator", path)
    if spec is None or spec.loader is None or not path.exists():
        raise InputError(f"{path}: expected the other simulator's Python file")
    module = importlib.util.module_from_spec(spec)
    sys.modules["other_simulator"] = module
    spec.loader.exec_module(module)
    return module


def _other(path: Path, number: int) -> tuple[FlightLog, Vehicle, dict[str, Any], str, str]:
    simulator = simulator_at(path)
    catalogue = simulator.catalogue()
    kind, settings, said = catalogue[number % len(catalogue)]
    rng = np.random.default_rng((number, 1))
    noise = _NOISES[int(rng.integers(len(_NOISES)))]
    flown = simulator.make_log(
        kind,
        seed=int(rng.integers(1 << 30)),
        sig_p=noise[0],
        sig_q=np.deg2rad(noise[1]),
        turb=_TURBULENCE if rng.random() < 0.5 else None,
        **settings,
    )
    log = FlightLog(
        flown["t"],
        np.round(flown["p"], 5),
        np.round(flown["q"], 6),
        np.round(flown["om"], 3),
        flown["vbat"],
        name=f"{kind} {number}",
    )
    vehicle = vehicle_of(simulator)
    truth: dict[str, Any] = {}
    outsider = ""
    for effect in said:
        what = effect.get("what", "")
        name = _KNOWN.get(what) or _BESIDE.get(what) or effect["name"]
        truth |= {name: {}} if name in names() else {}
        # a law that its catalogue gives another form than the library's
        outsider = outsider or (effect.get("law", "") if what in ("", *_KNOWN, *_GUSTS) else what)
    return log, vehicle, truth, outsider, kind


def vehicle_of(simulator: ModuleType) -> Vehicle:
    """Return the vehicle declared by the other simulator."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "vehicle.yaml"
        # its vehicle's file describes the pose's noise in words
        text = simulator.VEHICLE.replace("nominal ", "")
        file.write_text(text, encoding="utf-8")
        return load_vehicle(str(file))
