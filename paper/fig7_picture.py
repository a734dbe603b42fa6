"""The picture of tracking a fan: capture, moving fans, and the fastest fan held
beside the bound.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from ..evaluation.episodes import Episode
from ..runtime.drawing import BLACK, ESTIMATE, JET, PALE, SERIES, TRUTH, new_figure, styled

Array = NDArray[np.float64]
_GAINS = {6.0: SERIES[2], 18.0: SERIES[1], 36.0: SERIES[3]}
_RADIUS = 0.45  # m, of the fan
# field of a row of the search -> line, its style, and its entry in the legend
_HELD = (
    ("held_m_s", "o-", {"lw": 2.2, "ms": 7}, "held, rise time {:g} s"),
    ("calm_m_s", "^--", {"lw": 1, "ms": 5, "mfc": "white"}, "… in calm air"),
    ("calm_sudden_m_s", "s:", {"lw": 1, "ms": 4, "mfc": "white"}, "… in calm air, sudden start"),
)


@styled()
def draw_tracking(
    captures: Mapping[float, Mapping[float, list[Episode]]],
    tracks: Mapping[float, Mapping[float, list[Episode]]],
    fastest: Sequence[Mapping[str, Any]],
    largest: float,
    at: float,
    held_offset: float,
) -> Figure:
    """Draw the three experiments.

    Args:
        captures: flights by rise time (s) and gain, from 0.8 m off a fan that stands still.
        tracks: flights by fan speed (m/s) and gain, behind a fan that moves to and fro.
        fastest: rows of ``fig7.sweep``.
        largest: the jet's largest torque, Nm.
        at: the offset where it acts, m.
        held_offset: offset that ends a flight of that search, m.
    """
    figure = new_figure(11.6)
    grid = figure.add_gridspec(4, 3, height_ratios=[1, 1.15, 0.75, 1.4])
    rise_times, first = sorted(captures), None
    for column, rise_time in enumerate(rise_times):
        first = axes = figure.add_subplot(grid[0, column], sharey=first)
        _capture(axes, captures[rise_time])
        axes.set_title(f"from 0.8 m off, rise time {rise_time:g} s")
    # all of every trace, and the legend above them
    flown = [e for one in captures.values() for some in one.values() for e in some]
    offsets = np.concatenate([_signed_offset(e) for e in flown])
    axes.set_ylim(min(offsets.min(), -_RADIUS) - 0.1, max(offsets.max(), _RADIUS) + 0.35)
    axes = figure.add_subplot(grid[0, 2])
    _torque(axes, captures[rise_times[0]][18.0][0], largest)
    axes.set_title(f"its torque, rise time {rise_times[0]:g} s")
    first = second = None
    for column, (speed, flights) in enumerate(sorted(tracks.items())):
        first = axes = figure.add_subplot(grid[1, column], sharey=first)
        _follow(axes, flights)
        axes.set_title(f"fan at {speed:g} m/s, rise time {rise_times[0]:g} s")
        second = axes = figure.add_subplot(grid[2, column], sharex=axes, sharey=second)
        _torque(axes, flights[18.0][0], largest)
        axes.set_title("its torque, gain 18")
    _speeds(figure.add_subplot(grid[3, :2]), fastest, largest)
    axes = figure.add_subplot(grid[3, 2])
    axes.axhline(100, color="black", lw=1.6)
    _held(axes, fastest, lambda f: 100.0 / f["bound_m_s"])
    axes.set(title="the same as a share of the bound", ylim=(0, 130), ylabel="% of the bound")
    axes.set_xlabel("gain k (m/s per Nm)")
    figure.suptitle(
        f"Following a fan 2.3 m away by its torque.\nThe jet's largest torque, {1e3 * largest:.0f} "
        f"mNm, acts {at:.2f} m off the axis;\na fan counts as held while the offset stays below "
        f"{held_offset:g} m"
    )
    return figure


def _signed_offset(episode: Episode) -> Array:
    """Return the offset (m) from the axis, positive on the side where the vehicle started."""
    return np.asarray(np.sign(episode.y[0]) * (episode.y - episode.fan_y))


def _capture(axes: Any, flights: Mapping[float, list[Episode]]) -> None:
    """Draw the distance of every flight from the axis, and the median flight of each gain."""
    axes.axhspan(-_RADIUS, _RADIUS, color=JET, lw=0)
    for gain, some in flights.items():
        signed = [_signed_offset(e) for e in some]
        for e, offset in zip(some, signed, strict=True):
            axes.plot(e.time, offset, color=_GAINS[gain], lw=0.6, alpha=0.35)
        shortest = min(len(offset) for offset in signed)
        median = np.median([offset[:shortest] for offset in signed], axis=0)
        time = some[0].time[:shortest]
        axes.plot(time, median, color=_GAINS[gain], lw=2.2, label=f"gain {gain:g}")
    axes.axhline(0, ls="--", color=BLACK, lw=1.2)
    axes.legend(ncols=2, loc="upper right")
    axes.set(xlabel="time (s)", ylabel="y - fan (m), start positive")


def _follow(axes: Any, flights: Mapping[float, list[Episode]]) -> None:
    """Draw fan and vehicle of the first seed, with the RMSE over all."""
    longest = max((some[0] for some in flights.values()), key=lambda e: len(e.time))
    fan = longest.fan_y
    axes.fill_between(longest.time, fan - _RADIUS, fan + _RADIUS, color=JET, lw=0)
    axes.plot(longest.time, fan, "--", color=BLACK, lw=1.5, label="fan")
    for gain, some in flights.items():
        lost = float(np.mean([e.lost for e in some]))
        label = f"gain {gain:g}: RMSE {np.mean([e.rmse for e in some]):.2f} m"
        label += f", {lost:.0%} lost" if lost else ""
        axes.plot(some[0].time, some[0].y, color=_GAINS[gain], lw=1.8, label=label)
    axes.legend(loc="upper left")
    axes.set(xlabel="time (s)", ylabel="y (m)", ylim=(-1.7, 3.6))


def _torque(axes: Any, episode: Episode, largest: float) -> None:
    for bound in (-largest, largest):
        axes.axhline(1e3 * bound, color="black", lw=0.8, ls=":")
    axes.plot(episode.time, 1e3 * episode.torque[:, 2], color=TRUTH, lw=0.8, label="true")
    estimated = 1e3 * episode.observation[:, 5]
    axes.plot(episode.time, estimated, color=ESTIMATE, lw=1.6, label="estimated")
    axes.axhline(0, color="black", lw=0.5)
    axes.legend(ncols=2, loc="upper right")
    axes.set(xlabel="time (s)", ylabel=r"$\tau_z$ (mNm)", ylim=(-62, 90))


def _interval(row: Mapping[str, Any]) -> list[float]:
    """Return the ends, m/s, of the interval of the held speed."""
    return [share * row["bound_m_s"] for share in row["held_share_of_bound_ci95"]]


def _held(axes: Any, fastest: Sequence[Mapping[str, Any]], scale: Any) -> list[Any]:
    """Draw the speeds held over the gain for each rise time, times ``scale`` of their row; return
    what the legend names.
    """
    entries = []
    for rise, colour in zip(sorted({f["rise_time_s"] for f in fastest}), SERIES[4:], strict=False):
        some = [f for f in fastest if f["rise_time_s"] == rise]
        scales = np.array([scale(f) for f in some])
        held = np.array([f["held_m_s"] for f in some])
        low, high = np.transpose([_interval(f) for f in some])
        for name, line, style, label in _HELD:
            entries.append(
                axes.errorbar(
                    [f["gain"] for f in some],
                    scales * [f[name] for f in some],
                    scales * [held - low, high - held] if name == "held_m_s" else None,
                    fmt=line,
                    color=colour,
                    elinewidth=1.4,
                    capsize=4,
                    label=label.format(rise),
                    **style,
                )
            )
    return entries


def _speeds(axes: Any, fastest: Sequence[Mapping[str, Any]], largest: float) -> None:
    """Draw the fastest fan held over the gain, beside the bound."""
    gains = np.array(sorted({f["gain"] for f in fastest}))
    line = np.linspace(0.0, 1.08 * gains[-1], 200)
    bound = np.minimum(
        line * largest, max(f["bound_m_s"] for f in fastest) if largest * gains[-1] > 1 else np.inf
    )
    label = r"bound $k\,\tau_{max}$, at most 1 m/s"
    entries = axes.plot(line, bound, color="black", lw=1.6, label=label)
    words = "beyond it no fan can be followed"
    entries.append(axes.fill_between(line, bound, 2.0, color=PALE, lw=0, label=words))
    entries += _held(axes, fastest, lambda f: 1.0)
    for gain in gains:
        some = sorted((f for f in fastest if f["gain"] == gain), key=lambda f: f["rise_time_s"])
        axes.text(
            gain + 0.4,
            min(_interval(f)[0] for f in some) - 0.06,
            " / ".join(f"{f['held_m_s']:.2f}" for f in some),
            ha="left" if gain < gains[-1] else "center",
        )
    # in the order drawn; a legend of its own making has bars with intervals last
    axes.legend(handles=entries, loc="upper left", ncols=2)
    axes.set(
        title="the fastest fan held by four flights of five, 95 % interval",
        ylabel="speed of the fan (m/s)",
    )
    axes.set(xlabel="gain k (m/s per Nm)", ylim=(0, 1.75), xlim=(0, line[-1]))
