"""The parameters of a fit, chosen by the logs' sensors, and their start: plain least squares, axis
by axis, with every coefficient linear.
"""

import math
from collections import ChainMap
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.signal import butter, sosfiltfilt

from ...runtime.arrays import Array
from ...runtime.errors import InputError
from ...runtime.yaml_file import read_yaml
from ..logs.table import ArrayPair, Data, NamedArrays, Pair
from .channels import Pieces
from .columns import ANSWERED_HZ, rotor_columns
from .geometry import FLAT, GRAVITY, GYRATION
from .model import LOGARITHMIC, Model
from .spectra import BAND

# accelerometer with its factory's calibration alone, m/s2 and rad: 20 mg, as in data sheets of such
# sensors
FORCE_BIAS = 0.2
# m/s2, beside a pose: what a sensor a centimetre off the centre of mass feels on the mean
POSED_BIAS = 0.03
TILT = 0.02
# s, offset between the motion's clock and the rotors': sensors' own filters, transport
DELAY = 0.02
# standard deviation of the logarithm of a moment of inertia about its start: part of a flight can
# show no turn by its torque
_FACTOR = 3.0
# s: turning is compared with torque at these delays, before the fit has its own. Commands of a
# Crazyflie and of flight controllers lead the motion by 30 to 60 ms
_FIRST_DELAYS = np.linspace(0.0, 0.08, 9)
# correlation of turning with torque: a smaller one is no sign of opposition. A Crazyflie with
# hardly any roll has -.06
_OPPOSED = 0.15
_SWING_HZ = (0.5, 8.0)

QUANTITIES = read_yaml(Path(__file__).with_name("quantities.yaml"), "quantities")


class Further(NamedTuple):
    """An effect, kept if the logs get much likelier; ``quantities.yaml`` explains each field."""

    parameters: Data
    role: str = ""
    first: int = 0
    factor: float = 1.0
    how: str = ""
    turns: bool = False
    of_speeds: bool = False
    positive: bool = True


FURTHER = {n: Further(**row) for n, row in QUANTITIES["effects"].items()}


def first_model(pieces: Pieces, model: Model, *nonlinear: str) -> tuple[Model, Array]:
    """Return a model with its parameters, the turning senses shown by yaw, and the start;
    ``nonlinear`` parameters start at 0.

    Raises:
        InputError: roll or pitch turn against their rotors.
    """
    columns = [rotor_columns(piece, model, {}) for piece in pieces]
    count, mass, arm = len(model.exponents), model.mass, model.geometry.arm
    # each basis function's coefficient if it alone carried the weight
    totals = {e: np.concatenate([c[f"T{e}"] for c in columns]) for e in model.exponents}
    each = {f"a{e}": model.weight / max(x.mean(), 1e-12) for e, x in totals.items()}
    shares = {e: each[f"a{e}"] / count for e in totals}
    gains, alike = _first_gains(pieces, columns, shares, _SWING_HZ)
    # a loop that answers a swinging load opposes its own slow torque, and no quick one
    _, quick = _first_gains(pieces, columns, shares, (ANSWERED_HZ, BAND))
    for axis, slow, fast in zip(("roll", "pitch"), alike, quick, strict=False):
        if slow < -_OPPOSED and fast < 0.0:
            raise InputError(
                f"{axis} turns against the torque of its rotors; expected rotors in the order "
                "front-left, rear-left, rear-right, front-right, and body axes forward, left, up"
            )
    # an axis without a turn starts at the usual inertia of such a vehicle
    usual = GYRATION[0] * mass * arm**2
    inertia = np.array([1.0 / g if 1e-2 / usual < g < 1e2 / usual else usual for g in gains[:2]])
    flat = FLAT[0] * inertia.sum()
    known = {
        "mass": mass,
        "arm": arm,
        "Jx": inertia[0],
        "Jy": inertia[1],
        "Jz": flat,
        "reach": np.clip(abs(gains[2]) * flat, 1e-3 * arm, 10.0 * arm),
        "per_speed": 1.0 / max(np.concatenate([p.rotors for p in pieces]).mean(), 1e-6),
        "turn": np.sqrt(GRAVITY / arm),
    }
    basic, biases = QUANTITIES["basic"], QUANTITIES["biases"]
    units = ChainMap(basic, biases, *(further.parameters for further in FURTHER.values()))
    scale = each | {p: math.prod(known.get(x, x) for x in unit) for p, unit in units.items()}
    free, prior = (*each, *basic), {"delay": DELAY}
    prior |= {j: _FACTOR * known[j] for j in LOGARITHMIC}
    if model.sources.force == "accelerometer":
        free = (*free, *biases)
        prior |= {**dict.fromkeys(biases, FORCE_BIAS), "tilt x": TILT, "tilt y": TILT}
    model = replace(model, opposite=gains[2] < 0.0, free=free, scale=scale, prior=prior)
    start = {**dict.fromkeys(each, 1.0 / count), "reach": 1.0}
    theta = np.array([start.get(name, 0.0) for name in free])
    return model.with_more(theta, *nonlinear)


def _first_gains(
    pieces: Pieces, columns: list[NamedArrays], thrust: Mapping[int, float], band: Pair
) -> ArrayPair:
    """Return the angular acceleration per torque (3,) in 1/(kg m2), roughly, and their correlation
    (3,) in a ``band`` in Hz. ``thrust`` is a coefficient for each exponent. About x and y the first
    is the inertia's inverse, about z the inverse times torque over thrust (m). Each is taken at the
    delay, up to 80 ms, of the largest correlation of either sign.
    """
    cross, power, turned = np.zeros((len(_FIRST_DELAYS), 3)), np.zeros(3), np.zeros(3)
    for piece, column in zip(pieces, columns, strict=True):
        torque = np.sum(
            [[a * column[f"{axis}{e}"] for axis in "xyz"] for e, a in thrust.items()], axis=0
        )
        # turning is the integral of torque: compared where neither is differentiated
        spin = np.cumsum(torque.T - torque.mean(axis=1), axis=0) * piece.period
        ends = np.minimum(2.0 * piece.period * np.array(band), (0.8, 0.9))
        sections = butter(2, ends, btype="bandpass", output="sos")
        spin, rate = (sosfiltfilt(sections, x, axis=0) for x in (spin, piece.angular_velocity))
        late = np.rint(_FIRST_DELAYS / piece.period).astype(int)
        cross += [(spin[: len(spin) - n] * rate[n:]).sum(axis=0) for n in late]
        power += (spin**2).sum(axis=0)
        turned += (rate**2).sum(axis=0)
    most = cross[np.abs(cross).argmax(axis=0), range(3)]
    least = np.finfo(float).tiny
    return most / np.maximum(power, least), most / np.maximum(np.sqrt(power * turned), least)
