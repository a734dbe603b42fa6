"""Which parameters a fit has, from what the logs measure, and where they start."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from .channels import Piece, Sources
from .columns import Drive
from .model import Model
from .starting import check_order, first_gains, first_thrust

Array = NDArray[np.float64]

# of an accelerometer that is not calibrated beside its factory's, m/s2 and rad: 20 mg, as data
# sheets of such sensors state
FORCE_BIAS = 0.2
TILT = 0.02
# s: of the offset between the motion's clock and the rotors': sensors' own filters, transport
DELAY = 0.02

BASE = (
    "Jx",
    "Jy",
    "Jz",
    "reach",
    "cx",
    "cy",
    "Jr",
    "tilt x",
    "tilt y",
    "rx",
    "ry",
    "rz",
    "turn bias x",
    "turn bias y",
    "turn bias z",
)
BIASES = ("force bias x", "force bias y", "force bias z")
# of these a negative value is no physics, but another fault of the model
POSITIVE = tuple(f"{kind} {a}" for kind in ("rotor drag", "linear drag", "damping") for a in "xyz")
# each is added where it makes the logs much likelier
OPTIONAL: dict[str, tuple[str, ...]] = {
    "rotor drag": ("rotor drag x", "rotor drag y"),
    "linear drag": ("linear drag x", "linear drag y"),
    "quadratic drag": ("quadratic drag x", "quadratic drag y"),
    "vertical drag": ("linear drag z",),
    "inflow": ("rotor drag z",),
    "lift": ("lift",),
    "damping x": ("damping x",),
    "damping y": ("damping y",),
    "damping z": ("damping z",),
    "products of inertia": ("Jxy", "Jxz", "Jyz"),
}


def first_model(
    pieces: list[Piece], sources: Sources, drive: Drive, mass: float, gravity: float
) -> tuple[Model, Array, Drive, bool]:
    """Return the model, where it starts, the drive with the turning senses that yaw shows, and
    whether they are the opposite of the drive's.

    Raises:
        InputError: roll or pitch turn against their rotors.
    """
    each = first_thrust(pieces, drive, mass * gravity)
    share = 1.0 / len(each)
    thrust = [share * a for a in each]
    gains = first_gains(pieces, drive, thrust)
    check_order(gains)
    arm = float(np.mean(np.abs(drive.positions[:, :2])))
    # what hardly turns starts at the inertia that such a vehicle usually has
    usual = 0.45 * mass * arm**2
    inertia = np.array([1.0 / g if 1e-2 / usual < g < 1e2 / usual else usual for g in gains[:2]])
    flat = 0.9 * float(inertia.sum())
    reach = abs(float(gains[2])) * flat
    reach = float(np.clip(reach, 1e-3 * arm, 10.0 * arm))
    size = {
        **{f"a{j}": a for j, a in enumerate(each)},
        "Jx": inertia[0],
        "Jy": inertia[1],
        "Jz": flat,
        "Jxy": 0.1 * inertia[0],
        "Jxz": 0.1 * inertia[0],
        "Jyz": 0.1 * inertia[0],
        "reach": reach,
        "cx": 0.01 * arm,
        "cy": 0.01 * arm,
        "Jr": 0.01 * inertia[0] / _mean_speed(pieces, drive) * _rate(gravity, arm),
        **dict.fromkeys(("tilt x", "tilt y"), 0.01),
        **dict.fromkeys(("rx", "ry", "rz"), 0.01),
        **dict.fromkeys(("turn bias x", "turn bias y", "turn bias z"), 0.1),
        **dict.fromkeys(BIASES, 0.1),
        **{f"rotor drag {a}": 0.05 * mass / _mean_speed(pieces, drive) for a in "xyz"},
        **{f"linear drag {a}": 0.1 * mass for a in "xyz"},
        **{f"quadratic drag {a}": 0.03 * mass for a in "xyz"},
        "lift": 0.03 * mass,
        **{f"damping {a}": inertia[0] for a in "xyz"},
    }
    free = (*(f"a{j}" for j in range(len(each))), *BASE)
    prior: dict[str, float] = {}
    if sources.force == "accelerometer":
        free = (*free, *BIASES)
        prior = {**dict.fromkeys(BIASES, FORCE_BIAS), "tilt x": TILT, "tilt y": TILT}
    model = Model(mass, len(each), free, size, prior=prior)
    start = np.zeros(len(free))
    start[: len(each)] = share
    start[free.index("reach")] = 1.0
    turned = bool(gains[2] < 0.0)
    if turned:
        drive = Drive(**{**drive.__dict__, "spin": -drive.spin})
    return model, start, drive, turned


def with_more(model: Model, start: Array, names: Sequence[str]) -> tuple[Model, Array]:
    """Return a model with further parameters, which start at nothing."""
    more = Model(
        model.mass, model.powers, (*model.free, *names), model.scale, model.fixed, model.prior
    )
    return more, np.concatenate([start, np.zeros(len(names))])


def _mean_speed(pieces: list[Piece], drive: Drive) -> float:
    source = [p.command if drive.commands else p.rotor_speeds for p in pieces]
    return max(float(np.mean(np.concatenate([x for x in source if x is not None]))), 1e-6)


def _rate(gravity: float, arm: float) -> float:
    return float(np.sqrt(gravity / arm))  # 1/s: of a vehicle's own motion
