"""The columns of force and torque balance: contributions of rotors, turning and moving through
the air, before any coefficient.

A rotor's thrust is ``sum_j a_j phi_j``. Measured speeds give ``phi = [W^2]``, commands
``phi = [1, u, u^2] (V/V_ref)^gamma`` or some of these. Rotors follow with a first-order lag and a
time offset. Drag, inflow and lift act at each rotor, at its own velocity, and so turn the vehicle,
too. Forward velocity goes with pitch rate. The moment of lift while yawing therefore looks like the
gyroscopic one behind ``Jz``.
"""

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from ...runtime.arrays import Array
from ..logs.table import NamedArrays, Names
from ..motion.smoothing import derivative, lagged, low_pass
from .channels import MotionPiece, Pieces
from .spectra import BAND, Segment, segments_of

_STEP = {"lag": 1e-3, "gamma": 0.05}  # finite differences
# Hz: the flight loop answers slower, unmeasured moments with rotor torque, and this part of the
# torque turns nothing. From 3 to 15 Hz regression finds nearly all of the torque, below a fifth to
# a half (13 flights of a Crazyflie)
ANSWERED_HZ = 3.0


@dataclass(frozen=True)
class Drive:
    """Settings of the rotors' columns."""

    positions: Array  # (4, 3) m, or of length 1 where the arm is not known
    spin: Array  # (4,)
    known_arm: bool = True
    commands: bool = False  # the rotors are known by their commands, not by their speeds
    exponents: tuple[int, ...] = (2,)  # basis functions
    voltage_ref: float = 0.0  # V; 0: voltage is not used
    lag: float = 0.0  # s
    delay: float = 0.0  # s, of the motion behind the rotors
    gamma: float = 0.0  # exponent of the voltage
    band: float = BAND  # Hz: force and turning are compared up to here
    # rad/s, standard deviation of one measured speed; not known of speeds behind a lag
    speed_noise: float = 0.0

    @property
    def shares(self) -> NamedArrays:
        """Each rotor's share (4,) in thrust T and in the torques X, Y and Z, m."""
        x, y = self.positions[:, 0], self.positions[:, 1]
        return {"T": np.ones(4), "X": y, "Y": -x, "Z": -self.spin}


class BalanceSpectra(NamedTuple):
    """All pieces' transforms: the measured six first, then the columns, then their derivatives by
    the nonlinear parameters.
    """

    drive: Drive  # centre of linearisation
    names: Names  # columns
    nonlinear: Names  # some of NONLINEAR
    segments: tuple[Segment, ...]
    seconds: float
    noise: Array  # (4, c): standard deviation times root s, of each rotor's noise in each column


def balance(pieces: Pieces, drive: Drive, nonlinear: Names) -> BalanceSpectra:
    """Return the transforms of all pieces, linear about a drive in its ``nonlinear`` parameters."""
    segments: list[Segment] = []
    names: Names = ()
    for piece in pieces:
        here = rotor_columns(piece, drive)
        every = here | air_columns(piece, drive)
        slow = [i for i, name in enumerate(here) if name[0] in "XYZ"]
        names = (*every, *(f"slow {name}" for name in here if name[0] in "XYZ"))
        base = np.column_stack([*every.values()])
        parts = [piece.measured(), base]
        for name in nonlinear:
            if name in _STEP:
                there = replace(drive, **{name: getattr(drive, name) + _STEP[name]})
                moved = every | rotor_columns(piece, there)
                parts.append((np.column_stack([*moved.values()]) - base) / _STEP[name])
        stacked = low_pass(np.column_stack(parts), drive.band, piece.period)
        late = np.array([name in here for name in every])
        for s in segments_of(stacked, piece.period, piece.log, drive.band):
            # late columns are delayed; blocks are in the order of ``nonlinear``, each with the
            # slow part of its torques behind it
            turn = -2j * np.pi * s.frequency[:, None] * late
            measured, *blocks = np.split(s.columns, range(6, s.columns.shape[2], len(late)), axis=2)
            first, *others = (block * np.exp(turn * drive.delay) for block in blocks)
            rest = iter(others)
            ordered = [turn * first if name == "delay" else next(rest) for name in nonlinear]
            share = 1.0 / (1.0 + (s.frequency / ANSWERED_HZ) ** 4)[:, None]
            every_block = (x for b in (first, *ordered) for x in (b, share * b[:, :, slow]))
            segments.append(s._replace(columns=np.concatenate([measured, *every_block], axis=2)))
    seconds = np.array([len(p.t) * p.period for p in pieces])
    # white noise of each rotor's speed in a column: standard deviation times the root of the period
    noise = np.zeros((4, len(names)))
    if drive.speed_noise > 0.0 and drive.lag <= 0.0:
        squares = [p.period * (4.0 * np.square(p.rotors)).mean(axis=0) for p in pieces]
        size = drive.speed_noise * np.sqrt(np.average(squares, axis=0, weights=seconds))
        for letter, share in drive.shares.items():
            noise[:, names.index(f"{letter}0")] = size * share
    return BalanceSpectra(drive, names, nonlinear, tuple(segments), seconds.sum(), noise)


def rotor_columns(piece: MotionPiece, drive: Drive) -> NamedArrays:
    """Return the columns (n,) of the rotors."""
    speed = lagged(piece.rotors, drive.lag, piece.period)  # (n, 4), or the command
    phi = np.stack([speed**e for e in drive.exponents])  # of each rotor's thrust
    if drive.voltage_ref > 0.0 and piece.voltage is not None:
        phi *= np.power(piece.voltage / drive.voltage_ref, drive.gamma)[:, None]
    shares = drive.shares
    out = {f"{n}{j}": part @ shares[n] for j, part in enumerate(phi) for n in shares}
    momentum = speed @ drive.spin
    w = piece.angular_velocity
    smooth = low_pass(momentum[:, None], 2.0 * BAND, piece.period)
    out["spin z"] = -derivative(smooth, piece.period)[:, 0]
    out["spin x"], out["spin y"] = -w[:, 1] * momentum, w[:, 0] * momentum
    if piece.velocity is not None:
        drag = -speed[:, :, None] * _local(piece, piece.velocity, drive)
        along = np.moveaxis(drag, 2, 0)
        for axis, force in zip("xyz", along, strict=True):
            out[f"rotor drag {axis}"] = force.sum(axis=1)
        for axis, force, arm in zip("xy", along[:2], (shares["X"], shares["Y"]), strict=True):
            out[f"moment of rotor drag {axis}"] = -force @ arm
            out[f"moment {axis} of rotor drag z"] = along[2] @ arm
    return out


def _local(piece: MotionPiece, velocity: Array, drive: Drive) -> Array:
    """Return each rotor's velocity (n, 4, 3) in body axes; the vehicle's where no arm is known."""
    turning = np.cross(piece.angular_velocity[:, None], drive.positions)
    return velocity[:, None] + drive.known_arm * turning


def air_columns(piece: MotionPiece, drive: Drive) -> NamedArrays:
    """Return the columns (n,) without rotor speeds."""
    w = piece.angular_velocity
    dw = derivative(w, piece.period)
    out = {"1": np.ones(len(piece.t))}
    for i, a in enumerate("xyz"):
        out[f"w{a}"], out[f"dw{a}"] = w[:, i], dw[:, i]
        for j in range(i, 3):
            out[f"w{a}w{'xyz'[j]}"] = w[:, i] * w[:, j]
    if piece.velocity is not None:
        speed = np.linalg.norm(piece.velocity, axis=1)
        for a, v in zip("xyz", piece.velocity.T, strict=True):
            out[f"linear drag {a}"] = -v
            out[f"quadratic drag {a}"] = -speed * v
        across = _local(piece, piece.velocity, drive)[:, :, :2]
        lift = 0.25 * np.square(across).sum(axis=2)
        out["lift"] = lift.sum(axis=1)
        for a in "xy":
            out[f"moment {a} of lift"] = lift @ drive.shares[a.upper()]
    return out
