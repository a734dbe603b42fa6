"""The picture of a log's channels over time."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ...runtime.whole_files import replaced
from ..logs.flight_log import FlightLog

Array = NDArray[np.float64]

_COLOURS = ("#0072b2", "#d55e00", "#007f5f", "#cc79a7")


def plot_log(log: FlightLog, path: Path) -> Path:
    """Draw what a log holds, a panel a channel, into a PNG.

    Args:
        log: the flight.
        path: the PNG to write.

    Raises:
        InputError: the file cannot be written.
    """
    # matplotlib takes half a second to import, and most of the kit never draws
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    rotors = "rotor speeds" + (" of commands" if log.commanded else "")
    places = ("1 front-left", "2 rear-left", "3 rear-right", "4 front-right")
    placed = np.isfinite(log.position).any()  # also where no attitude is
    panels: list[tuple[str, Array | None, tuple[str, ...]]] = [
        ("position (m)", log.position if placed else None, ("x", "y", "z")),
        ("thrust axis (x, y of 1)", _axis(log) if log.has_pose else None, ("x", "y")),
        (f"{rotors}\n(rad/s)", log.rotor_speeds if log.has_rotor_speeds else None, places),
        ("motor commands\n(0 to 1)", log.command, places),
        ("accelerometer (m/s2)", log.accelerometer, ("x", "y", "z")),
        ("gyro (rad/s)", log.gyro, ("x", "y", "z")),
        ("battery (V)", None if log.voltage is None else log.voltage[:, None], ("",)),
    ]
    shown = [panel for panel in panels if panel[1] is not None]
    figure = Figure(figsize=(11.0, 1.2 + 1.7 * len(shown)), dpi=100, layout="constrained")
    FigureCanvasAgg(figure)
    axes = np.atleast_1d(figure.subplots(len(shown), 1, sharex=True))
    figure.suptitle(log.name)
    for axis, (title, values, names) in zip(axes, shown, strict=True):
        assert values is not None
        rows = np.isfinite(values).all(axis=1)
        for column, name, colour in zip(values.T, names, _COLOURS, strict=False):
            axis.plot(log.t[rows], column[rows], color=colour, lw=0.8, label=name)
        axis.set_ylabel(title, fontsize=8)
        axis.grid(alpha=0.3)
        if names != ("",):
            axis.legend(loc="upper right", fontsize=7, ncols=len(names))
    axes[-1].set_xlabel("time (s)")
    with replaced(path) as temporary:
        figure.savefig(temporary, format="png")
    return path


def _axis(log: FlightLog) -> Array:
    """Return the horizontal part (N, 2) of the body's z axis in the world."""
    w, x, y, z = log.quaternion.T
    return np.column_stack([2.0 * (x * z + w * y), 2.0 * (y * z - w * x)])
