"""The picture of tracking a fan: capture, moving fans, and the fastest fan held
beside the bound.
"""

from collections.abc import Mapping, Sequence
from typing import Any, Protocol

import numpy as np
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine
from numpy.typing import NDArray

from ..evaluation.episodes import Episode
from ..evaluation.pictures import COLOURS

Array = NDArray[np.float64]
_GAINS = {6.0: "#2a9d8f", 18.0: COLOURS["admittance"], 36.0: "#8d5a97"}
_FILTERS = ("#d1495b", "#30638e")
_JET = "#cfe5f5"
_RADIUS = 0.45  # m, of the fan


class _Fastest(Protocol):
    @property
    def gain(self) -> float: ...
    @property
    def rise_time(self) -> float: ...
    @property
    def bound(self) -> float: ...
    @property
    def held(self) -> float: ...
    @property
    def held_interval(self) -> tuple[float, float]: ...
    @property
    def calm(self) -> float: ...
    @property
    def sudden(self) -> float: ...


def draw_tracking(
    captures: Mapping[tuple[float, float], list[Episode]],
    tracks: Mapping[tuple[float, float], list[Episode]],
    fastest: Sequence[_Fastest],
    largest: float,
    at: float,
    held_offset: float,
) -> Figure:
    """Draw the three experiments.

    Args:
        captures: flights for each (rise time s, gain), from 0.8 m off a fan that stands still.
        tracks: flights for each (fan speed m/s, gain), behind a fan that moves to and fro.
        fastest: rows of the search for the fastest fan.
        largest: the jet's largest torque, Nm.
        at: the offset where it acts, m.
        held_offset: offset that ends a flight of that search, m.
    """
    figure = Figure(figsize=(13.5, 14.5), layout=ConstrainedLayoutEngine(w_pad=0.12))
    grid = figure.add_gridspec(4, 3, height_ratios=[1, 1.05, 0.7, 1.15])
    rise_times = sorted({rise for rise, _ in captures})
    offsets = [_signed_offset(e) for flights in captures.values() for e in flights]
    reach = min(o.min() for o in offsets), max(o.max() for o in offsets)
    first = None
    for column, rise_time in enumerate(rise_times):
        first = axes = figure.add_subplot(grid[0, column], sharey=first)
        _capture(
            axes,
            {gain: flights for (rise, gain), flights in captures.items() if rise == rise_time},
            reach,
        )
        axes.set_title(
            f"capture from 0.8 m, filter rise time {rise_time:g} s", fontsize=10, loc="left"
        )
    axes = figure.add_subplot(grid[0, 2])
    _torque(axes, captures[rise_times[0], 18.0][0], largest)
    axes.set_title(
        f"its torque, gain 18, rise time {rise_times[0]:g} s, one flight", fontsize=10, loc="left"
    )
    first = second = None
    for column, speed in enumerate(sorted({speed for speed, _ in tracks})):
        flights = {gain: some for (fan, gain), some in tracks.items() if fan == speed}
        first = axes = figure.add_subplot(grid[1, column], sharey=first)
        _follow(axes, flights)
        axes.set_title(
            f"fan at {speed:g} m/s, rise time {rise_times[0]:g} s", fontsize=10, loc="left"
        )
        second = axes = figure.add_subplot(grid[2, column], sharex=axes, sharey=second)
        _torque(axes, flights[18.0][0], largest)
        axes.set_title("its torque, gain 18", fontsize=10, loc="left")
    _speeds(figure.add_subplot(grid[3, :2]), fastest, largest)
    _shares(figure.add_subplot(grid[3, 2]), fastest)
    figure.suptitle(
        f"Following a fan 2.3 m away by its torque. The jet's largest torque, {1e3 * largest:.0f} "
        f"mNm, acts "
        f"{at:.2f} m off the axis; a fan counts as held while the offset stays below "
        f"{held_offset:g} m",
        fontsize=11,
    )
    return figure


def _bare(axes: Any, x: str, y: str) -> None:
    axes.set_xlabel(x)
    axes.set_ylabel(y)
    axes.spines[["top", "right"]].set_visible(False)


def _signed_offset(episode: Episode) -> Array:
    """Return the offset (m) from the axis, positive on the side where the vehicle started."""
    return np.asarray(np.sign(episode.y[0]) * (episode.y - episode.fan_y))


def _capture(axes: Any, flights: Mapping[float, list[Episode]], reach: tuple[float, float]) -> None:
    """Draw the distance of every flight from the axis, and the median flight of each gain;
    ``reach`` is the least and the largest offset (m) of all that are drawn side by side.
    """
    axes.axhspan(-_RADIUS, _RADIUS, color=_JET, lw=0)
    for gain, some in flights.items():
        signed = [_signed_offset(e) for e in some]
        for e, offset in zip(some, signed, strict=True):
            axes.plot(e.time, offset, color=_GAINS[gain], lw=0.6, alpha=0.35)
        shortest = min(len(offset) for offset in signed)
        axes.plot(
            some[0].time[:shortest],
            np.median([offset[:shortest] for offset in signed], axis=0),
            color=_GAINS[gain],
            lw=2.2,
            label=f"gain {gain:g}",
        )
    axes.axhline(0, ls="--", color="#222222", lw=1.2)
    # all of every trace, and the legend above them
    axes.set_ylim(min(reach[0], -_RADIUS) - 0.1, max(reach[1], _RADIUS) + 0.35)
    axes.legend(frameon=False, fontsize=8, ncols=3, loc="upper right")
    _bare(axes, "time (s)", "y - fan, on the side it started (m)")


def _follow(axes: Any, flights: Mapping[float, list[Episode]]) -> None:
    """Draw fan and vehicle of the first seed, with the RMSE over all."""
    longest = max((some[0] for some in flights.values()), key=lambda e: len(e.time))
    axes.fill_between(
        longest.time, longest.fan_y - _RADIUS, longest.fan_y + _RADIUS, color=_JET, lw=0
    )
    axes.plot(longest.time, longest.fan_y, "--", color="#222222", lw=1.5, label="fan")
    for gain, some in flights.items():
        e, lost = some[0], float(np.mean([e.lost for e in some]))
        text = f"gain {gain:g}: RMSE {np.mean([e.rmse for e in some]):.2f} m" + (
            f", {lost:.0%} lost" if lost else ""
        )
        axes.plot(e.time, e.y, color=_GAINS[gain], lw=1.8, label=text)
    axes.set_ylim(-1.7, 2.9)
    axes.legend(frameon=False, fontsize=8, loc="upper left")
    _bare(axes, "time (s)", "y (m)")


def _torque(axes: Any, episode: Episode, largest: float) -> None:
    for bound in (-largest, largest):
        axes.axhline(1e3 * bound, color="black", lw=0.8, ls=":")
    axes.plot(episode.time, 1e3 * episode.torque[:, 2], color="#9a9a9a", lw=0.8, label="true")
    axes.plot(
        episode.time,
        1e3 * episode.observation[:, 5],
        color=COLOURS["oracle"],
        lw=1.6,
        label="estimated",
    )
    axes.axhline(0, color="black", lw=0.5)
    axes.set_ylim(-62, 62)
    axes.legend(frameon=False, fontsize=8, ncols=2, loc="upper right")
    _bare(axes, "time (s)", r"$\tau_z$ (mNm)")


def _rows(fastest: Sequence[_Fastest]) -> list[tuple[float, str, list[_Fastest]]]:
    rises = sorted({f.rise_time for f in fastest})
    return [
        (rise, colour, [f for f in fastest if f.rise_time == rise])
        for rise, colour in zip(rises, _FILTERS, strict=False)
    ]


def _bars(some: Sequence[_Fastest], percent: bool = False) -> Array:
    """Return how far the intervals reach below and above what was held: (2, n) m/s, or percent of
    the bound.
    """
    scale = [100.0 / f.bound if percent else 1.0 for f in some]
    return np.array(
        [
            [c * (f.held - f.held_interval[0]) for c, f in zip(scale, some, strict=True)],
            [c * (f.held_interval[1] - f.held) for c, f in zip(scale, some, strict=True)],
        ]
    )


def _speeds(axes: Any, fastest: Sequence[_Fastest], largest: float) -> None:
    """Draw the fastest fan held over the gain, beside the bound."""
    gains = np.array(sorted({f.gain for f in fastest}))
    line = np.linspace(0.0, 1.08 * gains[-1], 200)
    bound = np.minimum(
        line * largest, max(f.bound for f in fastest) if largest * gains[-1] > 1 else np.inf
    )
    entries: list[Any] = axes.plot(
        line,
        bound,
        color="black",
        lw=1.6,
        label=r"bound $k\,\tau_{max}$ (and the largest command, 1 m/s)",
    )
    axes.fill_between(line, bound, 1.3, color="0.93", lw=0)
    for rise, colour, some in _rows(fastest):
        x = [f.gain for f in some]
        held = axes.errorbar(
            x,
            [f.held for f in some],
            _bars(some),
            fmt="o-",
            color=colour,
            lw=2.2,
            ms=7,
            elinewidth=1.4,
            capsize=4,
            label=f"held, rise time {rise:g} s (95 % interval)",
        )
        axes.plot(
            x,
            [f.calm for f in some],
            "^--",
            color=colour,
            lw=1,
            ms=5,
            mfc="white",
            label="… in calm air",
        )
        axes.plot(
            x,
            [f.sudden for f in some],
            "s:",
            color=colour,
            lw=1,
            ms=4,
            mfc="white",
            label="… in calm air, sudden start",
        )
        entries += [held, *axes.get_lines()[-2:]]
    for gain in gains:
        held = [f.held for _, _, some in _rows(fastest) for f in some if f.gain == gain]
        axes.text(
            gain + 0.4,
            min(f.held_interval[0] for f in fastest if f.gain == gain) - 0.06,
            " / ".join(f"{speed:.2f}" for speed in held),
            fontsize=8,
            ha="left" if gain < gains[-1] else "center",
        )
    axes.set_ylim(0, 1.2)
    axes.set_xlim(0, line[-1])
    axes.text(
        0.55 * line[-1], 1.08, "beyond the bound no fan can be followed", color="0.45", fontsize=9
    )
    # in the order drawn; a legend of its own making has bars with intervals last
    axes.legend(handles=entries, frameon=False, fontsize=8, loc="upper left")
    axes.set_title("the fastest fan held by four flights of five", fontsize=10, loc="left")
    _bare(axes, "gain k (m/s per Nm)", "speed of the fan (m/s)")


def _shares(axes: Any, fastest: Sequence[_Fastest]) -> None:
    """Draw the same as a share of the bound."""
    axes.axhline(100, color="black", lw=1.6)
    for _, colour, some in _rows(fastest):
        x = [f.gain for f in some]
        for name, style, width, size in (
            ("held", "o-", 2.2, 7),
            ("calm", "^--", 1, 5),
            ("sudden", "s:", 1, 4),
        ):
            held = name == "held"
            axes.errorbar(
                x,
                [100 * getattr(f, name) / f.bound for f in some],
                _bars(some, percent=True) if held else None,
                fmt=style,
                color=colour,
                lw=width,
                ms=size,
                elinewidth=1.4,
                capsize=4,
                mfc=colour if held else "white",
            )
    axes.set_ylim(0, 130)
    axes.set_title("the same as a share of the bound", fontsize=10, loc="left")
    _bare(axes, "gain k (m/s per Nm)", "% of the bound")
