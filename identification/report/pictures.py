"""The pictures of a diagnosis's report: small vector drawings for one column of a telephone or
three of a wide window.

Each is an SVG element that stands in the page itself. Its colours are the page's CSS variables, so
it follows the light or dark scheme, and its text is text.
"""

import io
import re
import textwrap
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from ..findings import CHANNELS, Candidate, Diagnosis, Signature, Trace
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
from .words import percent, rounded

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Array = NDArray[np.float64]

# drawn in these, written as the variables
_COLOURS = {
    "ink": "#1c2430",
    "muted": "#6b7483",
    "grid": "#dfe3e8",
    "bar": "#b4bcc7",
    "before": "#d55e00",
    "after": "#0072b2",
    "held": "#e6edda",
}
_BINS = 220  # columns that a line over time is thinned to: its lowest and highest point in each
_LABEL = 46  # letters in a line below a signature
_FEW_DECADES = (
    100.0  # between the ends of an axis, whose powers of ten are too few to read a number off
)
_BARS = 14  # candidates that are drawn, besides the named ones
_SVG = "http://www.w3.org/2000/svg"
_XLINK = "http://www.w3.org/1999/xlink"


@dataclass(frozen=True)
class Picture:
    """An SVG element with the words that stand for it and around it."""

    svg: str
    alt: str
    caption: str = ""
    key: str = ""  # its name in the page
    title: str = ""  # what is drawn, with its unit
    axis: str = ""  # what it is drawn over, where that differs from plot to plot


@contextmanager
def _style() -> Iterator[None]:
    """Set matplotlib's fonts and SVG for the pictures within, and only for them."""
    import matplotlib  # takes half a second, and most of the kit never draws

    # users' names may hold what mathematical text would choke on; points are thinned here, not by
    # the renderer
    style: dict[Any, Any] = {
        "svg.fonttype": "none",
        "svg.hashsalt": "windwrench",
        "path.simplify": False,
        "text.parse_math": False,
        "font.family": "sans-serif",
        "font.sans-serif": ["DejaVu Sans"],
        "font.size": 7.5,
        "axes.labelsize": 7.5,
        "axes.formatter.useoffset": False,
    }
    with matplotlib.rc_context(style):
        yield


@_style()
def draw_over_time(diagnosis: Diagnosis) -> list[Picture]:
    """Draw the residual before and after over time, a picture a channel; held-out blocks are
    shaded.

    Pieces of flight stand side by side, with their numbers above where there are several.
    """
    traces = diagnosis.traces
    if not traces:
        return []
    starts = first_times(traces)
    pictures = []
    for i in drawn_channels(traces):
        channel = CHANNELS[i]
        factor, unit, limit = axis_limits(traces, i)
        figure, panel = _panel(3.4, 1.75)
        for number, (trace, start) in enumerate(zip(traces, starts, strict=True), 1):
            t = trace.t - trace.t[0] + start
            _shade(panel, t, trace)
            for x, colour in ((trace.before, "before"), (trace.after, "after")):
                panel.plot(*_thin(t, factor * x[:, i]), color=_COLOURS[colour], lw=0.9)
            if len(traces) > 1:
                panel.axvline(start, color=_COLOURS["muted"], lw=0.5)
            if 1 < len(traces) <= 12:
                panel.text(
                    t.mean(),
                    0.97,
                    str(number),
                    transform=panel.get_xaxis_transform(),
                    ha="center",
                    va="top",
                    color=_COLOURS["muted"],
                )
        before, after = (
            _rms([x[:, i] for x in side])
            for side in ([t.before for t in traces], [t.after for t in traces])
        )
        change = f"rms {rounded(factor * before, 2)} → {rounded(factor * after, 2)}"
        panel.set_ylim(-factor * limit, factor * limit)
        panel.set_xlim(starts[0], starts[-1] + traces[-1].t[-1] - traces[-1].t[0])
        _title(panel, f"{SYMBOLS[channel]} ({unit})", change)
        panel.set_xlabel("time (s)" if len(traces) == 1 else "pieces of flight, side by side (s)")
        pictures.append(
            _picture(
                figure,
                f"time-{channel}",
                f"Residual {SYMBOLS[channel]} in {unit} over time, before and "
                f"after: {change}. Held-out blocks are shaded.",
                title=f"{SYMBOLS[channel]} ({unit})",
            )
        )
    return pictures


@_style()
def draw_over_frequency(diagnosis: Diagnosis) -> list[Picture]:
    """Draw amplitude spectra of force and torque (root of the sum over three axes, mean removed),
    before and after.
    """
    from matplotlib.ticker import LogLocator, NullFormatter, StrMethodFormatter

    pictures = []
    for spectrum in amplitude_spectra(diagnosis):
        grid, factor, unit, what = (
            spectrum.frequency,
            spectrum.factor,
            spectrum.unit,
            spectrum.what,
        )
        figure, panel = _panel(3.4, 2.0)
        for amplitude, colour in ((spectrum.before, "before"), (spectrum.after, "after")):
            panel.plot(grid, factor * np.maximum(amplitude, 1e-12), color=_COLOURS[colour], lw=1.3)
        panel.set_yscale("log")
        panel.yaxis.set_major_formatter("{x:g}")
        low, high = panel.get_ylim()
        panel.yaxis.set_minor_locator(LogLocator(subs=(2.0, 5.0)))
        panel.yaxis.set_minor_formatter(
            StrMethodFormatter("{x:g}") if high < _FEW_DECADES * low else NullFormatter()
        )
        panel.set_xlim(0.0, grid[-1])
        _title(panel, f"{what} ({unit}/√Hz)")
        panel.set_xlabel("frequency (Hz)")
        peak = grid[int(np.argmax(spectrum.before))]
        pictures.append(
            _picture(
                figure,
                f"frequency-{what}",
                f"Amplitude spectrum of the residual {what} in {unit} per root "
                f"hertz, before and after; before, it is largest at {rounded(peak, 2)} Hz.",
                title=f"{what} ({unit}/√Hz)",
                axis="frequency (Hz)",
            )
        )
    return pictures


@_style()
def draw_signatures(diagnosis: Diagnosis) -> list[Picture]:
    """Draw the residual against what drives each named effect, with the effect's
    own share of it.
    """
    return [
        _draw_signature(signature, number) for number, signature in enumerate(diagnosis.signatures)
    ]


def _draw_signature(signature: Signature, number: int) -> Picture:
    points = signature_points(signature)
    x, keep, factor, unit = points.x, points.kept, points.factor, points.unit
    residual, fitted = points.residual, points.fitted
    label = textwrap.wrap(signature.regressor, _LABEL) or [""]
    figure, panel = _panel(3.4, 2.4, lines=len(label))
    _dots(panel, x[keep], factor * residual[keep], "before", 2.5, 0.6)
    _dots(panel, x[keep], factor * fitted[keep], "after", 1.3, 1.0)
    middle, mean = binned(x, factor * residual)
    panel.plot(middle, mean, color=_COLOURS["ink"], lw=1.4)
    _title(panel, f"{SYMBOLS[signature.channel]} ({unit})")
    panel.set_xlabel("\n".join(label))
    fit = (
        float(np.corrcoef(residual, fitted)[0, 1])
        if len(x) > 2 and residual.std() > 0 and fitted.std() > 0
        else np.nan
    )
    alike = f"; correlation {rounded(fit, 2)}" if np.isfinite(fit) else ""
    symbol = SYMBOLS[signature.channel]
    return _picture(
        figure,
        f"signature-{number}",
        f"Residual {symbol} in {unit} without {signature.effect} against "
        f" {signature.regressor}, its mean, and the fitted values of {signature.effect}{alike}.",
        signature.effect,
        title=f"{symbol} ({unit})",
        axis=signature.regressor,
    )


@_style()
def draw_candidates(diagnosis: Diagnosis) -> Picture | None:
    """Draw the ranking of the effects that were tried: what each explains alone, the named ones in
    colour.
    """
    shown = shown_candidates(diagnosis)
    if not shown:
        return None
    figure, panel = _panel(3.4, 0.45 + 0.175 * len(shown), left=0.36)
    gains = np.array([candidate.gain for candidate in shown])
    finite = np.where(np.isfinite(gains), gains, 0.0)
    high, low = max(float(finite.max()), 0.05), max(float(min(finite.min(), 0.0)), -0.25)
    rows = np.arange(len(shown))[::-1]
    rivals = {x for effect in diagnosis.effects for x in effect.indistinguishable_from}
    colours = [_COLOURS["after" if candidate.named else "bar"] for candidate in shown]
    bars = panel.barh(rows, 100.0 * np.maximum(finite, low), height=0.68, color=colours, lw=0)
    for bar, candidate in zip(bars, shown, strict=True):
        if candidate.name in rivals and not candidate.named:
            bar.set(edgecolor=_COLOURS["after"], facecolor="none", lw=1.0)
    for row, gain in zip(rows, gains, strict=True):
        panel.text(
            100.0 * max(float(np.nan_to_num(gain)), 0.0) + 1.5 * high,
            row,
            percent(gain),
            va="center",
            color=_COLOURS["ink"],
        )
    panel.set_xlim(100.0 * low, 125.0 * high)
    panel.set_ylim(-0.6, len(shown) - 0.4)
    panel.set_yticks(rows, [candidate.name for candidate in shown])
    for label, candidate in zip(panel.get_yticklabels(), shown, strict=True):
        label.set_color(_COLOURS["after" if candidate.named else "ink"])
    panel.grid(visible=False, axis="y")
    panel.axvline(0.0, color=_COLOURS["muted"], lw=0.6)
    panel.set_xlabel("share of the residual that it alone explains (%)", x=0.32)
    best = ", ".join(f"{candidate.name} {percent(candidate.gain)}" for candidate in shown[:3])
    named = ", ".join(candidate.name for candidate in shown if candidate.named) or "none"
    alike = [c.name for c in shown if c.name in rivals and not c.named]
    return _picture(
        figure,
        "candidates",
        f"Share of the residual that each effect explains alone; best: {best}. Named: {named}."
        + (f" Not told from a named one: {', '.join(alike)}." if alike else ""),
    )


def shown_candidates(diagnosis: Diagnosis) -> list[Candidate]:
    """Return the candidates that are drawn: the best, and whichever else was named."""
    return [
        candidate
        for i, candidate in enumerate(diagnosis.candidates)
        if i < _BARS
        or candidate.named
        or any(candidate.name in e.indistinguishable_from for e in diagnosis.effects)
    ]


def _panel(
    width: float, height: float, left: float = 0.135, lines: int = 1
) -> "tuple[Figure, Axes]":
    """Return a figure (inches) with one frame and room for a label of so many lines; fixed margins
    keep neighbours in line.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height))
    low, high = (0.25 + 0.12 * lines) / height, 0.24 / height if left < 0.2 else 0.04 / height
    panel = figure.add_axes((left, low, 0.97 - left, 1.0 - low - high))
    figure.patch.set_visible(False)
    panel.patch.set_visible(False)
    panel.spines[["top", "right"]].set_visible(False)
    panel.spines[["left", "bottom"]].set_color(_COLOURS["muted"])
    panel.grid(color=_COLOURS["grid"], lw=0.6)
    panel.set_axisbelow(True)
    panel.tick_params(
        which="both", colors=_COLOURS["muted"], labelsize=7.5, length=2.0, width=0.6, pad=2.0
    )
    panel.xaxis.label.set_color(_COLOURS["muted"])
    panel.locator_params(axis="both", nbins=5)
    panel.xaxis.labelpad = 1.5
    return figure, panel


def _title(panel: "Axes", left: str, right: str = "") -> None:
    panel.set_title(
        left,
        loc="left",
        x=-0.13 if panel.get_position().x0 > 0.1 else 0.0,
        fontsize=8.5,
        pad=4.0,
        color=_COLOURS["ink"],
        fontweight="bold",
    )
    panel.set_title(right, loc="right", fontsize=8.0, pad=4.0, color=_COLOURS["muted"])


def _shade(panel: "Axes", t: Array, trace: Trace) -> None:
    """Shade the runs of samples that were held out."""
    runs = [(a, b - a) for a, b in held_out_runs(trace, t)]
    if runs:
        panel.broken_barh(
            runs,
            (0.0, 1.0),
            transform=panel.get_xaxis_transform(),
            facecolors=_COLOURS["held"],
            lw=0,
            zorder=0,
        )


def _thin(t: Array, x: Array) -> tuple[Array, Array]:
    """Return a line (n,) by its lowest and highest point in each of ``_BINS`` columns, in their
    order.
    """
    if len(t) <= 2 * _BINS:
        return t, x
    columns = np.array_split(np.arange(len(t)), _BINS)
    keep = np.unique([i for c in columns for i in (c[np.argmin(x[c])], c[np.argmax(x[c])])])
    keep = np.unique(np.concatenate([[0], keep, [len(t) - 1]]))
    return t[keep], x[keep]


def _dots(panel: "Axes", x: Array, y: Array, colour: str, size: float, alpha: float) -> None:
    """Draw points as one path of zero length strokes: a fifth of the text that a marker each would
    take.
    """
    nothing = np.full(len(x), np.nan)
    panel.plot(
        np.column_stack([x, x, nothing]).ravel(),
        np.column_stack([y, y, nothing]).ravel(),
        color=_COLOURS[colour],
        lw=size,
        alpha=alpha,
        solid_capstyle="round",
    )


def _rms(parts: Sequence[Array]) -> float:
    return float(np.sqrt(np.mean(np.square(np.concatenate(parts)))))


def _picture(
    figure: "Figure", key: str, alt: str, caption: str = "", title: str = "", axis: str = ""
) -> Picture:
    """Return a figure as an SVG element for the page, small and with names of its own (``key``)."""
    buffer = io.BytesIO()
    figure.savefig(
        buffer, format="svg", metadata={"Date": None, "Creator": None, "Format": None, "Type": None}
    )
    ElementTree.register_namespace("", _SVG)
    ElementTree.register_namespace("xlink", _XLINK)
    root = ElementTree.fromstring(buffer.getvalue())
    for parent in list(root.iter()):
        for child in list(parent):
            if child.tag in {f"{{{_SVG}}}metadata", f"{{{_SVG}}}style"}:
                parent.remove(child)
    used = set(re.findall(r"#([\w-]+)", ElementTree.tostring(root, encoding="unicode")))
    for element in root.iter():
        if element.get("id") in used:
            element.set("id", f"{key}-{element.get('id')}")
        else:
            element.attrib.pop("id", None)
        for name, value in element.attrib.items():
            if name == "d":
                value = re.sub(
                    r"\s*([A-Za-z])\s*",
                    r"\1",
                    re.sub(r"-?\d+\.\d+", lambda m: f"{float(m[0]):.4g}", value),
                ).strip()
            elif name == "style":
                value = re.sub(r"(font: (?:bold )?[\d.]+px)[^;]*", r"\1 var(--sans)", value)
                for variable, colour in _COLOURS.items():
                    value = value.replace(colour, f"var(--{variable})")
            elif name != "id":
                value = re.sub(
                    r"#([\w-]+)", lambda m: f"#{key}-{m[1]}" if m[1] in used else m[0], value
                )
            element.set(name, value)
    for name in ("width", "height", "version"):
        root.attrib.pop(name, None)
    root.set("role", "img")
    root.set("aria-label", alt)
    return Picture(ElementTree.tostring(root, encoding="unicode"), alt, caption, key, title, axis)
