"""The table behind each plot of a report: the same numbers for those who do not see it."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..findings import CHANNELS, Candidate, Diagnosis, Signature, Trace
from .plot_numbers import (
    SYMBOLS,
    amplitude_spectra,
    axis_limits,
    binned,
    drawn_channels,
    signature_points,
)
from .words import percent, rounded

Array = NDArray[np.float64]

_ROWS = 16  # of a table over time or frequency
_MOST_PIECES = 40  # of flight, that have rows of their own


@dataclass(frozen=True)
class Table:
    """A caption, the heads of the columns, and the rows as texts."""

    caption: str
    head: tuple[str, ...]
    rows: list[tuple[str, ...]]


def tables_over_time(diagnosis: Diagnosis) -> list[Table]:
    """Return a table a channel: the residual's rms before and after, interval by interval."""
    traces = diagnosis.traces
    if not traces:
        return []
    each = max(_ROWS // len(traces), 1)
    several = len(traces) > 1
    found: list[list[tuple[str, ...]]] = [[] for _ in CHANNELS]
    scales = [axis_limits(traces, i)[:2] for i in range(len(CHANNELS))]
    for number, trace in enumerate(traces[:_MOST_PIECES], 1):
        for rows in np.array_split(np.arange(len(trace.t)), min(each, len(trace.t))):
            first, last = trace.t[rows[0]], trace.t[rows[-1]]
            where = f"{first:.1f} to {last:.1f}"
            share = trace.held_out[rows].mean()
            held = "no" if share == 0 else "yes" if share == 1 else "in part"
            before, after = _rms(trace, rows)
            for i, (factor, _) in enumerate(scales):
                found[i].append(
                    (
                        *((str(number),) if several else ()),
                        where,
                        held,
                        rounded(factor * before[i], 2),
                        rounded(factor * after[i], 2),
                    )
                )
    head = (*(("Piece",) if several else ()), "Time (s)", "Held out", "Before", "After")
    more = (
        f", the first {_MOST_PIECES} of {len(traces)} pieces" if len(traces) > _MOST_PIECES else ""
    )
    return [
        Table(f"Residual {SYMBOLS[CHANNELS[i]]}, rms ({scales[i][1]}){more}", head, found[i])
        for i in drawn_channels(traces)
    ]


def _rms(trace: Trace, rows: NDArray[np.intp]) -> tuple[Array, Array]:
    """Return the rms (6,) before and after of some samples."""
    before, after = (np.sqrt(np.mean(x[rows] ** 2, axis=0)) for x in (trace.before, trace.after))
    return before, after


def tables_over_frequency(diagnosis: Diagnosis) -> list[Table]:
    """Return a table of the spectrum of the force and one of the torque."""
    found = []
    for spectrum in amplitude_spectra(diagnosis):
        keep = np.linspace(0, len(spectrum.frequency) - 1, _ROWS).astype(int)
        found.append(
            Table(
                f"Amplitude of the residual {spectrum.what} ({spectrum.unit}/√Hz)",
                ("Frequency (Hz)", "Before", "After"),
                [
                    (
                        rounded(spectrum.frequency[i]),
                        rounded(spectrum.factor * spectrum.before[i], 2),
                        rounded(spectrum.factor * spectrum.after[i], 2),
                    )
                    for i in keep
                ],
            )
        )
    return found


def tables_of_signatures(signatures: Sequence[Signature]) -> list[Table]:
    """Return a table a signature: mean residual and mean fitted effect over what drives it."""
    found = []
    for signature in signatures:
        points = signature_points(signature)
        middle, residual = binned(points.x, points.factor * points.residual)
        _, fitted = binned(points.x, points.factor * points.fitted)
        found.append(
            Table(
                f"{signature.effect}: {SYMBOLS[signature.channel]} ({points.unit}) over "
                f"{signature.regressor}, means of {len(middle)} groups of equally many points",
                (signature.regressor, "Residual without it", "Effect"),
                [
                    (rounded(x), rounded(r, 2), rounded(f, 2))
                    for x, r, f in zip(middle, residual, fitted, strict=True)
                ],
            )
        )
    return found


def table_of_candidates(candidates: Sequence[Candidate]) -> Table:
    """Return the candidate effects with the share of the residual that each explains alone."""
    return Table(
        "Share of the residual that each effect explains alone",
        ("Effect", "Named", "Share"),
        [(c.name, "yes" if c.named else "no", percent(c.gain)) for c in candidates],
    )
