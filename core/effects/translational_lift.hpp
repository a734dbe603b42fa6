// Translational lift: a rotor that moves through the air edgewise delivers more thrust.
//
// At rotor i, at body velocity u_i = R'(v - wind) + omega x r_i: F_i = kh (u_ix^2 + u_iy^2) along
// body z, applied at the rotor. It is the k_h of RotorPy.
#pragma once
#include "parts.hpp"

namespace windwrench {

// c: kh N/(m/s)2, central
template <class T, class C>
void translational_lift(const C *c, const VehicleNumbers<C> &v, const FlightState<T> &s,
                        Wrench<T> &w) {
  C r[3];
  T u[3];
  for (int i = 0; i < 4; i++) {
    rotor_place(v, i, c[1], r);
    air_velocity(s, r, u);
    T f[3] = {T{}, T{}, c[0] * (u[0] * u[0] + u[1] * u[1])};
    add_force_at(v, s, r, f, w);
  }
}

}  // namespace windwrench
