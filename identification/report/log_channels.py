"""The channels of a log: rates, gaps and ranges, and a picture of them over time."""

from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from ...runtime.drawing import SERIES, new_figure, styled
from ...runtime.page_files import write_png
from ..logs.flight_log import FlightLog
from ..logs.table import Array, Names, finite_rows, median_step
from .plot_numbers import telling_samples

_GAP = 3.0  # median steps of a channel
_BINS = 4000  # for a picture's 900 pixels: each bin draws a line's least and largest value
_AXES = ("x", "y", "z")
_ROTORS = ("1 front-left", "2 rear-left", "3 rear-right", "4 front-right")


class Channel(NamedTuple):
    """One channel of a log."""

    name: str
    unit: str
    samples: int
    rate_hz: float
    gaps: int  # longer than 3 of its own steps
    longest_gap_s: float
    low: float
    high: float
    t: Array  # (n,) s
    drawn: Array  # (n, k) lines of the picture: extremes of many rows
    title: str  # the picture's
    series: Names  # names of the k lines


def log_channels(log: FlightLog) -> list[Channel]:
    """Return a log's channels."""
    axis = np.full((len(log.t), 3), np.nan)  # thrust axis, world
    if log.valid.any():
        turned = Rotation.from_quat(log.quaternion[log.valid], scalar_first=True)
        axis[log.valid] = turned.apply([0.0, 0.0, 1.0])
    tilt = np.degrees(np.arccos(np.clip(axis[:, 2:], -1.0, 1.0)))
    rotors, source = "rotor speeds", "rotors"
    if log.commanded:
        rotors, source = "rotor speeds (from commands)", "commands"
    given = [
        ("position", "m", log.position, _AXES, "position"),
        ("attitude (tilt)", "deg", tilt, _AXES[:2], "position"),
        (rotors, "rad/s", log.rotor_speeds, _ROTORS, source),
        ("motor commands", "0 to 1", log.command, _ROTORS, "commands"),
        ("battery", "V", None if log.voltage is None else log.voltage[:, None], ("",), "battery"),
        ("accelerometer", "m/s2", log.accelerometer, _AXES, "accelerometer"),
        ("gyro", "rad/s", log.gyro, _AXES, "gyro"),
        ("true force", "N", log.force, _AXES, "force"),
        ("true torque", "Nm", log.torque, _AXES, "torque"),
    ]
    out = []
    for name, unit, values, series, section in given:
        if values is None or len(rows := np.flatnonzero(finite_rows(values))) < 2:
            continue
        t, title, drawn = log.t[rows], f"{name} ({unit})", values[rows]
        low, high = float(drawn.min()), float(drawn.max())
        if values is tilt:
            drawn, title = axis[rows, :2], "thrust axis (unit vector)"
        steps, step = np.diff(t), median_step(t)
        rate = min(log.rates.get(section) or np.inf, 1.0 / step)
        gaps, longest = int((steps > _GAP * step).sum()), max(float(steps.max()), 1.0 / rate)
        shown = telling_samples(drawn, _BINS)
        out.append(
            Channel(
                name,
                unit,
                len(rows),
                rate,
                gaps,
                longest,
                low,
                high,
                t[shown],
                drawn[shown],
                title,
                series,
            )
        )
    return out


@styled()
def plot_channels(name: str, channels: list[Channel], path: Path) -> Path:
    """Draw a log's channels over time, a panel each, into a PNG.

    Raises:
        InputError: the file cannot be written.
    """
    figure = new_figure(0.9 + 1.35 * len(channels))
    panels = np.atleast_1d(figure.subplots(len(channels), 1, sharex=True))
    figure.suptitle(name, parse_math=False)
    for panel, channel in zip(panels, channels, strict=True):
        for column, label, colour in zip(channel.drawn.T, channel.series, SERIES, strict=False):
            panel.plot(channel.t, column, color=colour, lw=0.8, label=label)
        panel.set_title(channel.title)
        panel.grid()
        if len(channel.series) > 1:
            panel.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=len(channel.series))
    panels[-1].set_xlabel("time (s)")
    write_png(figure, path)
    return path
