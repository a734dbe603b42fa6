"""What is wrong with a flight's log though every field of it can be read, and whether the answer
says so.

``python -m tests.fuzz.answers --flights 60 --seed 0`` spoils flights of 20 s by what loggers and
people do: rotors swapped, units, clocks, signs, frames, columns, samples that are lost, frozen or
jump. Each spoiled log goes through ``estimate``, through ``replay`` up to what it draws, or through
``diagnose``. It must be refused, or carry a note that names the fault, or give the answer of the
log that was not spoiled; anything else is a wrong answer given calmly.
"""

import argparse
import sys
import warnings
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation
from scipy.stats import binomtest

from windwrench.commands.log_film import flight_to_draw
from windwrench.dynamics import EffectSetting
from windwrench.dynamics.effects import parse_setting
from windwrench.dynamics.vehicle import Vehicle
from windwrench.dynamics.vehicle_file import load_vehicle
from windwrench.envs.recording import record_flight
from windwrench.envs.replay import arrow_scales
from windwrench.identification.diagnosis import diagnose
from windwrench.identification.logs.flight_log import FlightLog
from windwrench.identification.wrench_series import WrenchSeries, estimate_log
from windwrench.runtime.errors import InputError

Array = NDArray[np.float64]
Spoil = Callable[[FlightLog, np.random.Generator], FlightLog]

SECONDS = 20.0
TRAJECTORIES = ("excite", "circle", "gentle", "yaw")
_EFFECTS = (None, "rotor_drag", "constant_force")  # what a flight has that its vehicle file lacks
_SETTLED = 2.0  # s that the estimates have to settle before they are compared
_SAME_FORCE = 0.03  # of the weight, RMS: the same force
_SAME_TORQUE = 0.03  # of weight times arm, likewise


@dataclass(frozen=True)
class Fault:
    """A fault, and words of which a note that names it has one."""

    name: str
    spoil: Spoil
    words: tuple[str, ...]


def _swapped_rotors(log: FlightLog, rng: np.random.Generator) -> FlightLog:
    one, two = rng.choice(4, 2, replace=False)
    order = np.arange(4)
    order[[one, two]] = order[[two, one]]
    return replace(log, rotor_speeds=log.rotor_speeds[:, order])


def _permuted_rotors(log: FlightLog, rng: np.random.Generator) -> FlightLog:
    return replace(log, rotor_speeds=log.rotor_speeds[:, np.roll(np.arange(4), rng.integers(1, 4))])


def _rpm(log: FlightLog, rng: np.random.Generator) -> FlightLog:
    return replace(log, rotor_speeds=log.rotor_speeds * (60.0 / (2.0 * np.pi)))


def _millimetres(log: FlightLog, rng: np.random.Generator) -> FlightLog:
    return replace(log, position=log.position * float(rng.choice([1000.0, 100.0, 1.0 / 0.3048])))


def _milliseconds(log: FlightLog, rng: np.random.Generator) -> FlightLog:
    return replace(log, t=log.t * float(rng.choice([1e3, 1e6])))


def _late_rotors(log: FlightLog, rng: np.random.Generator) -> FlightLog:
    late = float(rng.choice([-1.0, 1.0]) * rng.uniform(0.1, 0.4))
    speeds = [np.interp(log.t - late, log.t, column) for column in log.rotor_speeds.T]
    return replace(log, rotor_speeds=np.column_stack(speeds))


def _sign(log: FlightLog, rng: np.random.Generator) -> FlightLog:
    flipped = np.ones(3)
    flipped[rng.integers(3)] = -1.0
    return replace(log, position=log.position * flipped)


def _inverse_attitude(log: FlightLog, rng: np.random.Generator) -> FlightLog:
    return replace(log, quaternion=log.quaternion * [1.0, -1.0, -1.0, -1.0])


def _north_east_down(log: FlightLog, rng: np.random.Generator) -> FlightLog:
    turn = np.array([1.0, -1.0, -1.0])
    return replace(
        log, position=log.position * turn, quaternion=log.quaternion * [1.0, 1.0, -1.0, -1.0]
    )


def _scalar_last(log: FlightLog, rng: np.random.Generator) -> FlightLog:
    return replace(log, quaternion=log.quaternion[:, [1, 2, 3, 0]])


def _scalar_first(log: FlightLog, rng: np.random.Generator) -> FlightLog:
    return replace(log, quaternion=log.quaternion[:, [3, 0, 1, 2]])


def _wrong_column(log: FlightLog, rng: np.random.Generator) -> FlightLog:
    one, two = rng.choice(3, 2, replace=False)
    order = np.arange(3)
    order[[one, two]] = order[[two, one]]
    return replace(log, position=log.position[:, order])


def _repeated_column(log: FlightLog, rng: np.random.Generator) -> FlightLog:
    """One rotor's column stands under the name of another, too."""
    one, two = rng.choice(4, 2, replace=False)
    speeds = log.rotor_speeds.copy()
    speeds[:, one] = speeds[:, two]
    return replace(log, rotor_speeds=speeds)


def _frozen_rotor(log: FlightLog, rng: np.random.Generator) -> FlightLog:
    speeds, i = log.rotor_speeds.copy(), rng.integers(4)
    begin = rng.integers(len(log.t) // 2)
    speeds[begin:, i] = speeds[begin, i]
    return replace(log, rotor_speeds=speeds)


def _frozen_position(log: FlightLog, rng: np.random.Generator) -> FlightLog:
    position, i = log.position.copy(), rng.integers(3)
    begin = rng.integers(len(log.t) // 2)
    position[begin:, i] = position[begin, i]
    return replace(log, position=position)


def _frozen_pose(log: FlightLog, rng: np.random.Generator) -> FlightLog:
    begin = int(rng.integers(len(log.t) // 4, len(log.t) // 2))
    frozen = slice(begin, begin + int(rng.uniform(1.0, 5.0) / log.period))
    position, quaternion = log.position.copy(), log.quaternion.copy()
    position[frozen], quaternion[frozen] = position[begin], quaternion[begin]
    return replace(log, position=position, quaternion=quaternion)


def _dead_rotor(log: FlightLog, rng: np.random.Generator) -> FlightLog:
    speeds = log.rotor_speeds.copy()
    begin = int(rng.integers(len(log.t) // 2))
    speeds[begin : begin + int(rng.uniform(0.5, 3.0) / log.period), rng.integers(4)] = 0.0
    return replace(log, rotor_speeds=speeds)


def _dropped_rows(log: FlightLog, rng: np.random.Generator) -> FlightLog:
    if rng.random() < 0.5:
        kept = rng.random(len(log.t)) > rng.uniform(0.02, 0.3)
    else:
        begin = rng.uniform(0.0, SECONDS - 4.0)
        kept = (log.t < begin) | (log.t > begin + rng.uniform(0.5, 4.0))
    return FlightLog(
        log.t[kept],
        log.position[kept],
        log.quaternion[kept],
        log.rotor_speeds[kept],
        None if log.voltage is None else log.voltage[kept],
        None if log.force is None else log.force[kept],
        None if log.torque is None else log.torque[kept],
        name=log.name,
        source=log.source,
    )


def _unstamped_loss(log: FlightLog, rng: np.random.Generator) -> FlightLog:
    """Rows are lost, and times are counted as if none were."""
    lossy = _dropped_rows(log, rng)
    return replace(lossy, t=log.t[0] + log.period * np.arange(len(lossy.t)))


def _spikes(log: FlightLog, rng: np.random.Generator) -> FlightLog:
    position = log.position.copy()
    hit = rng.random(len(log.t)) < 0.01
    position[hit] += rng.choice([0.1, 1.0, 100.0]) * rng.standard_normal((int(hit.sum()), 3))
    return replace(log, position=position)


def _rotor_spikes(log: FlightLog, rng: np.random.Generator) -> FlightLog:
    speeds = log.rotor_speeds.copy()
    hit = rng.random(len(log.t)) < 0.01
    speeds[hit, rng.integers(4)] *= rng.choice([0.0, 10.0, 100.0])
    return replace(log, rotor_speeds=speeds)


def _jump_for_good(log: FlightLog, rng: np.random.Generator) -> FlightLog:
    away = rng.standard_normal(3)
    away *= rng.choice([0.5, 2.0]) / np.linalg.norm(away)
    return replace(log, position=log.position + (log.t > SECONDS / 2)[:, None] * away)


def _y_up(log: FlightLog, rng: np.random.Generator) -> FlightLog:
    turn = Rotation.from_euler("x", -90.0, degrees=True)
    quaternion = (turn * Rotation.from_quat(log.quaternion, scalar_first=True)).as_quat(
        scalar_first=True
    )
    return replace(log, position=turn.apply(log.position), quaternion=quaternion)


_ORDER = ("rotor", "omega", "permut", "order", "mirror", "column")
_POSE = ("pose", "position", "px", "py", "pz", "quaternion", "attitude", "frame", "axes", "world")
FAULTS = (
    Fault("rotors swapped", _swapped_rotors, _ORDER),
    Fault("rotors rolled", _permuted_rotors, _ORDER),
    Fault("rotor speeds in rpm", _rpm, ("revolutions", "rpm", "thrust")),
    Fault("position in another unit", _millimetres, (*_POSE, "mm", "millimetres")),
    Fault("time in another unit", _milliseconds, ("millisecond", "microsecond", "time")),
    Fault("rotor speeds late or early", _late_rotors, ("late", "early", "clock", "delay", "shift")),
    Fault("sign of an axis", _sign, _POSE),
    Fault("inverse attitude", _inverse_attitude, _POSE),
    Fault("north, east, down", _north_east_down, _POSE),
    Fault("y up", _y_up, _POSE),
    Fault("quaternion as x, y, z, w", _scalar_last, _POSE),
    Fault("quaternion from x, y, z, w", _scalar_first, _POSE),
    Fault("axes exchanged", _wrong_column, _POSE),
    Fault("a rotor's column twice", _repeated_column, _ORDER),
    Fault("a rotor's speed stands still", _frozen_rotor, _ORDER),
    Fault("an axis stands still", _frozen_position, _POSE),
    Fault("the pose stands still", _frozen_pose, _POSE),
    Fault("a rotor reads zero", _dead_rotor, _ORDER),
    Fault("rows lost", _dropped_rows, ("gap", "lost", "rows", "step", "pose", "restart")),
    Fault("rows lost, times counted", _unstamped_loss, ("clock", "jump", "leap", "moves", "step")),
    Fault("outliers of the position", _spikes, ("pose", "jump", "leap")),
    Fault("outliers of a rotor", _rotor_spikes, _ORDER),
    Fault("a jump for good", _jump_for_good, ("pose", "jump", "leap", "restart")),
)


@cache
def vehicle() -> Vehicle:
    """Return the vehicle that flies, as it is declared."""
    return load_vehicle("ardrone2")


@cache
def flight(number: int) -> FlightLog:
    """Return a good flight: one of a few kinds, with or without an effect and wind."""
    rng = np.random.default_rng([number, 1])
    effect = _EFFECTS[number % len(_EFFECTS)]
    effects: tuple[EffectSetting, ...] = (
        () if effect is None else (parse_setting(effect, vehicle()),)
    )
    trajectory = TRAJECTORIES[number % len(TRAJECTORIES)]
    recorded = record_flight(vehicle(), effects, trajectory, SECONDS, seed=int(rng.integers(2**31)))
    return FlightLog(**recorded, name="flight", source="flight.csv")


@cache
def _clean_estimate(number: int) -> WrenchSeries:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return estimate_log(flight(number), vehicle())


def _same_wrench(
    t: Array, force: Array, torque: Array, status: NDArray[np.int64], number: int
) -> bool:
    """Return whether the wrench is that of the flight that was not spoiled, but where it says
    itself that it does not know (rows that were not tracked, and a rise time after them).
    """
    clean = _clean_estimate(number)
    sure = t - t[0] > _SETTLED
    for row in np.flatnonzero(status == 3):
        sure &= (t < t[row]) | (t > t[row] + _SETTLED)
    sure &= status != 1
    sure &= (t >= clean.t[0]) & (t <= clean.t[-1])
    if sure.sum() < 100:
        return False
    weight = vehicle().weight
    apart = []
    for ours, theirs, scale in (
        (force, clean.force, _SAME_FORCE * weight),
        (torque, clean.torque, _SAME_TORQUE * weight * vehicle().arm_l),
    ):
        there = np.column_stack([np.interp(t[sure], clean.t, column) for column in theirs.T])
        apart.append(float(np.sqrt(np.mean((ours[sure] - there) ** 2))) / scale)
    return max(apart) < 1.0


def _names_it(notes: Sequence[str], known: Sequence[str], fault: Fault) -> bool:
    """Return whether a note that the good flight does not have speaks of the fault."""
    new = [note for note in notes if note not in known]
    return any(word in note for note in new for word in fault.words)


def estimate_of(number: int, fault: Fault, seed: int) -> tuple[str, str]:
    """Return what became of a spoiled log that is estimated: refused, noted, same or wrong; and the
    words.
    """
    rng = np.random.default_rng([seed, number, 2])
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            series = estimate_log(fault.spoil(flight(number), rng), vehicle())
        except InputError as error:
            return "refused", str(error)
    return _judged(series, series.force, series.torque, number, fault)


def replay_of(number: int, fault: Fault, seed: int) -> tuple[str, str]:
    """Return the same of one that is replayed: the wrench is that of the arrows."""
    rng = np.random.default_rng([seed, number, 2])
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            log = fault.spoil(flight(number), rng)
            series = estimate_log(log, vehicle())
            drawn = flight_to_draw(log, series)
        except InputError as error:
            return "refused", str(error)
    arrows = arrow_scales(drawn, vehicle().arm_l)
    shown = np.column_stack([drawn.position, drawn.quaternion, drawn.force, drawn.torque])
    if not (np.isfinite(shown).all() and np.isfinite(arrows).all()):
        return "wrong", "what is drawn is not finite"
    return _judged(series, drawn.force, drawn.torque, number, fault)


def _judged(
    series: WrenchSeries, force: Array, torque: Array, number: int, fault: Fault
) -> tuple[str, str]:
    if _names_it(series.notes, _clean_estimate(number).notes, fault):
        return "noted", "; ".join(series.notes)
    if _same_wrench(series.t, force, torque, series.status_code, number):
        return "same", ""
    return "wrong", "; ".join(series.notes)


@cache
def _clean_names(number: int) -> tuple[frozenset[str], tuple[str, ...]]:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        found = diagnose([flight(number)], vehicle())
    return frozenset(effect.name for effect in found.effects), found.notes


def diagnosis_of(number: int, fault: Fault, seed: int) -> tuple[str, str]:
    """Return the same of one that is diagnosed: the answer is the names of the effects."""
    names, notes = _clean_names(number)
    rng = np.random.default_rng([seed, number, 2])
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            found = diagnose([fault.spoil(flight(number), rng)], vehicle())
        except InputError as error:
            return "refused", str(error)
    if _names_it(found.notes, notes, fault):
        return "noted", "; ".join(found.notes)
    now = frozenset(effect.name for effect in found.effects)
    # nothing named where something was is a weaker answer, not another one
    if now <= names:
        return "same", ""
    return "wrong", f"{sorted(names)} became {sorted(now)}; " + "; ".join(found.notes)


def main() -> int:
    """Run the fuzzer and print a table; return 0."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n\n")[0])
    parser.add_argument("--flights", type=int, default=12, help="flights, each with every fault")
    parser.add_argument("--diagnoses", type=int, default=0, help="spoiled logs that are diagnosed")
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    for what, outcome_of in (("estimate", estimate_of), ("replay", replay_of)):
        total: Counter[str] = Counter()
        print(
            f"| {what} of | refused | noted | same | wrong |\n| --- | ---: | ---: | ---: | ---: |"
        )
        for fault in FAULTS:
            row: Counter[str] = Counter()
            for number in range(given.flights):
                outcome, words = outcome_of(number, fault, given.seed)
                row[outcome] += 1
                if outcome == "wrong":
                    print(f"{what}, flight {number}, {fault.name}: {words}", file=sys.stderr)
            total.update(row)
            counts = " | ".join(str(row[k]) for k in ("refused", "noted", "same", "wrong"))
            print(f"| {fault.name} | {counts} |", flush=True)
        _sum_up(f"spoiled flights by {what}", total)
    asked: Counter[str] = Counter()
    for number in range(given.diagnoses):
        fault = FAULTS[number % len(FAULTS)]
        outcome, words = diagnosis_of(number % 4, fault, given.seed + number)
        asked[outcome] += 1
        if outcome == "wrong":
            print(f"diagnose, flight {number % 4}, {fault.name}: {words}", file=sys.stderr)
    if given.diagnoses:
        _sum_up("spoiled flights by diagnose", asked)
    return 0


def _sum_up(what: str, counts: Counter[str]) -> None:
    every = sum(counts.values())
    band = binomtest(counts["wrong"], every).proportion_ci(method="exact")
    said = ", ".join(f"{counts[k]} {k}" for k in ("refused", "noted", "same", "wrong"))
    print(f"{every} {what}: {said} ({100 * band.low:.1f}-{100 * band.high:.1f} % wrong)")


if __name__ == "__main__":
    sys.exit(main())
