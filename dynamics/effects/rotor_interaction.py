"""Rotor interaction: in edgewise flight rotors that follow fly in the wake of those that lead.

With u = R'(v - wind) the airspeed in body axes and e_i the direction of rotor i from the geometric
centre, p_i = e_ix u_x + e_iy u_y says how fast rotor i leads (> 0) or follows (< 0), and
F = -sum_i W_i (kp s p_i + kw max(-p_i, 0)) along body z, at the geometric centre. ``kw`` is thrust
that the followers lose in the wake. ``kp`` is what all gain where the leading ones need to turn
slower than the others for the moments to balance; where all rotors turn alike its part is zero. The
moment that goes with it is that of ``flapping_moment``.

Inflow leans towards the followers by the induced velocity v times tan(chi / 2), chi the angle by
which the wake is blown back: s = 2 v tan(chi / 2) / u_h = 2 v / (sqrt(u_h^2 + w^2) + w), with u_h
the airspeed along the disc and w = u_z + v that through it. It is 1 at low speed, falls in fast
flight and in climbs, and grows in descents. v is that of momentum theory, of the mean rotor:
v sqrt(u_h^2 + w^2) = T / (2 rho A).
"""

import math

from ..mean_jet import AIR_DENSITY
from .base import (
    ROTOR_RADIUS,
    ROTOR_SPEED,
    ROTOR_THRUST,
    Coefficient,
    Effect,
    compiled_model,
)
from .declaration import Family, Need
from .parts import add_force_at, air_velocity, rotor_place

_FOUR_ROTORS = 8.0 * AIR_DENSITY * math.pi  # 4 x 2 rho A over the square of the radius


@compiled_model
def effect_model(c, vehicle, state, wrench):  # type: ignore[no-untyped-def]
    ux, uy, uz = air_velocity(state, 0.0, 0.0, 0.0)
    along = ux * ux + uy * uy
    thrust = 0.0
    for i in range(4):
        thrust += state[ROTOR_THRUST + i]
    lean = 1.0
    if thrust > 0.0:
        hover = math.sqrt(thrust / _FOUR_ROTORS) / vehicle[ROTOR_RADIUS]  # induced, m/s
        induced = hover
        for _step in range(6):  # Newton; bounds keep it out of the vortex ring, where no v solves
            w = uz + induced
            flow = max(math.sqrt(along + w * w), 0.1 * hover)
            slope = max(flow + induced * w / flow, 0.5 * hover)
            induced -= (induced * flow - hover * hover) / slope
            induced = min(max(induced, 0.05 * hover), 2.5 * hover)
        w = uz + induced
        lean = 2.0 * induced / max(math.sqrt(along + w * w) + w, hover)
    force = 0.0
    for i in range(4):
        x, y, _ = rotor_place(vehicle, i, 0.0)
        arm = math.sqrt(x * x + y * y)
        if arm > 0.0:
            leads = (x * ux + y * uy) / arm
            force -= state[ROTOR_SPEED + i] * (c[0] * lean * leads + c[1] * max(-leads, 0.0))
    add_force_at(vehicle, state, wrench, 0.0, 0.0, 0.0, 0.0, 0.0, force)


EFFECT = Effect(
    name="rotor_interaction",
    kind="wrench",
    coefficients=(
        Coefficient("kp", "N/(rad/s m/s)", (1.4e-3, 2e-5), "per rotor, by how fast it leads"),
        Coefficient("kw", "N/(rad/s m/s)", (4e-4, 6e-6), "per rotor, lost where it follows"),
    ),
    source="form: rotors in tandem, Leishman, Principles of Helicopter Aerodynamics, 2006; inflow "
    "of a wake that is blown back, Coleman, Feingold and Stempin, NACA ARR L5E10, 1945; size: "
    "least squares on a 0.77 kg racer at 3 to 14 m/s (docs/trust.md), as a share of thrust at "
    "airspeed over induced velocity",
    excitation="flight at 5 m/s and more along both body axes, with turns that set the rotors "
    "apart; in hover it does nothing",
    model=effect_model,
    family=Family.FAST_FLIGHT,
    needs=(Need.SINGLE_ROTORS,),
)
