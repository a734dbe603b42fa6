"""The diagnosis on flights that others have measured.

NanoBench logs hold PWM, battery voltage and motion capture. Crazyswarm2 logs of slung payloads hold
commanded thrust. CrazyPAD logs hold motor requests of a vehicle with a weight or a cut propeller.
ULogs hold a motor that is commanded to fail. Flights in a fan wall are in ``fan_wall``.

| folder below the data folder | holds |
| --- | --- |
| ``nanobench`` | CSV files of syediu/nanobench-iros2026 |
| ``crazyswarm2_payload/csv`` | logs of IMRCLab/crazyswarm2-tools |
| ``crazypad`` | flights of CrazyPAD (Masalimov and others, Data 2024, 9, 79; MIT) |
| ``crazypad_e8`` | its ``data/motor_data``, vehicle E8 |
| ``fan_wall`` | ``data/experiment`` of aerorobotics/neural-fly |
| ``motor_faults`` | RflyMAD's ULogs, as republished in lerlis/RLS-fault-diagnosis-for-RflyMAD |

E8 is no blind test: the scatter between sessions was measured with its flights. The search for a
motor's fault was developed on the two ULogs, the diagnosis of commanded flights on NanoBench.
Every NanoBench fold is one call of ``diagnose`` on some flights, judged on a flight left out of the
fit. Its residuals are accelerations by the declared mass, through a 4 Hz low-pass with zero phase,
over the time in the air. Constant thrust, with each flight's mean removed, is the fair baseline:
the reader's thrust curve belongs to a full battery.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from numpy.typing import NDArray

from windwrench import __version__
from windwrench.dynamics.effects import get
from windwrench.dynamics.vehicle import EffectSetting, Vehicle
from windwrench.dynamics.vehicle_file import load_vehicle
from windwrench.evidence.fan_wall import fan_wall
from windwrench.evidence.kept_results import DOCS
from windwrench.evidence.residual_wrench import residual_wrench
from windwrench.evidence.runner import start
from windwrench.identification.comparison.change import NOWHERE, Change
from windwrench.identification.comparison.change import compare as compare_sets
from windwrench.identification.comparison.fault_channels import samples_of
from windwrench.identification.comparison.fault_detection import find_fault
from windwrench.identification.comparison.trim import Trim, trim_of_log
from windwrench.identification.comparison.words import fault_data
from windwrench.identification.diagnosis import diagnose
from windwrench.identification.diagnosis.commanded_rotors import in_flight
from windwrench.identification.findings import Diagnosis
from windwrench.identification.logs.flight_log import FlightLog
from windwrench.identification.logs.reading import read_log
from windwrench.identification.logs.text_table import open_table
from windwrench.identification.motion.sensing_effects import undo_log_sensing
from windwrench.identification.motion.signals import Signals, log_signals
from windwrench.identification.motion.smoothing import low_pass
from windwrench.runtime.errors import InputError, unknown_name
from windwrench.runtime.page_files import write_json
from windwrench.runtime.provenance import commit

Array = NDArray[np.float64]

CUTOFF_HZ = 4.0
_EDGE = 0.6  # s at either end, where filters start
PAYLOAD = 0.005  # kg, weighed by those who flew it
CABLE = 0.5  # m
CARRIER = 0.0369  # kg, the vehicle without its payload
NO_PAYLOAD = (
    (("146",), 0.033),
    (("160", "165"), 0.032),
    (("170", "172", "176", "178"), 0.032),
    (("100", "130", "140"), 0.0375),
)
WITH_PAYLOAD = (("202",), ("201", "202", "204"), ("201",), ("204",))
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


def motion(log: FlightLog, vehicle: Vehicle) -> Signals:
    """Return the signals of the longest piece of a log in the air, with the vehicle's sensing
    effects undone.
    """
    pieces = log_signals(undo_log_sensing(in_flight(log, vehicle), vehicle))
    return max(pieces, key=lambda s: len(s.t))


def slow(x: Array, period: float) -> Array:
    """Return signals (n, ...) behind the low-pass, without the edges."""
    edge = round(_EDGE / period)
    return low_pass(x, CUTOFF_HZ, period)[edge:-edge]


def acceleration_residual(log: FlightLog, vehicle: Vehicle, mass: float) -> Array:
    """Return the residual force (n, 3) by ``mass`` in m/s2, world, slow."""
    s = motion(log, vehicle)
    return slow(residual_wrench(s, vehicle)[:, :3] / mass, s.period)


def constant_thrust(log: FlightLog, vehicle: Vehicle) -> Array:
    """Return what (n, 3) m/s2 is left if thrust is taken to be the weight all the time."""
    s = motion(log, replace(vehicle, effects=()))
    up = np.array([0.0, 0.0, vehicle.gravity])
    return slow(s.acceleration + up - vehicle.gravity * s.rotation[:, :, 2], s.period)


def level(x: Array) -> list[float]:
    """Return the RMS per axis."""
    return [float(v) for v in np.sqrt(np.mean(np.square(x), axis=0))]


def spread(x: Array) -> list[float]:
    """Return the standard deviation per axis."""
    return [float(v) for v in x.std(axis=0)]


def compare(log: FlightLog, diagnosis: Diagnosis) -> dict[str, Any]:
    """Return how far a test flight is from the declared vehicle and from the amended one."""
    found: dict[str, Any] = {"flight": log.name, "drag_N_per_mps": linear_drag(diagnosis)}
    mass = diagnosis.declared.mass
    for when, vehicle in (("before", diagnosis.declared), ("after", diagnosis.amended)):
        x = acceleration_residual(log, vehicle, mass)
        found |= {f"{when}_rms": level(x), f"{when}_std": spread(x)}
        found[f"norm_{when}"] = float(np.sqrt(np.mean(np.sum(x**2, axis=1))))
    return found | {"constant_thrust_std": spread(constant_thrust(log, diagnosis.declared))}


def linear_drag(diagnosis: Diagnosis) -> list[float]:
    """Return the linear drag along body x and y in N per m/s, of all named drags together; rotor
    drag at the rotor speeds of hover.
    """
    total, rate = np.zeros(2), 4.0 * diagnosis.declared.hover_rate
    for e in diagnosis.effects:
        if e.name == "body_drag":
            total += [e.coefficients["dx"], e.coefficients["dy"]]
        if e.name == "rotor_drag":
            total += [rate * e.coefficients["kdx"], rate * e.coefficients["kdy"]]
    return [float(x) for x in total]


def imu_check(path: Path, log: FlightLog, diagnosis: Diagnosis) -> dict[str, float]:
    """Return how the model's vertical specific force agrees with the accelerometer of a flight that
    no fit saw (m/s2).
    """
    table = open_table(path).read(["t", "imu_acc_z"])
    s = motion(log, replace(diagnosis.declared, effects=()))
    measured = 9.81 * np.interp(s.t, table["t"] - table["t"][0], table["imu_acc_z"])
    up = np.array([0.0, 0.0, diagnosis.declared.gravity])
    felt = s.acceleration + up
    amended = replace(
        diagnosis.amended,
        effects=tuple(e for e in diagnosis.amended.effects if get(e.name).kind != "sensing"),
    )
    model = felt - residual_wrench(s, amended)[:, :3] / amended.mass

    def along(x: Array) -> Array:
        return slow(np.einsum("ni,ni->n", x, s.rotation[:, :, 2]), s.period)

    imu = slow(measured, s.period)
    return {
        "model_std": float((imu - along(model)).std()),
        "motion_capture_std": float((imu - along(felt)).std()),
        "constant_std": float(imu.std()),
    }


def names_of(diagnosis: Diagnosis) -> list[dict[str, Any]]:
    """Return the named effects as plain data."""
    return [
        {
            "name": e.name,
            "coefficients": dict(e.coefficients),
            "std": dict(e.std),
            "tentative": e.tentative,
            "indistinguishable_from": list(e.indistinguishable_from),
        }
        for e in diagnosis.effects
    ]


def payload_vehicle(mass: float) -> Vehicle:
    """Return a Crazyflie of this mass whose file states a cable of 0.5 m and leaves load and
    damping open.
    """
    return replace(
        load_vehicle("crazyflie"),
        mass=mass,
        effects=(EffectSetting("slung_payload", {"l": CABLE}),),
    )


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


def crazypad(folder: Path) -> list[dict[str, Any]]:
    """Compare every flight with the other normal flights of the same vehicle."""
    vehicle = load_vehicle("crazyflie")
    trims = {
        path.name: trim_of_log(read_log(path, "crazypad"), vehicle)
        for path in sorted(folder.glob("*.csv.gz"))
    }
    return _each_compared(trims)


def crazypad_e8(folder: Path) -> list[dict[str, Any]]:
    """Compare every flight of vehicle E8 in CrazyPAD's ``data/motor_data`` with all other normal
    ones; tape on a propeller is left out, of which nobody knows what it should do.
    """
    vehicle, trims = load_vehicle("crazyflie"), {}
    for path in sorted(folder.glob("*/E8_log*")):
        if not path.parent.name.startswith("tape"):
            log = read_log(path, "crazyflie_sd")
            commands = replace(log, rotor_speeds=np.full_like(log.rotor_speeds, np.nan))
            trims[f"{path.parent.name}__{path.name}"] = trim_of_log(commands, vehicle)
    return _each_compared(trims)


def _each_compared(trims: Mapping[str, Trim]) -> list[dict[str, Any]]:
    """Return the answer on each flight, against all other normal ones of the same vehicle."""
    rows = []
    for name, trim in trims.items():
        which = name.split("__")[1].split("_")[0]
        normal = [
            other
            for file, other in trims.items()
            if file.startswith("normal") and f"__{which}_" in file and file != name
        ]
        if normal:
            rows.append(_compared(name, compare_sets([trim], normal)))
    return rows


def _compared(name: str, change: Change) -> dict[str, Any]:
    """Return the answer of a comparison, beside the truth."""
    truth = truth_of(name)
    if_changed = max(
        (p for p in change.probabilities if p != NOWHERE), key=change.probabilities.__getitem__
    )
    return {
        "flight": name.removesuffix(".csv.gz"),
        "truth": truth,
        "place": change.place,
        "probability": change.probabilities[change.place],
        "if_changed": if_changed,
        "changed": 1.0 - change.probabilities[NOWHERE],
        "sure": change.sure,
        "difference": [*change.difference.values()],
        "right": change.place == truth,
        "right_if_changed": truth == NOWHERE or if_changed == truth,
        "sure_and_wrong": change.sure and change.place != truth,
    }


def motor_faults(folder: Path) -> list[dict[str, Any]]:
    """Search each ULog, and read from it what was commanded to fail, and when."""
    return [
        fault_data(find_fault(samples_of(read_log(path), path)))
        | {"log": path.name, "commanded": commanded_fault(path)}
        for path in sorted(folder.glob("*.ulg"))
    ]


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


def nanobench(folder: Path) -> list[dict[str, Any]]:
    """Return the folds of the NanoBench flights of a folder.

    Raises:
        InputError: there are fewer than three flights.
    """
    vehicle, paths = load_vehicle("crazyflie"), sorted(folder.glob("*.csv"))
    if len(paths) < 3:
        raise InputError(
            f"{folder}: {len(paths)} CSV file(s); expected at least three NanoBench flights"
        )
    logs = {p.stem: read_log(p, "nanobench", vehicle) for p in paths}
    folds = []
    for path in paths:
        test = path.stem
        print(f"NanoBench: {test} from all others", flush=True)
        diagnosis = diagnose([log for n, log in logs.items() if n != test], vehicle, [logs[test]])
        folds.append(
            {
                **compare(logs[test], diagnosis),
                "effects": names_of(diagnosis),
                "verdict": diagnosis.verdict,
                "imu": imu_check(path, logs[test], diagnosis),
            }
        )
    return folds


def slung_payload(folder: Path) -> list[dict[str, Any]]:
    """Return what is found on the groups of crazyswarm2 logs that are in a folder."""
    groups: list[tuple[Sequence[str], float, bool]] = [
        (numbers, CARRIER, True) for numbers in WITH_PAYLOAD
    ]
    groups += [(numbers, mass, False) for numbers, mass in NO_PAYLOAD]
    loads = []
    for numbers, mass, loaded in groups:
        if not all((folder / f"log{n}.csv").exists() for n in numbers):
            continue
        print(f"slung payload: {', '.join(numbers)}", flush=True)
        carrier = payload_vehicle(mass)
        logs = [read_log(folder / f"log{n}.csv", "crazyswarm2", carrier) for n in numbers]
        diagnosis = diagnose(logs, carrier)
        loads.append(
            {
                "logs": list(numbers),
                "payload": loaded,
                "mass": mass,
                "effects": names_of(diagnosis),
            }
        )
    return loads


# name of a part: its folder below the data folder, and what measures this folder
PARTS: Mapping[str, tuple[str, Callable[[Path], list[dict[str, Any]]]]] = {
    "nanobench": ("nanobench", nanobench),
    "slung_payload": ("crazyswarm2_payload/csv", slung_payload),
    "fan_wall": ("fan_wall", fan_wall),
    "crazypad": ("crazypad", crazypad),
    "crazypad_e8": ("crazypad_e8", crazypad_e8),
    "motor_faults": ("motor_faults", motor_faults),
}


def study(
    part: Annotated[str, typer.Option(help=f"One of {', '.join(PARTS)}.")],
    data: Annotated[Path, typer.Option(help="Folder of the parts' folders.")] = Path(
        "../shared/data"
    ),
) -> None:
    """Diagnose measured flights, test each on flights left out of its fit, and keep the results."""
    if part not in PARTS:
        raise unknown_name("part", part, PARTS)
    code = commit()  # before the diagnoses: the code that makes them
    folder, measure = PARTS[part]
    result = {"version": __version__, "commit": code, "flights": measure(data / folder)}
    write_json(result, DOCS / f"results/{part}.json", allow_nan=True)
    print(DOCS / f"results/{part}.json")


if __name__ == "__main__":
    start(study)
