"""The plots of a diagnosis's page: one object each, from which its three forms come.

``packed`` is what ``page.js`` draws with uPlot, ``drawing`` the still picture of the same numbers
for pages without scripts, and ``table`` the same numbers for readers who do not see them. A plot
over time keeps, in each column of the window, the samples with the lowest and the highest residual
before and after: peaks stay, and every value is one of the log.
"""

import base64
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.signal import welch

from ..findings import CHANNELS, Diagnosis, Signature, Trace
from .drawing import Drawing, DrawnLine, draw
from .words import percent, rounded, scale_of

Array = NDArray[np.float64]
Index = NDArray[np.intp]


@dataclass(frozen=True)
class PlotSettings:
    """How much of a flight the page carries."""

    # all series over time together, packed: beside library, text and pictures a page of 60 s of
    # flight stays below 600 kB
    most_bytes: int = 170_000
    least_columns: int = 150  # of a plot over time, however many effects share the bytes
    steps: int = 32_000  # of a packed series, between zero and its largest value
    tick: float = 1e-4  # s, of packed times
    still_columns: int = 110  # of a still picture, of four samples each
    rows: int = 16  # of a table over time or frequency
    points: int = 360  # of a signature
    spectrum_seconds: float = 8.0  # of the segments of a spectrum
    frequencies: int = 160  # of a spectrum
    most_pieces: int = 40  # of flight that have rows of their own


PLOTS = PlotSettings()
_BASE64 = 4.0 / 3.0  # letters a byte
_GROUPS = (("force", slice(0, 3), "N"), ("torque", slice(3, 6), "Nm"))
_SYMBOLS = ("Fx", "Fy", "Fz", "τx", "τy", "τz")


@dataclass(frozen=True)
class PlotTable:
    """A caption, the heads of the columns, and the rows as texts."""

    caption: str
    head: tuple[str, ...]
    rows: list[tuple[str, ...]]


@dataclass(frozen=True, eq=False)
class Plot:
    """One plot of the page."""

    packed: dict[str, Any]  # its ``key`` is its name in the page
    drawing: Drawing
    table: PlotTable
    title: str  # what is drawn, with its unit
    axis: str  # what it is drawn over
    alt: str  # in words, for a reader who does not see it
    caption: str = ""
    readout: str = ""


def plot_data(
    diagnosis: Diagnosis, time: list[Plot], frequency: list[Plot], signatures: list[Plot]
) -> dict[str, Any]:
    """Return what the page's script draws, as plain data; empty where nothing can be drawn."""
    groups = (("frequency", frequency), ("signatures", signatures))
    data: dict[str, Any] = {name: [p.packed for p in plots] for name, plots in groups if plots}
    if time:
        traces = diagnosis.traces
        starts = first_times(traces)
        data["time"] = {
            "effects": _drawn_effects(diagnosis),
            "pieces": [
                {"log": trace.log, "x": start, "t": float(trace.t[0])}
                for trace, start in zip(traces, starts, strict=True)
            ],
            "end": _end_of(traces, starts),
            "held": [[_digit(a, 9), _digit(b, 9)] for a, b in _held_out(traces, starts)],
            "channels": [plot.packed for plot in time],
        }
    return data


def plots_over_time(diagnosis: Diagnosis) -> list[Plot]:
    """Return a plot a channel of the residual before and after; held-out blocks are shaded.

    Pieces of flight stand side by side, with their numbers above where there are several.
    """
    traces = diagnosis.traces
    if not traces:
        return []
    starts = first_times(traces)
    marks = [
        (start, str(number) if len(traces) <= 12 else "")
        for number, start in enumerate(starts, 1)
        if len(traces) > 1
    ]
    plots = []
    for i in drawn_channels(traces):
        factor, unit, limit = axis_limits(traces, i)
        symbol = _SYMBOLS[i]
        lines = [
            DrawnLine(
                side, trace.t[kept] - trace.t[0] + start, factor * getattr(trace, side)[kept, i]
            )
            for side in ("before", "after")
            for trace, start, columns in zip(
                traces, starts, _columns(traces, PLOTS.still_columns), strict=True
            )
            for kept in [telling_samples(trace, i, columns)]
        ]
        packed = _packed_channel(traces, i, _drawn_effects(diagnosis), factor, unit, limit)
        after = factor * _rms(np.concatenate([trace.after[:, i] for trace in traces]))
        change = f"rms {rounded(packed['rms'], 2)} → {rounded(after, 2)}"
        drawing = draw(
            lines,
            height=170,
            x_range=(starts[0], _end_of(traces, starts)),
            y_range=(-factor * limit, factor * limit),
            blocks=_held_out(traces, starts),
            marks=marks,
        )
        alt = f"Residual {symbol} in {unit} over time, before and after: {change}. "
        plots.append(
            Plot(
                packed,
                drawing,
                _table_over_time(traces, i, factor, unit),
                f"{symbol} ({unit})",
                "time (s)" if len(traces) == 1 else "pieces of flight, side by side (s)",
                alt + "Held-out blocks are shaded.",
                readout=f"{change} {unit}",
            )
        )
    return plots


def plots_over_frequency(diagnosis: Diagnosis) -> list[Plot]:
    """Return plots of the amplitude spectra of force and torque (root of the sum over three axes,
    mean removed), before and after; none where flights are too short.
    """
    traces = [trace for trace in diagnosis.traces if len(trace.t) >= 16]
    drawn = drawn_channels(traces)
    return [
        _plot_of_spectrum(traces, what, group, unit, diagnosis.cutoff_hz)
        for what, group, unit in _GROUPS
        if group.start in drawn
    ]


def _plot_of_spectrum(
    traces: Sequence[Trace], what: str, group: slice, unit: str, cutoff_hz: float
) -> Plot:
    longest = max(len(trace.t) * trace.period for trace in traces)
    lowest = 1.0 / min(longest, PLOTS.spectrum_seconds)
    x = np.linspace(lowest, max(cutoff_hz, 1.0), PLOTS.frequencies)
    before, after = (_spectrum(traces, side, group, x) for side in ("before", "after"))
    factor, unit = scale_of([float(np.max(before))], unit)
    before, after = factor * before, factor * after
    rows = np.linspace(0, len(x) - 1, PLOTS.rows).astype(int)
    name = f"{what} ({unit}/√Hz)"
    return Plot(
        {
            "key": f"frequency-{what}",
            "x": _digits(x),
            "unit": f"{unit}/√Hz",
            "before": _digits(before),
            "after": _digits(after),
        },
        draw(
            [DrawnLine("before", x, before), DrawnLine("after", x, after)],
            height=200,
            x_range=(0.0, float(x[-1])),
            y_range=(0.8 * min(before.min(), after.min()), 1.2 * max(before.max(), after.max())),
            logarithmic=True,
        ),
        PlotTable(
            f"Amplitude of the residual {name}",
            ("Frequency (Hz)", "Before", "After"),
            [(rounded(x[i]), rounded(before[i], 2), rounded(after[i], 2)) for i in rows],
        ),
        name,
        "frequency (Hz)",
        f"Amplitude spectrum of the residual {what} in {unit} per root hertz, before and after; "
        f"before, it is largest at {rounded(x[int(np.argmax(before))], 2)} Hz.",
    )


def _spectrum(traces: Sequence[Trace], side: str, group: slice, grid: Array) -> Array:
    """Return the amplitude (f,) per root hertz of all pieces together, the longer counting for
    more.
    """
    total, weight = np.zeros(len(grid)), 0.0
    for trace in traces:
        x = getattr(trace, side)[:, group]
        f, power = welch(
            x,
            1.0 / trace.period,
            nperseg=min(len(x), round(PLOTS.spectrum_seconds / trace.period)),
            axis=0,
        )
        total += len(x) * trace.period * np.interp(grid, f, power.sum(axis=1))
        weight += len(x) * trace.period
    return np.asarray(np.sqrt(total / weight), dtype=np.float64)


def plots_of_signatures(diagnosis: Diagnosis) -> list[Plot]:
    """Return plots of the residual against what drives each named effect, with the effect's own
    share of it.
    """
    return [_plot_of_signature(s, number) for number, s in enumerate(diagnosis.signatures)]


def _plot_of_signature(signature: Signature, number: int) -> Plot:
    columns = np.column_stack([signature.x, signature.residual, signature.fitted])
    columns = columns[np.isfinite(columns).all(axis=1)]
    channel = CHANNELS.index(signature.channel)
    symbol, unit = _SYMBOLS[channel], "N" if channel < 3 else "Nm"
    factor, unit = scale_of(np.abs(columns[:, 1:]).ravel(), unit)
    x, residual, fitted = (columns * [1.0, factor, factor]).T
    middle, mean = binned(x, residual)
    kept = np.linspace(0, len(x) - 1, min(len(x), PLOTS.points)).astype(int)
    kept = kept[np.argsort(x[kept], kind="stable")]
    correlation = (
        f"; correlation {rounded(float(np.corrcoef(residual, fitted)[0, 1]), 2)}"
        if len(x) > 2 and residual.std() > 0 and fitted.std() > 0
        else ""
    )
    lines = [
        DrawnLine("before dots", x[kept], residual[kept]),
        DrawnLine("after dots", x[kept], fitted[kept]),
        DrawnLine("ink", middle, mean),
    ]
    return Plot(
        {
            "key": f"signature-{number}",
            "symbol": symbol,
            "unit": unit,
            "effect": signature.effect,
            "regressor": signature.regressor,
            "x": _digits(x[kept]),
            "residual": packed_series(residual[kept]),
            "fitted": packed_series(fitted[kept]),
            "middle": _digits(middle),
            "mean": _digits(mean),
        },
        draw(lines, height=230),
        PlotTable(
            f"{signature.effect}: {symbol} ({unit}) over {signature.regressor}, means of "
            f"{len(middle)} groups of equally many points",
            (signature.regressor, "Residual without it", "Effect"),
            [
                (rounded(at), rounded(r, 2), rounded(f, 2))
                for at, r, f in zip(middle, mean, binned(x, fitted)[1], strict=True)
            ],
        ),
        f"{symbol} ({unit})",
        signature.regressor,
        f"Residual {symbol} in {unit} without {signature.effect} against {signature.regressor}, "
        f"its mean, and the fitted values of {signature.effect}{correlation}.",
        signature.effect,
    )


def first_times(traces: Sequence[Trace]) -> list[float]:
    """Return where each piece begins on a common axis: its own time if there is one, side by side
    if there are several.
    """
    if len(traces) == 1:
        return [float(traces[0].t[0])]
    lengths = [float(trace.t[-1] - trace.t[0]) for trace in traces]
    gap = 0.01 * sum(lengths)
    return [sum(lengths[:i]) + gap * i for i in range(len(traces))]


def axis_limits(traces: Sequence[Trace], i: int) -> tuple[float, str, float]:
    """Return the factor and unit of a channel's plot over time, and where its axis ends (N or Nm):
    the same for all three axes.
    """
    group = slice(0, 3) if i < 3 else slice(3, 6)
    largest = max(
        float(np.abs(x[:, group]).max(initial=0.0))
        for trace in traces
        for x in (trace.before, trace.after)
    )
    factor, unit = scale_of([largest], "N" if i < 3 else "Nm")
    return factor, unit, 1.08 * largest or 1.0 / factor


def drawn_channels(traces: Sequence[Trace]) -> list[int]:
    """Return the channels that were compared: force, torque or both.

    The torque is zero throughout where the logs cannot tell it, as where rotor speeds are commands.
    """
    return [
        i
        for group in (range(3), range(3, 6))
        if any(x[:, group].any() for trace in traces for x in (trace.before, trace.after))
        for i in group
    ]


def held_out_runs(trace: Trace, t: Array) -> list[tuple[float, float]]:
    """Return from when to when samples were held out, on an axis ``t`` (n,)."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], trace.held_out, [False]]).astype(int)))
    return [(t[a], t[min(b, len(t) - 1)]) for a, b in edges.reshape(-1, 2)]


def binned(x: Array, y: Array, count: int = 14) -> tuple[Array, Array]:
    """Return the mean of ``y`` over ``x`` (n,) in bins with as many points each."""
    if len(x) < 4 * count:
        return np.empty(0), np.empty(0)
    parts = np.array_split(np.argsort(x, kind="stable"), count)
    return np.array([x[p].mean() for p in parts]), np.array([y[p].mean() for p in parts])


def _drawn_effects(diagnosis: Diagnosis) -> list[str]:
    """Return the named effects of which every trace has the part."""
    names = [effect.name for effect in diagnosis.effects]
    return [name for name in names if all(name in trace.parts for trace in diagnosis.traces)]


def _end_of(traces: Sequence[Trace], starts: Sequence[float]) -> float:
    return float(starts[-1] + traces[-1].t[-1] - traces[-1].t[0])


def _held_out(traces: Sequence[Trace], starts: Sequence[float]) -> list[tuple[float, float]]:
    """Return the held-out blocks of all pieces, on the common axis."""
    return [
        (float(a), float(b))
        for trace, start in zip(traces, starts, strict=True)
        for a, b in held_out_runs(trace, trace.t - trace.t[0] + start)
    ]


def _columns(traces: Sequence[Trace], columns: int) -> list[int]:
    """Return how many of a window's columns each piece of flight gets."""
    total = sum(len(trace.t) for trace in traces)
    return [max(round(columns * len(trace.t) / total), 1) for trace in traces]


def _packed_channel(
    traces: Sequence[Trace], i: int, names: Sequence[str], factor: float, unit: str, limit: float
) -> dict[str, Any]:
    """Return a channel's series over time as ``page.js`` unpacks them.

    ``products`` are mean products of ``after`` and the effects' parts: the mean square of
    ``after`` with any choice of parts added is a sum of them.
    """
    a_sample = _BASE64 * 2.0 * (3 + len(names)) * len(CHANNELS)
    columns = max(int(PLOTS.most_bytes / a_sample / 4), PLOTS.least_columns)
    kept = [
        telling_samples(*each)
        for each in zip(traces, len(traces) * [i], _columns(traces, columns), strict=True)
    ]
    series = {
        "before": [trace.before for trace in traces],
        "after": [trace.after for trace in traces],
        **{name: [trace.parts[name] for trace in traces] for name in names},
    }
    whole = {
        name: factor * np.concatenate([x[:, i] for x in each]) for name, each in series.items()
    }
    packed = {
        name: packed_series(
            factor * np.concatenate([x[k, i] for x, k in zip(each, kept, strict=True)])
        )
        for name, each in series.items()
    }
    times = [trace.t[k] - trace.t[0] for trace, k in zip(traces, kept, strict=True)]
    longest = max(float(np.diff(t, prepend=0.0).max()) for t in times)
    tick = max(PLOTS.tick, longest / PLOTS.steps)
    summed = [whole[name] for name in ("after", *names)]
    return {
        "key": f"time-{CHANNELS[i]}",
        "symbol": _SYMBOLS[i],
        "unit": unit,
        "limit": factor * limit,
        "counts": [len(k) for k in kept],
        "tick": tick,
        "steps": _base64(
            np.concatenate([np.diff(np.rint(t / tick), prepend=0.0) for t in times]), "<u2"
        ),
        "before": packed["before"],
        "after": packed["after"],
        "parts": [packed[name] for name in names],
        "products": [[_digit(float(np.mean(x * y))) for y in summed] for x in summed],
        "rms": _digit(_rms(whole["before"])),
    }


def telling_samples(trace: Trace, i: int, columns: int) -> Index:
    """Return which samples of channel ``i`` stand for a piece of flight: all of a short one, or
    in each of ``columns`` stretches the lowest and highest before and after.
    """
    n = len(trace.t)
    if n <= 4 * columns:
        return np.arange(n)
    edges = np.linspace(0, n, columns + 1).astype(int)
    width = int(np.diff(edges).max())
    rows = np.minimum(edges[:-1, None] + np.arange(width), edges[1:, None] - 1)
    extremes = [
        np.take_along_axis(rows, which(x[rows], axis=1)[:, None], axis=1).ravel()
        for x in (trace.before[:, i], trace.after[:, i])
        for which in (np.argmin, np.argmax)
    ]
    return np.unique(np.concatenate([[0, n - 1], *extremes]))


def _table_over_time(traces: Sequence[Trace], i: int, factor: float, unit: str) -> PlotTable:
    """Return the residual's rms before and after in a channel, interval by interval."""
    several, many = len(traces) > 1, len(traces) > PLOTS.most_pieces
    each = max(PLOTS.rows // len(traces), 1)
    rows: list[tuple[str, ...]] = []
    for number, trace in enumerate(traces[: PLOTS.most_pieces], 1):
        for part in np.array_split(np.arange(len(trace.t)), min(each, len(trace.t))):
            share = trace.held_out[part].mean()
            rows.append(
                (
                    *((str(number),) if several else ()),
                    f"{trace.t[part[0]]:.1f} to {trace.t[part[-1]]:.1f}",
                    "no" if share == 0 else "yes" if share == 1 else "in part",
                    *(rounded(factor * _rms(x[part, i]), 2) for x in (trace.before, trace.after)),
                )
            )
    more = f", the first {PLOTS.most_pieces} of {len(traces)} pieces" if many else ""
    return PlotTable(
        f"Residual {_SYMBOLS[i]}, rms ({unit}){more}",
        (*(("Piece",) if several else ()), "Time (s)", "Held out", "Before", "After"),
        rows,
    )


@dataclass(frozen=True)
class Bar:
    """One candidate effect in the chart of what each explains alone."""

    name: str
    share: str
    named: bool
    rival: bool  # these logs cannot tell it from a named effect
    left: float  # of the bar's ends, per cent of the chart's width
    width: float


def candidate_bars(diagnosis: Diagnosis, most: int = 14) -> list[Bar]:
    """Return the ranking of the effects that were tried: the best ``most``, and whichever else is
    named or cannot be told from a named one.
    """
    rivals = {x for effect in diagnosis.effects for x in effect.indistinguishable_from}
    shown = [
        candidate
        for i, candidate in enumerate(diagnosis.candidates)
        if i < most or candidate.named or candidate.name in rivals
    ]
    gains = [candidate.gain if np.isfinite(candidate.gain) else 0.0 for candidate in shown]
    high, low = max([*gains, 0.05]), max(min([*gains, 0.0]), -0.25)

    def place(gain: float) -> float:
        return 100.0 * (max(gain, low) - low) / (high - low)

    return [
        Bar(
            candidate.name,
            percent(candidate.gain),
            candidate.named,
            candidate.name in rivals and not candidate.named,
            round(min(place(gain), place(0.0)), 1),
            round(abs(place(gain) - place(0.0)), 1),
        )
        for candidate, gain in zip(shown, gains, strict=True)
    ]


def packed_series(x: Array) -> dict[str, Any] | None:
    """Return a series (n,) as 16-bit integers in base64 and their scale; None for one that is zero
    throughout, or nearly so.
    """
    x = np.nan_to_num(x)
    largest = float(np.abs(x).max(initial=0.0))
    if largest < 1e-12:
        return None
    scale = largest / PLOTS.steps
    return {"scale": _digit(scale, 9), "data": _base64(np.rint(x / scale), "<i2")}


def _rms(x: Array) -> float:
    return float(np.sqrt(np.mean(np.square(x))))


def _base64(x: Array, kind: str) -> str:
    return base64.b64encode(x.astype(kind).tobytes()).decode()


def _digit(x: float, digits: int = 5) -> float:
    return float(f"{x:.{digits}g}")


def _digits(x: Iterable[float]) -> list[float]:
    return [_digit(float(v)) for v in x]
