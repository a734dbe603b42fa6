"""Rate damping: a torque against the body rate, tau = -diag(dx, dy, dz) omega in body axes."""

from .base import Effect, along
from .declaration import Family, Found, Need, Role

# least share of the damping about z, about x and y: rotors at the arms climb and sink, and damp
# these axes more
_LEAST_SHARE_OF_YAW = 0.3


def implausible(found: Found) -> str:
    """Return why a found damping is none: it acts about z alone."""
    dx, dy, dz = EFFECT.vector(found.coefficients)
    if 0.5 * (dx + dy) >= _LEAST_SHARE_OF_YAW * dz:
        return ""
    return "acts about z alone, but rotors damp the other axes more"


EFFECT = Effect(
    name="rate_damping",
    kind="wrench",
    coefficients=along("d{}", "Nm/(rad/s)", (5e-3, 3e-5), "about body {}", minimum=0.0),
    source="linear damping; sizes: what typical rotor drag and inflow make at the rotors' arms",
    excitation="steady yaw rates of 1 rad/s and more, and quick roll and pitch, with little "
    "translation",
    model="rate_damping",
    family=Family.AERODYNAMICS,
    role=Role.RATE_DAMPING,
    implausible=implausible,
    needs=(Need.MOMENTS,),
)
