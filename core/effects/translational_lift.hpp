// Translational lift: dynamics/effects/translational_lift.py has the equation in words.
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
