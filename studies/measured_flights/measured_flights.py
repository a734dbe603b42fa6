"""The diagnosis on measured flights: NanoBench (PWM, battery, motion capture) and slung payloads
(commanded thrust).

Every fold is one call of ``diagnose`` on some flights, judged on flights left out of this fit.
The diagnosis of commanded flights itself was developed on these very flights, which the page says.
Forces are stated as accelerations by the declared mass, through a 4 Hz low-pass with zero phase,
over the time in the air.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from numpy.typing import NDArray

from windwrench import __version__
from windwrench.dynamics.effects import get
from windwrench.dynamics.vehicle import EffectSetting, Vehicle
from windwrench.dynamics.vehicle_file import load_vehicle
from windwrench.identification.diagnosis import diagnose
from windwrench.identification.findings import Diagnosis
from windwrench.identification.inference.commanded_rotors import in_flight
from windwrench.identification.inference.regression import Flights
from windwrench.identification.logs.flight_log import FlightLog
from windwrench.identification.logs.reading import read_log
from windwrench.identification.logs.tables import open_table
from windwrench.identification.motion.residual import residual_wrench
from windwrench.identification.motion.sensing_effects import undo_log_sensing
from windwrench.identification.motion.signals import Signals, log_signals
from windwrench.identification.motion.smoothing import low_pass
from windwrench.runtime.errors import InputError
from windwrench.runtime.page_files import write_json, write_png
from windwrench.runtime.provenance import commit, made_by

Array = NDArray[np.float64]

CUTOFF_HZ = 4.0
_EDGE = 0.6  # s at either end, where filters start
_DAY = 86400.0  # s
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


def motion(log: FlightLog, vehicle: Vehicle) -> Signals:
    """Return the signals of the longest piece of a log in the air, with the vehicle's sensing
    effects undone.
    """
    pieces = log_signals(undo_log_sensing(in_flight(log, vehicle), vehicle))
    return max(pieces, key=lambda s: len(s.t))


def acceleration_residual(log: FlightLog, vehicle: Vehicle, mass: float) -> Array:
    """Return the residual force (n, 3) by ``mass`` in m/s2, world, low-passed,
    without the edges.
    """
    s = motion(log, vehicle)
    edge = round(_EDGE / s.period)
    return low_pass(residual_wrench(s, vehicle)[:, :3] / mass, CUTOFF_HZ, s.period)[edge:-edge]


def constant_thrust(log: FlightLog, vehicle: Vehicle) -> Array:
    """Return what (n, 3) m/s2 is left if thrust is taken to be the weight all the time."""
    s = motion(log, replace(vehicle, effects=()))
    edge = round(_EDGE / s.period)
    up = np.array([0.0, 0.0, vehicle.gravity])
    return low_pass(
        s.acceleration + up - vehicle.gravity * s.rotation[:, :, 2], CUTOFF_HZ, s.period
    )[edge:-edge]


def level(x: Array) -> list[float]:
    """Return the RMS per axis."""
    return [float(v) for v in np.sqrt(np.mean(np.square(x), axis=0))]


def spread(x: Array) -> list[float]:
    """Return the standard deviation per axis."""
    return [float(v) for v in x.std(axis=0)]


def compare(log: FlightLog, diagnosis: Diagnosis) -> dict[str, Any]:
    """Return how far a test flight is from the declared vehicle and from the amended one."""
    declared, amended = diagnosis.declared, diagnosis.amended
    before = acceleration_residual(log, declared, declared.mass)
    after = acceleration_residual(log, amended, declared.mass)
    constant = constant_thrust(log, declared)
    return {
        "flight": log.name,
        "before_rms": level(before),
        "after_rms": level(after),
        "before_std": spread(before),
        "after_std": spread(after),
        "constant_thrust_std": spread(constant),
        "norm_before": float(np.sqrt(np.mean(np.sum(before**2, axis=1)))),
        "norm_after": float(np.sqrt(np.mean(np.sum(after**2, axis=1)))),
        "drag_N_per_mps": linear_drag(diagnosis),
    }


def linear_drag(diagnosis: Diagnosis) -> list[float]:
    """Return the linear drag along body x and y in N per m/s; rotor drag at the rotor speeds of
    hover.
    """
    for e in diagnosis.effects:
        if e.name == "body_drag":
            return [e.coefficients["dx"], e.coefficients["dy"]]
        if e.name == "rotor_drag":
            rate = 4.0 * diagnosis.declared.hover_rate
            return [rate * e.coefficients["kdx"], rate * e.coefficients["kdy"]]
    return [0.0, 0.0]


def imu_check(path: Path, log: FlightLog, diagnosis: Diagnosis) -> dict[str, float]:
    """Return how the model's vertical specific force agrees with an accelerometer that nothing else
    here looks at (m/s2).
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
    edge = round(_EDGE / s.period)

    def along(x: Array) -> Array:
        return low_pass(np.einsum("ni,ni->n", x, s.rotation[:, :, 2]), CUTOFF_HZ, s.period)[
            edge:-edge
        ]

    imu = low_pass(measured, CUTOFF_HZ, s.period)[edge:-edge]
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


def nanobench_flights(folder: Path, vehicle: Vehicle) -> dict[str, tuple[Path, FlightLog, int]]:
    """Return the NanoBench flights of a folder: path, log and day of recording.

    Raises:
        InputError: there are fewer than three.
    """
    return {
        p.stem: (
            p,
            read_log(p, "nanobench", vehicle),
            int(open_table(p).read(["t"])["t"][0] // _DAY),
        )
        for p in _nanobench_paths(folder)
    }


def _nanobench_paths(folder: Path) -> list[Path]:
    paths = sorted(folder.glob("*.csv"))
    if len(paths) < 3:
        raise InputError(
            f"{folder}: {len(paths)} CSV file(s); expected at least three NanoBench flights"
        )
    return paths


def nanobench_fold(
    logs: Sequence[FlightLog], test: Sequence[FlightLog], vehicle: Vehicle
) -> tuple[Diagnosis, list[dict[str, Any]]]:
    """Return the diagnosis of some flights and how it does on others."""
    diagnosis = diagnose(logs, vehicle, test)
    return diagnosis, [compare(log, diagnosis) for log in test]


def payload_vehicle(mass: float) -> Vehicle:
    """Return a Crazyflie of this mass whose file states a cable of 0.5 m and leaves load and
    damping open.
    """
    return replace(
        load_vehicle("crazyflie"),
        mass=mass,
        effects=(EffectSetting("slung_payload", {"l": CABLE}),),
    )


def payload_logs(folder: Path, numbers: Sequence[str], vehicle: Vehicle) -> list[FlightLog]:
    """Return crazyswarm2 logs by number."""
    return [read_log(folder / f"log{n}.csv", "crazyswarm2", vehicle) for n in numbers]


def swing(log: FlightLog, diagnosis: Diagnosis) -> dict[str, list[float]] | None:
    """Return how strongly the cable pulls sideways (standard deviation, N, x and y): by the model,
    and by the payload's track.
    """
    found = next((e for e in diagnosis.effects if e.name == "slung_payload"), None)
    if found is None or "payload_position" not in log.extra:
        return None
    bare = replace(diagnosis.declared, effects=())
    flights = Flights([log], bare)
    setting = {e.name: dict(e.coefficients) for e in diagnosis.amended.effects}
    law = flights.residual(
        {k: v for k, v in setting.items() if k != "slung_payload"}
    ) - flights.residual(setting)
    s = motion(log, bare)
    track = np.column_stack([np.interp(s.t, log.t, x) for x in log.extra["payload_position"].T])
    smooth = low_pass(track, CUTOFF_HZ, s.period)
    pull = -PAYLOAD * np.gradient(np.gradient(smooth, s.period, axis=0), s.period, axis=0)
    edge = round(_EDGE / s.period)
    return {"law_std": spread(law[:, :2]), "tracked_std": spread(pull[edge:-edge, :2])}


def plan(nanobench: Path, payload: Path) -> dict[str, list[str]]:
    """Return what ``run`` diagnoses: flights, each in folds of its own, and logs of payloads.

    Raises:
        InputError: flights are missing.
    """
    groups = [list(numbers) for numbers in WITH_PAYLOAD] + [
        list(numbers) for numbers, _ in NO_PAYLOAD
    ]
    return {
        "nanobench": [p.stem for p in _nanobench_paths(nanobench)],
        "slung payload": [
            ", ".join(g) for g in groups if all((payload / f"log{n}.csv").exists() for n in g)
        ],
    }


def run(
    out: Path,
    nanobench: Path,
    payload: Path,
    report: Callable[[float, str], None] = lambda share, text: None,
) -> dict[str, Any]:
    """Diagnose the measured flights in folds; write ``real_flights.json`` and the pictures to a
    folder.

    Args:
        out: folder for the files.
        nanobench: folder with NanoBench CSV files.
        payload: folder with crazyswarm2 CSV files.
        report: called with the share that is done and what comes next.

    Raises:
        InputError: flights are missing or a file cannot be written.
    """
    code = commit()  # before the diagnoses: the code that makes them
    vehicle = load_vehicle("crazyflie")
    flights = nanobench_flights(nanobench, vehicle)
    folds: list[dict[str, Any]] = []
    kept: dict[str, tuple[FlightLog, Diagnosis]] = {}
    groups_of = [(numbers, CARRIER, True) for numbers in WITH_PAYLOAD] + [
        (n, m, False) for n, m in NO_PAYLOAD
    ]
    steps = len(flights) + len(groups_of)
    for done, test in enumerate(flights):
        groups = {"all others": [n for n in flights if n != test]}
        same = [n for n in flights if n != test and flights[n][2] == flights[test][2]]
        if 2 <= len(same) < len(groups["all others"]):
            groups["the same day"] = same
        for words, names in groups.items():
            report(done / steps, f"NanoBench: {test} from {words}")
            diagnosis, (row,) = nanobench_fold(
                [flights[n][1] for n in names], [flights[test][1]], vehicle
            )
            folds.append(
                {
                    "fitted_on": words,
                    "flights": names,
                    **row,
                    "effects": names_of(diagnosis),
                    "verdict": diagnosis.verdict,
                    "remainder": diagnosis.remainder,
                    "imu": imu_check(flights[test][0], flights[test][1], diagnosis),
                }
            )
            kept[test] = flights[test][1], diagnosis
    loads = []
    for done, (numbers, mass, loaded) in enumerate(groups_of, len(flights)):
        if not all((payload / f"log{n}.csv").exists() for n in numbers):
            continue
        report(done / steps, f"slung payload: {', '.join(numbers)}")
        carrier = payload_vehicle(mass)
        logs = payload_logs(payload, numbers, carrier)
        diagnosis = diagnose(logs, carrier)
        loads.append(
            {
                "logs": list(numbers),
                "payload": loaded,
                "mass": mass,
                "effects": names_of(diagnosis),
                "swing": {log.name: swing(log, diagnosis) for log in logs},
            }
        )
    result = {
        "version": __version__,
        "commit": code,
        "cutoff_hz": CUTOFF_HZ,
        "nanobench": folds,
        "slung_payload": loads,
    }
    write_json(result, out / "real_flights.json", allow_nan=True)
    _picture(kept, out / "nanobench.png")
    return result


def _picture(kept: Mapping[str, tuple[FlightLog, Diagnosis]], path: Path) -> None:
    figure, panels = plt.subplots(
        len(kept),
        3,
        figsize=(11, 2.0 * len(kept)),
        sharex="col",
        squeeze=False,
        layout="constrained",
    )
    for row, (name, (log, diagnosis)) in zip(panels, kept.items(), strict=True):
        mass = diagnosis.declared.mass
        before, after = (
            acceleration_residual(log, v, mass) for v in (diagnosis.declared, diagnosis.amended)
        )
        for i, (panel, axis) in enumerate(zip(row, "xyz", strict=True)):
            for x, words in ((before, "declared"), (after, "amended")):
                panel.plot(
                    np.arange(len(x)) / 100.0,
                    x[:, i] - x[:, i].mean() * (i < 2),
                    lw=0.8,
                    label=words,
                )
            panel.set_title(
                f"{name.split('_')[0]}, {axis}" + (", mean removed" if i < 2 else ""), fontsize=9
            )
    panels[0, 0].legend(fontsize=8)
    figure.supylabel("residual (m/s2)")
    figure.supxlabel("time in the air (s)")
    write_png(figure, path)
    plt.close(figure)


def ratio(folds: Sequence[Mapping[str, Any]], before: str, after: str, axis: int) -> float:
    """Return by how many times the pooled residual of an axis falls over folds."""
    a, b = (np.sqrt(np.mean([f[key][axis] ** 2 for f in folds])) for key in (before, after))
    return float(a / b)


def page(result: Mapping[str, Any], folder: str) -> str:
    """Return the page (Markdown) of a result whose pictures lie in ``folder``."""
    lines = [
        "# The diagnosis on measured flights",
        "",
        made_by("windwrench real-flights", [result["commit"]], result["version"]),
        "",
        "Residuals are accelerations by the declared mass (m/s2) through a "
        f"{result['cutoff_hz']:g} Hz low-pass, of flights left out of the fit, with one thrust "
        f"scale for all "
        "flights.",
        "",
        *_WARNING,
        "",
        "Cut propellers, weights and failing motors have a page of their own: [real faults]"
        "(real-faults.md).",
        "",
        "## NanoBench",
        "",
        *_nanobench_lines(result["nanobench"], folder),
        "",
        "## Slung payload",
        "",
        *_payload_lines(result["slung_payload"]),
        "",
        f"Data: [real_flights.json]({folder}/real_flights.json).",
    ]
    return "\n".join(lines) + "\n"


_WARNING = (
    "**How blind this is.** Coefficients are fitted without the test flight. But these flights "
    "were at hand when some settings were chosen: the time by which the reader puts the battery's "
    "voltage sooner, the thresholds for flights known from commands, the band that weighs their "
    "coefficients, and the share that a slung load must explain. So was the rule that thrust may "
    "also bend and fade once it is known to follow the battery. The delay is measured apart, from "
    "how the vehicles turn (`identification/inference/turning_delay.py`); only its band was set by "
    "these flights. Flights that were not here are the real test.",
)


def unmet(fold: Mapping[str, Any]) -> list[str]:
    """Return which of the bounds that the diagnosis aims at a fold misses, in words."""
    named = {e["name"]: e["coefficients"] for e in fold["effects"]}
    delay = next(
        (
            next(iter(named[n].values()))
            for n in ("motor_lag", "latency", "clock_offset")
            if n in named
        ),
        0.0,
    )
    drag, before, after = fold["drag_N_per_mps"], fold["before_std"], fold["after_std"]
    bounds = {
        "vertical at most 0.18 m/s2": fold["after_rms"][2] <= 0.18,
        "vertical down 5 times": fold["before_rms"][2] >= 5 * fold["after_rms"][2],
        "vertical below constant thrust": after[2] < fold["constant_thrust_std"][2],
        "x down 1.9 times": before[0] >= 1.9 * after[0],
        "y down 4 times": before[1] >= 4.0 * after[1],
        "all three axes down 4 times": fold["norm_before"] >= 4 * fold["norm_after"],
        "battery_sag named": "battery_sag" in named,
        "drag of 0.0095 to 0.012 N per m/s": all(0.0095 <= d <= 0.012 for d in drag),
        "delay of 30 to 55 ms": 0.030 <= delay <= 0.055,
    }
    return [words for words, met in bounds.items() if not met]


def _nanobench_lines(rows: Sequence[Mapping[str, Any]], folder: str) -> list[str]:
    lines = [
        "Pose, PWM and battery voltage alone; the accelerometer is used for the last column only. "
        "*Constant* is "
        "what is left if thrust is taken to be constant; it and *own mean* are with each flight's "
        "mean removed.",
        "",
        "| test flight | fitted on | z before | z after | z own mean | z constant | x fell by | y "
        "fell by | 3-D fell by "
        "| IMU z, model / constant |",
        "|---|---|---|---|---|---|---|---|---|---|",
    ]
    for f in rows:
        x, y = (f["before_std"][i] / f["after_std"][i] for i in range(2))
        lines.append(
            f"| {f['flight']} | {f['fitted_on']} | {f['before_rms'][2]:.2f} | "
            f"{f['after_rms'][2]:.3f} | "
            f"{f['after_std'][2]:.3f} | {f['constant_thrust_std'][2]:.3f} | {x:.1f} | {y:.1f} | "
            f"{f['norm_before'] / f['norm_after']:.1f} | {f['imu']['model_std']:.3f} / "
            f"{f['imu']['constant_std']:.3f} |"
        )
    for words in dict.fromkeys(f["fitted_on"] for f in rows):
        folds = [f for f in rows if f["fitted_on"] == words]
        rms = float(np.sqrt(np.mean([f["after_rms"][2] ** 2 for f in folds])))
        fell = [ratio(folds, "before_std", "after_std", i) for i in range(2)]
        beside = [ratio(folds, "constant_thrust_std", "after_std", i) for i in range(3)]
        lines += [
            "",
            f"Fitted on {words}, pooled: vertical {rms:.3f} m/s2, down "
            f"{ratio(folds, 'before_rms', 'after_rms', 2):.0f} times; lateral, mean removed, down "
            f"{fell[0]:.1f} "
            f"times in x and {fell[1]:.1f} in y. Against constant thrust, a before that no wrong "
            f"scale makes larger: "
            f"{beside[0]:.2f} in x, {beside[1]:.2f} in y, {beside[2]:.2f} in z.",
        ]
    lines += ["", "Bounds that this diagnosis aims at, and who misses them:", ""]
    lines += [
        f"* {f['flight']} from {f['fitted_on']}: {'; '.join(unmet(f)) or 'meets them all'}"
        for f in rows
    ]
    lines += [
        "",
        "The residual before is large because the reader's thrust curve belongs to a full battery: "
        "it is the "
        "figure against constant thrust that says what the named effects are worth. What *z after* "
        "has over *own "
        "mean* is the difference between flights that one thrust scale cannot hold.",
        "",
        f"![Residuals of test flights]({folder}/nanobench.png)",
        "",
        "| test flight | fitted on | effect | coefficients | not separable from |",
        "|---|---|---|---|---|",
    ]
    for f in rows:
        lines += [
            f"| {f['flight']} | {f['fitted_on']} | {_effect_cells(e)} |" for e in f["effects"]
        ]
        drag = " and ".join(f"{d:.4f}" for d in f["drag_N_per_mps"])
        lines.append(
            f"| {f['flight']} | {f['fitted_on']} | *linear drag* | {drag} N per m/s in x and y | |"
        )
    return [
        *lines,
        "",
        "Of the constant offset: a frame that is tilted (`world_tilt`) and a steady force "
        "(`constant_force`) are "
        "the same while yaw hardly changes. Torque is left out: what PWM would make of it hardly "
        "shows in how these "
        "vehicles turn, but for its timing. thrust_curvature and thrust_fade are asked for only "
        "once battery_sag is named.",
    ]


def _payload_lines(rows: Sequence[Mapping[str, Any]]) -> list[str]:
    lines = [
        f"Truth: {1000 * PAYLOAD:g} g on {CABLE:g} m. The vehicle's file states the cable's "
        f"length.",
        "",
        "| logs | payload | effect | coefficients | not separable from |",
        "|---|---|---|---|---|",
    ]
    for load in rows:
        lines += [
            f"| {', '.join(load['logs'])} | {'yes' if load['payload'] else 'no'} | "
            f"{_effect_cells(e)} |"
            for e in load["effects"]
        ]
    lines += [
        "",
        "How strongly the cable pulls sideways (standard deviation, mN, x and y): by the fitted "
        "effect model, and by "
        "the payload "
        "that was tracked apart.",
        "",
        "| fitted on | flight | effect model | tracked |",
        "|---|---|---|---|",
    ]
    for load in rows:
        for name, s in load["swing"].items():
            if s is not None:
                law, tracked = (
                    ", ".join(f"{1000 * v:.1f}" for v in s[k]) for k in ("law_std", "tracked_std")
                )
                lines.append(f"| {', '.join(load['logs'])} | {name} | {law} | {tracked} |")
    return lines


def _effect_cells(effect: Mapping[str, Any]) -> str:
    units = {c.name: c.unit for c in get(effect["name"]).coefficients}
    values = ", ".join(
        f"{k} = {v:.3g}{'' if units[k] == '1' else ' ' + units[k]}"
        for k, v in effect["coefficients"].items()
    )
    name = effect["name"] + (" (tentative)" if effect["tentative"] else "")
    return f"{name} | {values} | {', '.join(effect['indistinguishable_from'])}"
