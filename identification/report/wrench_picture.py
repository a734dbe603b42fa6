"""The picture of an estimated wrench: height, force and torque over time, with the flight's phases
shaded.
"""

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ...dynamics.vehicle import Vehicle
from ...runtime.arrays import Array
from ...runtime.drawing import BLACK, GREY, PALE, SERIES, new_figure, room_above, styled
from ...runtime.page_files import write_png
from ..logs.flight_log import FlightLog
from ..logs.flight_phases import GROUND, LANDING, TAKE_OFF, Phase, flight_phases
from ..wrench_series import WrenchSeries
from .words import scale_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_SHADES = {GROUND: PALE, TAKE_OFF: "#cfe8cf", LANDING: "#fbe3c4"}
_THRUST = SERIES[3]
_LASTING = 0.1  # s without a pose, at least, for hatching


@styled()
def plot_wrench(series: WrenchSeries, log: FlightLog, path: Path) -> Path:
    """Draw height, force and torque with their 2-sigma bands, and the log's truth if any, into a
    PNG.

    Args:
        series: the estimate.
        log: the estimated flight.
        path: the PNG to write.

    Raises:
        InputError: the file cannot be written.
    """
    vehicle = series.vehicle
    known = bool(np.isfinite(series.position).all())
    phases = (
        flight_phases(series.t, series.position[:, 2], log.rotor_speeds, vehicle) if known else []
    )
    figure = new_figure(7.0)
    height, force, torque = figure.subplots(3, 1, sharex=True, height_ratios=[1.0, 1.5, 1.5])
    figure.suptitle(f"External wrench: {log.name}, {vehicle.name}", parse_math=False)

    height.plot(series.t, series.position[:, 2], color=BLACK, lw=1.2)
    height.set_ylabel("height (m)" if known else "height (not known)")
    if not known:
        height.set_yticks([])
    backdrop = _draw_thrust(height, series.t, log, vehicle)
    scale, unit = scale_of([np.percentile(np.abs(series.torque), 99)], "Nm")
    truth = None if log.torque is None else scale * log.torque
    mean, std = scale * series.torque, scale * series.std_torque
    _draw_vectors(force, series.t, series.force, series.std_force, log.force, "f", "N")
    _draw_vectors(torque, series.t, mean, std, truth, "τ", unit)
    force.set_ylabel("external force ± 2σ (N)")
    torque.set(ylabel=f"external torque ± 2σ ({unit})", xlabel="time (s)")
    if GROUND in {phase.name for phase in phases}:
        force.axhline(
            vehicle.weight, color=BLACK, lw=0.8, ls=":", label=f"weight {vehicle.weight:.3g} N"
        )
    columns, room = (4, 0.14) if log.force is None else (3, 0.26)
    for panel, behind in ((height, backdrop), (force, force), (torque, torque)):
        panel.grid()
        panel.margins(x=0.0)
        _shade(behind, phases, log)
        if panel.get_legend_handles_labels()[0]:
            panel.legend(loc="upper center", ncols=columns)
            room_above(panel, room)
    for phase in phases:
        height.text(
            0.5 * (phase.start + phase.end),
            1.03,
            phase.name,
            transform=height.get_xaxis_transform(),
            ha="center",
            size="small",
        )
    write_png(figure, path)
    return path


def _draw_thrust(panel: "Axes", t: Array, log: FlightLog, vehicle: Vehicle) -> "Axes":
    """Draw the rotors' thrust, in weights, behind the height; return the axes behind."""
    thrust = panel.twinx()
    weights = np.square(log.rotor_speeds) @ vehicle.k / vehicle.weight
    thrust.plot(t, weights, color=_THRUST, lw=0.6, alpha=0.6)
    thrust.set_ylabel("rotor thrust / weight", color=_THRUST)
    thrust.tick_params(axis="y", labelcolor=_THRUST)
    thrust.set_ylim(bottom=0.0)
    panel.set(zorder=thrust.get_zorder() + 1, facecolor="none")
    return thrust


def _draw_vectors(
    panel: "Axes", t: Array, mean: Array, std: Array, truth: Array | None, symbol: str, unit: str
) -> None:
    """Draw three components (N, 3) of a symbol and unit with their 2-sigma bands, or say there are
    none. The truth is dashed, with its RMSE in the legend.
    """
    if not np.isfinite(mean).any():
        panel.text(
            0.5,
            0.5,
            "not estimated: the rotors were measured too seldom",
            transform=panel.transAxes,
            ha="center",
        )
        panel.set_yticks([])
        return
    low, high = mean - 2 * std, mean + 2 * std
    true: Iterable[Array | None] = [None] * 3 if truth is None else truth.T
    for axis, colour, x, least, most, real in zip(
        "xyz", SERIES, mean.T, low.T, high.T, true, strict=False
    ):
        name = f"{symbol}$_{axis}$"
        panel.fill_between(t, least, most, color=colour, alpha=0.18, lw=0)
        (line,) = panel.plot(t, x, color=colour, lw=1.1, label=name)
        if real is not None:
            rmse = np.sqrt(np.square(x - real).mean())
            line.set_label(f"{name} (RMSE {rmse:.3g} {unit})")
            panel.plot(t, real, color=colour, lw=1.0, ls="--", label=f"true {name}")
    # the wide band of the filter's first moments must not set the scale
    bottom = min(np.percentile(low, 1, axis=0).min(), mean.min())
    top = max(np.percentile(high, 99, axis=0).max(), mean.max())
    room = 0.05 * (top - bottom)
    panel.set_ylim(bottom - room, top + room)


def _shade(panel: "Axes", phases: Sequence[Phase], log: FlightLog) -> None:
    """Shade the phases, and hatch long stretches without a pose; a pose slower than the log has
    none.
    """
    for phase in phases:
        if phase.name in _SHADES:
            panel.axvspan(phase.start, phase.end, color=_SHADES[phase.name], zorder=0, lw=0)
    poses = np.r_[-np.inf, log.t[log.valid], np.inf]
    after = poses[np.searchsorted(poses, log.t, "left")]
    lost = after - poses[np.searchsorted(poses, log.t, "right") - 1] > _LASTING
    if lost.any() and log.has_pose:
        lost[1:] |= lost[:-1]  # up to the next pose
        panel.fill_between(
            log.t,
            0.0,
            1.0,
            where=lost,
            transform=panel.get_xaxis_transform(),
            zorder=0,
            lw=0,
            facecolor="none",
            edgecolor=GREY,
            hatch="///",
        )
