"""Mass: the vehicle is heavier (dm > 0) or lighter than declared, with the same inertia and centre
of mass.
"""

from dataclasses import replace

from ...runtime.errors import InputError
from ..vehicle import Vehicle
from .base import Coefficient, Effect
from .declaration import Coefficients, Family, Role


def amend(vehicle: Vehicle, coefficients: Coefficients) -> Vehicle:
    """Return the vehicle with ``dm`` kg added."""
    mass = vehicle.mass + coefficients.get("dm", 0.0)
    if not mass > 0:
        raise InputError(
            f"effect mass: dm: {vehicle.name} would weigh {mass:g} kg; expected dm > "
            f"{-vehicle.mass:g}"
        )
    return replace(vehicle, mass=mass)


EFFECT = Effect(
    name="mass",
    kind="body",
    coefficients=(Coefficient("dm", "kg", (0.04, 0.003), "added to the declared mass"),),
    source="definition",
    excitation="vertical accelerations of 1 m/s2 and more: in hover a mass, a thrust scale and a "
    "vertical force are the same",
    amend=amend,
    family=Family.RIGID_BODY,
    role=Role.MASS,
    any_size=True,
)
