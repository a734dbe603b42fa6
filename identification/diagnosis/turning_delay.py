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
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar
from scipy.signal import csd, welch

from ...dynamics.effects import Role, get
from ...dynamics.vehicle import Vehicle
from ..logs.table import Array
from ..motion.signals import Signals
from .regression import moves_time

# Hz, of the commanded moments in the angular acceleration
BAND_HZ = (1.0, 8.0)
# log-likelihood ratio over no visible moments, with one number less an axis
LEAST_LOG_LIKELIHOOD_RATIO = 40.0
SEGMENT = 2.0  # s, of a spectrum
LONGEST_DELAY = 0.12  # s


@dataclass(frozen=True, eq=False)
class _Spectra:
    """Spectra (frequencies in the band,) of a moment and of its turn, from ``count`` segments."""

    omega: Array  # rad/s
    moment: Array
    turning: Array
    cross: NDArray[np.complex128]
    count: float  # independent segments

    def deviance(self, response: NDArray[np.complex128]) -> float:
        """Return minus twice the log likelihood, up to a constant, at the best gain."""
        along = np.real(np.conj(response) * self.cross)
        power = np.square(np.abs(response)) * self.moment
        # the gain changes its own weights, the noise
        noise = self.turning
        for _ in range(6):
            gain = max(np.sum(along / noise) / np.sum(power / noise), 0.0)
            noise = self.turning - 2.0 * gain * along + gain**2 * power
        return 2.0 * self.count * float(np.sum(np.log(noise / self.turning)))


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
    spectra = [s for piece in pieces for s in _spectra(piece, vehicle)]
    if not spectra:
        return None

    def behind(omega: Array, seconds: float) -> Array:
        angles = (np.arctan(omega * x) if role == Role.LAG else omega * x for role, x in declared)
        return omega * seconds + sum(angles)

    def deviance(seconds: float) -> float:
        return sum(s.deviance(np.exp(-1j * behind(s.omega, seconds))) for s in spectra)

    step = 0.005
    at = min(np.arange(0.0, LONGEST_DELAY + step, step).tolist(), key=deviance)
    best = minimize_scalar(
        deviance, bounds=(max(at - step, 0.0), at + step), method="bounded", options={"xatol": 1e-5}
    )
    seconds = float(best.x)
    least = float(best.fun)
    near = 0.1 * step
    bend = (deviance(seconds + near) - 2.0 * least + deviance(seconds - near)) / near**2
    std = math.sqrt(2.0 / max(bend, 1e-6))
    # a lag delays each frequency differently, and the frequencies shown by the loop are not known
    omega = spectra[0].omega
    std = math.hypot(std, np.std(behind(omega, 0.0) / omega), 0.5 * held / math.sqrt(12.0))
    clear = -least > LEAST_LOG_LIKELIHOOD_RATIO and seconds - 0.25 * held > 2.0 * std
    return (seconds, std, -least) if clear else None


def _spectra(piece: Signals, vehicle: Vehicle) -> list[_Spectra]:
    rate = 1.0 / piece.period
    length = round(SEGMENT * rate)
    if rate < 2.2 * BAND_HZ[1] or len(piece.t) < 2 * length:
        return []
    out = []
    moments = vehicle.rotor_wrench(piece.rotor_speeds)[:, 1:3]
    for x, y in zip(moments.T, piece.angular_acceleration[:, :2].T, strict=True):
        f, xx = welch(x, rate, nperseg=length)
        yy = welch(y, rate, nperseg=length)[1]
        xy = csd(x, y, rate, nperseg=length)[1]
        band = (f >= BAND_HZ[0]) & (f <= BAND_HZ[1])
        if np.all(xx[band] > 0) and np.all(yy[band] > 0):
            out.append(
                _Spectra(2.0 * np.pi * f[band], xx[band], yy[band], xy[band], len(x) / length)
            )
    return out
