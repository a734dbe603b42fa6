"""Turbulence with the spectra of Dryden and von Karman, as a field in space carried along by the
mean wind.

A field is a sum of plane waves with random directions, each normal to its own direction: the air
keeps its volume. The waves' energies follow the three-dimensional spectrum E(k) of the
one-dimensional ones in MIL-F-8785C. With the same length and strength on all axes, the spectrum
along any line is the stated one. So are the components along the line and across. Gusts at
two points of a vehicle are then as alike as in theory. Near the ground MIL-F-8785C states other
lengths and strengths on each axis, impossible for an isotropic field. There each component comes
from a field of its own with the stated spectrum along the mean wind. The field is frozen (Taylor's
hypothesis): a point sees ``u(x - U t)``.
"""

import math

import numpy as np
from numpy.typing import ArrayLike

from ...runtime.arrays import Array
from ...runtime.errors import InputError, unknown_name
from .field import CompiledWind, number, vector

_FOOT = 0.3048  # m
# factor on the length; powers of 1 + x along and across, the latter with a factor on x; factor and
# power of the energy
_SPECTRA = {
    "dryden": (1.0, 1, (2, 3.0), (8.0, 3)),
    "von-karman": (1.339, 5 / 6, (11 / 6, 8 / 3), (55 / 9, 17 / 6)),
}


TURBULENCE = np.dtype(
    [
        # address of the table (count, 7): wave number (3) in turns per m, phase in turns,
        # amplitude (3) in m/s
        ("waves", "i8"),
        ("count", "i8"),
        ("advection", "f8", (3,)),  # m/s
    ]
)


def _spectrum_of(form: str) -> tuple[float, float, tuple[float, float], tuple[float, float]]:
    if form not in _SPECTRA:
        raise unknown_name("form", form, _SPECTRA, "wind: turbulence")
    return _SPECTRA[form]


def spectrum(form: str, axis: str, wave_number: ArrayLike, sigma: float, length: float) -> Array:
    """Return the one-dimensional spectrum of MIL-F-8785C 3.7.1, (m/s)^2 per rad/m.

    The spectrum is one-sided: its integral over the wave number (rad/m) from zero is ``sigma``^2.

    Args:
        form: ``dryden`` or ``von-karman``.
        axis: ``along`` the line of the wave number, or ``across``.
        wave_number: Omega, rad/m.
        sigma: m/s.
        length: L, m.

    Raises:
        InputError: an unknown form or axis.
    """
    scale, along, (across, share), _ = _spectrum_of(form)
    if axis not in ("along", "across"):
        raise unknown_name("axis", axis, ("along", "across"), "wind: turbulence")
    x = (scale * length * np.asarray(wave_number, dtype=np.float64)) ** 2
    size = sigma**2 * length / math.pi
    if axis == "along":
        return 2.0 * size / (1.0 + x) ** along
    return size * (1.0 + share * x) / (1.0 + x) ** across


def _energy(form: str, k: Array, length: float) -> Array:
    """Return E(k), m, of unit variance on each axis: ``1/2 k^3 d/dk(1/k dF/dk)`` of the spectrum F
    along a line.
    """
    scale, *_, (factor, power) = _spectrum_of(form)
    x = scale * length * k
    return factor * length / math.pi * x**4 / (1.0 + x * x) ** power


def waves(
    rng: np.random.Generator, form: str, sigma: Array, length: Array, count: int, smallest: float
) -> Array:
    """Return plane waves (m, 7) in axes with the mean wind along the first.

    One wave number is drawn from each of ``count`` strata, even in the logarithm. They reach from
    a tenth of 1 / L to eddies of ``smallest`` m.
    """
    alike = bool(np.ptp(sigma) == 0.0 and np.ptp(length) == 0.0)
    parts = []
    for axis in range(1 if alike else 3):
        size = float(length[axis])
        low, high = math.log(0.1 / size), math.log(2.0 * math.pi / smallest)
        step = (high - low) / count
        k = np.exp(low + step * (np.arange(count) + rng.random(count)))
        # variance of the three components together is 2 E dk, half the squared amplitude
        amplitude = np.sqrt(4.0 * _energy(form, k, size) * k * step)
        direction = _directions(rng, count)
        other = _directions(rng, count)
        normal = np.cross(direction, other)
        normal *= (amplitude / np.linalg.norm(normal, axis=1))[:, None]
        deviation = sigma if alike else np.where(np.arange(3) == axis, sigma, 0.0)
        number_of_waves = direction * k[:, None] / (2.0 * math.pi)
        parts.append(np.column_stack([number_of_waves, rng.random(count), normal * deviation]))
    return np.concatenate(parts)


def _directions(rng: np.random.Generator, count: int) -> Array:
    normals = rng.standard_normal((count, 3))
    directions: Array = normals / np.linalg.norm(normals, axis=1, keepdims=True)
    return directions


class Turbulence(CompiledWind):
    """Turbulence in a mean wind; the mean wind itself is another wind to add.

    Args:
        seed: a number or a generator; the same seed gives the same field.
        sigma: standard deviation, m/s: one number, or (3,) along the mean wind, across, and up.
        length: L, m, likewise.
        advection: (3,) m/s, the mean wind.
        form: ``dryden`` or ``von-karman``.
        modes: plane waves an axis. Variance and spectrum are right on average for any number; more
            waves make a single field more even.
        smallest: m, of the smallest eddies. The rest of the spectrum is left out: with L = 3 m and
            0.2 m, 2 % of the variance of Dryden's, 6 % of von Karman's.

    Raises:
        InputError: an unknown form, or a number out of range.
    """

    def __init__(
        self,
        seed: int | np.random.Generator,
        sigma: ArrayLike,
        length: ArrayLike,
        advection: ArrayLike,
        form: str = "dryden",
        modes: int = 48,
        smallest: float = 0.2,
    ) -> None:
        sizes = _three(sigma, "sigma", at_least_zero=True)
        lengths = _three(length, "length", at_least_zero=False)
        if modes < 1 or number(smallest, "smallest", 0.0) >= 0.5 * lengths.min():
            raise InputError(
                f"wind: turbulence: modes must be at least 1 and smallest less than half of every "
                f"length, got {modes} and {smallest:g} m"
            )
        carried = vector(advection, "advection")
        table = waves(np.random.default_rng(seed), form, sizes, lengths, modes, smallest)
        heading = math.atan2(carried[1], carried[0])
        c, s = math.cos(heading), math.sin(heading)
        turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
        table[:, :3], table[:, 4:] = table[:, :3] @ turn.T, table[:, 4:] @ turn.T
        parameters = np.array([(0, len(table), carried)], dtype=TURBULENCE)
        super().__init__("waves", parameters, {"waves": table})


def _three(value: ArrayLike, name: str, at_least_zero: bool) -> Array:
    array = np.asarray(value, dtype=np.float64)
    whole = np.full(3, float(array)) if array.ndim == 0 else array
    good = whole.shape == (3,) and np.all(np.isfinite(whole))
    if not good or whole.min() < 0.0 or (whole.min() == 0.0 and not at_least_zero):
        raise InputError(
            f"wind: {name} must be one number or three, "
            f"{'at least' if at_least_zero else 'above'} zero, got {value!r}"
        )
    return whole


def low_altitude(height: float, wind_20ft: float) -> tuple[Array, Array]:
    """Return standard deviations (3,) m/s and lengths (3,) m of MIL-F-8785C 3.7.3 below 1000 ft.

    ``sigma_w = 0.1 W20``, ``sigma_u = sigma_v = sigma_w / (0.177 + 0.000823 h)^0.4``, ``L_w = h``,
    ``L_u = L_v = h / (0.177 + 0.000823 h)^1.2`` with h in ft.

    Args:
        height: above ground, m; below 10 ft, where the specification ends, it counts as 10 ft.
        wind_20ft: W20, the mean wind at 20 ft (6.1 m), m/s.

    Raises:
        InputError: a height above 1000 ft or not above zero, or a negative wind.
    """
    h = number(height, "height", 0.0) / _FOOT
    wind = number(wind_20ft, "wind_20ft")
    if h > 1000.0 or wind < 0.0:
        raise InputError(
            f"wind: low_altitude: height must be at most 304.8 m (1000 ft) and wind_20ft at least "
            f"0, got {height:g} m and {wind:g} m/s"
        )
    h = max(h, 10.0)
    part = 0.177 + 0.000823 * h
    vertical = 0.1 * wind
    across, along = vertical / part**0.4, h * _FOOT / part**1.2
    return np.array([across, across, vertical]), np.array([along, along, h * _FOOT])
