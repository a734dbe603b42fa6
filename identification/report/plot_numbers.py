"""The plots of a diagnosis's page: one object with two forms each.

``packed`` is for uPlot in ``page.js``, and ``table`` for pages without scripts and readers without
sight of a plot. A plot over time keeps, in each column of the window, the samples with the lowest
and the highest residual before and after: peaks stay, and every value is one of the log.
"""

import base64
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ...runtime.plain_values import plain
from ..findings import CHANNELS, Diagnosis, NamedEffect, Signature, Trace
from ..logs.table import Array, Data, Names, Pair, Rows, finite_rows
from ..motion.smoothing import power_spectrum, runs_of
from .words import percent, rounded, scale_of

# all series over time together, packed: beside library and text a page of 60 s of flight stays
# below 600 kB
_MOST_BYTES = 170_000
_LEAST_COLUMNS = 150  # in a plot over time, at any number of effects
_STEPS = 32_000  # in a packed series, between zero and its largest value
_TICK = 1e-4  # s, packed times
_ROWS = 16  # in a table over time or frequency
_POINTS = 360  # in a signature
_BINS = 14  # in a signature's mean
_SPECTRUM_SECONDS = 8.0  # segments of a spectrum
_FREQUENCIES = 160  # in a spectrum
_MOST_PIECES = 40  # pieces of flight with rows of their own
_BASE64 = 4.0 / 3.0  # letters a byte
_GROUPS = (("force", slice(0, 3), "N"), ("torque", slice(3, 6), "Nm"))
_SYMBOLS = ("Fx", "Fy", "Fz", "τx", "τy", "τz")


class _PlotTable(NamedTuple):
    """A caption, the heads of the columns, and the rows as texts."""

    caption: str
    head: Names
    rows: list[Names]


class Plot(NamedTuple):
    """One plot of the page."""

    packed: Data  # ``key`` is the plot's name in the page
    table: _PlotTable
    title: str  # quantity and unit
    axis: str  # quantity of the x axis
    alt: str  # words for readers without sight of the plot
    caption: str = ""
    readout: str = ""


class _Joined:
    """The residual of all pieces of flight, one after the other on a common axis (n samples)."""

    def __init__(self, traces: Sequence[Trace], effects: Sequence[NamedEffect]) -> None:
        self.traces = traces
        # start of each piece: its own time for one piece, side by side for several
        lengths = np.array([trace.t[-1] - trace.t[0] for trace in traces])
        ends = np.cumsum(lengths + 0.01 * lengths.sum())
        self.starts = [traces[0].t[0] if len(traces) == 1 else 0.0, *ends[:-1]]
        self.end = self.starts[-1] + lengths[-1]
        self.before = np.concatenate([trace.before for trace in traces])
        self.after = np.concatenate([trace.after for trace in traces])
        moved = [t.t - t.t[0] + start for t, start in zip(traces, self.starts, strict=True)]
        self.x = np.concatenate(moved)
        self.parts = {
            effect.name: np.concatenate([trace.parts[effect.name] for trace in traces])
            for effect in effects
            if all(effect.name in trace.parts for trace in traces)
        }
        self.pieces = np.split(np.arange(len(self.x)), np.cumsum([*map(len, moved)])[:-1])
        # the compared channels: force, torque or both. The torque is zero throughout if unknown, as
        # with commands for rotor speeds
        is_known = np.any([self.before, self.after], axis=(0, 1)).reshape(2, 3).any(axis=1)
        self.channels = np.flatnonzero(np.repeat(is_known, 3)).tolist()

    def kept(self, i: int) -> list[Rows]:
        """Return the drawn samples of each piece for channel ``i``."""
        a_sample = _BASE64 * 2.0 * (3 + len(self.parts)) * len(CHANNELS)
        share = max(int(_MOST_BYTES / a_sample / 4), _LEAST_COLUMNS) / len(self.x)
        lines = np.column_stack([self.before[:, i], self.after[:, i]])
        return [
            rows[telling_samples(lines[rows], max(round(share * len(rows)), 1))]
            for rows in self.pieces
        ]

    def held_out(self) -> list[Pair]:
        """Return start and end of each held-out block."""
        return [
            (self.x[rows[a]], self.x[rows[min(b, len(rows) - 1)]])
            for rows, trace in zip(self.pieces, self.traces, strict=True)
            for a, b in runs_of(trace.held_out)
        ]


class _PagePlots(NamedTuple):
    """The plots of a page, and the script's plain data; empty without anything to draw."""

    time: list[Plot]  # one a channel
    frequency: list[Plot]  # force and torque
    signatures: list[Plot]  # one a named effect
    data: Data


def page_plots(diagnosis: Diagnosis) -> _PagePlots:
    """Return all plots of a diagnosis's page.

    Over time the residual before and after, with held-out blocks shaded and pieces of flight side
    by side. Their amplitude spectra (root of the sum over three axes, mean removed). The residual
    against each named effect's regressor, with the effect's own share.
    """
    time, frequency = [], []
    data: Data = {}
    if diagnosis.traces:
        joined = _Joined(diagnosis.traces, diagnosis.effects)
        time = [_plot_over_time(joined, i) for i in joined.channels]
        data["time"] = {
            "effects": list(joined.parts),
            "pieces": [
                {"log": trace.log, "x": start, "t": trace.t[0]}
                for trace, start in zip(joined.traces, joined.starts, strict=True)
            ],
            "end": joined.end,
            "held": joined.held_out(),
            "channels": [plot.packed for plot in time],
        }
        long = [trace for trace in diagnosis.traces if len(trace.t) >= 16]
        frequency = [
            _plot_of_spectrum(long, what, group, unit, diagnosis.cutoff_hz)
            for what, group, unit in _GROUPS
            if long and group.start in joined.channels
        ]
    signatures = [_plot_of_signature(s, number) for number, s in enumerate(diagnosis.signatures)]
    drawn = {"frequency": frequency, "signatures": signatures}
    data |= {name: [plot.packed for plot in plots] for name, plots in drawn.items() if plots}
    return _PagePlots(time, frequency, signatures, plain(data, 8))


def _plot_over_time(joined: _Joined, i: int) -> Plot:
    """Return a channel's plot; ``packed`` holds its series as ``page.js`` unpacks them.

    ``products`` are mean products of ``after`` and the effects' parts: the mean square of
    ``after`` with any choice of parts added is a sum of them.
    """
    _, group, unit = _GROUPS[i // 3]  # with the same axis
    largest = np.abs([joined.before[:, group], joined.after[:, group]]).max()
    factor, unit = scale_of([largest], unit)
    before, after, *parts = (
        factor * x[:, i] for x in (joined.before, joined.after, *joined.parts.values())
    )
    change = f"rms {rounded(_rms(before), 2)} → {rounded(_rms(after), 2)}"
    kept = joined.kept(i)
    rows = np.concatenate(kept)
    times = [joined.x[k] - joined.x[k[0]] for k in kept]
    tick = max(_TICK, np.diff(np.concatenate(times), prepend=0.0).max() / _STEPS)
    steps = np.concatenate([np.diff(np.rint(t / tick), prepend=0.0) for t in times])
    return Plot(
        {
            "key": f"time-{CHANNELS[i]}",
            "symbol": _SYMBOLS[i],
            "unit": unit,
            "limit": factor * (1.08 * largest or 1.0 / factor),
            "counts": [len(k) for k in kept],
            "tick": tick,
            "steps": _base64(steps, "<u2"),
            "before": _packed_series(before[rows]),
            "after": _packed_series(after[rows]),
            "parts": [_packed_series(part[rows]) for part in parts],
            "products": [[(x * y).mean() for y in (after, *parts)] for x in (after, *parts)],
            "rms": _rms(before),
        },
        _table_over_time(joined.traces, i, factor, unit),
        f"{_SYMBOLS[i]} ({unit})",
        "time (s)" if len(kept) == 1 else "pieces of flight, side by side (s)",
        f"Residual {_SYMBOLS[i]} in {unit} over time, before and after: {change}. Held-out blocks "
        "are shaded.",
        readout=f"{change} {unit}",
    )


def _plot_of_spectrum(
    traces: Sequence[Trace], what: str, group: slice, unit: str, cutoff_hz: float
) -> Plot:
    longest = max(len(trace.t) * trace.period for trace in traces)
    x = np.linspace(1.0 / min(longest, _SPECTRUM_SECONDS), max(cutoff_hz, 1.0), _FREQUENCIES)
    before, after = (_spectrum(traces, side, group, x) for side in ("before", "after"))
    factor, unit = scale_of(before, unit)
    before, after = factor * before, factor * after
    rows = np.linspace(0, len(x) - 1, _ROWS).astype(int)
    name = f"{what} ({unit}/√Hz)"
    return Plot(
        {
            "key": f"frequency-{what}",
            "x": x,
            "unit": f"{unit}/√Hz",
            "before": before,
            "after": after,
        },
        _PlotTable(
            f"Amplitude of the residual {name}",
            ("Frequency (Hz)", "Before", "After"),
            [(rounded(x[i]), rounded(before[i], 2), rounded(after[i], 2)) for i in rows],
        ),
        name,
        "frequency (Hz)",
        f"Amplitude spectrum of the residual {what} in {unit} per root hertz, before and after; "
        f"before, it is largest at {rounded(x[np.argmax(before)], 2)} Hz.",
    )


def _spectrum(traces: Sequence[Trace], side: str, group: slice, grid: Array) -> Array:
    """Return the amplitude (f,) per root hertz of all pieces together, the longer counting for
    more.
    """
    powers = []
    for trace in traces:
        x, period = getattr(trace, side)[:, group], trace.period
        f, power = power_spectrum(x, period, round(_SPECTRUM_SECONDS / period))
        powers.append(np.interp(grid, f, power.sum(axis=1)))
    spectrum: Array = np.sqrt(np.average(powers, 0, [len(x.t) * x.period for x in traces]))
    return spectrum


def _plot_of_signature(signature: Signature, number: int) -> Plot:
    columns = np.column_stack([signature.x, signature.residual, signature.fitted])
    columns = columns[finite_rows(columns)]
    symbol = _SYMBOLS[CHANNELS.index(signature.channel)]
    factor, unit = scale_of(columns[:, 1:].ravel(), "N" if symbol.startswith("F") else "Nm")
    columns = columns * [1.0, factor, factor]
    x, residual, fitted = columns.T
    means = _binned(columns)
    middle, mean, _ = means.T
    kept = np.linspace(0, len(x) - 1, min(len(x), _POINTS)).astype(int)
    kept = kept[np.argsort(x[kept], kind="stable")]
    correlation = ""
    if len(x) > 2 and residual.std() > 0 and fitted.std() > 0:
        correlation = f"; correlation {rounded(np.corrcoef(residual, fitted)[0, 1], 2)}"
    return Plot(
        {
            "key": f"signature-{number}",
            "symbol": symbol,
            "unit": unit,
            "effect": signature.effect,
            "regressor": signature.regressor,
            "x": x[kept],
            "residual": _packed_series(residual[kept]),
            "fitted": _packed_series(fitted[kept]),
            "middle": middle,
            "mean": mean,
        },
        _PlotTable(
            f"{signature.effect}: {symbol} ({unit}) over {signature.regressor}, means of "
            f"{len(means)} groups of equally many points",
            (signature.regressor, "Residual without it", "Effect"),
            [(rounded(at), rounded(r, 2), rounded(f, 2)) for at, r, f in means],
        ),
        f"{symbol} ({unit})",
        signature.regressor,
        f"Residual {symbol} in {unit} without {signature.effect} against {signature.regressor}, "
        f"its mean, and the fitted values of {signature.effect}{correlation}.",
        signature.effect,
    )


def _binned(columns: Array) -> Array:
    """Return the mean rows of columns (n, k) in bins of the first column with as many points
    each.
    """
    if len(columns) < 4 * _BINS:
        return np.empty((0, columns.shape[1]))
    parts = np.array_split(np.argsort(columns[:, 0], kind="stable"), _BINS)
    return np.array([columns[rows].mean(axis=0) for rows in parts])


def telling_samples(lines: Array, columns: int) -> Rows:
    """Return the drawn rows of lines (n, k): all of a few, or both ends, and in each of ``columns``
    stretches the lowest and highest of each line.
    """
    n = len(lines)
    if n <= 4 * columns:
        return np.arange(n)
    edges = np.linspace(0, n, columns + 1).astype(int)
    width = int(np.diff(edges).max())
    rows = np.minimum(edges[:-1, None] + np.arange(width), edges[1:, None] - 1)
    extremes = [
        np.take_along_axis(rows, which(lines[rows], axis=1), axis=1).ravel()
        for which in (np.argmin, np.argmax)
    ]
    return np.unique(np.concatenate([[0, n - 1], *extremes]))


def _table_over_time(traces: Sequence[Trace], i: int, factor: float, unit: str) -> _PlotTable:
    """Return the residual's rms before and after in a channel, interval by interval."""
    each = max(_ROWS // len(traces), 1)
    head: Names = ("Piece", "Time (s)", "Held out", "Before", "After")
    rows: list[Names] = []
    for number, trace in enumerate(traces[:_MOST_PIECES], 1):
        for part in np.array_split(np.arange(len(trace.t)), min(each, len(trace.t))):
            held = {0.0: "no", 1.0: "yes"}.get(trace.held_out[part].mean(), "in part")
            time = f"{trace.t[part[0]]:.1f} to {trace.t[part[-1]]:.1f}"
            sides = (rounded(factor * _rms(x[part, i]), 2) for x in (trace.before, trace.after))
            rows.append((str(number), time, held, *sides))
    if len(traces) == 1:
        head, rows = head[1:], [row[1:] for row in rows]
    more = f", the first {_MOST_PIECES} of {len(traces)} pieces" * (len(traces) > _MOST_PIECES)
    return _PlotTable(f"Residual {_SYMBOLS[i]}, rms ({unit}){more}", head, rows)


class Bar(NamedTuple):
    """One candidate effect in the chart of the shares each explains alone."""

    name: str
    share: str
    kind: str  # named; rival, indistinguishable from a named effect; or empty
    left: float  # the bar's left end, per cent of the chart's width
    width: float


def candidate_bars(diagnosis: Diagnosis) -> list[Bar]:
    """Return the ranking of the tried effects: the best 14, named effects, and effects
    indistinguishable from a named one.
    """
    rivals = {x for effect in diagnosis.effects for x in effect.indistinguishable_from}
    ranked = [
        (x, "named" if x.named else "rival" if x.name in rivals else "")
        for x in diagnosis.candidates
    ]
    shown = ranked[:14] + [(x, kind) for x, kind in ranked[14:] if kind]
    gains = np.nan_to_num([x.gain for x, _ in shown], posinf=0.0, neginf=0.0)
    high, low = np.max(gains, initial=0.05), max(np.min(gains, initial=0.0), -0.25)
    *places, zero = (100.0 * (np.maximum([*gains, 0.0], low) - low) / (high - low)).tolist()
    return [
        Bar(x.name, percent(x.gain), kind, round(min(at, zero), 1), round(abs(at - zero), 1))
        for (x, kind), at in zip(shown, places, strict=True)
    ]


def _packed_series(x: Array) -> Data | None:
    """Return a series (n,) as 16-bit integers in base64 and their scale; None for zeros, or nearly
    zeros, throughout.
    """
    x = np.nan_to_num(x)
    scale = np.abs(x).max(initial=0.0) / _STEPS
    if scale * _STEPS < 1e-12:
        return None
    return {"scale": scale, "data": _base64(np.rint(x / scale), "<i2")}


def _rms(x: Array) -> float:
    return float(np.sqrt(np.square(x).mean()))


def _base64(x: Array, kind: str) -> str:
    return base64.b64encode(x.astype(kind).tobytes()).decode()
