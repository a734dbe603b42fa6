"""Trials of the diagnosis: flights with a known cause, most of them flown here and now, each
diagnosed as a user would.

Every trial is one flight, diagnosed with the whole library and, where it asks for that, with
effects left out. ``judgements`` says what the outcomes are worth.
"""

import time
import zlib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, astuple, dataclass
from pathlib import Path
from typing import Any

from windwrench.dynamics import EffectSetting, load_vehicle
from windwrench.dynamics.effects import names
from windwrench.dynamics.vehicle import Vehicle
from windwrench.envs.recording import TRAJECTORIES, background
from windwrench.identification.diagnosis import diagnose
from windwrench.identification.findings import Diagnosis
from windwrench.identification.logs.flight_log import FlightLog
from windwrench.identification.prediction import rollout_error
from windwrench.runtime.errors import InputError, unknown_name
from windwrench.runtime.plain_values import plain
from windwrench.studies.runner import code_stamp, run_tasks
from windwrench.studies.scoring import EQUIVALENTS
from windwrench.studies.trials.held_back_outsiders import HELD_BACK
from windwrench.studies.trials.outsiders import OUTSIDERS
from windwrench.studies.trials.practice_flights import practise, practise_held_back, shown_in
from windwrench.studies.trials.rotorpy_flights import (
    aero_settings,
    available,
    hummingbird_vehicle,
    rotorpy_flight,
)

_ATTEMPTS = 4  # at a flight that crashes
_ROTORPY_SECONDS = 40.0  # RotorPy is slow
STRONG_TURBULENCE = 4.0  # times the background's
HOVERED = (
    "mass",
    "thrust_scale",
    "constant_force",
    "com_offset",
    "constant_torque",
    "rotor_efficiency",
    "world_tilt",
    "thrust_axis_tilt",
)
PAIRS = 30  # a seed
PRESETS = ("hummingbird", "crazyflie")  # flown in part
_PRESET_EFFECTS = ("rotor_drag", "mass", "com_offset", "motor_lag", "thrust_curvature")
_QUICK_EFFECTS = ("rotor_drag", "mass", "inflow_thrust", "ground_effect", "com_offset", "latency")
_QUICK_OUTSIDERS = ("contact_pushes", "sloshing", "cubic_drag")
_ROTORPY_PATHS = ("excite", "fast")
_KIND = {
    "typical": "effect",
    "third": "effect",
    "preset": "effect",
    "pair": "pair",
    "nothing": "nothing",
    "strong turbulence": "nothing",
    "hover": "hover",
    "outsider": "outsider",
}  # of practice flight, by group
GROUPS = (*_KIND, "held back", "rotorpy")


@dataclass(frozen=True)
class Trial:
    """One flight and what it is diagnosed with."""

    group: str  # one of GROUPS
    added: tuple[str, ...] = ()  # effects, or the disturbance; nothing for a pair, which is drawn
    size: str = "typical"
    seed: int = 0
    libraries: tuple[tuple[str, ...], ...] = (
        (),
    )  # effects left out of the library, once for each diagnosis
    trajectory: str | None = None  # default: drawn
    turbulence: float | None = None  # default: drawn
    vehicle: str = "ardrone2"
    seconds: float = 60.0  # s, length of the log

    @property
    def key(self) -> str:
        """What no other trial of a plan is called."""
        parts = (
            self.group,
            "+".join(self.added) or "-",
            self.size,
            self.trajectory or "-",
            self.vehicle,
            str(self.seed),
        )
        return "/".join(parts)

    @property
    def flight_seed(self) -> int:
        """Of everything random on this flight, another one for each trial."""
        return zlib.crc32(self.key.encode())


def plan(
    seeds: int = 1, quick: bool = False, first: int = 0, groups: Sequence[str] = ()
) -> list[Trial]:
    """Return the trials of a run; one effect is flown on the trajectory that shows it best.

    Args:
        seeds: how often everything is flown, each time with other signs, sizes, paths and noise.
        quick: a part of it only, some minutes long.
        first: the first seed.
        groups: those of ``GROUPS`` that are wanted; default: all.

    Raises:
        InputError: ``seeds`` is not positive, ``first`` is negative, or no group has this name.
    """
    for group in groups:
        if group not in GROUPS:
            raise unknown_name("group", group, GROUPS)
    if seeds < 1 or first < 0:
        raise InputError(
            f"trials: --seeds must be at least 1 and --seed at least 0, got {seeds} and {first}"
        )
    effects = _QUICK_EFFECTS if quick else names()
    out: list[Trial] = []
    for seed in range(first, first + seeds):
        for group, size in (("typical", "typical"), ("third", "small")):
            for name in effects:
                less = list(dict.fromkeys([(name,), (name, *EQUIVALENTS.get(name, ()))]))
                # what no log can tell apart is asked once more, with its equivalent left in
                asked = ((), *(less if group == "typical" and not quick else less[-1:]))
                out.append(Trial(group, (name,), size, seed, asked, shown_in(name)[0]))
        for name in _QUICK_OUTSIDERS if quick else OUTSIDERS:
            out += [
                Trial("outsider", (name,), size, seed)
                for size in (("typical",) if quick else ("typical", "small"))
            ]
        for name in list(HELD_BACK)[:2] if quick else HELD_BACK:
            out += [
                Trial("held back", (name,), size, seed)
                for size in (("typical",) if quick else ("typical", "small"))
            ]
        for path in ("gentle", "excite") if quick else TRAJECTORIES:
            out.append(Trial("nothing", (), seed=seed, trajectory=path))
            out.append(
                Trial(
                    "strong turbulence",
                    (),
                    seed=seed,
                    trajectory=path,
                    turbulence=STRONG_TURBULENCE,
                )
            )
        count = 2 if quick else PAIRS
        out += [Trial("pair", (), seed=count * seed + i) for i in range(count)]
        out += [Trial("hover", (name,), seed=seed) for name in (HOVERED[:2] if quick else HOVERED)]
        if not quick:
            for vehicle in PRESETS:
                out += [
                    Trial(
                        "preset", (name,), seed=seed, trajectory=shown_in(name)[0], vehicle=vehicle
                    )
                    for name in _PRESET_EFFECTS
                ]
                out.append(Trial("nothing", (), seed=seed, trajectory="excite", vehicle=vehicle))
        if available():
            for path in _ROTORPY_PATHS[:1] if quick else _ROTORPY_PATHS:
                out += [
                    Trial(
                        "rotorpy",
                        added,
                        seed=seed,
                        trajectory=path,
                        vehicle="rotorpy",
                        seconds=_ROTORPY_SECONDS,
                    )
                    for added in (("aero",), ())
                ]
    return [trial for trial in out if trial.group in (groups or GROUPS)]


def stamp() -> str:
    """Return a digest of the code that flies and diagnoses."""
    return code_stamp(
        "trials/trials",
        "trials/held_back_outsiders",
        "trials/outsiders",
        "trials/practice_flights",
        "trials/rotorpy_flights",
    )


def fly_and_diagnose(trial: Trial) -> dict[str, Any]:
    """Return a trial's outcome as JSON: what was flown, and each diagnosis or the error that ended
    it.
    """
    out: dict[str, Any] = {
        "key": trial.key,
        "trial": plain(trial, 6),
        "diagnoses": [],
    }
    begun = time.perf_counter()
    for attempt in range(_ATTEMPTS):
        # some draws, of two effects above all, no flight loop can fly
        try:
            log, vehicle, flown = _fly(trial, trial.flight_seed + attempt)
            break
        except InputError as error:
            out["error"] = str(error)
    else:
        return out
    out.pop("error", None)
    flown["rollout_of_truth"] = None
    out |= {"flown": plain(flown, 6), "seconds": _since(begun)}
    for without in trial.libraries:
        begun = time.perf_counter()
        try:
            diagnosis = diagnose([log], vehicle, without=without, probabilities=True)
            found = _findings(diagnosis)
            if not without and not flown["outsider"]:
                truth = _rollout_of_truth(
                    log,
                    vehicle,
                    flown["truth"],
                    [(a, b) for _, a, b in diagnosis.held_out_segments],
                )
                out["flown"]["rollout_of_truth"] = plain(truth, 6)
        except Exception as error:  # a diagnosis that falls over is an outcome too, and a bad one
            found = {"error": f"{type(error).__name__}: {error}"}
        out["diagnoses"].append({"without": list(without), **found, "seconds": _since(begun)})
    return out


def _rollout_of_truth(
    log: FlightLog,
    vehicle: Vehicle,
    truth: Mapping[str, Mapping[str, float]],
    segments: Sequence[tuple[float, float]],
) -> float | None:
    """Return the one-second prediction error of the true model over that of the declared one, on
    stretches of a flight (s).

    What turbulence and the noise of the pose leave; no diagnosis can be far below it.
    """
    if not truth:
        return None
    effects = [EffectSetting(name, dict(coefficients)) for name, coefficients in truth.items()]
    before, after = (
        rollout_error(log, vehicle, segments),
        rollout_error(log, vehicle.with_effects(*effects), segments),
    )
    return after / before if before > 0.0 else None


def _since(begun: float) -> float:
    return round(time.perf_counter() - begun, 1)


def _fly(trial: Trial, seed: int) -> tuple[FlightLog, Vehicle, dict[str, Any]]:
    """Return the log, the declared vehicle, and in words what was flown, with the truth."""
    if trial.group == "rotorpy":
        on, path = bool(trial.added), trial.trajectory or "excite"
        truth = {s.name: dict(s.coefficients) for s in aero_settings()} if on else {}
        log = rotorpy_flight(path, trial.seconds, seed, on)
        return (
            log,
            hummingbird_vehicle(),
            {
                "trajectory": path,
                "turbulence": 0.0,
                "sensor": 1.0,
                "truth": truth,
                "outsider": None,
            },
        )
    vehicle = load_vehicle(trial.vehicle)
    if trial.group == "held back":
        p = practise_held_back(vehicle, trial.added[0], trial.size, seed, trial.seconds)
    else:
        p = practise(
            vehicle,
            _KIND[trial.group],
            trial.added,
            trial.size,
            trial.trajectory,
            seed,
            trial.seconds,
            trial.turbulence,
        )
    truth = {e.name: dict(e.coefficients) for e in p.effects}
    return (
        p.log,
        p.vehicle,
        {
            "trajectory": p.trajectory,
            "turbulence": p.turbulence,
            "sensor": p.sensor,
            "truth": truth,
            "outsider": p.outsider,
            "gusts": background(vehicle, p.turbulence).disturbance_force,
        },
    )


def _findings(found: Diagnosis) -> dict[str, Any]:
    """Return what a score needs of a diagnosis, as JSON."""
    stated = found.probabilities
    summary = {
        "verdict": found.verdict,
        "remainder": found.remainder,
        "effects": [
            {
                "name": e.name,
                "coefficients": e.coefficients,
                "std": e.std,
                "tentative": e.tentative,
                "indistinguishable_from": e.indistinguishable_from,
                "probability": stated.names[e.name] if stated else None,
            }
            for e in found.effects
        ],
        "unknown": stated.unknown if stated else None,
        "before": asdict(found.before),
        "after": asdict(found.after),
        "floor": {"force_rms": found.floor_force_rms, "torque_rms": found.floor_torque_rms},
        "structure": [asdict(sign) for sign in found.structure[:3]],
        "gusts": [gusts.rms for gusts in found.gusts],
    }
    return dict(plain(summary, 6))


def run_trials(trials: Iterable[Trial], folder: Path, jobs: int = 1) -> list[dict[str, Any]]:
    """Run those trials whose outcomes are not in the folder; return the outcomes of all, in the
    order of the trials.

    Args:
        trials: as ``plan`` makes them.
        folder: for ``trials.jsonl``.
        jobs: processes.

    Raises:
        InputError: the folder cannot be written.
    """
    tasks = [astuple(trial) for trial in trials]
    return list(run_tasks(_outcome, tasks, folder / "trials.jsonl", jobs, stamp()).values())


def _outcome(*parts: Any) -> dict[str, Any]:
    return fly_and_diagnose(Trial(*parts))
