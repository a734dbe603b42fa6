// Flapping moment: dynamics/effects/flapping_moment.py has the equation in words.
#pragma once
#include "parts.hpp"

namespace windwrench {

// c: kflap Nm/(rad/s m/s)
template <class T, class C>
void flapping_moment(const C *c, const VehicleNumbers<C> &v, const FlightState<T> &s,
                     Wrench<T> &w) {
  C r[3];
  T u[3];
  for (int i = 0; i < 4; i++) {
    rotor_place(v, i, C{}, r);
    air_velocity(s, r, u);
    w.torque[0] -= c[0] * s.rotor_speed[i] * u[1];
    w.torque[1] += c[0] * s.rotor_speed[i] * u[0];
  }
}

}  // namespace windwrench
