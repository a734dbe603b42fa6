"""The numbers that a report's plots and tables show, for the pictures and for the page's script."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.signal import welch

from ..findings import CHANNELS, Diagnosis, Signature, Trace
from .words import scale_of

Array = NDArray[np.float64]

SYMBOLS = dict(zip(CHANNELS, ("Fx", "Fy", "Fz", "τx", "τy", "τz"), strict=True))
UNITS = ("N", "N", "N", "Nm", "Nm", "Nm")
_POINTS = 360  # of a signature, that are drawn


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
    factor, unit = scale_of([largest], UNITS[i])
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


@dataclass(frozen=True, eq=False)
class Spectra:
    """Amplitude spectra of force or torque, all axes together."""

    what: str  # force or torque
    factor: float  # by which amplitudes are multiplied to be in ``unit``
    unit: str
    frequency: Array  # (f,) Hz
    before: Array  # (f,) N/sqrt(Hz) or Nm/sqrt(Hz)
    after: Array


def amplitude_spectra(diagnosis: Diagnosis) -> list[Spectra]:
    """Return the spectra of the residual's force and torque; none where flights are too short."""
    traces = [trace for trace in diagnosis.traces if len(trace.t) >= 16]
    if not traces:
        return []
    longest = max(len(trace.t) * trace.period for trace in traces)
    grid = np.linspace(1.0 / min(longest, 8.0), max(diagnosis.cutoff_hz, 1.0), 160)
    found = []
    for what, group, unit in (("force", slice(0, 3), "N"), ("torque", slice(3, 6), "Nm")):
        if group.start not in drawn_channels(traces):
            continue
        before, after = (_spectrum(traces, side, group, grid) for side in ("before", "after"))
        found.append(Spectra(what, *scale_of([float(np.max(before))], unit), grid, before, after))
    return found


@dataclass(frozen=True, eq=False)
class SignaturePoints:
    """The points of a signature that are finite numbers (n)."""

    x: Array  # (n,)
    residual: Array  # (n,) N or Nm
    fitted: Array  # (n,)
    kept: NDArray[np.intp]  # those that are drawn
    factor: float  # by which wrenches are multiplied to be in ``unit``
    unit: str


def signature_points(signature: Signature) -> SignaturePoints:
    """Return the points of a signature, and which of them are drawn."""
    every = (signature.x, signature.residual, signature.fitted)
    good = np.logical_and.reduce([np.isfinite(values) for values in every])
    x, residual, fitted = (values[good] for values in every)
    kept = np.unique(np.linspace(0, len(x) - 1, min(len(x), _POINTS)).astype(int))
    unit = UNITS[CHANNELS.index(signature.channel)]
    scale = scale_of(np.abs(np.concatenate([residual, fitted])), unit)
    return SignaturePoints(x, residual, fitted, kept, *scale)


def _spectrum(traces: Sequence[Trace], side: str, group: slice, grid: Array) -> Array:
    """Return the amplitude (f,) per root hertz of all pieces together, the longer counting for
    more.
    """
    total, weight = np.zeros(len(grid)), 0.0
    for trace in traces:
        x = getattr(trace, side)[:, group]
        f, power = welch(
            x, 1.0 / trace.period, nperseg=min(len(x), round(8.0 / trace.period)), axis=0
        )
        total += len(x) * trace.period * np.interp(grid, f, power.sum(axis=1))
        weight += len(x) * trace.period
    return np.asarray(np.sqrt(total / weight), dtype=np.float64)
