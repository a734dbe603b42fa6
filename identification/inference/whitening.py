"""A filter that makes the noise of a residual white, so that least squares weight it rightly.

The noise has two parts: that of the sensors, known from the log itself, and disturbances, of which
only the strength is unknown: their spectrum is flat up to a corner and falls beyond it. What else
is in a residual is no noise but an effect that the model lacks: a filter free to follow the
residual would hide it.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_toeplitz
from scipy.signal import lfilter, welch

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]


@dataclass(frozen=True)
class WhiteningSettings:
    """The noise model of a residual."""

    order: int = 8  # of the autoregression
    # share of the variance added as white noise, so that what the low-pass took away is not blown
    # up
    loading: float = 1e-3
    segment: int = 256  # rows of a spectrum's segment
    disturbance_corner_hz: float = 0.6  # a correlation time of a quarter of a second
    disturbance_band_hz: tuple[float, float] = (0.3, 1.5)  # where their strength is read
    sensor_noise_factor: float = 1.1  # on the sensors' part


WHITENING = WhiteningSettings()


class Whitener:
    """A filter for each channel after which the noise is white with variance one.

    Args:
        residual: (rows, 6), that no effect explains; its level in the disturbances' band gives
            their strength.
        sensors: (rows, 6), a sample of what sensors alone make.
        start: (rows,) first rows of unbroken pieces.
        fit: (rows,) the rows of the residual that may be looked at.
        period: s, from row to row.
        free: of flights whose rotors are known from commands alone, or whose pose was filtered
            so that its own noise is not in ``sensors``: take all of the residual for
            noise, nowhere less than its mean in this band (Hz).
    """

    def __init__(
        self,
        residual: Array,
        sensors: Array,
        start: Mask,
        fit: Mask,
        period: float,
        free: tuple[float, float] | None = None,
    ) -> None:
        # blocks apart in time are pieces apart
        begins = start | np.concatenate([[True], fit[1:] != fit[:-1]])
        self._filters: list[tuple[Array, float]] = []
        for i in range(residual.shape[1]):
            frequency, own = _spectrum(sensors[:, i], start, period)
            # a mean that nothing explains is no noise: it would make an offset count for little
            _, whole = _spectrum(
                residual[fit, i], begins[fit], period, "constant" if free is not None else False
            )
            if free is not None:
                noise = np.maximum(
                    np.maximum(whole, own),
                    whole[(frequency >= free[0]) & (frequency <= free[1])].mean(),
                )
            else:
                shape = 1.0 / (1.0 + np.square(frequency / WHITENING.disturbance_corner_hz))
                band = (frequency >= WHITENING.disturbance_band_hz[0]) & (
                    frequency <= WHITENING.disturbance_band_hz[1]
                )
                noise = (
                    WHITENING.sensor_noise_factor * own
                    + max(float(np.median(((whole - own) / shape)[band])), 0.0) * shape
                )
            self._filters.append(_predictor(noise))
        ends = np.flatnonzero(start)
        self._lost = np.unique(
            np.concatenate(
                [np.arange(int(k), min(int(k) + WHITENING.order, len(start))) for k in ends]
            )
        )

    def __call__(self, x: Array) -> Array:
        """Return ``x`` (rows, 6) or (rows, 6, columns) whitened; the first rows of each piece
        become zero.
        """
        out = np.empty_like(x)
        for i, (a, deviation) in enumerate(self._filters):
            out[:, i] = lfilter(np.concatenate([[1.0], -a]) / deviation, [1.0], x[:, i], axis=0)
        out[self._lost] = 0.0
        return out


def _spectrum(
    x: Array, start: Mask, period: float, detrend: str | bool = False
) -> tuple[Array, Array]:
    """Return frequencies (Hz) and the power at each, averaged over unbroken pieces; it sums to the
    variance.
    """
    total, weight = np.zeros(WHITENING.segment // 2 + 1), 0
    frequency = np.fft.rfftfreq(WHITENING.segment, period)
    for part in np.split(x, np.flatnonzero(start)[1:]):
        if len(part) >= 2 * WHITENING.order:
            length = min(WHITENING.segment, len(part))
            at, power = welch(
                part, 1.0 / period, nperseg=length, noverlap=length // 2, detrend=detrend
            )
            total += len(part) * np.interp(frequency, at, power)
            weight += len(part)
    total *= frequency[1] / max(weight, 1)
    return np.asarray(frequency, dtype=np.float64), total


def _predictor(power: Array) -> tuple[Array, float]:
    """Return the prediction filter (p,) of noise with this spectrum, and the standard deviation of
    its innovation.
    """
    two_sided = power.copy()
    two_sided[1:-1] *= 0.5
    lags = np.fft.irfft(two_sided, WHITENING.segment)[: WHITENING.order + 1] * WHITENING.segment
    lags[0] = lags[0] * (1.0 + WHITENING.loading) + 1e-30
    a = solve_toeplitz(lags[: WHITENING.order], lags[1:])
    return a, float(np.sqrt(max(lags[0] - a @ lags[1:], 1e-12 * lags[0])))
