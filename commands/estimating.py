"""The external wrench on a logged flight."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..runtime.errors import InputError
from ..runtime.extras import need
from .flight_logs import AS_THEY_ARE, LogOptions, log_notes, read_flights
from .terminal import (
    console,
    gate_of,
    note,
    result_file,
    results_folder,
    run,
    say,
    show_table,
    working,
)

if TYPE_CHECKING:
    from ..dynamics.vehicle import Vehicle
    from ..estimator import NoiseFit, UKFTuning
    from ..estimator.consistency import Consistency
    from ..identification.logs.flight_log import FlightLog

# endings of the wrench's file, with their library and its extra
_TRACKS: dict[str, tuple[str, str] | None] = {
    ".csv": None,
    ".mcap": ("rosbags", "logs"),
}
# sentences for correlated innovations, of a given and of a fitted tuning
_TOO_SLOW = (
    "warning: innovations are correlated within a second: the wrench changes faster than the "
    "tuning allows. The estimate lags, and its deviations are too small. Leave out --no-tune and "
    "--tuning.",
    "Innovations are still correlated within a second: the wrench is no random walk. "
    "--fit-disturbance fits gusts; windwrench diagnose names missing effects.",
)


def estimate(
    log: Path,
    reading: LogOptions = AS_THEY_ARE,
    smooth: bool | None = None,
    gate: float | None = None,
    tune: bool | None = None,
    fit_disturbance: bool = False,
    tuning: Path | None = None,
    out: Path = Path("results/estimate"),
) -> dict[str, Any]:
    """Estimate the wrench on a logged flight. Write wrench.csv and a picture.

    Example: windwrench estimate flight.csv --vehicle crazyflie
    """
    import numpy as np

    from ..estimator.noise_scale import noise_warning
    from ..identification.motion.inertial_signals import reads_imu
    from ..identification.report.headline import wrench_headline
    from ..identification.report.words import rounded, scale_of
    from ..identification.report.wrench_picture import plot_wrench
    from ..identification.wrench_series import (
        counts,
        estimate_log,
        truth_rmse,
        uncertainty_note,
        write_wrench,
    )
    from ..identification.wrench_track import write_mcap
    from .tuning_file import load_tuning, save_tuning

    level = gate_of(gate)
    if fit_disturbance and tune is False:
        raise InputError("--fit-disturbance: fits the tuning; leave out --no-tune")
    (flight,), model = read_flights([log], reading)
    track = result_file(out, "wrench.csv", _TRACKS)
    if needed := _TRACKS[track.suffix]:
        need(*needed, f"--out {out}")
    folder = results_folder(track.parent)
    begin = f"{track.stem}." if track == out else ""  # part of the names of the files beside
    run.record = folder / f"{begin}run.json"
    if smooth is None:
        smooth = (flight.gyro is None) == (flight.accelerometer is None)
    smooth = smooth or reads_imu(flight)
    given = None if tuning is None else load_tuning(tuning, flight.period)
    wanted = fit_disturbance or (tuning is None if tune is None else tune)
    fit, consistency, said = _tuned(flight, model, given, wanted, fit_disturbance)
    with working("estimating") as progress:
        series = estimate_log(flight, model, fit.tuning if fit else given, progress, smooth, level)
    if track.suffix == ".csv":
        write_wrench(series, track)
    else:
        write_mcap(series, track)
    written = [track, plot_wrench(series, flight, track.with_suffix(".png"))]
    written.append(folder / f"{begin}tuning.yaml")
    save_tuning(series.tuning, flight.period, written[2])
    seconds = float(flight.t[-1] - flight.t[0])
    headline = wrench_headline(series)
    console.print(headline)
    console.print(f"{flight.name}: {len(flight.t)} samples, {seconds:.1f} s, vehicle {model.name}")
    log_notes(series.notes)
    result: dict[str, Any] = {
        "headline": headline,
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
    note(said)
    if consistency is not None:
        result["consistency"] = consistency.as_dict()
        if consistency.too_slow:
            note(_TOO_SLOW[fit is not None])
    noise = np.median(series.noise_scales[flight.valid], axis=0) if flight.valid.any() else None
    if noise is not None:
        result["noise_scale"] = dict(zip(("attitude", "position"), noise, strict=True))
        if noisy := noise_warning(noise, series.tuning, fit is None and given is None):
            note(f"warning: {noisy}.")
    console.print(f"{uncertainty_note(series)}.")
    truth = truth_rmse(series, flight)
    table = []
    for i, (name, values, unit) in enumerate(
        (("force", series.force, "N"), ("torque", series.torque, "Nm"))
    ):
        measures = {"mean": values.mean(axis=0), "std": values.std(axis=0)}
        if truth is not None:
            measures["RMSE to truth"] = truth[i]
        # a log may tell no torque
        for measure, value in measures.items() if np.isfinite(values).any() else ():
            factor, small = scale_of(value, unit)
            table.append((f"{name}, {measure} ({small})", *(rounded(factor * v) for v in value)))
            result[f"{name}_{measure.lower().replace(' ', '_')}_{unit}"] = value
    show_table(("", "x", "y", "z"), table)
    say(*written)
    return result


def _tuned(
    flight: "FlightLog",
    model: "Vehicle",
    given: "UKFTuning | None",
    wanted: bool,
    gusts: bool,
) -> "tuple[NoiseFit | None, Consistency | None, str]":
    """Return the fitted tuning, if wanted and possible, with correlation times if ``gusts``; the
    innovations' judgement of the tuning in use, if there are enough; and a sentence on both.
    """
    from ..identification.wrench_series import consistency_with_log, tune_to_log

    try:
        if not wanted:
            consistency = consistency_with_log(flight, model, given)
            return None, consistency, f"The tuning was not fitted: {consistency}."
        with working("fitting the tuning"):
            fit = tune_to_log(flight, model, given, gusts)
    except InputError as error:
        return None, None, f"The {'given' if given else 'default'} tuning was used: {error}"
    return fit, fit.after, str(fit)
