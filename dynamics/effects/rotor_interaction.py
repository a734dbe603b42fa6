"""Rotor interaction: in edgewise flight the rear rotors fly in the wake of the front rotors.

With u = R'(v - wind) the airspeed in body axes and e_i the direction of rotor i from the geometric
centre, p_i = e_ix u_x + e_iy u_y says how fast rotor i leads (> 0) or follows (< 0). The force
F = -sum_i W_i (kp s p_i + kw max(-p_i, 0)) acts along body z, at the geometric centre. ``kw``: the
rear rotors lose thrust in the wake. ``kp``: in balance, the front rotors turn slower, and all
rotors gain thrust; with equal rotor speeds this part is zero. ``flapping_moment`` is the moment of
the same cause.

Inflow leans towards the rear rotors by the induced velocity v times tan(chi / 2), chi the angle by
which the wake is blown back: s = 2 v tan(chi / 2) / u_h = 2 v / (sqrt(u_h^2 + w^2) + w), with u_h
the airspeed along the disc and w = u_z + v the airspeed through the disc. s is 1 at low speed,
falls in fast flight and in climbs, and grows in descents. Momentum theory gives v for the mean
rotor: v sqrt(u_h^2 + w^2) = T / (2 rho A).
"""

from .base import Coefficient, Effect
from .declaration import Family, Need

EFFECT = Effect(
    name="rotor_interaction",
    kind="wrench",
    coefficients=(
        Coefficient("kp", "N/(rad/s m/s)", (1.4e-3, 2e-5), "per rotor, by how fast it leads"),
        Coefficient("kw", "N/(rad/s m/s)", (4e-4, 6e-6), "per rotor, lost where it follows"),
    ),
    source="form: rotors in tandem, Leishman, Principles of Helicopter Aerodynamics, 2006; inflow "
    "of a wake that is blown back, Coleman, Feingold and Stempin, NACA ARR L5E10, 1945; size: "
    "least squares on a 0.77 kg racer at 3 to 14 m/s, as a share of thrust at "
    "airspeed over induced velocity",
    excitation="flight at 5 m/s and more along both body axes, with turns that set the rotors "
    "apart; in hover it does nothing",
    model="rotor_interaction",
    family=Family.FAST_FLIGHT,
    needs=(Need.SINGLE_ROTORS,),
)
