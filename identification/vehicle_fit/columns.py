"""The columns of force and torque balance: contributions of rotors, turning and moving through
the air, before any coefficient.

A rotor's thrust is ``sum_j a_j phi_j``. Measured speeds give ``phi = [W^2]``, commands
``phi = [1, u, u^2] (V/V_ref)^gamma`` or some of these. Rotors follow with a first-order lag and a
time offset. Drag, inflow and lift act at each rotor, at its own velocity, and so turn the vehicle,
too. Forward velocity goes with pitch rate. The moment of lift while yawing therefore looks like the
gyroscopic one behind ``Jz``.

A column of one parameter has the name of its axis and of the parameter: ``Fx rotor drag x``, ``My
lift``.
"""

from operator import itemgetter
from typing import NamedTuple

import numpy as np

from ...runtime.arrays import Array, Mask
from ..logs.table import NamedArrays, NamedNumbers, Names, Values
from ..motion.smoothing import derivative, lagged, low_pass
from .channels import MotionPiece, Pieces
from .model import NONLINEAR, PAIRS, Model, coefficients
from .spectra import BAND, Segment, segments_of

# s at either end of a piece, outside all segments: the rotors' columns are set back by less, and
# their lag and the low-passes settle there
MARGIN = 0.1
_STEP = {"lag": 1e-3, "gamma": 0.05}  # finite differences
# Hz: the flight loop answers slower, unmeasured moments with rotor torque, and this part of the
# torque turns nothing. From 3 to 15 Hz regression finds nearly all of the torque, below a fifth to
# a half (13 flights of a Crazyflie)
ANSWERED_HZ = 3.0


class BalanceSpectra(NamedTuple):
    """All pieces' transforms: the measured six first, then the columns, then the derivatives of the
    rotors' columns by the nonlinear parameters.
    """

    pieces: Pieces
    model: Model
    centre: NamedNumbers  # nonlinear parameters: the columns are linear about them
    names: Names  # columns; the rotors' are the last
    rotors: int  # the number of these
    segments: list[Segment]
    seconds: float
    noise: Array  # (4, c): standard deviation times root s, of each rotor's noise in each column

    @property
    def slow(self) -> Mask:
        """Whether a column (c,) is the slow part of the one before."""
        return np.array([name.startswith("slow ") for name in self.names])

    def combined(self, theta: Array) -> Array:
        """Return the residual as a combination (6, 1 + ...) of a measured axis and all
        columns.
        """
        values = self.model.values(theta)
        gains = coefficients(self.model, values, self.names)
        late = gains[:, -self.rotors :]
        moved = [late * (values[name] - x) for name, x in self.centre.items()]
        return -np.column_stack([-np.ones(6), gains, *moved])


def balance(pieces: Pieces, model: Model, theta: Array) -> BalanceSpectra:
    """Return the transforms of all pieces, linear about the nonlinear parameters of ``theta``."""
    values = model.values(theta)
    centre = {name: values[name] for name in NONLINEAR if name in values}
    segments = []
    for whole in pieces:
        late, ends = round(model.late / whole.period), round(MARGIN / whole.period)
        # the rotors' first or last sample holds at the end
        rows = np.clip(np.arange(len(whole.t)) - late, 0, len(whole.t) - 1)
        piece = whole.mapped(itemgetter(rows), "rotors", "voltage")
        inner = slice(ends, len(whole.t) - ends)
        air, rotors = air_columns(piece, model), rotor_columns(piece, model, centre)
        base = np.column_stack([*rotors.values()])
        parts = [np.nan_to_num(piece.measured()), *air.values(), base]
        for name, step in _STEP.items():
            if name in centre:
                there = rotor_columns(piece, model, centre | {name: centre[name] + step})
                parts.append((np.column_stack([*there.values()]) - base) / step)
        stacked = low_pass(np.column_stack(parts), model.band, piece.period)
        for s in segments_of(stacked[inner], piece.t[inner], piece.period, piece.log, model.band):
            turn = -2j * np.pi * s.frequency[:, None]
            at_once, delayed = np.split(s.columns, [6 + len(air)], axis=2)
            delayed = delayed * np.exp(turn * (centre["delay"] - late * piece.period))
            blocks = [at_once, delayed, turn * delayed[:, :, : len(rotors)]]
            segments.append(s._replace(columns=np.concatenate(blocks, axis=2)))
    seconds = np.array([len(p.t) * p.period for p in pieces])
    names = (*air, *rotors)
    # white noise of each rotor's speed in a column: standard deviation times the root of the period
    noise = np.zeros((4, len(names)))
    if centre.get("lag", 0.0) <= 0.0:
        squares = [p.period * (4.0 * p.rotors**2).mean(axis=0) for p in pieces]
        size = model.speed_noise * np.sqrt(np.average(squares, axis=0, weights=seconds))
        for letter, share in model.shares.items():
            for name in {f"{letter}2", f"slow {letter}2"}.intersection(names):
                noise[:, names.index(name)] = size * share
    sizes = len(rotors), segments, seconds.sum()
    return BalanceSpectra(pieces, model, centre, names, *sizes, noise)


def rotor_columns(piece: MotionPiece, model: Model, values: Values) -> NamedArrays:
    """Return the columns (n,) of the rotors, before their time offset."""
    speed = lagged(piece.rotors, values.get("lag", 0.0), piece.period)  # (n, 4), or the command
    battery = np.ones(1)
    if model.voltage_ref > 0.0 and piece.voltage is not None:
        battery = np.power(piece.voltage / model.voltage_ref, values.get("gamma", 0.0))
    out = {}
    for exponent in model.exponents:
        thrust = speed**exponent * battery[:, None]
        for letter, share in model.shares.items():
            out[name := f"{letter}{exponent}"] = thrust @ share
            if letter != "T":
                out[f"slow {name}"] = low_pass(out[name], ANSWERED_HZ, piece.period)
    momentum = speed @ model.spin[:, None]  # (n, 1)
    across, smooth = piece.angular_velocity * momentum, low_pass(momentum, 2.0 * BAND, piece.period)
    out["Mz Jr"] = -derivative(smooth, piece.period)[:, 0]
    out["Mx Jr"], out["My Jr"] = -across[:, 1], across[:, 0]
    if piece.velocity is not None:
        drag = -speed[:, :, None] * _local(piece, piece.velocity, model)
        for i, axis in enumerate("xyz"):
            out |= _at_rotors(drag[:, :, i], i, f"rotor drag {axis}", model)
        out["Mx flapping"], out["My flapping"] = out["Fy rotor drag y"], -out["Fx rotor drag x"]
    return out


def _at_rotors(force: Array, axis: int, parameter: str, model: Model) -> NamedArrays:
    """Return the columns (n,) of forces (n, 4) along a body axis at each rotor, and of moments."""
    arms = np.cross(model.geometry.positions * [1.0, 1.0, 0.0], np.eye(3)[axis])  # (4, 3)
    columns = {f"F{'xyz'[axis]} {parameter}": force.sum(axis=1)}
    moments = zip("xyz", arms.T, strict=True)
    return columns | {f"M{a} {parameter}": force @ arm for a, arm in moments if arm.any()}


def _local(piece: MotionPiece, velocity: Array, model: Model) -> Array:
    """Return each rotor's velocity (n, 4, 3) in body axes; the vehicle's where no arm is known."""
    turning = np.cross(piece.angular_velocity[:, None], model.geometry.positions)
    return velocity[:, None] + model.geometry.known * turning


def air_columns(piece: MotionPiece, model: Model) -> NamedArrays:
    """Return the columns (n,) without rotor speeds."""
    w = piece.angular_velocity.T
    turning = derivative(piece.angular_velocity, piece.period).T
    out = {"1": np.ones(len(piece.t))}
    out |= {f"dw{a}": x for a, x in zip("xyz", turning, strict=True)}
    out |= {f"w{i}w{j}": w[i] * w[j] for i, j in PAIRS}
    out |= {f"M{a} damping {a}": -x for a, x in zip("xyz", w, strict=True)}
    if piece.velocity is not None:
        speed = np.linalg.norm(piece.velocity, axis=1)
        for a, v in zip("xyz", piece.velocity.T, strict=True):
            out[f"F{a} linear drag {a}"], out[f"F{a} quadratic drag {a}"] = -v, -speed * v
        across = _local(piece, piece.velocity, model)[:, :, :2]
        out |= _at_rotors(0.25 * (across**2).sum(axis=2), 2, "lift", model)
    return out
