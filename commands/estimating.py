"""The external wrench on a logged flight."""

from pathlib import Path
from typing import Any

from .flight_logs import log_notes, read_flights
from .terminal import console, film_kinds, gate_of, note, results_folder, say, show_table, working


def estimate(
    log: Path,
    reader: str | None = None,
    map: str | None = None,
    vehicle: str | None = None,
    smooth: bool | None = None,
    gate: float | None = None,
    tune: bool = False,
    film: bool = False,
    video: bool = False,
    rrd: bool = False,
    view: bool = False,
    begin: float = 0.0,
    film_seconds: float = 30.0,
    out: Path = Path("results/estimate"),
) -> dict[str, Any]:
    """Estimate the wrench on a logged flight. Write wrench.csv and a picture, and a film of the
    flight on request.

    Example: windwrench estimate flight.csv --vehicle crazyflie --film
    """
    from ..identification.motion.inertial_signals import reads_imu
    from ..identification.report.wrench_picture import plot_wrench
    from ..identification.wrench_series import (
        counts,
        estimate_log,
        truth_rmse,
        tune_to_log,
        tuning_note_of,
        write_wrench,
    )
    from .log_film import draw_film, shown_rows

    level = gate_of(gate)
    kinds = film_kinds(view, video, film, "--film")
    (flight,), model = read_flights([log], reader, vehicle, map)
    drawn = bool(kinds) or view or rrd
    rows = shown_rows(flight, log, begin, film_seconds) if drawn else None
    folder = results_folder(out)
    if smooth is None:
        smooth = (flight.gyro is None) == (flight.accelerometer is None)
    smooth = smooth or reads_imu(flight)
    fit = None
    if tune:
        with working("fitting the tuning"):
            fit = tune_to_log(flight, model)
    with working("estimating") as progress:
        series = estimate_log(flight, model, fit.tuning if fit else None, progress, smooth, level)
    written = [write_wrench(series, folder), plot_wrench(series, flight, folder / "wrench.png")]
    if rows is not None:
        written += draw_film(flight, model, series, rows, folder, kinds, view, rrd)
    log_notes(series.notes)
    seconds = float(flight.t[-1] - flight.t[0])
    console.print(f"{flight.name}: {len(flight.t)} samples, {seconds:.1f} s, vehicle {model.name}")
    result: dict[str, Any] = {
        "log": flight.name,
        "vehicle": model.name,
        "samples": len(flight.t),
        "seconds": seconds,
        "smoothed": smooth,
        "status": counts(series),
        "restarts": int(series.restarts[-1]),
    }
    if fit is not None:
        result["tuning"] = fit.as_dict()
        console.print(str(fit))
    elif unsuited := tuning_note_of(flight, model):
        note(f"{unsuited} Use --tune to fit the tuning to this log.")
    truth = truth_rmse(series, flight)
    table = []
    for i, (name, values, unit) in enumerate(
        (("force", series.force, "N"), ("torque", series.torque, "Nm"))
    ):
        measures = {"mean": values.mean(axis=0), "std": values.std(axis=0)}
        if truth is not None:
            measures["RMSE to truth"] = truth[i]
        for measure, value in measures.items():
            sign = "+" if measure == "mean" else ""
            table.append((f"{name}, {measure} ({unit})", *(f"{v:{sign}.4g}" for v in value)))
            result[f"{name}_{measure.lower().replace(' ', '_')}_{unit}"] = value
    show_table(("", "x", "y", "z"), table)
    say(*written)
    return result
