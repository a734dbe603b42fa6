"""Files of identify: the vehicle, the estimates beside it, and a picture of measured against fitted
force and torque.
"""

import json
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ...dynamics.vehicle_file import save_vehicle
from ...runtime.arrays import Array
from ...runtime.drawing import ESTIMATE, TRUTH, new_figure, styled
from ...runtime.page_files import write_png, write_text
from ...runtime.plain_values import plain
from ..logs.table import Data, Names
from ..motion.smoothing import low_pass
from ..prediction import QUANTITIES, PredictionErrors
from .channels import MotionPiece
from .columns import air_columns, rotor_columns
from .held_out import LEAST_HZ, powers
from .model import coefficients
from .result import Identified, text_of

if TYPE_CHECKING:
    from matplotlib.figure import Figure


_SHOWN_HZ = 8.0  # highest frequency of the picture: above it lies the pose's noise
_SHOWN_SECONDS = 10.0


def identified_data(identified: Identified) -> Data:
    """Return the dictionary of ``identify.json``; None for unknown values."""
    data: Data = {
        "vehicle": identified.vehicle.name,
        "mass_kg": identified.vehicle.mass,
        "flight_s": identified.fit.balance.seconds,
        "segments": len(identified.fit.balance.segments),
        "channels": identified.fit.model.sources,
        "estimates": [
            {
                "name": e.name,
                "value": e.value,
                "interval_95": [e.low, e.high],
                "unit": e.unit,
                "status": e.status,
                "how": e.how,
            }
            for e in identified.estimates.values()
        ],
        "notes": identified.notes,
        "advice": identified.advice,
        "status": identified.vehicle.status,
        "use": use_of(identified),
    }
    keys = ("unit", "model", "if_nothing_changes", "thrust_and_drag")
    for where, (errors, simplest) in identified.predicted.items():
        data[where] = {"starts": errors.starts, "horizon_s": errors.horizon}
        ends = errors.model, errors.still, simplest.model
        for name, *of in zip(QUANTITIES, QUANTITIES.values(), *ends, strict=True):
            data[where][name.replace(" ", "_")] = dict(zip(keys, of, strict=True))
    return dict(plain(data))


def headline(identified: Identified) -> str:
    """Return one sentence: parts refuted by held-out flight, identified quantities with half of
    their 95 % interval, and assumed ones.
    """
    return text_of("headline", it=identified)


def use_of(identified: Identified) -> str:
    """Return one sentence: the use of the vehicle's file for predictions."""
    return text_of("use", v=identified.vehicle)


def reasons_of(found: Identified) -> list[str]:
    """Return why quantities are assumed or not identifiable, a line for each reason."""
    return text_of("reasons", estimates=found.estimates).splitlines()


def table_of(errors: PredictionErrors, simplest: PredictionErrors) -> list[Names]:
    """Return rows: quantity, mean error of the vehicle, of thrust and drag, of no change, unit."""
    ends = (of[:, -1] for of in (errors.model, simplest.model, errors.still))
    return [
        (name, *(f"{x:.3g}" for x in row), unit)
        for (name, unit), *row in zip(QUANTITIES.items(), *ends, strict=True)
    ]


def write_identified(identified: Identified, path: Path) -> list[Path]:
    """Write the vehicle to a YAML file, and beside it ``NAME.identify.json``,
    ``NAME.identify.png`` and, with predictions, ``NAME.prediction.png``; return the paths.

    Raises:
        InputError: a file cannot be written.
    """
    known = identified.estimates
    std = {
        e.name: {
            c: (estimate.high - estimate.low) / 3.92
            for c in e.coefficients
            if (estimate := known.get(f"{e.name} {c}", known.get(e.name)))
        }
        for e in identified.vehicle.effects
    }
    save_vehicle(identified.vehicle, path, std)
    data, picture = (path.with_name(f"{path.stem}.identify.{end}") for end in ("json", "png"))
    write_text(json.dumps(identified_data(identified), indent=1) + "\n", data)
    write_png(_picture(identified), picture)
    written = [path, data, picture]
    if identified.predicted:
        written.append(path.with_name(f"{path.stem}.prediction.png"))
        where, (errors, _) = list(identified.predicted.items())[-1]
        write_png(_prediction_picture(where, errors), written[-1])
    return written


def _fitted(identified: Identified, piece: MotionPiece) -> list[Array]:
    """Return a piece's measured and fitted specific force (m/s2) and angular acceleration (rad/s2).

    Both are (n, 6), behind the picture's low-pass and within the band of the fit.
    """
    fit = identified.fit
    then, columns = piece.t - fit.values["delay"], air_columns(piece, fit.model)
    for name, x in rotor_columns(piece, fit.model, fit.values).items():
        columns[name] = np.interp(then, piece.t, x)
    gains = coefficients(fit.model, fit.values, tuple(columns))
    model = np.column_stack(list(columns.values())) @ gains.T
    shown_hz = min(_SHOWN_HZ, fit.model.band)
    return [low_pass(x, shown_hz, piece.period) for x in (piece.measured(), model)]


def explained(identified: Identified) -> Array:
    """Return the share (6,) of measured power of force and turning that the fit explains in its
    band. Each frequency counts by its ratio to the noise; NaN without a measurement.
    """
    fit = identified.fit
    left, total = powers(fit, by_noise=True).sum(axis=0)
    return np.asarray(np.clip(1.0 - left / np.where(total > 0.0, total, np.nan), 0.0, 1.0))


@styled()
def _picture(identified: Identified) -> "Figure":
    vehicle, band = identified.vehicle, identified.fit.model.band
    scale = [*3 * [vehicle.mass], *np.diag(vehicle.inertia)]
    longest = max(identified.fit.balance.pieces, key=lambda p: len(p.t))
    t = longest.t
    shown = np.abs(t - t[len(t) // 2]) <= 0.5 * _SHOWN_SECONDS
    curves = ((x[shown] * scale).T for x in _fitted(identified, longest))
    figure = new_figure(4.8)
    axes = figure.subplots(2, 3, sharex=True)
    titles = [
        f"{what} {axis} ({unit})"
        for what, unit in (("force", "N"), ("torque", "Nm"))
        for axis in "xyz"
    ]
    rows = zip(axes.flat, titles, explained(identified), *curves, strict=True)
    for plot, title, share, measured, model in rows:
        plot.plot(t[shown], measured, TRUTH, lw=1.6, label="measured")
        plot.plot(t[shown], model, ESTIMATE, lw=1.0, label="fitted")
        told = "not measured" if np.isnan(share) else f"{share:.0%} explained"
        plot.set_title(f"{title}, {told}")
    for plot in axes[1]:
        plot.set_xlabel("time (s)")
    axes[0, 0].legend()
    figure.suptitle(
        f"explained: of the power from {LEAST_HZ:g} to {band:g} Hz, each frequency by its noise; "
        f"drawn: up to {min(_SHOWN_HZ, band):g} Hz"
    )
    return figure


@styled()
def _prediction_picture(where: str, errors: PredictionErrors) -> "Figure":
    figure = new_figure(2.6)
    rows = zip(figure.subplots(1, 4), QUANTITIES.items(), errors.model, errors.still, strict=True)
    for axes, (name, unit), model, still in rows:
        axes.plot(errors.horizon, still, TRUTH, label="if nothing changes")
        axes.plot(errors.horizon, model, ESTIMATE, label="of the vehicle")
        axes.set(title=f"{name} ({unit})", xlabel="time after the start (s)", ylim=(0.0, None))
    axes.legend()
    figure.suptitle(f"mean error, {errors.starts} starts: {where.replace('_', ' ')}")
    return figure
