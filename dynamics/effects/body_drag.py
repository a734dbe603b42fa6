"""Body drag: the air's force on hull and frame, linear and quadratic in the airspeed, at the
geometric centre.

With u = R'(v - wind) the airspeed in body axes, F = -diag(dx, dy, dz) u - |u| diag(cx, cy, cz) u in
body axes. The quadratic part is the parasitic drag of RotorPy, c_Dx, c_Dy, c_Dz.
"""

import numpy as np

from .base import Effect, along
from .declaration import Family, Found, Role

# share of a body's drag along its most exposed axis, that another axis must have. On six seeds true
# drags had 0.78 and more, RotorPy's 0.34 and more. Without the rotors' inflow in the library,
# wrongly named ones had 0.00 to 0.02
_LEAST_SHARE_OF_LARGEST = 0.15
_SIGNIFICANCE = 2.0  # standard deviations of the difference


def implausible(found: Found) -> str:
    """Return why a found drag is none: at the flights' speed it is small along one axis."""
    value, std, speed = EFFECT.vector(found.coefficients), EFFECT.vector(found.std), found.speed
    size = value[:3] + speed * value[3:]
    error = np.hypot(std[:3], speed * std[3:])
    if np.all(size + _SIGNIFICANCE * error >= _LEAST_SHARE_OF_LARGEST * size.max()):
        return ""
    return "acts along some axes alone, but air drags a body along every axis"


EFFECT = Effect(
    name="body_drag",
    kind="wrench",
    coefficients=(
        *along("d{}", "N/(m/s)", (0.06, 0.002), "linear, along body {}", minimum=0.0),
        *along("c{}", "N/(m/s)^2", (0.02, 0.0005), "quadratic, along body {}", minimum=0.0),
    ),
    source="Hoerner, Fluid-Dynamic Drag, 1965; quadratic part as in Folk, Paulos and Kumar, "
    "RotorPy, 2023 (0.005 to 0.01 N/(m/s)^2 for 0.5 kg); sizes: 0.5 * 1.2 kg/m3 * C_d A with C_d A "
    "= 0.03 m2, 8 cm2",
    excitation="several speeds up to 2 m/s and more for the quadratic part, at several loads "
    "(climbs, hard turns) to tell it from rotor drag, whose force grows with the rotor speeds",
    model="body_drag",
    family=Family.DRAG,
    role=Role.BODY_DRAG,
    implausible=implausible,
)
