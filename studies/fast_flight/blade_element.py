"""What blade-element momentum theory says of the coefficients that a racer's flights are fitted
with, before any flight: means and standard deviations of their priors.

A rotor of lift slope times solidity sa, at climb u_z and edgewise speed u_h over its tip speed
(lambda_c and mu) and with induced velocity lambda_i, has the thrust coefficient
sa/2 (B (1 + 3/2 mu^2) - (lambda_c + lambda_i)/2), and momentum asks
2 lambda_i sqrt(mu^2 + (lambda_c + lambda_i)^2) of the same (Leishman, *Principles of Helicopter
Aerodynamics*, 2006, chapters 2, 3 and 5). The pitch term B follows from the declared thrust
coefficient, so that in hover nothing changes. Coefficients of the library are the least squares of
what that thrust gains or loses over a grid of speeds.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from windwrench.dynamics import Vehicle

Array = NDArray[np.float64]
Coefficient = tuple[str, str]  # effect and coefficient
Priors = Mapping[Coefficient, tuple[float, float]]  # mean and standard deviation


@dataclass(frozen=True)
class BladeSettings:
    """A five-inch propeller with three blades, and the frame that carries it.

    Attributes:
        solidity: blade area over disc area, published for this vehicle's propeller (Agilicious,
            Foehn and others, Science Robotics 7, 2022: its blade-element model).
        lift_slope: 1/rad, from the same source.
        density: kg/m3.
        flat_plate: drag coefficient of a flat plate (Hoerner, *Fluid-Dynamic Drag*, 1965).
        side_area: m2, of the frame as seen from ahead or from the side.
        top_area: m2, as seen from above.
        spread: standard deviation over mean, of what theory says.
        fastest: m/s, of the grid, along the disc.
        climb: m/s, of the grid, through the disc.
    """

    solidity: float = 0.215
    lift_slope: float = 4.8
    density: float = 1.2
    flat_plate: float = 1.2
    side_area: float = 0.012
    top_area: float = 0.03
    spread: float = 0.5
    fastest: float = 14.0
    climb: float = 5.0


SETTINGS = BladeSettings()
_NEWTON_STEPS = 40


def rotor_thrust(
    speed: Array, edgewise: Array, climb: Array, k: float, radius: float, set_: BladeSettings
) -> Array:
    """Return a rotor's thrust (n,) N.

    Args:
        speed: (n,) rad/s, of the rotor.
        edgewise: (n,) m/s, of the air along the disc.
        climb: (n,) m/s, of the rotor along its axis.
        k: N/(rad/s)^2, thrust coefficient in hover.
        radius: m.
        set_: of the blades.
    """
    sa = set_.solidity * set_.lift_slope
    scale = set_.density * np.pi * radius**4 * np.square(speed)
    hover = k / (set_.density * np.pi * radius**4)
    induced = np.sqrt(hover / 2.0)
    pitch = 2.0 * hover / sa + induced / 2.0
    mu, through = edgewise / (speed * radius), climb / (speed * radius)
    inflow = np.full_like(speed, induced)
    for _ in range(_NEWTON_STEPS):
        flow = np.sqrt(mu**2 + (through + inflow) ** 2)
        missing = sa / 2.0 * (pitch * (1.0 + 1.5 * mu**2) - (through + inflow) / 2.0)
        missing -= 2.0 * inflow * flow
        slope = -sa / 4.0 - 2.0 * flow - 2.0 * inflow * (through + inflow) / flow
        # half a step: where the rotor sinks into its wake the slope vanishes
        inflow -= 0.5 * missing / np.minimum(slope, -sa / 4.0)
    out: Array = scale * sa / 2.0 * (pitch * (1.0 + 1.5 * mu**2) - (through + inflow) / 2.0)
    return out


@dataclass(frozen=True)
class Projection:
    """The library's terms that come nearest to blade-element thrust, and how near they come."""

    inflow: float  # N/(rad/s m/s), of ``inflow_thrust``
    lift: float  # N/(m/s)^2, of ``translational_lift``
    drag: float  # N/(m/s)^2, that four rotors add to vertical ``body_drag``
    change: float  # N, RMS over the grid, of one rotor's change of thrust
    left: float  # N, RMS, what the terms leave of it


def project(vehicle: Vehicle, set_: BladeSettings = SETTINGS) -> Projection:
    """Return the coefficients of the library that come nearest to a vehicle's rotors in theory."""
    k = float(np.mean(vehicle.k))
    hover = np.sqrt(vehicle.weight / (4.0 * k))
    speed, edgewise, climb = (
        axis.ravel()
        for axis in np.meshgrid(
            hover * np.linspace(0.9, 1.8, 6),
            np.linspace(0.0, set_.fastest, 8),
            np.linspace(-set_.climb, set_.climb, 7),
        )
    )
    change = rotor_thrust(speed, edgewise, climb, k, vehicle.rotor_radius, set_) - k * speed**2
    terms = np.column_stack([-speed * climb, edgewise**2, -np.hypot(edgewise, climb) * climb])
    found = np.linalg.lstsq(terms, change, rcond=None)[0]
    left = change - terms @ found
    return Projection(
        float(found[0]),
        float(found[1]),
        4.0 * float(found[2]),
        float(np.sqrt(np.mean(change**2))),
        float(np.sqrt(np.mean(left**2))),
    )


def priors(vehicle: Vehicle, set_: BladeSettings = SETTINGS) -> Priors:
    """Return mean and standard deviation of the coefficients of which theory says something.

    The air that one rotor drives into the disc of another cannot be faster than the other's own
    edgewise speed: that bounds ``rotor_interaction``, whose sign it leaves open.
    """
    rotors = project(vehicle, set_)
    plate = 0.5 * set_.density * set_.flat_plate
    down, side = rotors.drag + plate * set_.top_area, plate * set_.side_area
    area = np.pi * vehicle.rotor_radius**2
    # thrust lost for each rad/s and m/s of air through the disc, at constant induced velocity
    loss = set_.solidity * set_.lift_slope / 4.0 * set_.density * area * vehicle.rotor_radius
    return {
        ("inflow_thrust", "kz"): (rotors.inflow, set_.spread * rotors.inflow),
        ("translational_lift", "kh"): (rotors.lift, set_.spread * rotors.lift),
        ("body_drag", "cx"): (side, side),
        ("body_drag", "cy"): (side, side),
        ("body_drag", "cz"): (down, set_.spread * down),
        ("rotor_interaction", "kp"): (0.0, loss),
        ("rotor_interaction", "kw"): (0.0, loss),
    }
