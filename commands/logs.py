"""Measured flights: the wrench on a log, and what the model of its vehicle lacks."""

import shlex
import sys
import warnings
from pathlib import Path
from typing import Annotated

import typer
from rich import box
from rich.table import Table

from .terminal import Out, VehicleOption, console, errors, results_folder, say


def estimate(
    log: Annotated[Path, typer.Argument(help="Flight log: .csv, .csv.gz or .parquet.")],
    reader: Annotated[str | None, typer.Option(help="For a log of another form: nanobench, crazyswarm2, px4_ulog, rosbag "
                                                    "or rosbag:TOPICS.yaml.")] = None,
    vehicle: VehicleOption = "ardrone2",
    out: Out = Path("results/estimate"),
) -> None:
    """Estimate the external wrench on a logged flight; write wrench.csv and a picture.

    Example: windwrench estimate flight.csv --reader nanobench --vehicle crazyflie
    """
    from ..dynamics.vehicle_file import load_vehicle
    from ..identification.estimate import estimate_log, plot_wrench, truth_rmse, write_wrench
    from ..identification.flight_log import read_log

    model = load_vehicle(vehicle)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # the notes say the same
        flight = read_log(log, reader, model)
    folder = results_folder(out)
    with console.status("estimating"):
        series = estimate_log(flight, model)
    path = write_wrench(series, folder)
    picture = plot_wrench(series, flight, folder / "wrench.png")
    for note in dict.fromkeys((*flight.notes, *series.notes)):
        errors.print(note, style="yellow" if note.startswith("warning") else "dim", highlight=False, markup=False)
    console.print(f"{flight.name}: {len(flight.t)} samples, {flight.t[-1] - flight.t[0]:.1f} s", highlight=False)
    table = Table("", "x", "y", "z", box=box.SIMPLE_HEAD)
    for name, values, unit in (("force", series.force, "N"), ("torque", series.torque, "Nm")):
        table.add_row(f"{name}, mean ({unit})", *(f"{v:+.4g}" for v in values.mean(axis=0)))
        table.add_row(f"{name}, std ({unit})", *(f"{v:.4g}" for v in values.std(axis=0)))
    truth = truth_rmse(series, flight)
    if truth is not None:
        for name, error, unit in (("force", truth[0], "N"), ("torque", truth[1], "Nm")):
            table.add_row(f"{name}, RMSE to truth ({unit})", *(f"{v:.4g}" for v in error))
    console.print(table)
    say(path, picture)


def diagnose(
    logs: Annotated[list[Path], typer.Argument(help="Flight logs of one vehicle: .csv, .csv.gz or .parquet.")],
    test: Annotated[list[Path] | None, typer.Option(help="Log on which alone the error is reported; may be repeated.")] = None,
    reader: Annotated[str | None, typer.Option(help="For logs of another form: nanobench, crazyswarm2, px4_ulog, rosbag or "
                                                    "rosbag:TOPICS.yaml.")] = None,
    without: Annotated[list[str] | None, typer.Option(help="Effect to take out of the library; may be repeated.")] = None,
    vehicle: VehicleOption = "ardrone2",
    out: Out = Path("results/diagnose"),
) -> None:
    """Find the physical effects that a vehicle's model lacks; write report.json, report.html and vehicle.yaml.

    Example: windwrench diagnose flight.csv --vehicle my_drone.yaml --out results/my_drone
    """
    from ..dynamics.vehicle_file import load_vehicle
    from ..identification.diagnosis import diagnose as run
    from ..identification.flight_log import read_log
    from ..identification.report import write_report
    from ..identification.report_words import error_sentences, headline, remainder_sentence

    model = load_vehicle(vehicle)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # the notes say the same
        flights = [read_log(path, reader, model) for path in logs]
        unseen = [read_log(path, reader, model) for path in test or []]
    folder = results_folder(out)
    with console.status("looking at the logs") as status:
        found = run(flights, model, unseen, without or (), lambda text: status.update(text))
    for note in found.notes:
        errors.print(note, style="dim", highlight=False, markup=False)
    for sentence in (headline(found), *error_sentences(found), remainder_sentence(found)):
        console.print(sentence, highlight=False, markup=False)
    if found.effects:
        table = Table("effect", "coefficient", "value", "+-", "unit", box=box.SIMPLE_HEAD)
        for effect in found.effects:
            for i, (name, value) in enumerate(effect.coefficients.items()):
                title = effect.name + (" (tentative)" if effect.tentative else "") if i == 0 else ""
                table.add_row(title, name, f"{value:.4g}", f"{effect.std[name]:.2g}", effect.units[name])
        console.print(table)
    table = Table("held-out", "before", "after", "floor", box=box.SIMPLE_HEAD)
    before, after = found.before, found.after
    table.add_row("force (N)", f"{before.force_rms:.3g}", f"{after.force_rms:.3g}", f"{found.floor_force_rms:.3g}")
    table.add_row("torque (Nm)", f"{before.torque_rms:.3g}", f"{after.torque_rms:.3g}", f"{found.floor_torque_rms:.3g}")
    table.add_row("1 s prediction (m)", f"{before.rollout_1s_position_rms:.3g}", f"{after.rollout_1s_position_rms:.3g}", "")
    console.print(table)
    for line in found.advice:
        console.print(line, highlight=False, markup=False)
    say(*write_report(found, folder, shlex.join(["windwrench", *sys.argv[1:]])))
