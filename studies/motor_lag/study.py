"""The lag of motors behind their commands by thrust alone, under four models.

The lag is that of a first-order system. It acts on the commands, behind which the thrust is a
polynomial (as ``windwrench identify`` has it), or on the thrust that the commands ask for. Beside
it there is a time offset between commands and accelerometer, or none. Nothing is weighted: least
squares of the specific force along body z.
"""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize
from scipy.signal import lfilter
from scipy.stats import t as student

from windwrench.identification.logs.reading import read_log
from windwrench.runtime.errors import InputError

Array = NDArray[np.float64]

WARM_UP = 1.0  # s before the window, by which the filter forgets where it began
BLOCK = 5.0  # s: errors further apart are taken as independent
POWERS = 3  # of the command in thrust: u^0, u^1, u^2
START = (0.06, 0.01)  # s, lag and offset
MODELS = tuple((on, beside) for on in ("commands", "thrust") for beside in (False, True))
DIGITS = 6  # of what is kept: 1 us, less than the search resolves


def lagged(x: Array, lag: float, period: float) -> Array:
    """Return ``x`` (n, ...) behind a first-order lag in s, at rest before the first sample."""
    keep = np.exp(-period / lag)
    return np.asarray(lfilter([1.0 - keep], [1.0, -keep], x, axis=0, zi=keep * x[:1])[0])


def thrust_columns(command: Array, lag: float, offset: float, period: float, on: str) -> Array:
    """Return (n, 3): the sums over rotors of the command's powers, late by lag and offset (s).

    Args:
        command: (n, 4), 0 to 1.
        lag: s.
        offset: s.
        period: s.
        on: ``commands``, or ``thrust``: the powers lag, not what they are powers of.
    """
    steps = np.arange(len(command))
    late = np.stack([np.interp(steps - offset / period, steps, one) for one in command.T], axis=1)
    if on == "commands":
        late = lagged(late, lag, period)
    powers = np.stack([(late**j).sum(axis=1) for j in range(POWERS)], axis=1)
    return lagged(powers, lag, period) if on == "thrust" else powers


def fitted(command: Array, force: Array, period: float, on: str, beside: bool) -> list[Array]:
    """Return lag and offset in s, their 95 % half widths, and what is left (rms, m/s2).

    Half widths are those of a jackknife over blocks of 5 s, at Student's factor for their count.

    Args:
        command: (n, 4), 0 to 1, from ``WARM_UP`` s before what is fitted.
        force: (n,) specific force along body z, m/s2.
        period: s.
        on: what lags, ``commands`` or ``thrust``.
        beside: fit a time offset, too.
    """
    first = round(WARM_UP / period)
    y = force[first:]
    block = (np.arange(len(y)) * period / BLOCK).astype(int)
    count = max(int(len(y) * period / BLOCK), 2)

    def left(parameters: Array, use: Array) -> float:
        lag, offset = np.exp(parameters[0]), parameters[1] if beside else 0.0
        x = thrust_columns(command, float(lag), float(offset), period, on)[first:][use]
        best = np.linalg.lstsq(x, y[use], rcond=None)[0]
        return float(np.mean(np.square(y[use] - x @ best)))

    def fit(use: Array, start: Array) -> Array:
        found = minimize(
            left, start, (use,), method="Nelder-Mead", options={"xatol": 1e-4, "fatol": 1e-7}
        )
        return np.asarray(found.x)

    everything = np.ones(len(y), dtype=bool)
    best = fit(everything, np.array([np.log(START[0]), START[1]] if beside else [np.log(START[0])]))

    def told(parameters: Array) -> Array:
        return np.array([np.exp(parameters[0]), parameters[1] if beside else 0.0])

    without = np.array([told(fit(block != b, best)) for b in range(count)])
    spread = np.sqrt((count - 1) / count * np.square(without - without.mean(axis=0)).sum(axis=0))
    width = student.ppf(0.975, count - 1) * spread
    return [told(best), width, np.sqrt(left(best, everything))]


def outcomes(command: Array, force: Array, period: float) -> list[dict[str, Any]]:
    """Return what each model makes of a flight, as JSON holds it; arguments as of ``fitted``."""
    out = []
    for on, beside in MODELS:
        (lag, offset), (lag_width, offset_width), left = fitted(command, force, period, on, beside)
        figures = {
            "lag_s": lag,
            "lag_half_width_s": lag_width,
            "offset_s": offset,
            "offset_half_width_s": offset_width,
            "residual_rms_mps2": left,
        }
        rounded = {key: round(float(value), DIGITS) for key, value in figures.items()}
        out.append({"on": on, "offset_fitted": beside, **rounded})
    return out


def of_log(path: Path, begin: float, end: float) -> list[dict[str, Any]]:
    """Return the outcomes on a part of a log, in s after its start.

    Raises:
        InputError: the log cannot be read, or lacks motor commands or an accelerometer.
    """
    log = read_log(path)
    time = log.t - log.t[0]
    period = float(np.median(np.diff(time)))
    even = np.arange(max(begin - WARM_UP, 0.0), min(end, float(time[-1])), period)
    if log.command is None or log.accelerometer is None:
        raise InputError(f"{path}: expected motor commands and an accelerometer")
    command = np.stack([np.interp(even, time, one) for one in log.command.T], axis=1)
    return outcomes(command, np.interp(even, time, log.accelerometer[:, 2]), period)
