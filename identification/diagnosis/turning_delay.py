"""The delay of the rotors behind their commands, from the vehicle's turns.

In closed loop thrust and vertical acceleration cause each other, and the delay of their best fit is
as much the loop's as the motors'. Roll and pitch are driven far harder: between 1 and 8 Hz the
commanded moments show in the angular acceleration of the pose, later by the delay. Their gain
(inertia, the thrust curve) is free for each axis of each flight; it may not be negative. Other
forces, and the pose's noise, may have any spectrum: the likelihood is Whittle's with an unknown
noise at each frequency.

The fit is of a pure delay. A lag also takes gain away at high frequencies, but so does a loop
closed over a noisy pose: a lag of equal delay is always as good. A declared lag or delay is no part
of the fitted one.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray
from scipy.optimize import fminbound

from ...dynamics.effects import Role, get
from ...dynamics.vehicle import Vehicle
from ..logs.table import Array
from ..motion.signals import Signals
from .coefficients import moves_time

# Hz, of the commanded moments in the angular acceleration
BAND_HZ = (1.0, 8.0)
# log-likelihood ratio over no visible moments, with one number less an axis
LEAST_LOG_LIKELIHOOD_RATIO = 40.0
SEGMENT = 2.0  # s, of a spectrum
MEMORY = 5  # overlapping segments
LONGEST_DELAY = 0.12  # s


class _Spectra(NamedTuple):
    """Spectra (s, f, 2) of moments and turns, roll and pitch, of s segments."""

    omega: Array  # (f, 1) rad/s, in the band
    moment: Array
    turning: Array
    cross: NDArray[np.complex128]
    share: float  # independent segments a segment: they overlap

    def deviance(self, response: NDArray[np.complex128]) -> tuple[float, Array]:
        """Return minus twice the log likelihood, up to a constant, at the best gain an axis, and
        its slope (s,) by the delay, a part of each segment.
        """
        cross, turning = self.cross.mean(axis=0), self.turning.mean(axis=0)
        along = np.real(np.conj(response) * cross)
        power = np.square(np.abs(response)) * self.moment.mean(axis=0)
        # the gain changes its own weights, the noise
        noise = turning
        for _ in range(6):
            gain = np.sum(along / noise, axis=0) / (np.sum(power / noise, axis=0) + 1e-300)
            gain = np.maximum(gain, 0.0)
            noise = turning - 2.0 * gain * along + gain**2 * power
        steep = self.omega * np.imag(np.conj(response) * self.cross) * gain / noise
        slopes = 4.0 * self.share * steep.sum(axis=(1, 2))
        count = self.share * len(self.cross)
        return 2.0 * count * float(np.sum(np.log(noise / turning))), slopes


def turning_delay(
    pieces: Sequence[Signals], vehicle: Vehicle, held: float = 0.0
) -> tuple[float, float, float] | None:
    """Return the delay of the rotors' moments behind the commands, s, its standard deviation, and
    its log-likelihood ratio over no visible moments; None if turning does not show one.

    Args:
        pieces: unbroken flight, with rotor speeds from commands.
        vehicle: as declared.
        held: s, from one logged command to the next. Between them rotor speeds move linearly here.
            Rotors held at each command are late by half as long; with commands left out of the log,
            by less.
    """
    declared = [
        (get(e.name).role, x)
        for e in vehicle.effects
        if moves_time(e.name) and get(e.name).kind != "sensing"
        for x in e.coefficients.values()
    ]
    spectra = [
        _spectra(piece, vehicle)
        for piece in pieces
        if piece.period * 2.2 * BAND_HZ[1] <= 1.0 and len(piece.t) * piece.period >= 2.0 * SEGMENT
    ]
    if not spectra:
        return None

    def behind(omega: Array, seconds: float) -> Array:
        angles = (np.arctan(omega * x) if role == Role.LAG else omega * x for role, x in declared)
        return omega * seconds + sum(angles)

    def seen(seconds: float) -> list[tuple[float, Array]]:
        return [s.deviance(np.exp(-1j * behind(s.omega, seconds))) for s in spectra]

    def deviance(seconds: float) -> float:
        return sum(x for x, _ in seen(seconds))

    step = 0.005
    near = 0.1 * step
    at = min(np.arange(0.0, LONGEST_DELAY + step, step).tolist(), key=deviance)
    seconds = fminbound(deviance, max(at - step, 0.0), at + step, xtol=1e-5).item()
    least = deviance(seconds)
    bend = (deviance(seconds + near) - 2.0 * least + deviance(seconds - near)) / near**2
    # an answer of the loop lasts longer than a segment, and a delay differs from flight to flight:
    # the slopes' own scatter counts where larger
    slopes = [x for _, x in seen(seconds)]
    count = len(slopes)
    flights = np.square([x.sum() for x in slopes]).sum() * count / max(count - 1, 1)
    # W. K. Newey and K. D. West, Econometrica 55 (1987), 703-708
    sums = np.convolve(np.concatenate(slopes), np.ones(MEMORY))
    lasting = sums @ sums / MEMORY
    std = math.sqrt(max(2.0 * bend, flights, lasting)) / max(bend, 1e-6)
    # a lag delays each frequency differently, and the frequencies shown by the loop are not known
    omega = spectra[0].omega
    spread = float(np.std(behind(omega, 0.0) / omega))
    std = math.hypot(std, spread, 0.5 * held / math.sqrt(12.0))
    clear = -least > LEAST_LOG_LIKELIHOOD_RATIO and seconds - 0.25 * held > 2.0 * std
    return (seconds, std, -least) if clear else None


def _spectra(piece: Signals, vehicle: Vehicle) -> _Spectra:
    """Return the spectra of a piece, of two segments at least."""
    length = round(SEGMENT / piece.period)
    moments = vehicle.rotor_wrench(piece.rotor_speeds)[:, 1:3]
    f = np.fft.rfftfreq(length, piece.period)
    band = (f >= BAND_HZ[0]) & (f <= BAND_HZ[1])
    x, y = (
        np.fft.rfft((part - part.mean(axis=2, keepdims=True)) * np.hanning(length)).swapaxes(1, 2)[
            :, band
        ]
        for z in (moments, piece.angular_acceleration[:, :2])
        for part in [sliding_window_view(z, length, axis=0)[:: length // 2]]
    )
    share = len(moments) / length / len(x)
    moment, turning = np.square(np.abs(x)), np.square(np.abs(y)) + 1e-300
    omega = np.asarray(2.0 * np.pi * f[band, None], np.float64)
    return _Spectra(omega, moment, turning, np.conj(x) * y, share)
