"""Flight logs: the external wrench on a flight, the effects that its vehicle's model lacks, and the
flight drawn again.
"""

import math
import shlex
import sys
import warnings
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich import box
from rich.table import Table

from ..runtime.errors import InputError
from .fleets import diagnose_fleet
from .terminal import (
    MapOption,
    Out,
    ReaderOption,
    console,
    effect_names,
    note,
    offering,
    results_folder,
    say,
    vehicle_names,
    working,
)

if TYPE_CHECKING:
    from ..dynamics.vehicle import Vehicle
    from ..identification.findings import Diagnosis
    from ..identification.logs.flight_log import FlightLog

LogVehicleOption = Annotated[
    str | None,
    typer.Option(
        "--vehicle",
        help="Vehicle that flew: a preset (ardrone2, crazyflie, hummingbird) or a YAML file; "
        "required unless the log names it.",
        autocompletion=offering(vehicle_names),
    ),
]

# of a diagnosis' time, where its stages begin
STAGES = {
    "looking at the logs": 0.0,
    "asking whether every effect is needed": 0.45,
    "asking what else it could be": 0.75,
    "looking for structure in the residual": 0.9,
    "predicting the flights": 0.96,
}


def read_flights(
    paths: Sequence[Path], reader: str | None, vehicle: str | None, log_map: str | None = None
) -> "tuple[list[FlightLog], Vehicle]":
    """Read flights of one vehicle, the one given or the one that the logs name.

    Raises:
        InputError: a log cannot be read; or no vehicle is given, and the logs name none, none that
            comes with the kit, or several.
    """
    from ..dynamics.vehicle_file import load_vehicle, preset_names
    from ..identification.logs.reading import read_log

    model = None if vehicle is None else load_vehicle(vehicle)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # the notes say the same
        flights = [read_log(path, reader, model, log_map) for path in paths]
    if model is not None:
        return flights, model
    expected = f"--vehicle {', '.join(preset_names())} or the path of a YAML file"
    for path, flight in zip(paths, flights, strict=True):
        if not flight.vehicle:
            raise InputError(f"{path}: the log does not name its vehicle; expected {expected}")
        if flight.vehicle != flights[0].vehicle:
            raise InputError(
                f"{path}: names the vehicle {flight.vehicle}, {paths[0]} names "
                f"{flights[0].vehicle}; expected logs of one vehicle, or {expected}"
            )
        if flight.vehicle not in preset_names():
            raise InputError(
                f"{path}: names the vehicle {flight.vehicle}, which does not come with the kit; "
                f"expected {expected}"
            )
    return flights, load_vehicle(flights[0].vehicle)


def log_notes(texts: Iterable[str]) -> None:
    """Say notes on standard error, each once, and how often where that was more than once."""
    for text, count in Counter(texts).items():
        note(text if count == 1 else f"{text} ({count} times)")


def estimate(
    log: Annotated[Path, typer.Argument(help="Flight log: a table, or of an autopilot or a bag.")],
    reader: ReaderOption = None,
    map: MapOption = None,
    vehicle: LogVehicleOption = None,
    smooth: Annotated[
        bool | None,
        typer.Option(
            "--smooth/--no-smooth",
            help="Use the whole log for each time's estimate, or the past alone as on the vehicle; "
            "default: smooth, unless the log has one of gyro and accelerometer only, which the "
            "smoother does not take. A log without a pose is always smoothed, from both.",
        ),
    ] = None,
    gate: Annotated[
        float | None,
        typer.Option(
            help="Refuse poses that jump and are less likely than 1 minus this; 0: refuse none. "
            "Default: 0.9999.",
        ),
    ] = None,
    tune: Annotated[
        bool,
        typer.Option("--tune", help="Fit the filter's noise to this log first (some seconds)."),
    ] = False,
    out: Out = Path("results/estimate"),
) -> dict[str, Any]:
    """Estimate the wrench on a logged flight. Write wrench.csv and a picture.

    Example: windwrench estimate flight.csv --vehicle crazyflie
    """
    from ..identification.motion.inertial_signals import reads_imu
    from ..identification.report.wrench_picture import plot_wrench
    from ..identification.wrench_series import (
        GATE,
        counts,
        estimate_log,
        truth_rmse,
        tune_to_log,
        tuning_note_of,
        write_wrench,
    )

    if gate is None:
        gate = GATE
    elif gate != 0.0 and not 0.5 <= gate < 1.0:
        raise InputError(f"--gate: expected 0, or a probability from 0.5 to below 1, got {gate:g}")
    (flight,), model = read_flights([log], reader, vehicle, map)
    folder = results_folder(out)
    if smooth is None:
        smooth = (flight.gyro is None) == (flight.accelerometer is None)
    smooth = smooth or reads_imu(flight)
    fit = None
    if tune:
        with working("fitting the tuning"):
            fit = tune_to_log(flight, model)
    with working("estimating") as progress:
        series = estimate_log(
            flight, model, fit.tuning if fit else None, progress, smooth, gate or None
        )
    path = write_wrench(series, folder)
    picture = plot_wrench(series, flight, folder / "wrench.png")
    log_notes(series.notes)
    console.print(
        f"{flight.name}: {len(flight.t)} samples, {flight.t[-1] - flight.t[0]:.1f} s, vehicle "
        f"{model.name}",
        highlight=False,
    )
    table = Table("", "x", "y", "z", box=box.SIMPLE_HEAD)
    result: dict[str, Any] = {
        "log": flight.name,
        "vehicle": model.name,
        "samples": len(flight.t),
        "seconds": flight.t[-1] - flight.t[0],
        "smoothed": smooth,
        "status": counts(series),
        "restarts": int(series.restarts[-1]),
    }
    if fit is not None:
        result["tuning"] = fit.as_dict()
        console.print(str(fit), highlight=False, markup=False)
    elif unsuited := tuning_note_of(flight, model):
        note(f"{unsuited} Use --tune to fit the tuning to this log.")
    for name, values, unit in (("force", series.force, "N"), ("torque", series.torque, "Nm")):
        result |= {
            f"{name}_mean_{unit}": values.mean(axis=0),
            f"{name}_std_{unit}": values.std(axis=0),
        }
        table.add_row(f"{name}, mean ({unit})", *(f"{v:+.4g}" for v in values.mean(axis=0)))
        table.add_row(f"{name}, std ({unit})", *(f"{v:.4g}" for v in values.std(axis=0)))
    truth = truth_rmse(series, flight)
    if truth is not None:
        for name, error, unit in (("force", truth[0], "N"), ("torque", truth[1], "Nm")):
            result[f"{name}_rmse_to_truth_{unit}"] = error
            table.add_row(f"{name}, RMSE to truth ({unit})", *(f"{v:.4g}" for v in error))
    console.print(table)
    say(path, picture)
    return result


def diagnose(
    logs: Annotated[
        list[Path] | None,
        typer.Argument(
            help="Flight logs of one vehicle: tables, or of autopilots or bags; with --fleet, logs "
            "of any vehicles and folders of them."
        ),
    ] = None,
    example: Annotated[
        bool,
        typer.Option(
            "--example",
            help="Diagnose a measured flight that comes with the kit, beside what is known of it, "
            "and open the report.",
        ),
    ] = False,
    no_open: Annotated[
        bool,
        typer.Option("--no-open", help="With --example: do not open the report in a browser."),
    ] = False,
    test: Annotated[
        list[Path] | None,
        typer.Option(
            help="Test log: kept out of the fit, the error is reported on test logs alone; may be "
            "repeated."
        ),
    ] = None,
    reader: ReaderOption = None,
    map: MapOption = None,
    against: Annotated[
        list[Path] | None,
        typer.Option(
            help="Log of the same vehicle before a change; may be repeated. Then only what changed "
            "is looked for (which rotor, which side), and no model has to be true.",
        ),
    ] = None,
    rotor_faults: Annotated[
        bool,
        typer.Option(
            "--rotor-faults",
            help="Look only for a rotor that lost thrust during a flight: which, when and how "
            "much. Needs gyro, accelerometer and motor commands; no pose and no vehicle.",
        ),
    ] = False,
    without: Annotated[
        list[str] | None,
        typer.Option(
            help="Effect to leave out of the library; may be repeated.",
            autocompletion=offering(effect_names),
        ),
    ] = None,
    probabilities: Annotated[
        bool,
        typer.Option(
            "--probabilities/--no-probabilities",
            help="Say how probable each name is, its alternatives, and that something unknown "
            "acts; it takes some seconds a minute of flight.",
        ),
    ] = True,
    vehicle: LogVehicleOption = None,
    fleet: Annotated[
        bool,
        typer.Option(
            "--fleet",
            help="Diagnose each log by itself, many at a time; write one page and table of all: "
            "fleet.html, fleet.json, fleet.csv, fleet.png. A run that was ended goes on.",
        ),
    ] = False,
    manifest: Annotated[
        Path | None,
        typer.Option(
            help="With --fleet: which log is of which vehicle (.yaml or .csv); default: fleet.yaml "
            "in the folder of logs."
        ),
    ] = None,
    cluster: Annotated[
        str | None,
        typer.Option(help="With --fleet: address of a Ray cluster to work on, or local."),
    ] = None,
    jobs: Annotated[
        int | None,
        typer.Option(min=1, help="With --fleet: number of processes; default: one per core."),
    ] = None,
    limit: Annotated[
        float | None,
        typer.Option(
            min=1.0,
            help="With --fleet: longest time for one log, s; default: 600. Then it is refused.",
        ),
    ] = None,
    out: Out = Path("results/diagnose"),
) -> dict[str, Any]:
    """Find effects that a vehicle's model lacks. From flight logs; write report.json, report.html
    and vehicle.yaml.

    Example: windwrench diagnose flight.csv --vehicle my_drone.yaml --out results/my_drone
    """
    if example:
        given: dict[str, Any] = {"LOGS": logs, "--vehicle": vehicle, "--reader": reader}
        given |= {"--map": map, "--test": test, "--against": against, "--fleet": fleet}
        for option, is_given in {**given, "--rotor-faults": rotor_faults}.items():
            if is_given:
                raise InputError(f"--example: has a log of its own; expected it without {option}")
        return _example(without or (), out, no_open, probabilities)
    if not logs:
        raise InputError("diagnose: expected at least one flight log, or --example")
    if rotor_faults:
        if against or test:
            raise InputError("--rotor-faults: expected neither --against nor --test with it")
        return _rotor_faults(logs, reader, vehicle, out, map)
    if fleet:
        if test or against:
            raise InputError(
                "--fleet: each log is diagnosed by itself; expected no --test, --against"
            )
        return diagnose_fleet(
            logs, vehicle, reader, map, without or (), manifest, cluster, jobs, limit, out
        )
    alone = {"--manifest": manifest, "--cluster": cluster, "--jobs": jobs, "--limit": limit}
    for option, value in alone.items():
        if value is not None:
            raise InputError(f"{option}: expected --fleet with it")
    if against:
        return _compare(logs, against, reader, vehicle, out, map)
    return _diagnose(logs, test or [], reader, vehicle, map, without or (), out, probabilities)


def _example(
    without: Sequence[str], out: Path, no_open: bool, probabilities: bool
) -> dict[str, Any]:
    """Diagnose the flight that comes with the kit."""
    from ..identification.logs.example import example_flight
    from .example import conclude, introduce
    from .opening import show_page

    with example_flight() as flight:
        introduce(flight)
        result = _diagnose(
            [flight.log], [], None, flight.vehicle, None, without, out, probabilities
        )
    result["known"] = conclude(flight, result["effects"])
    show_page(out / "report.html", not no_open)
    return result


def _diagnose(
    logs: Sequence[Path],
    test: Sequence[Path],
    reader: str | None,
    vehicle: str | None,
    log_map: str | None,
    without: Sequence[str],
    out: Path,
    probabilities: bool,
) -> dict[str, Any]:
    """Find the effects that a vehicle's model lacks; write the report."""
    from ..identification.diagnosis import diagnose as run
    from ..identification.report.files import report_data, write_report
    from ..identification.report.words import (
        error_sentences,
        headline,
        name_in_words,
        percent,
        remainder_sentence,
    )

    every, model = read_flights([*logs, *test], reader, vehicle, log_map)
    flights, unseen = every[: len(logs)], every[len(logs) :]
    folder = results_folder(out)
    with working("looking at the logs") as progress:
        found = run(
            flights,
            model,
            unseen,
            without,
            lambda text: progress(STAGES.get(text), text),
            probabilities,
        )
    found = _with_rotor_faults(found, logs, flights)
    # before a word is said: a reader who has read enough (a pipe to head) must not cost the results
    written = write_report(found, folder, shlex.join(["windwrench", *sys.argv[1:]]))
    log_notes(found.notes)
    console.print(f"vehicle: {model.name}", highlight=False, markup=False)
    faults = [data["headline"] for data in found.rotor_faults if data["rotor"] is not None]
    sentences = (headline(found), *error_sentences(found), remainder_sentence(found), *faults)
    for sentence in sentences:
        console.print(sentence, highlight=False, markup=False)
    if found.effects:
        stated = found.probabilities.names if found.probabilities else {}
        last = ["probability"] if stated else []
        table = Table("effect", "coefficient", "value", "+-", "unit", *last, box=box.SIMPLE_HEAD)
        for effect in found.effects:
            for i, (name, value) in enumerate(effect.coefficients.items()):
                first = i == 0
                table.add_row(
                    name_in_words(effect) if first else "",
                    name,
                    f"{value:.4g}",
                    f"{effect.std[name]:.2g}",
                    effect.units[name],
                    *([percent(stated[effect.name]) if first else ""] if stated else []),
                )
        console.print(table)
    table = Table("error on held-out data", "before", "after", "noise floor", box=box.SIMPLE_HEAD)
    before, after = found.before, found.after
    table.add_row(
        "force (N)",
        f"{before.force_rms:.3g}",
        f"{after.force_rms:.3g}",
        f"{found.floor_force_rms:.3g}",
    )
    torques = (before.torque_rms, after.torque_rms, found.floor_torque_rms)
    # zero before and after: these logs cannot tell it
    told = [f"{x:.3g}" for x in torques] if any(torques[:2]) else ["–", "–", ""]
    table.add_row("torque (Nm)", *told)
    table.add_row(
        "1 s prediction (m)",
        *(  # none where no pose says how it went on
            f"{x:.3g}" if math.isfinite(x) else "–"
            for x in (before.rollout_1s_position_rms, after.rollout_1s_position_rms)
        ),
        "",
    )
    console.print(table)
    for line in found.advice:
        console.print(line, highlight=False, markup=False)
    say(*written)
    return report_data(found)


def _compare(
    logs: Sequence[Path],
    against: Sequence[Path],
    reader: str | None,
    vehicle: str | None,
    out: Path,
    log_map: str | None = None,
) -> dict[str, Any]:
    """Find what changed between two sets of flights; write change.json and change.png."""
    from ..identification.comparison.change import compare
    from ..identification.comparison.trim import trim_of_log
    from ..identification.comparison.words import change_data, change_headline, write_change

    every, model = read_flights([*logs, *against], reader, vehicle, log_map)
    folder = results_folder(out)
    trims = [trim_of_log(log, model) for log in every]
    change = compare(trims[: len(logs)], trims[len(logs) :])
    written = write_change(change, folder)
    log_notes(text for log in every for text in log.notes)
    console.print(f"vehicle: {model.name}", highlight=False, markup=False)
    console.print(change_headline(change), highlight=False, markup=False)
    table = Table("where something changed", "probability", box=box.SIMPLE_HEAD)
    for name, chance in sorted(change.places.items(), key=lambda item: -item[1]):
        table.add_row(name, f"{chance:.3f}")
    console.print(table)
    say(*written)
    return change_data(change)


def _with_rotor_faults(
    found: "Diagnosis", paths: Sequence[Path], flights: "Sequence[FlightLog]"
) -> "Diagnosis":
    """Add whether a rotor lost thrust during a flight, for the logs that can show it."""
    from ..identification.comparison.fault_channels import channels_of
    from ..identification.comparison.fault_detection import find_fault
    from ..identification.comparison.words import fault_data

    faults = []
    with working("looking for a rotor that lost thrust"):
        for path, log in zip(paths, flights, strict=True):
            try:
                faults.append(fault_data(find_fault(channels_of(path, log))))
            except InputError:
                continue  # no gyro, no accelerometer, no command, or too little flight
    notes = tuple(data["headline"] for data in faults if data["rotor"] is not None)
    return replace(found, rotor_faults=tuple(faults), notes=(*found.notes, *notes))


def _rotor_faults(
    logs: Sequence[Path],
    reader: str | None,
    vehicle: str | None,
    out: Path,
    log_map: str | None,
) -> dict[str, Any]:
    """Look for rotors that lost thrust during flights; write rotor_faults.json and a picture."""
    from ..dynamics.vehicle_file import load_vehicle
    from ..identification.comparison.fault_channels import read_channels, sample
    from ..identification.comparison.fault_detection import find_fault
    from ..identification.comparison.words import fault_data, fault_headline, write_faults

    model = None if vehicle is None else load_vehicle(vehicle)
    read = [read_channels(path, reader, model, log_map) for path in logs]
    folder = results_folder(out)
    found = []
    with working("looking for a rotor that lost thrust") as progress:
        for i, (channels, _) in enumerate(read):
            progress(i / len(read))
            found.append((find_fault(channels), sample(channels)))
    written = write_faults(found, folder)
    log_notes(text for _, notes in read for text in notes)
    for fault, samples in found:
        ended = f"; nothing later: {samples.ended}" if samples.ended else ""
        console.print(
            f"{fault.name}: {fault.seconds:.1f} s in flight{ended}", highlight=False, markup=False
        )
        console.print(fault_headline(fault), highlight=False, markup=False)
    say(*written)
    return {"rotor_faults": [fault_data(fault) for fault, _ in found]}
