"""Winds that have a formula: uniform, sheared with height, and single gusts."""

import numpy as np
from numpy.typing import ArrayLike

from ...runtime.errors import InputError, unknown_name
from .field import CompiledWind, number, vector

_FOOT = 0.3048  # m
# MIL-F-8785C 3.7.3.4: roughness length, ft, of flight phases near the ground (category C), and else
ROUGHNESS = {"terminal": 0.15 * _FOOT, "open": 2.0 * _FOOT}
_LAWS = {"log": 1, "power": 2}  # 0: none

STEADY = np.dtype(
    [
        ("velocity", "f8", (3,)),  # m/s, at the height ``reference``; of a gust, its largest
        ("law", "i8"),
        ("reference", "f8"),  # m
        ("roughness", "f8"),  # m, or the exponent of the power law
        ("floor", "f8"),  # m, below which the height counts as this
        # a gust's direction of travel (3,), its speed (m/s), and its front's place at ``start``
        ("travel", "f8", (3,)),
        ("front", "f8", (3,)),
        ("speed", "f8"),
        ("start", "f8"),
        ("length", "f8"),  # m, of the rise; 0: no gust
        ("falls", "i8"),
    ]
)


class Uniform(CompiledWind):
    """The same wind everywhere and always.

    Args:
        velocity: (3,) m/s, world.
    """

    def __init__(self, velocity: ArrayLike) -> None:
        parameters = np.zeros(1, dtype=STEADY)
        parameters["velocity"] = vector(velocity, "velocity")
        super().__init__("steady", parameters)


class Shear(CompiledWind):
    """A wind growing with height.

    ``log``: ``u(h) = u_ref ln(h / z0) / ln(h_ref / z0)``, MIL-F-8785C 3.7.3.4, which states
    ``h_ref`` = 20 ft; zero below ``z0``. ``power``: ``u(h) = u_ref (h / h_ref)^exponent``.

    Args:
        velocity: (3,) m/s, world, at ``reference``.
        reference: height in m.
        law: ``log`` or ``power``.
        roughness: z0 in m, of the log law; MIL-F-8785C: 0.0457 near the ground (category C), 0.61
            else.
        exponent: the power law's; 1/7 over open, flat land.

    Raises:
        InputError: an unknown law, or a number out of range.
    """

    def __init__(
        self,
        velocity: ArrayLike,
        reference: float = 20 * _FOOT,
        law: str = "log",
        roughness: float = ROUGHNESS["terminal"],
        exponent: float = 1.0 / 7.0,
    ) -> None:
        if law not in _LAWS:
            raise unknown_name("law", law, _LAWS, "wind: Shear")
        parameters = np.zeros(1, dtype=STEADY)
        w = parameters[0]
        w["velocity"], w["law"] = vector(velocity, "velocity"), _LAWS[law]
        w["reference"] = number(reference, "reference", 0.0)
        if law == "log":
            w["roughness"] = w["floor"] = number(roughness, "roughness", 0.0)
            if roughness >= reference:
                raise InputError(
                    f"wind: Shear: roughness must be below reference, got {roughness:g} and "
                    f"{reference:g} m"
                )
        else:
            w["roughness"] = number(exponent, "exponent", 0.0)
        super().__init__("steady", parameters)


class Gust(CompiledWind):
    """A single travelling gust of the form 1 - cos.

    ``v = v_m / 2 (1 - cos(pi s / d))`` with the front ``0 < s < d`` ahead of the point. Behind
    ``d`` the wind stays at ``v_m`` (MIL-F-8785C 3.7.2.3). A gust that ``falls`` comes down again by
    the same law until ``2 d`` (14 CFR 25.341).

    Args:
        velocity: v_m, (3,) m/s, world.
        length: d in m.
        start: s, when the front is at ``front``.
        speed: m/s, of travel.
        direction: (3,), of travel; default: that of ``velocity``.
        front: (3,) m.
        falls: whether the gust comes down again.

    Raises:
        InputError: a number out of range, or no direction.
    """

    def __init__(
        self,
        velocity: ArrayLike,
        length: float,
        start: float = 0.0,
        speed: float = 3.0,
        direction: ArrayLike | None = None,
        front: ArrayLike = (0.0, 0.0, 0.0),
        falls: bool = True,
    ) -> None:
        parameters = np.zeros(1, dtype=STEADY)
        w = parameters[0]
        w["velocity"] = vector(velocity, "velocity")
        travel = vector(velocity if direction is None else direction, "direction")
        size = float(np.linalg.norm(travel))
        if size == 0.0:
            raise InputError("wind: Gust: direction must not be zero")
        w["travel"], w["front"] = travel / size, vector(front, "front")
        w["speed"], w["length"] = number(speed, "speed", 0.0), number(length, "length", 0.0)
        w["start"], w["falls"] = number(start, "start"), bool(falls)
        super().__init__("steady", parameters)
