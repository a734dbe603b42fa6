// Inflow thrust: dynamics/effects/inflow_thrust.py has the equation in words.
#pragma once
#include "parts.hpp"

namespace windwrench {

// c: kz N/(rad/s m/s), central
template <class T, class C>
void inflow_thrust(const C *c, const VehicleNumbers<C> &v, const FlightState<T> &s, Wrench<T> &w) {
  C r[3];
  T u[3];
  for (int i = 0; i < 4; i++) {
    rotor_place(v, i, c[1], r);
    air_velocity(s, r, u);
    T f[3] = {T{}, T{}, -c[0] * s.rotor_speed[i] * u[2]};
    add_force_at(v, s, r, f, w);
  }
}

}  // namespace windwrench
