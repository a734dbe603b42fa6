"""Which parameters a fit has, from what the logs measure, and where they start: at plain least
squares, axis by axis, in which every coefficient is linear.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.signal import butter, sosfiltfilt

from ...dynamics.effects import Role
from ...runtime.arrays import Array
from ...runtime.errors import InputError
from .channels import MotionPiece, Sources
from .columns import Drive, rotor_columns
from .geometry import GRAVITY, USUAL
from .model import Model

# of an accelerometer that is not calibrated beside its factory's, m/s2 and rad: 20 mg, as data
# sheets of such sensors state
FORCE_BIAS = 0.2
TILT = 0.02
# s: of the offset between the motion's clock and the rotors': sensors' own filters, transport
DELAY = 0.02
# s: the delays at which turning is compared with torque before the fit knows its own; commands of
# a Crazyflie and of flight controllers lead the motion by 30 to 60 ms
_FIRST_DELAYS = np.linspace(0.0, 0.08, 9)
# correlation of turning with torque below which a log does not show that they oppose: a Crazyflie
# that hardly rolls has -.06
_OPPOSED = 0.15

BASE = (
    *("Jx", "Jy", "Jz", "reach", "cx", "cy", "Jr", "tilt x", "tilt y", "rx", "ry", "rz"),
    *("turn bias x", "turn bias y", "turn bias z"),
)
BIASES = ("force bias x", "force bias y", "force bias z")


@dataclass(frozen=True)
class Further:
    """An effect that is fitted where it makes the logs much likelier."""

    parameters: tuple[str, ...]
    role: Role | None = None  # of the library's effect; None: it is none
    first: int = 0  # of the effect's coefficients
    shows: str = ""  # in force along body x and y; or along "z", or in "turning"
    of_speeds: bool = False  # takes measured rotor speeds
    positive: bool = True  # a negative value is no physics, but another fault of the model


FURTHER: dict[str, Further] = {
    "rotor drag": Further(("rotor drag x", "rotor drag y"), Role.ROTOR_DRAG, of_speeds=True),
    "linear drag": Further(("linear drag x", "linear drag y"), Role.BODY_DRAG),
    "quadratic drag": Further(
        ("quadratic drag x", "quadratic drag y"), Role.BODY_DRAG, 3, positive=False
    ),
    "vertical drag": Further(("linear drag z",), Role.BODY_DRAG, 2),
    "inflow": Further(("rotor drag z",), Role.INFLOW_THRUST, 0, "z", of_speeds=True),
    "lift": Further(("lift",), Role.TRANSLATIONAL_LIFT, 0, "z", positive=False),
    # shares of slow torques that turn nothing, since the flight loop answers with them
    "answered torque": Further(("answered x", "answered y", "answered z")),
    **{
        f"damping {a}": Further((f"damping {a}",), Role.RATE_DAMPING, i, "turning")
        for i, a in enumerate("xyz")
    },
    "flapping": Further(("flapping",), Role.FLAPPING_MOMENT, 0, "turning", of_speeds=True),
    "products of inertia": Further(("Jxy", "Jxz", "Jyz"), positive=False),
}


def first_model(
    pieces: list[MotionPiece],
    sources: Sources,
    drive: Drive,
    mass: float,
    nonlinear: Sequence[str],
) -> tuple[Model, Array, Drive, bool]:
    """Return the model, where it starts, the drive with the turning senses that yaw shows, and
    whether they are the opposite of the drive's; ``nonlinear`` of its parameters start as the
    drive has them.

    Raises:
        InputError: roll or pitch turn against their rotors.
    """
    columns = [rotor_columns(piece, drive) for piece in pieces]
    # a basis coefficient at which it alone would carry the weight
    totals = [np.concatenate([c[f"T{j}"] for c in columns]) for j in range(len(drive.exponents))]
    each = [mass * GRAVITY / max(float(np.mean(total)), 1e-12) for total in totals]
    share = 1.0 / len(each)
    gains, alike = _first_gains(pieces, columns, [share * a for a in each])
    for axis, correlation in zip(("roll", "pitch"), alike, strict=False):
        if correlation < -_OPPOSED:
            raise InputError(
                f"{axis} turns against the torque of its rotors; expected rotors in the order "
                "front-left, rear-left, rear-right, front-right, and body axes forward, left, up"
            )
    arm = float(np.mean(np.abs(drive.positions[:, :2])))
    # what hardly turns starts at the inertia that such a vehicle usually has
    usual = USUAL.gyration * mass * arm**2
    inertia = np.array([1.0 / g if 1e-2 / usual < g < 1e2 / usual else usual for g in gains[:2]])
    flat = USUAL.flat * float(inertia.sum())
    source = [p.command if drive.commands else p.rotor_speeds for p in pieces]
    speed = max(float(np.mean(np.concatenate([x for x in source if x is not None]))), 1e-6)
    size = {
        **{f"a{j}": a for j, a in enumerate(each)},
        **dict(zip(("Jx", "Jy", "Jz"), (*inertia, flat), strict=True)),
        **dict.fromkeys(("Jxy", "Jxz", "Jyz"), 0.1 * inertia[0]),
        "reach": float(np.clip(abs(float(gains[2])) * flat, 1e-3 * arm, 10.0 * arm)),
        **dict.fromkeys(("cx", "cy"), 0.01 * arm),
        "Jr": 0.01 * inertia[0] / speed * float(np.sqrt(GRAVITY / arm)),
        **dict.fromkeys(("tilt x", "tilt y", "rx", "ry", "rz"), 0.01),
        **dict.fromkeys(("turn bias x", "turn bias y", "turn bias z", *BIASES), 0.1),
        **{f"rotor drag {a}": 0.05 * mass / speed for a in "xyz"},
        **{f"linear drag {a}": 0.1 * mass for a in "xyz"},
        **{f"quadratic drag {a}": 0.03 * mass for a in "xyz"},
        "lift": 0.03 * mass,
        **{f"damping {a}": inertia[0] for a in "xyz"},
        "flapping": 0.05 * mass / speed * 0.03 * arm,
        **{f"answered {a}": 0.3 for a in "xyz"},
    }
    free = (*(f"a{j}" for j in range(len(each))), *BASE)
    prior = {"delay": DELAY}
    if sources.force == "accelerometer":
        free = (*free, *BIASES)
        prior |= {**dict.fromkeys(BIASES, FORCE_BIAS), "tilt x": TILT, "tilt y": TILT}
    known = {**{f"a{j}": share for j in range(len(each))}, "reach": 1.0}
    known |= {name: getattr(drive, name) for name in nonlinear}
    model = Model(mass, len(each), (*free, *nonlinear), size, prior)
    turned = bool(gains[2] < 0.0)
    if turned:
        drive = replace(drive, spin=-drive.spin)
    return model, np.array([known.get(name, 0.0) for name in model.free]), drive, turned


def _first_gains(
    pieces: list[MotionPiece], columns: list[dict[str, Array]], thrust: list[float]
) -> tuple[Array, Array]:
    """Return the angular acceleration per torque (3,) in 1/(kg m2), roughly: about x and y the
    inertia's inverse, about z that times torque over thrust (m); and their correlation (3,). Each
    at the delay, up to 80 ms, at which the two are most alike or most opposed.
    """
    gains, alike = np.zeros(3), np.zeros(3)
    for i, letter in enumerate("XYZ"):
        cross, power, turned = np.zeros(len(_FIRST_DELAYS)), 0.0, 0.0
        for piece, column in zip(pieces, columns, strict=True):
            torque = np.sum([a * column[f"{letter}{j}"] for j, a in enumerate(thrust)], axis=0)
            # turning is the integral of torque: compared where neither is differentiated
            spin = _swing(np.cumsum(torque - torque.mean()) * piece.period, piece.period)
            rate = _swing(piece.angular_velocity[:, i], piece.period)
            late = np.rint(_FIRST_DELAYS / piece.period).astype(int)
            cross += [float(spin[: len(spin) - n] @ rate[n:]) for n in late]
            power += float(spin @ spin)
            turned += float(rate @ rate)
        most = cross[np.argmax(np.abs(cross))]
        if power > 0.0 and turned > 0.0:
            gains[i], alike[i] = most / power, most / np.sqrt(power * turned)
    return gains, alike


def _swing(x: Array, period: float) -> Array:
    """Return what of ``x`` (n,) is faster than about 0.5 Hz."""
    sections = butter(2, [1.0 * period, min(0.9, 16.0 * period)], btype="bandpass", output="sos")
    return np.asarray(sosfiltfilt(sections, x))
