"""The numbers behind the plots of a diagnosis's page, packed small: what ``page.js`` draws.

A plot over time holds samples of the residual as they are, in every column of the window the lowest
and the highest of the residual before and of the residual after: peaks stay, and every value that
the page shows is one of the log. A series is 16-bit integers times a scale, in base64.
"""

import base64
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..findings import CHANNELS, Diagnosis, Signature, Trace
from .plot_numbers import (
    SYMBOLS,
    amplitude_spectra,
    axis_limits,
    binned,
    drawn_channels,
    first_times,
    held_out_runs,
    signature_points,
)

Array = NDArray[np.float64]
Index = NDArray[np.intp]


@dataclass(frozen=True)
class InteractiveSettings:
    """How much of a flight the page carries."""

    # all series over time together, packed: beside library, text and pictures a page of 60 s of
    # flight stays below 600 kB
    most_bytes: int = 170_000
    least_columns: int = 150  # of a plot over time, however many effects share the bytes
    steps: int = 32_000  # of a packed series, between nothing and its largest value
    tick: float = 1e-4  # s, of packed times


INTERACTIVE = InteractiveSettings()
_BASE64 = 4.0 / 3.0  # letters a byte


def plot_data(diagnosis: Diagnosis) -> dict[str, Any]:
    """Return what the page's script draws, as plain data; empty where nothing can be drawn."""
    found: dict[str, Any] = {}
    if diagnosis.traces:
        found["time"] = _over_time(diagnosis)
    spectra = amplitude_spectra(diagnosis)
    if spectra:
        found["frequency"] = [
            {
                "key": f"frequency-{s.what}",
                "x": _digits(s.frequency),
                "unit": f"{s.unit}/√Hz",
                "before": _digits(s.factor * s.before),
                "after": _digits(s.factor * s.after),
            }
            for s in spectra
        ]
    if diagnosis.signatures:
        found["signatures"] = [_signature(s, i) for i, s in enumerate(diagnosis.signatures)]
    return found


def _over_time(diagnosis: Diagnosis) -> dict[str, Any]:
    traces = diagnosis.traces
    names = [effect.name for effect in diagnosis.effects]
    names = [name for name in names if all(name in trace.parts for trace in traces)]
    starts = first_times(traces)
    columns = _columns(traces, len(names))
    return {
        "effects": names,
        "pieces": [
            {"log": trace.log, "x": start, "t": float(trace.t[0])}
            for trace, start in zip(traces, starts, strict=True)
        ],
        "end": float(starts[-1] + traces[-1].t[-1] - traces[-1].t[0]),
        "held": [
            [round(float(a), 4), round(float(b), 4)]
            for trace, start in zip(traces, starts, strict=True)
            for a, b in held_out_runs(trace, trace.t - trace.t[0] + start)
        ],
        "channels": [
            _channel(traces, i, names, columns, *axis_limits(traces, i))
            for i in drawn_channels(traces)
        ],
    }


def _channel(
    traces: Sequence[Trace],
    i: int,
    names: Sequence[str],
    columns: Sequence[int],
    factor: float,
    unit: str,
    limit: float,
) -> dict[str, Any]:
    kept = [telling_samples(t, i, n) for t, n in zip(traces, columns, strict=True)]

    def joined(series: Sequence[Array]) -> dict[str, Any] | None:
        return packed(factor * np.concatenate([x[k, i] for x, k in zip(series, kept, strict=True)]))

    times = [t.t[k] - t.t[0] for t, k in zip(traces, kept, strict=True)]
    tick = max(
        INTERACTIVE.tick,
        max(float(np.diff(t, prepend=0.0).max()) for t in times) / INTERACTIVE.steps,
    )
    after = [trace.after for trace in traces]
    parts = [[trace.parts[name] for trace in traces] for name in names]
    whole = [factor * np.concatenate([x[:, i] for x in series]) for series in (after, *parts)]
    return {
        "key": f"time-{CHANNELS[i]}",
        "symbol": SYMBOLS[CHANNELS[i]],
        "unit": unit,
        "limit": factor * limit,
        "counts": [len(k) for k in kept],
        "tick": tick,
        "steps": _base64(
            np.concatenate([np.diff(np.rint(t / tick), prepend=0.0) for t in times]), "<u2"
        ),
        "before": joined([trace.before for trace in traces]),
        "after": joined(after),
        "parts": [joined(part) for part in parts],
        # mean products: the mean square of ``after`` and any choice of parts is a sum of these
        "products": [[_digit(float(np.mean(x * y))) for y in whole] for x in whole],
        "rms": _digit(
            float(factor * np.sqrt(np.mean(np.concatenate([t.before[:, i] for t in traces]) ** 2)))
        ),
    }


def _columns(traces: Sequence[Trace], effects: int) -> list[int]:
    """Return how many columns, of four samples each, every piece of flight gets of the bytes."""
    a_sample = _BASE64 * 2.0 * (3 + effects) * len(CHANNELS)
    columns = max(int(INTERACTIVE.most_bytes / a_sample / 4), INTERACTIVE.least_columns)
    total = sum(len(trace.t) for trace in traces)
    return [max(round(columns * len(trace.t) / total), 1) for trace in traces]


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
    found = [
        np.take_along_axis(rows, which(x[rows], axis=1)[:, None], axis=1).ravel()
        for x in (trace.before[:, i], trace.after[:, i])
        for which in (np.argmin, np.argmax)
    ]
    return np.unique(np.concatenate([[0, n - 1], *found]))


def packed(x: Array) -> dict[str, Any] | None:
    """Return a series (n,) as integers and their scale; None for one that is zero throughout, or
    nearly so.
    """
    x = np.nan_to_num(x)
    largest = float(np.abs(x).max(initial=0.0))
    if largest < 1e-12:
        return None
    scale = largest / INTERACTIVE.steps
    return {"scale": _digit(scale, 9), "data": _base64(np.rint(x / scale), "<i2")}


def _signature(signature: Signature, number: int) -> dict[str, Any]:
    points = signature_points(signature)
    middle, mean = binned(points.x, points.factor * points.residual)
    order = points.kept[np.argsort(points.x[points.kept], kind="stable")]
    return {
        "key": f"signature-{number}",
        "symbol": SYMBOLS[signature.channel],
        "unit": points.unit,
        "effect": signature.effect,
        "regressor": signature.regressor,
        "x": _digits(points.x[order]),
        "residual": packed(points.factor * points.residual[order]),
        "fitted": packed(points.factor * points.fitted[order]),
        "middle": _digits(middle),
        "mean": _digits(mean),
    }


def scripted(value: str) -> str:
    """Return JSON as it may stand in a page's script element: no tag can begin in it."""
    return value.replace("<", "\\u003c").replace("\u2028", "\\u2028").replace("\u2029", "\\u2029")


def _base64(x: Array, kind: str) -> str:
    return base64.b64encode(x.astype(kind).tobytes()).decode()


def _digit(x: float, digits: int = 5) -> float:
    return float(f"{x:.{digits}g}")


def _digits(x: Array) -> list[float]:
    return [_digit(float(v)) for v in x]
