"""Candidate regressors: what a missing effect may depend on, as columns.

Each explanatory variable is scaled to one standard deviation, and a column is one of them in one
channel. Variables that hardly vary, or are sensor noise in part, are left out: that noise is in the
residual as well.
"""

import itertools
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.signal import bilinear, lfilter

from ..findings import CHANNELS
from ..motion.smoothing import CUTOFFS, low_pass
from .regression import Flights, Setting

Array = NDArray[np.float64]


def _least_variation() -> dict[str, float]:
    return {
        "velocity": 0.05,
        "speed": 0.05,
        "height": 0.03,
        "heading": 0.05,
        "angular velocity": 0.05,
        "position": 0.1,
        "voltage": 0.05,
        "tilt": 0.01,
    }


@dataclass(frozen=True, eq=False)
class RegressorSettings:
    """Which candidate regressors a flight excites, and the grids of places and frequencies."""

    # standard deviation, in the regressor's unit (m/s, m, rad/s, V; sine of an angle): with less it
    # says nothing, or is the sensors' noise
    least_variation: Mapping[str, float] = field(default_factory=_least_variation)
    # share of sensor noise in an angular velocity: it is in the residual's torque as well
    most_noise_share: float = 0.05
    # share of rounding noise in a rotor torque: shares of 0.045 look like an effect
    most_rounding_share: float = 0.02
    # Hz, of a load on a cable of 0.1 to 1.5 m; flight loops answer faster
    load_frequencies_hz: Array = field(default_factory=lambda: np.geomspace(0.4, 1.5, 11))
    # Hz, of a part on a soft mount; the residual ends at 5
    mount_frequencies_hz: Array = field(default_factory=lambda: np.geomspace(1.0, 4.0, 12))
    damping_ratio: float = 0.08  # of these resonant modes


REGRESSORS = RegressorSettings()


Variable = tuple[str, Array]  # in words, (rows,)


def explanatory_variables(flights: Flights, setting: Setting) -> list[Variable]:
    """Return the explanatory variables at the rows: what a force may depend on, with its unit."""
    parts: list[list[Variable]] = []
    vehicle = flights.amended(setting)
    plain = [_is_excited(flights, i) for i in range(3)]
    for piece in flights.pieces(setting):
        s, at = piece.signals, piece.rows
        body = np.einsum("nij,ni->nj", s.rotation[at], s.velocity[at])
        speed = np.linalg.norm(body, axis=1)
        thrust = vehicle.rotor_wrench(s.rotor_speeds)[:, 0]
        heading = np.arctan2(s.rotation[at, 1, 0], s.rotation[at, 0, 0])
        found: list[Variable] = [
            (f"body velocity {a} (m/s)", body[:, i]) for i, a in enumerate("xyz")
        ]
        found += [
            ("speed (m/s)", speed),
            ("squared speed (m2/s2)", speed**2),
            ("height (m)", s.position[at, 2]),
            ("sine of the heading", np.sin(heading)),
            ("cosine of the heading", np.cos(heading)),
            ("time (s)", s.t[at]),
        ]
        if flights.rotor_speeds_vary:
            found.append(("thrust (N)", low_pass(thrust, CUTOFFS.residual_hz, s.period)[at]))
        found += [
            (
                f"angular velocity {a} (rad/s)",
                low_pass(s.angular_velocity[:, i], CUTOFFS.residual_hz, s.period)[at],
            )
            for i, a in enumerate("xyz")
            if plain[i]
        ]
        found += [(f"world position {a} (m)", s.position[at, i]) for i, a in enumerate("xy")]
        if s.voltage is not None:
            found.append(("battery voltage (V)", s.voltage[at]))
        parts.append(found)
    joined = [
        (name, np.concatenate([p[i][1] for p in parts])) for i, (name, _) in enumerate(parts[0])
    ]
    return [
        (name, x)
        for name, x in joined
        if x.std()
        > next((least for word, least in REGRESSORS.least_variation.items() if word in name), 1e-9)
    ]


def _is_excited(flights: Flights, axis: int) -> bool:
    """Return whether an angular velocity is more than the sensors' noise, which is in the torque as
    well.
    """
    return bool(flights.angular_velocity_noise[axis] <= REGRESSORS.most_noise_share)


def standardised(found: list[Variable]) -> dict[str, Array]:
    """Return variables with mean zero and standard deviation one, by their names without units."""
    return {name.split(" (")[0]: (x - x.mean()) / x.std() for name, x in found}


def general_regressors(flights: Flights, setting: Setting) -> Iterator[tuple[str, str, Array]]:
    """Yield general columns (rows, 6), with the channel and the variable in words.

    Of 340 flights with a wrong name they doubt 186, and 10 as the only ones.
    """
    known = standardised(explanatory_variables(flights, setting))
    shapes = dict(known)
    for a in "xyz":
        u = known.get(f"body velocity {a}")
        w = known.get(f"angular velocity {a}")
        if u is not None:
            shapes[f"body velocity {a}, squared with its sign"] = u * np.abs(u)
        if w is not None:
            shapes[f"angular velocity {a}, squared with its sign"] = w * np.abs(w)
    for a, b in (("x", "y"), ("y", "z"), ("x", "z")):
        if f"angular velocity {a}" in known and f"angular velocity {b}" in known:
            shapes[f"angular velocities {a} and {b}"] = (
                known[f"angular velocity {a}"] * known[f"angular velocity {b}"]
            )
        if f"body velocity {a}" in known and f"body velocity {b}" in known:
            shapes[f"body velocities {a} and {b}"] = (
                known[f"body velocity {a}"] * known[f"body velocity {b}"]
            )
    pieces = flights.pieces(setting)
    rotation = np.concatenate([p.signals.rotation[p.rows] for p in pieces])
    velocity = np.concatenate([p.signals.velocity[p.rows] for p in pieces])
    wrench = flights.rotor_wrench(setting)
    for i, a in enumerate("xyz"):
        if velocity[:, i].std() > REGRESSORS.least_variation["velocity"]:
            shapes[f"world velocity {a}"] = velocity[:, i]
        if (
            flights.rotor_speeds_vary
            and flights.rotor_noise[1 + i] < REGRESSORS.most_rounding_share
        ):
            shapes[f"rotor torque {a}"] = wrench[:, 1 + i]
    for i, a in enumerate("xy"):
        if rotation[:, 2, i].std() > REGRESSORS.least_variation["tilt"]:
            shapes[f"tilt {a}"] = rotation[:, 2, i]
    limits = {"time": flights.t}
    if "height" in known:
        limits["height"] = np.concatenate([p.signals.position[p.rows, 2] for p in pieces])
    for name, x in limits.items():  # bumps
        low, high = np.quantile(x, [0.02, 0.98])
        for center in np.linspace(low, high, 6):
            shapes[f"{name} near {center:.3g}"] = np.maximum(
                0.0, 1.0 - np.abs(x - center) / (0.2 * (high - low) + 1e-9)
            )
    shapes["a constant"] = np.ones(len(rotation))
    for name, x in shapes.items():
        for channel in range(6):
            column = np.zeros((len(x), 6))
            column[:, channel] = x
            yield CHANNELS[channel], name, column
            if channel < 3:
                column = np.zeros((len(x), 6))
                column[:, :3] = rotation[:, :, channel] * x[:, None]
                yield f"force along body {'xyz'[channel]}", name, column


def resonant_regressors(flights: Flights, setting: Setting) -> Iterator[tuple[str, str, Array]]:
    """Yield the force or torque (rows, 6) of a resonant mode that the vehicle's own motion excites,
    with the channel and the frequency in words.

    A load on a cable is excited by the vehicle's acceleration, a part on a soft mount by the
    angular one. From the differentiated attitude, its noise would be in column and residual alike:
    the angular acceleration is taken from the rotors' torque, which is hardly noisy.

    Without them a loose camera is a sure inertia, on one of 166 flights with a wrong name.
    """
    pieces = flights.pieces(setting)
    for hertz in REGRESSORS.load_frequencies_hz:
        parts = [
            low_pass(
                _resonant_response(p.signals.acceleration[:, :2], hertz, p.signals.period),
                CUTOFFS.residual_hz,
                p.signals.period,
            )[p.rows]
            for p in pieces
        ]
        pull = np.concatenate(parts)
        yield (
            "Fx and Fy",
            f"a resonant mode at {hertz:.2g} Hz",
            np.column_stack([pull, np.zeros((len(pull), 4))]),
        )
    vehicle = flights.amended(setting)
    torques = [vehicle.rotor_wrench(p.signals.rotor_speeds)[:, 1:] for p in pieces]
    plain = [
        i
        for i in range(3)
        if flights.rotor_speeds_vary and flights.rotor_noise[1 + i] < REGRESSORS.most_rounding_share
    ]
    for hertz, i in itertools.product(REGRESSORS.mount_frequencies_hz, plain):
        parts = [
            low_pass(
                _resonant_response(torque[:, i], hertz, p.signals.period),
                CUTOFFS.residual_hz,
                p.signals.period,
            )[p.rows]
            for torque, p in zip(torques, pieces, strict=True)
        ]
        column = np.zeros((sum(map(len, parts)), 6))
        column[:, 3 + i] = np.concatenate(parts)
        yield CHANNELS[3 + i], f"a resonant mode at {hertz:.2g} Hz", column


def _resonant_response(drive: Array, hertz: float, period: float) -> Array:
    """Return the reaction (n, ...) of a pendulum or a spring to the acceleration of its base,
    sample by sample.
    """
    # s'' = -a - rate^2 s - 2 damping rate s', which pulls by rate^2 s + 2 damping rate s'
    rate = 2.0 * np.pi * hertz
    shape = bilinear(
        [-2.0 * REGRESSORS.damping_ratio * rate, -(rate**2)],
        [1.0, 2.0 * REGRESSORS.damping_ratio * rate, rate**2],
        1.0 / period,
    )
    return np.asarray(lfilter(*shape, drive, axis=0))
